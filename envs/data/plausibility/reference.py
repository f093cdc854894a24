"""Plausibility of the reference of a recording: its clock and axes, jumps, and samples that stand for others."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....filters.core import rotation
from ..reference_clock import WINDOW, aligned, clock_offset, mean_rates, rate_error
from ..repeats import HELD, runs_of, usual_run
from ..trajectory import REFERENCE_CLOCK, Trajectory
from .readings import Finding, Severity
from .sites import seen

LARGE_OFFSET = 0.01
"""s by which a reference may be late before it decides about errors."""
FROZEN = 0.2
"""rad that a gyroscope turns while a reference stands still."""
SLOW = 0.2
"""rad/s that may be the bias of a gyroscope at rest."""
MISALIGNED = 4.0
"""deg between the axes of reference and sensor, or their verticals, that decide about errors."""
SIDEWAYS = 45.0
"""deg from which on they are another order of axes."""
ALIGN = "Errors contain this angle; align it (poise.envs.data.reference_clock.aligned)."
EXPLAINED = 0.5
"""Share of the difference of their rates that is left if an offset or a rotation explains it."""
JUMP = 0.35
"""rad that a reference turns between two samples beyond what the gyroscope shows."""
STALE = 0.01
"""rad that a gyroscope turns, on average, while a slower reference repeats one value."""
DRIFT = 0.5 * LARGE_OFFSET
"""s between the offsets of the two halves of a recording, from which on a clock drifts."""
TURNS = 0.015
"""rad/s by which a reference turns about the vertical and the gyroscope does not."""
TILTS, SURE = 0.05, 6.0
"""Variance of the vertical in the sensor's axes without which that is no other than a bias; standard errors."""
FEWEST = 500
"""Samples that determine how a reference lies."""


def check_reference(trajectory: Trajectory) -> Iterator[Finding]:
    """Offset of the clock of the reference, if known."""
    offset = trajectory.metadata.get(REFERENCE_CLOCK)
    if isinstance(offset, int | float) and abs(offset) > 1e-3:
        what = f"the reference is {1e3 * abs(offset):.1f} ms {'ahead of' if offset > 0.0 else 'behind'} the gyroscope"
        remedy = "Evaluate with the reference clock corrected as well."
        severity: Severity = "warning" if abs(offset) > LARGE_OFFSET else "note"
        yield Finding(severity, "orientation", what, "two clocks that were not synchronised", remedy)


def reference_on_sensor(trajectory: Trajectory) -> tuple[Trajectory, list[Finding]]:
    """The trajectory with its reference on the gyroscope's clock, and findings about that clock and about its axes.

    A reference that its loader has aligned, or that the motion does not determine, is left alone.
    """
    truth = trajectory.truth.get("orientation")
    channels = [seen(trajectory, channel) for channel in ("imu/gyr", "imu/acc")]
    if truth is None or "reference_alignment" in trajectory.metadata or any(values is None for values in channels):
        return trajectory, []
    there = np.isfinite(np.concatenate([truth, *channels], axis=1)).all(axis=1) & trajectory.mask
    if there.sum() < FEWEST:
        return trajectory, []
    calm = trajectory.replace(truth=trajectory.truth | {"orientation": without_jumps(trajectory)})
    found = aligned(calm)
    findings: list[Finding] = []
    angles = found.metadata.get("reference_alignment")
    if angles is None:  # too few pairs of known orientations
        return trajectory, []
    axes, vertical, offset = angles["sensor_deg"], angles["vertical_deg"], found.metadata.get(REFERENCE_CLOCK, 0.0)
    explained = rate_error(found) < EXPLAINED * rate_error(calm)
    if explained and abs(offset) > LARGE_OFFSET and REFERENCE_CLOCK not in trajectory.metadata:
        trajectory = trajectory.replace(metadata=trajectory.metadata | {REFERENCE_CLOCK: offset})
        findings += check_reference(trajectory)
        trajectory = trajectory.reference_clock_corrected()
    if explained and MISALIGNED < axes < SIDEWAYS:
        what, cause = f"its axes are turned by {axes:.0f}° against the sensor's", "markers and sensor on one body"
        findings.append(Finding("warning", "orientation", what, f"{cause}, whose axes were not aligned", ALIGN))
    if axes < SIDEWAYS and MISALIGNED < vertical < SIDEWAYS:
        what = f"its vertical leans by {vertical:.0f}° against that of the accelerometer, on average"
        cause = "a laboratory whose z axis is not upright, or a bias of the accelerometer"
        findings.append(Finding("warning", "orientation", what, cause, ALIGN))
    return trajectory, findings


