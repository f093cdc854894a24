"""Plausibility of a recording: SI units, signs and axes of a right-handed sensor, time in seconds.

An estimator cannot distinguish a wrong unit from strong motion. Each check here compares a number with limits from
physics and other channels, and names the most likely mistake.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from ...filters.core import rotation
from .rate_consistency import FASTEST_TURN, RateConsistency, rate_consistency
from .readings import Finding, check_alive, plausible_samples
from .trajectory import Trajectory

GRAVITY = 9.80665
PLAUSIBLE_FORCE = (7.0, 13.0)
"""m/s²: median length of the specific force of anything that people or vehicles carry."""
FORCE_UNITS = {
    "g": 1.0,
    "m/s² that were multiplied by 9.81 once too often": GRAVITY**2,
    "mg": 1e3,
    "cm/s²": 100.0 * GRAVITY,
    "ft/s²": GRAVITY / 0.3048,
    "mm/s²": 1e3 * GRAVITY,
    "counts of ±2 g in 16 bits": 16384.0,
    "counts of ±4 g in 16 bits": 8192.0,
    "counts of ±8 g in 16 bits": 4096.0,
    "counts of ±16 g in 16 bits": 2048.0,
}
"""Unit → what an accelerometer at rest reports in it."""
FIELD_UNITS = {"nT": 1e3, "mG": 10.0, "G": 1e-2, "mT": 1e-3, "T": 1e-6}
"""Unit → what a magnetometer reports in it for 1 µT."""
FIELD = (22.0, 68.0)
"""µT: the earth's field anywhere."""
PLAUSIBLE_RATES = (5.0, 10_000.0)
"""Hz."""
SLOW_RATE, UNUSUAL_RATE = 20.0, 2000.0
"""Hz, slower than what motion needs and faster than what nearly all recorders write."""
LARGEST_BIAS = 0.12
"""rad/s (7 °/s): beyond what uncalibrated consumer gyroscopes show at rest."""
NORMALISED = 1e-4
"""Standard deviation of the length of a specific force, as a share, below which it is none."""
QUIET_FORCE, LARGEST_SCALE = 0.3, 0.06
"""m/s² of scatter up to which an accelerometer is quiet, and by which share of gravity it may be wrong then: twice what
uncalibrated consumer accelerometers show."""
LEANING, STILL = 0.2, 0.05
"""rad by which a specific force must lean for a gyroscope to show it; below which share of that it shows none."""
REST_WINDOW = 100
"""Samples; the quietest such window is taken for rest."""


def check_recording(trajectory: Trajectory) -> list[Finding]:
    """Look for wrong units, signs, axes and clocks.

    Args:
        trajectory: any; every ``site/gyr``, ``site/acc`` and ``site/mag`` is checked.

    Returns:
        Findings, warnings first; empty for a plausible recording.

    Raises:
        ValueError: ``trajectory`` is not a :class:`.Trajectory`.
    """
    if not isinstance(trajectory, Trajectory):
        raise ValueError(f"trajectory must be a Trajectory, such as poise.load_recording gives, got {trajectory!r}")
    findings = list(check_clock(trajectory))
    wrong_clock = any(finding.severity == "warning" for finding in findings)
    if not wrong_clock:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            trajectory = trajectory.on_grid()
    for site in sites(trajectory):
        findings += check_site(trajectory, site, wrong_clock)
    findings += check_reference(trajectory)
    return sorted(findings, key=lambda finding: finding.severity != "warning")


def sites(trajectory: Trajectory) -> list[str]:
    """Mounting locations with an inertial sensor, ``imu`` of ``imu/gyr`` …, in order of appearance."""
    found = (name.rpartition("/") for name in trajectory.measurements)
    return list(dict.fromkeys(site for site, _, kind in found if kind in ("gyr", "acc", "mag") and site))


def vectors(trajectory: Trajectory, channel: str) -> np.ndarray | None:
    """Samples ``(T, 3)`` of a channel of three axes, or None."""
    values = trajectory.measurements.get(channel)
    return values if values is not None and values.shape[1] == 3 else None


def seen(trajectory: Trajectory, channel: str) -> np.ndarray | None:
    """Plausible samples ``(T, 3)`` of a channel, NaN elsewhere; None if it has none."""
    values = vectors(trajectory, channel)
    found = None if values is None else plausible_samples(channel.rpartition("/")[2], values)
    return found if found is not None and np.isfinite(found).all(axis=1).any() else None


