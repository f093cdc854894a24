"""Whether a gyroscope turns as gravity, the field and the reference do: its unit, signs and axes, and theirs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....filters.core import rotation
from ..reference_clock import coarse_shift
from ..resampling import shifted
from ..trajectory import Trajectory
from .rate_consistency import FASTEST_TURN, SCALES, RateConsistency, rate_consistency
from .readings import Finding

LEANING, STILL = 0.2, 0.05
"""rad by which a specific force must lean for a gyroscope to show it; below which share of that it shows none."""
NEAR_SCALE = 0.15
"""Of the logarithm, by which a unit may differ from a known scale."""
LATE = 0.05
"""s by which a reference must be early or late for that to hide how its quaternions are read."""
SHORTEST_HALF = 10.0
"""s."""
MOVING = 1.0
"""rad/s that a gyroscope reports only if it moves, or in another unit."""


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


def check_halves(
    trajectory: Trajectory, site: str, gyr: np.ndarray, acc: np.ndarray | None, mag: np.ndarray | None
) -> Iterator[Finding]:
    """Unit, signs and axes of the gyroscope in each half of a recording that has others on the whole.

    Arguments as for :func:`compared`; the trajectory is on its grid.
    """
    middle = len(gyr) // 2
    if middle * trajectory.dt < SHORTEST_HALF:
        return
    for name, part in (("first", slice(middle)), ("second", slice(middle, None))):
        half = trajectory.replace(truth={})[part]
        rates, *others = (None if values is None else values[part] for values in (gyr, acc, mag))
        if rates is None or not np.isfinite(rates).all(axis=1).any():
            continue
        for one in check_rates(half, site, rates, compared(half, site, rates, *others), sure=True):
            remedy = f"If they change on the way, cut the recording there. {one.remedy}"
            yield Finding(one.severity, one.channel, f"in the {name} half, {one.what}", one.cause, remedy)


def check_rates(
    trajectory: Trajectory,
    site: str,
    gyr: np.ndarray,
    turning: dict[str, RateConsistency],
    scale: float | None = None,
    sure: bool = False,
) -> Iterator[Finding]:
    """Unit, signs and axes of the gyroscope, against the motion of gravity, of the field and of the truth.

    Args:
        trajectory: with the truth.
        site: of the sensor.
        gyr: ``(T, 3)``.
        turning: see :func:`compared`.
        scale: by which the rates must be multiplied, where that is known for certain; then no other unit is.
        sure: only what a unit or an arrangement of axes explains.
    """
    channel, found = f"{site}/gyr", dict(turning)
    fastest = float(np.nanquantile(np.linalg.norm(gyr, axis=1), 0.99))
    yield from check_reading(trajectory, gyr, found)
    turned = 0.0 if "accelerometer" not in found else found["accelerometer"].at_rest
    if turned > LEANING and 3.0 * fastest < STILL * turned:
        what = f"rates of {fastest:.2g} rad/s at most, while the specific force leans by {turned:.2g} rad within 3 s"
        remedy = "Check the unit, and which column holds the rates."
        yield Finding("warning", channel, what, "a gyroscope that is off, or rates that were scaled down", remedy)
        return
    decided = {name: one for name, one in found.items() if one.explains} or found
    units = {name: one.other_unit for name, one in decided.items() if one.other_unit is not None}
    if scale is not None:
        units = {name: unit for name, unit in units.items() if abs(np.log(SCALES[unit] / scale)) < NEAR_SCALE}
    if units and not any(one.confirmed for one in decided.values()):
        unit = max(units.values(), key=list(units.values()).count)
        what = f"the reported turns are not those of the {' and '.join(units)}"
        cause = f"rates in {unit}"
        if not any(decided[name].explains for name in units) and fastest > MOVING:
            cause += f", or a constant {' or '.join(units)}, as one in world axes"
        yield Finding("warning", channel, what, cause, "Convert to rad/s.")
        return
    if fastest > FASTEST_TURN:
        what = f"rates up to {fastest:.4g} rad/s, {np.degrees(fastest):.0f} °/s"
        yield Finding("warning", channel, what, "rates in deg/s, or raw counts", "Convert to rad/s.")
        return
    yield from check_axes(site, decided)
    if not sure:
        yield from check_disagreement(site, found)


def check_disagreement(site: str, found: dict[str, RateConsistency]) -> Iterator[Finding]:
    """Name channels that the rates do not turn under any hypothesis."""
    trusted = any(one.confirmed for one in found.values())
    causes = {
        "accelerometer": ("gyr", "rates of another sensor, in world axes, or angles instead of rates"),
        "magnetometer": ("mag", "a magnetometer without calibration, near iron, or in other axes"),
        "reference": ("", "quaternions in another order, Euler angles in another sequence, or another body"),
    }
    for name, one in found.items():
        beside_trusted = trusted and name == "reference" and one.as_given > 0.5 * one.at_rest > 0.025
        if one.other_axes is None and (one.worsens or (beside_trusted and not one.explains)):
            kind, cause = causes[name]
            channel = f"{site}/{kind}" if kind else "orientation"
            what = f"gyroscope and {name} do not turn together, whatever the unit and the axes"
            yield Finding("warning", channel, what, cause, "Check which columns hold what.")


def check_reading(trajectory: Trajectory, gyr: np.ndarray, found: dict[str, RateConsistency]) -> Iterator[Finding]:
    """Whether the reference turns as the gyroscope does only if its quaternions are read in another way.

    It may be early or late as well.
    """
    given = found.get("reference")
    if given is None or given.as_given < 0.3 * given.at_rest or given.at_rest < 0.05:
        return
    q = trajectory.truth["orientation"]
    first, last = "quaternions whose scalar is the first", "quaternions whose scalar is the last"
    readings = {
        ("conjugate quaternions, which turn the world into the sensor", "Conjugate them."): rotation.conjugate(q),
        (last, "Read them in the order x, y, z, w."): rotation.from_xyzw(q),
        (first, "Read them in the order w, x, y, z."): rotation.to_xyzw(q),
        (f"{last}, and conjugate ones", "Read them so."): rotation.conjugate(rotation.from_xyzw(q)),
        (f"{first}, and conjugate ones", "Read them so."): rotation.conjugate(rotation.to_xyzw(q)),
    }
    for (cause, remedy), other in readings.items():
        lag = trajectory.dt * coarse_shift(other, gyr, trajectory.dt)
        moved = abs(lag) > LATE
        if moved:
            other = shifted({"orientation": other}, trajectory.time, lag)["orientation"]
        turned = rate_consistency(trajectory.time, gyr, rotation.rotate_back(other, np.array([0.6, 0.0, 0.8])), True)
        if turned is not None and turned.as_given < 0.3 * min(given.as_given, given.axes_residual):
            what = "gyroscope and reference turn together only if it is read the other way round"
            if moved:
                what += f" and moved by {lag:+.2f} s"
                cause += ", on another clock"
            del found["reference"]
            yield Finding("warning", "orientation", what, cause, remedy)
            return


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
    # A vector's own sign does not show: of the two arrangements that look alike, the one with fewer signs is meant, of
    # a reference the one that is a rotation.
    unlikely = (lambda m: float(np.linalg.det(m)) < 0.0) if name == "reference" else (lambda m: (m < 0.0).sum())
    of_vector = f"of the {name} {axes_in_words(min(axes, -axes, key=unlikely))}"
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
