"""Clock offset and alignment of the reference of a recording relative to its gyroscope.

No estimator is involved. The rotation of the reference over a short interval and the integral of the gyroscope over the
same interval describe one motion. If the reference runs ahead by τ, it shows the rate ω(t + τ) ≈ ω + τ dω/dt: the
regression of the difference on the derivative of the gyroscope is τ. A constant bias is removed with the means.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...filters.core import rotation
from .resampling import shifted
from .trajectory import REFERENCE_CLOCK, Trajectory

WINDOW = 0.04
"""s over which rotations are compared: shorter ones are noise of the reference, longer ones blur the motion."""
LEAST_MOTION = 0.3
"""rad/s; root mean square rate below which offsets are not determined."""
LARGEST_ERROR = 2e-4
"""s; offsets with a larger standard error are not reported."""
LARGEST, FARTHEST = 0.5, 8.0
"""s; offsets are looked for within the one, and within the other where rates are not alike so near."""
ALIKE, LESS_ALIKE = 0.85, 0.8
"""Correlation of rates' magnitudes from which on they are alike, and the share of it that they have at other lags."""


class Rates(NamedTuple):
    """Mean angular rates ``(N, 3)`` rad/s of gyroscope and reference over the same intervals, in their own axes."""

    gyroscope: np.ndarray
    reference: np.ndarray


def mean_rates(orientation: np.ndarray, gyr: np.ndarray, dt: float) -> Rates:
    """Rates of a reference and a gyroscope over the same intervals of a uniform grid; NaN where unknown."""
    n = max(1, round(WINDOW / dt))
    turn = rotation.log(rotation.multiply(rotation.conjugate(orientation[:-n]), orientation[n:]))
    # A sample is the mean of the interval that it ends.
    sums = np.concatenate([np.zeros((1, 4)), np.cumsum(np.nan_to_num(np.column_stack([gyr, np.isnan(gyr).any(1)])), 0)])
    mean = (sums[n + 1 :] - sums[1:-n]) / n
    mean[mean[:, 3] > 0.5 / n] = np.nan
    # A rotation vector differs from the integral of the rates by coning, which is of second order in the interval.
    return Rates(mean[:, :3], turn / (n * dt))


def clock_offset(orientation: np.ndarray, gyr: np.ndarray, dt: float) -> float | None:
    """Seconds by which the reference is ahead of the gyroscope; None if the motion does not determine it.

    The regression is repeated on the reference as corrected so far, until nothing is left. The orientation ``(T, 4)``
    of the sensor, NaN where unknown, and the gyroscope ``(T, 3)`` are on a uniform grid.
    """
    if len(gyr) < 4 * round(WINDOW / dt) + 8:
        return None
    time = dt * np.arange(len(gyr))
    offset = dt * coarse_shift(orientation, gyr, dt)
    for _ in range(6):
        moved = shifted({"orientation": orientation}, time, offset)["orientation"]
        rates = mean_rates(moved, gyr, dt)
        slope = np.gradient(rates.gyroscope, dt, axis=0)
        difference = rates.reference - rates.gyroscope
        known = np.isfinite(slope).all(axis=1) & np.isfinite(difference).all(axis=1)
        if known.sum() < 50 or np.sqrt(3.0 * np.mean(rates.gyroscope[known] ** 2)) < LEAST_MOTION:
            return None
        # Jumps of the reference (swapped markers) carry no information about the clock.
        size = np.linalg.norm(difference - np.median(difference[known], axis=0), axis=1)
        known &= size <= 5.0 * np.median(size[known]) + 1e-9
        a, b = (values[known] - values[known].mean(axis=0) for values in (slope, difference))
        step = float((a * b).sum() / (a * a).sum())
        offset += step
        if abs(step) < 1e-5:
            break
    # Neighbouring intervals overlap: only one in a window is a new one.
    independent = max(1.0, known.sum() * dt / WINDOW)
    error = np.sqrt(np.mean((b - step * a) ** 2) / np.mean(a * a) / (3.0 * independent))
    return offset if error < LARGEST_ERROR else None