def check_clock(trajectory: Trajectory) -> Iterator[Finding]:
    """Unit of time, gaps."""
    if len(trajectory) < 2:
        what = "a single sample"
        yield Finding("warning", "time", what, "a recording that was cut off", "Estimators need a sequence of samples.")
        return
    step = np.diff(trajectory.time)
    try:
        interval = trajectory.dt
    except ValueError as reason:
        remedy = "Name the device's nominal rate, or cut the recording."
        what = str(reason).removeprefix(f"{trajectory.name}: ")
        yield Finding("warning", "time", what, "stamps of arrival, or of several recordings", remedy)
        return
    rate = 1.0 / interval
    if trajectory.contradicted_rate:
        cause = "a recording that was thinned out, or another sensor's rate"
        yield Finding("note", "time", trajectory.contradicted_rate, cause, "The stamps are believed.")
    if rate < PLAUSIBLE_RATES[0]:
        whole = bool(np.all(np.abs(step - np.round(step)) < 1e-6 * interval))
        units = {"sample numbers": 1.0} if whole and interval == 1.0 else {}
        units |= {"ms": 1e3, "µs": 1e6, "ns": 1e9}
        fitting = [unit for unit, scale in units.items() if unit == "sample numbers" or 15 <= scale * rate <= 4000]
        cause = f"time in {' or '.join(fitting)}" if fitting else "a recording that is too slow for inertial sensors"
        remedy = "Give time in seconds." if fitting else "Inertial estimates need 20 Hz or more."
        yield Finding("warning", "time", f"{interval:.4g} s between samples ({rate:.3g} Hz)", cause, remedy)
    elif rate > PLAUSIBLE_RATES[1]:
        what = f"{rate:.3g} Hz"
        yield Finding("warning", "time", what, "time in minutes, days or another unit", "Give time in seconds.")
    else:
        if rate < SLOW_RATE:
            cause = "a recording that was thinned out, or a sensor's slow mode"
            yield Finding("note", "time", f"{rate:.3g} Hz", cause, "Motion needs 20 Hz or more; 50 Hz if it is fast.")
        if rate > UNUSUAL_RATE:
            cause = f"time in minutes (in seconds that would be {rate / 60.0:.4g} Hz)"
            yield Finding(
                "note", "time", f"{rate:.4g} Hz", cause, "Give time in seconds, unless the sensor is so fast."
            )
        long = step[step > 1.0]
        if len(long):
            what = f"{len(long)} gaps of more than 1 s, the longest {long.max():.1f} s"
            remedy = "Estimators predict through gaps; cut the recording if the motion in them matters."
            yield Finding("note", "time", what, "lost rows, or a paused recorder", remedy)
        lost = 1.0 - len(trajectory) * interval / (trajectory.time[-1] - trajectory.time[0] + interval)
        if lost > 0.05 and not len(long):
            remedy = "They are treated as missing samples."
            yield Finding("note", "time", f"{100 * lost:.0f} % of the rows are missing", "lost packets", remedy)


def check_site(trajectory: Trajectory, site: str, wrong_clock: bool) -> list[Finding]:
    """All checks of one sensor."""
    recorded = {kind: vectors(trajectory, f"{site}/{kind}") for kind in ("gyr", "acc", "mag")}
    findings: list[Finding] = []
    for kind, values in recorded.items():
        if values is not None:
            findings += check_alive(f"{site}/{kind}", values, trajectory.dt if not wrong_clock else None)
    dead = {finding.channel for finding in findings if finding.severity == "warning"}
    gyr, acc, mag = (
        None if f"{site}/{kind}" in dead else seen(trajectory, f"{site}/{kind}") for kind in ("gyr", "acc", "mag")
    )
    turning = {} if gyr is None or wrong_clock else compared(trajectory, site, gyr, acc, mag)
    if acc is not None:
        findings += check_force(f"{site}/acc", acc, turning.get("accelerometer"))
    if gyr is not None:
        if not wrong_clock:
            findings += check_rates(trajectory, site, gyr, turning)
        known = any(finding.channel == f"{site}/gyr" for finding in findings)
        findings += check_rest(f"{site}/gyr", gyr, known or any(one.explains for one in turning.values()))
    if mag is not None:
        findings += check_field(f"{site}/mag", mag)
    removed = any(f.channel == f"{site}/acc" and f.severity == "warning" for f in findings)
    if acc is not None and not removed:
        findings += check_sign(trajectory, f"{site}/acc", acc, mag)
    return findings


