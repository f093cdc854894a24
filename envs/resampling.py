"""Trajectories at another rate, without losing what integrates to the pose.

A sample stands for the interval that ends at its tick. Its kind decides how samples are joined:

* a gyroscope is integrated to an attitude, which is read at the new ticks, so that coning is kept;
* an accelerometer beside a gyroscope is integrated to a velocity in the frame of that attitude, and given in the
  attitude of the middle of the new interval, so that sculling is kept (P. G. Savage, "Strapdown Inertial Navigation
  Integration Algorithm Design", J. Guidance, Control, and Dynamics 21(1–2), 1998);
* every other channel is averaged.
"""

from __future__ import annotations

import numpy as np

from ..filters import rotation
from .trajectory import Trajectory


def resample(trajectory: Trajectory, rate: float) -> Trajectory:
    """Resample to ``rate`` on the uniform grid that starts at the first tick.

    Strapdown integration of the result passes through the attitudes and velocities that the original gives. Nothing is
    filtered beyond the mean over an interval. At a higher rate samples are repeated: no information is added.

    Args:
        trajectory: with uniform or other ticks; its samples are taken as means over the interval that ends at them.
        rate: Hz.

    Returns:
        The new trajectory. A sample is NaN if its interval overlaps a missing one; orientations are interpolated on
        the great circle, other truth linearly, both NaN beside unknown truth; a tick is scored if both its old
        neighbours are.

    Raises:
        ValueError: ``rate`` is not positive and finite.
    """
    if not 0.0 < rate < np.inf:
        raise ValueError(f"rate must be a positive number of Hz, got {rate}")
    old, dt = trajectory.time, trajectory.dt
    # The tolerance keeps the last tick when the ratio of the rates is a whole number.
    count = int(np.floor((old[-1] - old[0]) * rate + 1e-6)) + 1
    new = old[0] + np.arange(count) / rate
    edges = np.concatenate([[new[0] - 1.0 / rate], new])
    # Before the first sample nothing is known; the first is held over the first interval.
    knots = np.concatenate([[min(old[0] - dt, edges[0])], old])
    measurements = {}
    for name, values in trajectory.measurements.items():
        place, _, kind = name.rpartition("/")
        gyroscope = trajectory.measurements.get(f"{place}/gyr")
        turning = kind in ("gyr", "acc") and gyroscope is not None and gyroscope.shape[1] == values.shape[1] == 3
        samples = held(gyroscope, values, knots, edges) if turning and kind == "acc" else None
        if turning and kind == "gyr":
            samples = turned(values, knots, edges)
        measurements[name] = mean(values, knots, edges) if samples is None else samples
    left, right, weight = neighbours(old, new)
    return trajectory.replace(
        time=new,
        measurements=measurements,
        truth={name: between(name, values[left], values[right], weight) for name, values in trajectory.truth.items()},
        mask=trajectory.mask[left] & trajectory.mask[right],
        metadata=trajectory.metadata | {"rate": float(rate), "resampled_from": 1.0 / dt},
    )


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


def attitude_at(rates: np.ndarray, knots: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Attitude ``(N, 4)`` relative to the start, after piecewise constant angular rates (missing ones are zero)."""
    rates = np.nan_to_num(rates)
    steps = rotation.exp(rates * np.diff(knots)[:, None])
    attitude = np.empty((len(knots), 4))
    attitude[0] = (1.0, 0.0, 0.0, 0.0)
    for tick, step in enumerate(steps):
        attitude[tick + 1] = rotation.multiply(attitude[tick], step)
    attitude = rotation.normalize(attitude)
    interval = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(steps) - 1)
    elapsed = (at - knots[interval])[:, None]
    return rotation.multiply(attitude[interval], rotation.exp(rates[interval] * elapsed))


def turned(rates: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Angular rates whose rotation over each new interval is that of the old rates."""
    attitude = attitude_at(rates, knots, edges)
    steps = rotation.log(rotation.multiply(rotation.conjugate(attitude[:-1]), attitude[1:]))
    return mark_missing(steps / np.diff(edges)[:, None], rates, knots, edges)


def held(rates: np.ndarray, forces: np.ndarray, knots: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Specific force whose velocity over each new interval is that of the old samples, in the attitude of its middle."""
    middles = attitude_at(rates, knots, 0.5 * (knots[1:] + knots[:-1]))
    increments = rotation.rotate(middles, np.nan_to_num(forces)) * np.diff(knots)[:, None]
    velocity = np.diff(integral_at(increments, knots, edges), axis=0) / np.diff(edges)[:, None]
    result = rotation.rotate_back(attitude_at(rates, knots, 0.5 * (edges[1:] + edges[:-1])), velocity)
    return mark_missing(mark_missing(result, forces, knots, edges), rates, knots, edges)