def jumps_of(orientation: np.ndarray, turned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First rows after jumps of orientations ``(T, 4)``, and the angles ``(T - 1,)`` in rad between neighbours.

    Args:
        orientation: NaN where unknown.
        turned: ``(T,)`` rad that a gyroscope turns in the interval of each sample.
    """
    angle = np.asarray(rotation.angle(rotation.multiply(rotation.conjugate(orientation[:-1]), orientation[1:])))
    return np.flatnonzero(angle > JUMP + 3.0 * (turned[:-1] + turned[1:])) + 1, angle


def without_jumps(trajectory: Trajectory) -> np.ndarray:
    """The orientation of the truth, NaN beside its jumps: they would decide how its rates compare with others."""
    orientation = np.array(trajectory.truth["orientation"])
    turned = trajectory.dt * np.linalg.norm(np.nan_to_num(trajectory.measurements["imu/gyr"]), axis=1)
    reach = max(1, round(WINDOW / trajectory.dt))
    for row in jumps_of(orientation, turned)[0]:
        orientation[max(row - reach, 0) : row + reach] = np.nan
    return orientation


def check_steps(trajectory: Trajectory) -> Iterator[Finding]:
    """A reference that is slower than the recording, and jumps that the gyroscope does not show."""
    q, gyr = trajectory.truth.get("orientation"), seen(trajectory, "imu/gyr")
    if q is None or gyr is None or len(q) < 3:
        return
    step = np.gradient(trajectory.time)
    turned = np.linalg.norm(np.nan_to_num(gyr), axis=1) * step
    begins, lengths = runs_of(q)
    usual = usual_run(lengths)
    if usual > 1 and float((lengths == usual).mean()) > EXPLAINED:
        missed = float(turned.sum() / len(begins)) * (usual - 1) / usual
        what = f"every orientation stands {usual} times: the reference runs at {1.0 / (usual * np.median(step)):.4g} Hz"
        severity: Severity = "warning" if missed > STALE else "note"
        cause, remedy = "a reference that is slower than the recording", "Replace the repeated rows by NaN."
        yield Finding(severity, "orientation", what, cause, remedy)
        return
    rows, angle = jumps_of(q, turned)
    if len(rows):
        count = f"{len(rows)} jump{'s' if len(rows) > 1 else ''}"
        what = f"{count} of up to {np.degrees(angle[rows - 1].max()):.0f}° (first at sample {rows[0]})"
        cause = "a tracking system that lost the body, or mistook its markers"
        remedy = "The gyroscope does not show them: replace the wrong rows by NaN."
        yield Finding("warning", "orientation", what, cause, remedy)


def check_drift(trajectory: Trajectory) -> Iterator[Finding]:
    """A clock that drifts against the gyroscope's, and a heading that does."""
    q, gyr = trajectory.truth.get("orientation"), seen(trajectory, "imu/gyr")
    if q is None or gyr is None or len(q) < FEWEST:
        return
    q, half = without_jumps(trajectory), len(q) // 2
    first, second = (clock_offset(q[part], gyr[part], trajectory.dt) for part in (slice(half), slice(half, None)))
    if first is not None and second is not None and abs(second - first) > DRIFT:
        speed = (second - first) / (half * trajectory.dt)
        offsets = (
            f"{1e3 * first:+.0f} ms ahead of the gyroscope in the first half, {1e3 * second:+.0f} ms in the second"
        )
        pace = f"about {100.0 * abs(speed):.1g} % {'fast' if speed > 0.0 else 'slow'}"
        what, cause = f"it is {offsets}", f"a clock that runs {pace}, or lost samples"
        yield Finding("warning", "orientation", what, cause, "Bring both to one clock.")
        return
    rates = mean_rates(q, gyr, trajectory.dt)
    middle = (len(q) - len(rates.reference)) // 2
    up = rotation.up_in_body(q)[middle : middle + len(rates.reference)]
    difference = rates.reference - rates.gyroscope
    known = np.isfinite(difference).all(axis=1) & np.isfinite(up).all(axis=1)
    if known.sum() < FEWEST:
        return
    size = np.linalg.norm(difference - np.median(difference[known], axis=0), axis=1)
    known &= size <= 5.0 * np.median(size[known]) + 1e-9
    up, difference = (values[known] - values[known].mean(axis=0) for values in (up, difference))
    turning = float((up * difference).sum() / max(float((up * up).sum()), 1e-9))
    error = np.sqrt(np.mean((difference - turning * up) ** 2) / np.sum(up * up) * WINDOW / trajectory.dt)
    if (up * up).sum() > TILTS * len(up) and abs(turning) > max(TURNS, SURE * error):
        what = f"it turns about the vertical by {np.degrees(turning):.1f} °/s, and the gyroscope does not"
        cause = "a heading that drifts, as that of a reference which is an inertial sensor itself"
        yield Finding("warning", "orientation", what, cause, "Score the inclination, or take another reference.")


def check_frozen(trajectory: Trajectory) -> Iterator[Finding]:
    """Stretches in which the reference repeats one orientation while the gyroscope turns."""
    q, gyr = trajectory.truth.get("orientation"), seen(trajectory, "imu/gyr")
    if q is None or gyr is None or len(q) < 3:
        return
    begins, lengths = runs_of(q)
    ends = begins + lengths
    speed = np.linalg.norm(np.nan_to_num(gyr), axis=1)
    turned = np.add.reduceat(np.where(speed > SLOW, speed, 0.0) * np.gradient(trajectory.time), begins)
    frozen = (trajectory.time[ends - 1] - trajectory.time[begins] > HELD) & (turned > FROZEN)
    if frozen.any():
        share = 100.0 * float(lengths[frozen].sum()) / len(q)
        what = (
            f"{share:.3g} % of it repeat one orientation, while the gyroscope turns by {turned[frozen].max():.2g} rad"
        )
        cause = "a tracking system that lost its markers and repeats the last value"
        yield Finding("warning", "orientation", what, cause, "Replace the repeated rows by NaN.")