def compared(
    trajectory: Trajectory, site: str, gyr: np.ndarray, acc: np.ndarray | None, mag: np.ndarray | None
) -> dict[str, RateConsistency]:
    """The rates beside the motion of gravity, of the field and of the truth, by name, where these can be compared."""
    against = {"accelerometer": acc, "magnetometer": mag}
    if site == "imu" and "orientation" in trajectory.truth:
        against["reference"] = rotation.rotate_back(trajectory.truth["orientation"], np.array([0.6, 0.0, 0.8]))
    found = {
        name: None if vector is None else rate_consistency(trajectory.time, gyr, vector, name != "accelerometer")
        for name, vector in against.items()
    }
    return {name: one for name, one in found.items() if one is not None}


def check_force(channel: str, acc: np.ndarray, turning: RateConsistency | None = None) -> Iterator[Finding]:
    """Unit of the accelerometer, and whether gravity is in it: by the median, and by means that the gyroscope turns."""
    samples = acc[np.isfinite(acc).all(axis=1) & acc.any(axis=1)]
    length = np.linalg.norm(samples, axis=1)
    usual = float(np.median(length))
    if len(length) > REST_WINDOW and float(length.std()) < NORMALISED * usual and not (samples == samples[0]).all():
        what, remedy = f"every sample is {usual:.4g} long", "Export the specific force itself."
        yield Finding("warning", channel, what, "directions of length one instead of measurements", remedy)
    rest = quietest(samples)
    mean = usual if turning is None else turning.longest
    scattered = turning is not None and not turning.steady and mean < 0.5 * usual
    lively = turning is not None and turning.steady and PLAUSIBLE_FORCE[0] <= turning.length <= PLAUSIBLE_FORCE[1]
    if (PLAUSIBLE_FORCE[0] <= usual <= PLAUSIBLE_FORCE[1] and not scattered) or lively:
        yield from check_scale(channel, rest)
        return
    what = f"median length {usual:.4g} m/s²"
    # Where the sensor is quiet it reads gravity, in whatever unit; without gravity it reads next to nothing.
    quiet = usual if rest is None else float(np.linalg.norm(rest.mean(axis=0)))
    unit = min(FORCE_UNITS, key=lambda name: abs(np.log(mean / FORCE_UNITS[name])))
    apart = max(abs(np.log(value / FORCE_UNITS[unit])) if value > 0.0 else np.inf for value in (mean, quiet))
    if apart < 0.25:
        factor = GRAVITY / FORCE_UNITS[unit]
        yield Finding("warning", channel, what, f"readings in {unit}", f"Multiply by {factor:.6g}.")
    elif usual < PLAUSIBLE_FORCE[0] or scattered:
        remedy = "Export the raw acceleration (specific force), which is 9.81 m/s² at rest."
        cause = "gravity was removed (linear acceleration)"
        cause += ", or the rates are not those of this sensor" if scattered and usual > PLAUSIBLE_FORCE[0] else ""
        yield Finding("warning", channel, what, cause, remedy)
    else:
        remedy = "Calibrate the sensor, or convert to m/s²."
        yield Finding("warning", channel, what, "a scale error, or a unit other than m/s²", remedy)


def check_scale(channel: str, rest: np.ndarray | None) -> Iterator[Finding]:
    """Scale of an accelerometer in m/s² where it is quiet."""
    if rest is None or float(rest.std(axis=0).max()) > QUIET_FORCE:
        return
    at_rest = float(np.linalg.norm(rest.mean(axis=0)))
    if abs(at_rest / GRAVITY - 1.0) > LARGEST_SCALE:
        what = f"{at_rest:.4g} m/s² where it is quiet"
        remedy = "Calibrate the sensor (poise calibrate), or check its range."
        yield Finding("warning", channel, what, "a scale error, or a bias of the accelerometer", remedy)


