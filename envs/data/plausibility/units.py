"""Plausibility of the readings of one sensor: units, scales, biases and signs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....filters.core.quantity import STANDARD_GRAVITY
from ..trajectory import Trajectory
from .rate_consistency import RateConsistency
from .readings import Finding, Severity

PLAUSIBLE_FORCE = (7.0, 13.0)
"""m/s²: median length of the specific force of anything that people or vehicles carry."""
FORCE_UNITS = {
    "g": 1.0,
    "m/s² that were multiplied by 9.81 once too often": STANDARD_GRAVITY**2,
    "mg": 1e3,
    "cm/s²": 100.0 * STANDARD_GRAVITY,
    "ft/s²": STANDARD_GRAVITY / 0.3048,
    "mm/s²": 1e3 * STANDARD_GRAVITY,
    **{f"counts of ±{most} g in 16 bits": 2.0**15 / most for most in (2, 4, 8, 16)},
    **{f"counts of ±{most} g in 16 bits, named g": 2.0**15 / most * STANDARD_GRAVITY for most in (2, 4, 8, 16)},
}
"""Unit → what an accelerometer at rest reports in it."""
FIELD_UNITS = {"nT": 1e3, "mG": 10.0, "G": 1e-2, "mT": 1e-3, "T": 1e-6}
"""Unit → what a magnetometer reports in it for 1 µT."""
FIELD = (22.0, 68.0)
"""µT: the earth's field anywhere."""
LARGEST_BIAS = 0.12
"""rad/s (7 °/s): beyond what uncalibrated consumer gyroscopes show at rest."""
NORMALISED = 1e-4
"""Standard deviation of the length of a specific force, as a share, below which it is none."""
QUIET_FORCE, LARGEST_SCALE = 0.3, 0.06
"""m/s² of scatter up to which an accelerometer is quiet, and by which share of gravity it may be wrong then: twice what
uncalibrated consumer accelerometers show."""
STEADY_TURN = 0.5
"""rad/s from which on a sensor that is quiet does not rest."""
LEAST_NOISE, USUAL_NOISE = 7e-5, 8e-3
"""rad/s of noise at rest below which only gyroscopes of navigation grade are, and m/s² that these are not beside."""
STEADY_FIELD = 0.25
"""Scatter of the length of a magnetic field, as a share, below which it is the earth's."""
REST_WINDOW = 100
"""Samples; the quietest such window is taken for rest."""


def check_force(
    channel: str, acc: np.ndarray, gyr: np.ndarray | None = None, turning: RateConsistency | None = None
) -> Iterator[Finding]:
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
        # A steady turn is as quiet as rest, and has an acceleration.
        turns = False if gyr is None else np.linalg.norm(gyr, axis=1, keepdims=True) > STEADY_TURN
        yield from check_scale(channel, quietest(np.where(turns, np.nan, acc)))
        return
    what = f"median length {usual:.4g} m/s²"
    # Where the sensor is quiet it reads gravity, in whatever unit; without gravity it reads next to nothing.
    quiet = usual if rest is None else float(np.linalg.norm(rest.mean(axis=0)))
    unit = min(FORCE_UNITS, key=lambda name: abs(np.log(mean / FORCE_UNITS[name])))
    apart = max(abs(np.log(value / FORCE_UNITS[unit])) if value > 0.0 else np.inf for value in (mean, quiet))
    if apart < 0.25:
        factor = STANDARD_GRAVITY / FORCE_UNITS[unit]
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
    if abs(at_rest / STANDARD_GRAVITY - 1.0) > LARGEST_SCALE:
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


def check_noise(channel: str, gyr: np.ndarray, acc: np.ndarray) -> Iterator[Finding]:
    """Noise of a gyroscope at rest that no sensor beside such an accelerometer has."""
    resting, beside = quietest(gyr), quietest(acc)
    if resting is None or beside is None or len(np.unique(resting[:, 0])) < REST_WINDOW // 5:
        return
    noise, other = float(resting.std(axis=0).max()), float(np.median(beside.std(axis=0)))
    if noise < LEAST_NOISE and other > USUAL_NOISE:
        what = f"{noise:.2g} rad/s of noise where it is quiet, beside {other:.2g} m/s² of the accelerometer"
        cause = "rates that were converted from deg/s once too often, read in thousandths of a unit, or smoothed"
        yield Finding("warning", channel, what, cause, "Check the unit.")


def check_sign(trajectory: Trajectory, channel: str, acc: np.ndarray, mag: np.ndarray | None) -> Iterator[Finding]:
    """Whether the accelerometer points up at rest (+g on an axis that points up), as a specific force does."""
    apple = "the accelerometer has Apple's sign (it reports −g on an axis that points up)"
    remedy = "Change the sign of all three axes."
    if "up" in trajectory.quantities and channel == "imu/acc":
        # Accelerations average out, as velocity stays bounded.
        upwards = (acc * trajectory.truth_of("up")).sum(axis=1)
        if np.isfinite(upwards).any():
            cosine = float(np.nanmean(upwards) / STANDARD_GRAVITY)
            if cosine < -0.5:
                what = f"it points down by the reference (cosine {cosine:.2f})"
                yield Finding("warning", channel, what, f"{apple}, or the z axis of the reference points down", remedy)
            elif cosine < 0.5:
                what = f"it does not point up by the reference (cosine {cosine:.2f})"
                cause = "a reference in another frame, or conjugate quaternions"
                yield Finding("warning", "orientation", what, cause, "Check frame and order of the reference.")
            return
    length = np.linalg.norm(acc, axis=1)
    direction = acc / np.where(length > 0.0, length, np.nan)[:, None]
    usual = np.nanmedian(direction, axis=0)
    size = float(np.nanmedian(length))
    if usual[2] < -0.9:
        cause = f"a sensor that is mounted upside down, or {apple}"
        what = f"−{size:.2f} m/s² on z: the z axis points down"
        yield Finding("warning", channel, what, cause, f"{remedy[:-1]} if the z axis points up.")
    elif mag is not None:
        field = mag / np.where(mag.any(axis=1), np.linalg.norm(mag, axis=1), np.nan)[:, None]
        upwards = float(np.nanmedian((direction * field).sum(axis=1)))
        length = np.linalg.norm(mag[mag.any(axis=1)], axis=1)
        steady = float(np.nanstd(length)) < STEADY_FIELD * float(np.nanmedian(length))
        if upwards > 0.3:
            cause = f"a recording south of the equator, or {apple}"
            what = f"the magnetic field points {np.degrees(np.arcsin(min(upwards, 1.0))):.0f}° above the horizon"
            severity: Severity = "warning" if steady else "note"
            yield Finding(severity, channel, what, cause, f"{remedy[:-1]} if the recording is from the north.")
