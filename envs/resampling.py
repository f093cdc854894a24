"""Trajectories at another rate, without losing what integrates to the pose.

With ``sampling="interval"`` a sample stands for the interval that ends at its tick, and its kind decides how samples are
joined:

* a gyroscope is integrated to an attitude, which is read at the new ticks, so that coning is kept;
* an accelerometer beside a gyroscope is integrated to a velocity in the frame of that attitude, and given in the
  attitude of the middle of the new interval, so that sculling is kept (P. G. Savage, "Strapdown Inertial Navigation
  Integration Algorithm Design", J. Guidance, Control, and Dynamics 21(1–2), 1998);
* an orientation is interpolated, every other channel averaged.

With ``sampling="instant"`` a sample is the value at its tick, and all are interpolated; motion faster than half the new
rate is aliased. This suits estimators that use the accelerometer in the attitude of the tick.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..filters import rotation
from .trajectory import Trajectory


def resample(trajectory: Trajectory, rate: float, sampling: Literal["interval", "instant"] = "interval") -> Trajectory:
    """Resample to ``rate`` on the uniform grid that starts at the first tick.

    By intervals, strapdown integration of the result passes through the attitudes of the original, and through its velocities,
    interpolated between old ticks. Nothing is filtered beyond the mean over an interval. At a higher rate samples are
    repeated: no information is added.

    Args:
        trajectory: with uniform or other ticks.
        rate: Hz.
        sampling: what a sample is, the mean over the interval that ends at its tick or the value at its tick.

    Returns:
        The new trajectory. A sample is NaN if its interval overlaps a missing one, or an old neighbour is missing; orientations are interpolated on
        the great circle, other truth linearly, both NaN beside unknown truth; a tick is scored if both its old
        neighbours are.

    Raises:
        ValueError: ``rate`` is not positive and finite, or ``sampling`` unknown.
    """
    if sampling not in ("interval", "instant"):
        raise ValueError(f"sampling must be 'interval' or 'instant', got {sampling!r}")
    if not 0.0 < rate < np.inf:
        raise ValueError(f"rate must be a positive number of Hz, got {rate}")
    old, dt = trajectory.time, trajectory.dt
    # The tolerance keeps the last tick when the ratio of the rates is a whole number.
    count = int(np.floor((old[-1] - old[0]) * rate + 1e-6)) + 1
    new = old[0] + np.arange(count) / rate
    edges = np.concatenate([[new[0] - 1.0 / rate], new])
    # Before the first sample nothing is known; the first is held over the first interval.
    knots = np.concatenate([[min(old[0] - dt, edges[0])], old])
    left, right, weight = neighbours(old, new)
    return trajectory.replace(
        time=new,
        measurements={
            name: between(name, values[left], values[right], weight)
            if sampling == "instant" or name.endswith("orientation")
            else joined(name, trajectory.measurements, knots, edges)
            for name, values in trajectory.measurements.items()
        },
        truth={name: between(name, values[left], values[right], weight) for name, values in trajectory.truth.items()},
        mask=trajectory.mask[left] & trajectory.mask[right],
        metadata=trajectory.metadata | {"rate": float(rate), "resampled_from": 1.0 / dt},
    )


def joined(name: str, channels: dict[str, np.ndarray], knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Samples of one channel for the new intervals."""
    place, _, kind = name.rpartition("/")
    values, rates = channels[name], channels.get(f"{place}/gyr")
    if kind not in ("gyr", "acc") or rates is None or not rates.shape[1] == values.shape[1] == 3:
        return mean(values, knots, edges)
    if kind == "gyr":
        return angular_rate(values, knots, edges)
    return specific_force(rates, values, knots, edges)