def coarse_shift(orientation: np.ndarray, gyr: np.ndarray, dt: float) -> int:
    """Whole samples by which the reference runs ahead, from the correlation of the rates' magnitudes."""
    rates = mean_rates(orientation, gyr, dt)
    a, b = (np.linalg.norm(values, axis=1) for values in rates)
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() < 50:
        return 0
    a, b = (np.where(known, values - values[known].mean(), 0.0) for values in (a, b))
    size = 1 << int(np.ceil(np.log2(2 * len(a))))
    correlation = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)

    def best(within: float) -> int:
        reach = min(round(within / dt), len(a) // 2)
        lags = np.concatenate([np.arange(reach + 1), np.arange(-reach, 0)])
        return int(lags[np.argmax(correlation[lags])])

    def alike(shift: int) -> float:
        one, other = (
            values[max(shift * sign, 0) : len(a) + min(shift * sign, 0)] for values, sign in ((a, 1), (b, -1))
        )
        return float((one * other).sum() / np.sqrt((one * one).sum() * (other * other).sum() + 1e-12))

    near, far = best(LARGEST), best(FARTHEST)
    return far if alike(far) > ALIKE and alike(near) < LESS_ALIKE * alike(far) else near


def measured(trajectory: Trajectory) -> Trajectory:
    """The trajectory with ``metadata["reference_clock_offset"]``, s that its truth runs ahead of its gyroscope.

    It is unchanged where it knows no orientation or gyroscope, or does not move enough.
    """
    if "orientation" not in trajectory.truth or "imu/gyr" not in trajectory.measurements or len(trajectory) < 2:
        return trajectory
    grid = trajectory.on_grid()
    orientation = np.where(grid.mask[:, None], grid.truth["orientation"], np.nan)
    offset = clock_offset(orientation, grid.measurements["imu/gyr"], grid.dt)
    return (
        trajectory if offset is None else trajectory.replace(metadata=trajectory.metadata | {REFERENCE_CLOCK: offset})
    )


def aligned(trajectory: Trajectory) -> Trajectory:
    """The trajectory with its reference in the axes of its sensor and a world whose z axis is up.

    Markers and sensor are two bodies: the constant rotation between them is the one that turns the reference's rates
    into those of the gyroscope (least squares, W. Kabsch 1976). The vertical of the reference's world is the direction
    of the mean specific force in it, as a motion that begins and ends at rest has no mean acceleration.
    """
    grid = trajectory.on_grid()
    orientation = np.where(grid.mask[:, None], grid.truth["orientation"], np.nan)
    time = grid.dt * np.arange(len(grid))
    # Magnitudes of rates give the approximate clock offset for any axes.
    offset = grid.dt * coarse_shift(orientation, grid.measurements["imu/gyr"], grid.dt)
    orientation = shifted({"orientation": orientation}, time, offset)["orientation"]
    rates = mean_rates(orientation, grid.measurements["imu/gyr"], grid.dt)
    known = np.isfinite(rates.gyroscope).all(axis=1) & np.isfinite(rates.reference).all(axis=1)
    if known.sum() < 50 or np.abs(rates.reference[known]).max() < 1e-6:
        return trajectory
    turn = body_rotation(Rates(rates.gyroscope[known], rates.reference[known]))
    orientation = rotation.multiply(orientation, turn)
    force = rotation.rotate(orientation, grid.measurements["imu/acc"])
    mean = force[np.isfinite(force).all(axis=1)].mean(axis=0)
    world = rotation.level(mean)
    # level() is the attitude of a body in which `mean` is up: it turns that direction to the world's z axis.
    truth = dict(trajectory.truth)
    truth["orientation"] = rotation.multiply(world, rotation.multiply(truth["orientation"], turn))
    if "position" in truth:
        truth["position"] = rotation.rotate(world, truth["position"])
    found: dict[str, Any] = {
        "sensor_deg": float(np.degrees(rotation.angle(turn))),
        "vertical_deg": float(np.degrees(np.arccos(np.clip(mean[2] / np.linalg.norm(mean), -1.0, 1.0)))),
    }
    return measured(trajectory.replace(truth=truth, metadata=trajectory.metadata | {"reference_alignment": found}))


def rate_error(trajectory: Trajectory) -> float:
    """Root mean square difference in rad/s of the rates of reference and gyroscope, biases removed."""
    grid = trajectory.reference_clock_corrected().on_grid()
    orientation = np.where(grid.mask[:, None], grid.truth["orientation"], np.nan)
    rates = mean_rates(orientation, grid.measurements["imu/gyr"], grid.dt)
    difference = rates.reference - rates.gyroscope
    return float(np.sqrt(np.nanmean((difference - np.nanmedian(difference, axis=0)) ** 2)))


def body_rotation(rates: Rates) -> np.ndarray:
    """Quaternion from the sensor's axes to those of the reference's body, by their rates (means removed)."""
    a, b = rates.reference - rates.reference.mean(axis=0), rates.gyroscope - rates.gyroscope.mean(axis=0)
    return rotation.from_matrix(rotation.nearest_matrix(a.T @ b))