def check_field(channel: str, mag: np.ndarray) -> Iterator[Finding]:
    """Unit of the magnetometer."""
    usual = float(np.nanmedian(np.linalg.norm(mag[mag.any(axis=1)], axis=1)))
    unit = next((unit for unit, scale in FIELD_UNITS.items() if FIELD[0] <= usual / scale <= FIELD[1]), None)
    if unit is not None and not FIELD[0] <= usual <= FIELD[1]:
        remedy = "Nothing needs to be done: only the direction of the field is used."
        yield Finding("note", channel, f"median length {usual:.4g}", f"readings in {unit} instead of µT", remedy)


def check_rates(
    trajectory: Trajectory, site: str, gyr: np.ndarray, turning: dict[str, RateConsistency]
) -> Iterator[Finding]:
    """Unit, signs and axes of the gyroscope, against the motion of gravity, of the field and of the truth."""
    channel, found = f"{site}/gyr", dict(turning)
    fastest = float(np.nanquantile(np.linalg.norm(gyr, axis=1), 0.99))
    yield from check_conjugate(trajectory, gyr, found)
    turned = 0.0 if "accelerometer" not in found else found["accelerometer"].at_rest
    if turned > LEANING and 3.0 * fastest < STILL * turned:
        what = f"rates of {fastest:.2g} rad/s at most, while the specific force leans by {turned:.2g} rad within 3 s"
        remedy = "Check the unit, and which column holds the rates."
        yield Finding("warning", channel, what, "a gyroscope that is off, or rates that were scaled down", remedy)
        return
    decided = {name: one for name, one in found.items() if one.explains} or found
    units = {name: one.other_unit for name, one in decided.items() if one.other_unit is not None}
    if units:
        unit = max(units.values(), key=list(units.values()).count)
        what = f"the reported turns are not those of the {' and '.join(units)}"
        yield Finding("warning", channel, what, f"rates in {unit}", "Convert to rad/s.")
        return
    if fastest > FASTEST_TURN:
        what = f"rates up to {fastest:.4g} rad/s, {np.degrees(fastest):.0f} °/s"
        yield Finding("warning", channel, what, "rates in deg/s, or raw counts", "Convert to rad/s.")
        return
    yield from check_axes(site, decided)


def check_conjugate(trajectory: Trajectory, gyr: np.ndarray, found: dict[str, RateConsistency]) -> Iterator[Finding]:
    """Whether the reference turns as the gyroscope does only if its quaternions are conjugated."""
    given = found.get("reference")
    if given is None or given.as_given < 0.3 * given.at_rest or given.at_rest < 0.05:
        return
    other = rotation.rotate(trajectory.truth["orientation"], np.array([0.6, 0.0, 0.8]))
    conjugate = rate_consistency(trajectory.time, gyr, other, constant=True)
    if conjugate is not None and conjugate.as_given < 0.3 * min(given.as_given, given.axes_residual):
        what = "gyroscope and reference turn together only if it is read the other way round"
        cause = "conjugate quaternions, which turn the world into the sensor"
        del found["reference"]
        yield Finding("warning", "orientation", what, cause, "Conjugate them.")


def check_axes(site: str, found: dict[str, RateConsistency]) -> Iterator[Finding]:
    """Name the channel whose axes contradict the others."""
    odd = {name: one.other_axes for name, one in found.items() if one.other_axes is not None}
    if not odd:
        return
    agreeing = [name for name in found if name not in odd]
    name, axes = next(iter(odd.items()))
    assert axes is not None
    what = f"gyroscope and {' and '.join(odd)} do not turn together"
    proper = float(np.linalg.det(axes)) > 0.0
    of_gyroscope = f"of the gyroscope {axes_in_words(axes)}"
    # A vector's own sign does not show: of the two arrangements that look alike, the one with fewer signs is meant.
    of_vector = f"of the {name} {axes_in_words(min(axes, -axes, key=lambda m: int((m < 0.0).sum())))}"
    if proper and agreeing:
        channel = {"accelerometer": f"{site}/acc", "magnetometer": f"{site}/mag", "reference": "orientation"}[name]
        cause = of_vector
    else:
        # No arrangement of a vector's axes looks like a left-handed gyroscope.
        channel, cause = f"{site}/gyr", f"{of_gyroscope}, or {of_vector}" if proper else of_gyroscope
    yield Finding("warning", channel, what, cause, "Check signs and order of the axes.")