def neighbours(old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Old ticks to the left and right of every new one and the weight ``(N, 1)`` of the right one; equal on a tick."""
    left = np.clip(np.searchsorted(old, new + 1e-9, side="right") - 1, 0, len(old) - 1)
    on_tick = np.abs(old[left] - new) < 1e-9
    right = np.where(on_tick, left, np.minimum(left + 1, len(old) - 1))
    span = np.where(right > left, old[right] - old[left], 1.0)
    return left, right, np.where(right > left, (new - old[left]) / span, 0.0)[:, None]


def between(name: str, a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Truth between two ticks."""
    if name.endswith("orientation"):
        step = rotation.log(rotation.multiply(rotation.conjugate(a), b))
        return rotation.normalize(rotation.multiply(a, rotation.exp(weight * step)))
    value = a + weight * (b - a)
    return rotation.normalize(value) if name == "up" else value


def mark_missing(result: np.ndarray, values: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """NaN where an interval overlaps a missing sample by more than rounding."""
    absent = (~np.isfinite(values).all(axis=1)).astype(float)[:, None]
    overlap = np.diff(integral_at(absent * np.diff(knots)[:, None], knots, edges), axis=0)[:, 0]
    return np.where((overlap > 1e-6 * np.diff(edges))[:, None], np.nan, result)


def integral_at(increments: np.ndarray, knots: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Running sum of increments ``(T, n)`` over the intervals between knots, linear within each."""
    total = np.concatenate([np.zeros((1, increments.shape[1])), np.cumsum(increments, axis=0)])
    return np.stack([np.interp(at, knots, column) for column in total.T], axis=1)


def mean(values: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Mean of piecewise constant samples over the new intervals."""
    increments = np.nan_to_num(values) * np.diff(knots)[:, None]
    result = np.diff(integral_at(increments, knots, edges), axis=0) / np.diff(edges)[:, None]
    return mark_missing(result, values, knots, edges)


def running_product(q: np.ndarray) -> np.ndarray:
    """Products ``q[0] ⊗ … ⊗ q[k]`` ``(T, 4)`` of quaternions ``(T, 4)``, by doubling."""
    reach = 1
    while reach < len(q):
        q = np.concatenate([q[:reach], rotation.multiply(q[:-reach], q[reach:])])
        reach *= 2
    return rotation.normalize(q)


def attitude_at(rates: np.ndarray, knots: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Attitude ``(N, 4)`` relative to the start, after piecewise constant angular rates (missing ones are zero)."""
    rates = np.where(np.isfinite(rates).all(axis=1, keepdims=True), rates, 0.0)
    steps = rotation.exp(rates * np.diff(knots)[:, None])
    attitude = running_product(np.concatenate([[[1.0, 0.0, 0.0, 0.0]], steps]))
    interval = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(steps) - 1)
    return rotation.multiply(attitude[interval], rotation.exp(rates[interval] * (at - knots[interval])[:, None]))


def turns(rates: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes ``(N, 4)`` at the start of every new interval, and its rotation vector ``(N, 3)``."""
    attitude = attitude_at(rates, knots, edges)
    return attitude[:-1], rotation.log(rotation.multiply(rotation.conjugate(attitude[:-1]), attitude[1:]))


def angular_rate(rates: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Angular rates whose rotation over each new interval is that of the old rates."""
    _, turn = turns(rates, knots, edges)
    return mark_missing(turn / np.diff(edges)[:, None], rates, knots, edges)


def specific_force(rates: np.ndarray, forces: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Specific force with the velocity increments of the old samples, in the attitude half-way through each turn."""
    old_middle = attitude_at(rates, knots, 0.5 * (knots[1:] + knots[:-1]))
    increments = rotation.rotate(old_middle, np.nan_to_num(forces)) * np.diff(knots)[:, None]
    velocity = np.diff(integral_at(increments, knots, edges), axis=0)
    start, turn = turns(rates, knots, edges)
    new_middle = rotation.multiply(start, rotation.exp(0.5 * turn))
    result = rotation.rotate_back(new_middle, velocity) / np.diff(edges)[:, None]
    return mark_missing(mark_missing(result, forces, knots, edges), rates, knots, edges)