def axes_in_words(axes: np.ndarray) -> str:
    """What a signed permutation does to x, y, z."""
    if np.array_equal(axes, -np.eye(3)):
        return "all signs are reversed (left-handed)"
    if np.array_equal(np.abs(axes), np.eye(3)):
        return f"the sign of {' and '.join('xyz'[i] for i in range(3) if axes[i, i] < 0.0)} is reversed"
    terms = [("-" if row.sum() < 0.0 else "") + "xyz"[int(np.abs(row).argmax())] for row in axes]
    return f"the axes x, y, z should be {', '.join(terms)}"


def quietest(values: np.ndarray) -> np.ndarray | None:
    """The samples of the window that varies least; None if there is no complete window."""
    present = values[np.isfinite(values).all(axis=1)]
    count = len(present) // REST_WINDOW
    if count == 0:
        return None
    windows = present[: count * REST_WINDOW].reshape(count, REST_WINDOW, -1)
    return windows[int(np.argmin(windows.var(axis=1).sum(axis=1)))]


def check_rest(channel: str, gyr: np.ndarray, known: bool) -> Iterator[Finding]:
    """Bias of the gyroscope where it rests."""
    rest = quietest(gyr)
    if rest is None or known:
        return
    bias, spread = float(np.linalg.norm(rest.mean(axis=0))), float(rest.std(axis=0).max())
    if bias > LARGEST_BIAS and spread < 0.05 * bias:
        what = f"{bias:.3g} rad/s ({np.degrees(bias):.1f} °/s) where it is steady"
        cause = "rates in deg/s, a gyroscope without calibration, or a steady turn about the vertical"
        yield Finding("warning", channel, what, cause, "Convert to rad/s, or subtract the rates at rest.")


def check_sign(trajectory: Trajectory, channel: str, acc: np.ndarray, mag: np.ndarray | None) -> Iterator[Finding]:
    """Whether the accelerometer points up at rest (+g on an axis that points up), as a specific force does."""
    apple = "the accelerometer has Apple's sign (it reports −g on an axis that points up)"
    remedy = "Change the sign of all three axes."
    length = np.linalg.norm(acc, axis=1)
    direction = acc / np.where(length > 0.0, length, np.nan)[:, None]
    cosines = np.array([])
    if "up" in trajectory.quantities and channel == "imu/acc":
        cosines = (direction * trajectory.truth_of("up")).sum(axis=1)
    if np.isfinite(cosines).any():
        cosine = float(np.nanmedian(cosines))
        if cosine < -0.5:
            what = f"it points down by the reference (cosine {cosine:.2f})"
            yield Finding("warning", channel, what, f"{apple}, or the z axis of the reference points down", remedy)
        elif cosine < 0.5:
            what = f"it does not point up by the reference (cosine {cosine:.2f})"
            cause = "a reference in another frame, or conjugate quaternions"
            yield Finding("warning", "orientation", what, cause, "Check frame and order of the reference.")
        return
    usual = np.nanmedian(direction, axis=0)
    size = float(np.nanmedian(length))
    if usual[2] < -0.9:
        cause = f"a sensor that is mounted upside down, or {apple}"
        what = f"−{size:.2f} m/s² on z: the z axis points down"
        yield Finding("warning", channel, what, cause, f"{remedy[:-1]} if the z axis points up.")
    elif mag is not None:
        field = mag / np.where(mag.any(axis=1), np.linalg.norm(mag, axis=1), np.nan)[:, None]
        upwards = float(np.nanmedian((direction * field).sum(axis=1)))
        if upwards > 0.3:
            cause = f"a recording south of the equator, or {apple}"
            what = f"the magnetic field points {np.degrees(np.arcsin(min(upwards, 1.0))):.0f}° above the horizon"
            yield Finding("note", channel, what, cause, f"{remedy[:-1]} if the recording is from the north.")


def check_reference(trajectory: Trajectory) -> Iterator[Finding]:
    """Offset of the clock of the reference, if known."""
    offset = trajectory.metadata.get("reference_clock_offset")
    if isinstance(offset, int | float) and abs(offset) > 1e-3:
        what = f"the reference is {1e3 * abs(offset):.1f} ms {'ahead of' if offset > 0.0 else 'behind'} the gyroscope"
        remedy = "Evaluate with the reference clock corrected as well."
        yield Finding("note", "orientation", what, "two clocks that were not synchronised", remedy)
