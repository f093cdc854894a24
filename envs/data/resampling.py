"""Resampling of trajectories that preserves the integrals to attitude and velocity.

With ``sampling="interval"`` a sample describes the interval that ends at its time (of a slower sensor:
that reaches back to its own last sample), and its kind decides how samples are joined:

* a gyroscope is integrated to an attitude, which is interpolated at the new times, so that coning is kept;
* an accelerometer beside a gyroscope is integrated to a velocity in the frame of that attitude, and given in the
  attitude of the middle of the new interval, so that sculling is kept (P. G. Savage, "Strapdown Inertial Navigation
  Integration Algorithm Design", J. Guidance, Control, and Dynamics 21(1–2), 1998);
* an orientation is interpolated, every other channel averaged.

With ``sampling="instant"`` a sample is the value at its time, and all are interpolated; motion faster than half the new
rate is aliased. This suits estimators that use the accelerometer in the attitude at the time of the sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any, Literal, NamedTuple

import numpy as np

from ...filters.core import rotation

MOST_SAMPLES = 10**8
LONGEST_STEP = 1.5
"""Samples of one sensor that are further apart than so many of its intervals have lost one between them."""


class Samples(NamedTuple):
    """Piecewise constant samples ``(S, size)`` between knots ``(S + 1,)`` s; NaN where there was none."""

    values: np.ndarray
    knots: np.ndarray


def resampled_fields(
    old: np.ndarray,
    channels: Mapping[str, np.ndarray],
    truth: Mapping[str, np.ndarray],
    mask: np.ndarray,
    rate: float,
    sampling: Literal["interval", "instant"] = "interval",
) -> dict[str, Any]:
    """Fields of a trajectory on the uniform grid of ``rate`` in Hz that starts at the first sample.

    By intervals, strapdown integration of the result passes through the attitudes of the original, and through its
    velocities, interpolated between the old times. Nothing is filtered beyond the mean over an interval. At a higher
    rate samples are repeated: no information is added. Arguments are those of
    :meth:`poise.envs.data.trajectory.Trajectory.resampled`, stamps ``old`` strictly increasing.

    Raises:
        ValueError: ``rate`` is not positive and finite, or ``sampling`` unknown.
    """
    if sampling not in ("interval", "instant"):
        raise ValueError(f"sampling must be 'interval' or 'instant', got {sampling!r}")
    if isinstance(rate, bool) or not isinstance(rate, Real) or not 0.0 < rate < np.inf:
        raise ValueError(f"rate must be a positive number of Hz, got {rate!r}")
    rate = float(rate)
    # The tolerance keeps the last sample when the ratio of the rates is a whole number.
    count = int(np.floor((old[-1] - old[0]) * rate + 1e-6)) + 1
    if count > MOST_SAMPLES:
        raise ValueError(
            f"rate {rate:g} Hz would make {count:.3g} samples of {old[-1] - old[0]:.4g} s; {MOST_SAMPLES:g} at most"
        )
    new = old[0] + np.arange(count) / rate
    left, right, weight = neighbours(old, new)
    if sampling == "interval":
        edges = np.concatenate([[new[0] - 1.0 / rate], new])
        samples = {
            name: samples_of(values, old, own_interval(old, 1.0 / rate), edges) for name, values in channels.items()
        }
        measurements = {name: joined(name, samples, edges) for name in channels if not name.endswith("orientation")}
    else:
        measurements = {}
    interpolated = {name: at_instants(name, channels[name], old, new) for name in channels if name not in measurements}
    return {
        "time": new,
        "measurements": {name: (measurements | interpolated)[name] for name in channels},
        "truth": {name: between(name, values[left], values[right], weight) for name, values in truth.items()},
        "mask": mask[left] & mask[right],
    }


def neighbours(old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Old times to the left and right of every new one, and the weight ``(N, 1)`` of the right one."""
    near = 1e-6 * np.min(np.diff(old), initial=1.0)
    left = np.clip(np.searchsorted(old, new + near, side="right") - 1, 0, len(old) - 1)
    on_tick = np.abs(old[left] - new) < near
    right = np.where(on_tick, left, np.minimum(left + 1, len(old) - 1))
    span = np.where(right > left, old[right] - old[left], 1.0)
    return left, right, np.where(right > left, (new - old[left]) / span, 0.0)[:, None]


def between(name: str, a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Values between two samples."""
    if name.endswith("orientation"):
        step = rotation.log(rotation.multiply(rotation.conjugate(a), b))
        return rotation.normalize(rotation.multiply(a, rotation.exp(weight * step)))
    value = a + weight * (b - a)
    return rotation.normalize(value) if name == "up" else value


def shifted(truth: Mapping[str, np.ndarray], time: np.ndarray, offset: float) -> dict[str, np.ndarray]:
    """Truth recorded at ``time`` as it is at ``time - offset``, s; NaN outside and beside unknown truth."""
    wanted = time - offset
    left, right, weight = neighbours(time, wanted)
    outside = ((wanted < time[0]) | (wanted > time[-1]))[:, None]
    with np.errstate(invalid="ignore"):
        return {
            name: np.where(outside, np.nan, between(name, values[left], values[right], weight))
            for name, values in truth.items()
        }


def own_interval(times: np.ndarray, dt: float) -> float:
    """Usual distance of a sensor's samples, s; ``dt`` if it has fewer than two."""
    return float(np.median(np.diff(times))) if len(times) > 1 else dt


def at_instants(name: str, values: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Samples interpolated between those of the same sensor; NaN in gaps and outside."""
    present = np.isfinite(values).all(axis=1)
    if not present.any():
        return np.full((len(new), values.shape[1]), np.nan)
    times, values = old[present], values[present]
    left, right, weight = neighbours(times, new)
    interval = own_interval(times, 1.0)
    outside = (new < times[0] - 1e-6 * interval) | (new > times[-1] + 1e-6 * interval)
    gap = times[right] - times[left] > LONGEST_STEP * interval
    return np.where((outside | gap)[:, None], np.nan, between(name, values[left], values[right], weight))


def fill_short_gaps(values: np.ndarray, longest: float) -> np.ndarray:
    """Samples ``(T, size)`` with lines through missing ones whose neighbours are at most ``longest`` samples apart."""
    present = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(present) < 2:
        return values
    samples = np.arange(len(values))
    right = np.clip(np.searchsorted(present, samples), 1, len(present) - 1)
    before, after = present[right - 1], present[right]
    short = (after - before <= longest + 1e-6) & (samples > before) & (samples < after)
    weight = ((samples - before) / (after - before))[:, None]
    return np.where(short[:, None], values[before] + weight * (values[after] - values[before]), values)


def samples_of(values: np.ndarray, old: np.ndarray, dt: float, edges: np.ndarray) -> Samples:
    """Samples of one sensor and the intervals that they stand for, with holes between them where some are missing.

    The first sample is extended backwards over the first new interval, since nothing else is known of it.
    """
    present = np.isfinite(values).all(axis=1)
    ends = old[present]
    if len(ends) == 0:
        return Samples(np.full((1, values.shape[1]), np.nan), edges[[0, -1]])
    interval = own_interval(ends, dt)
    start, stop = min(edges[0], old[0] - dt), max(edges[-1], old[-1])
    previous = np.concatenate([[start], ends[:-1]])
    begins = np.where(ends - previous > LONGEST_STEP * interval, ends - interval, previous)
    begins[0] = start if present[0] else max(start, ends[0] - interval)
    spans = np.stack([np.stack([previous, begins], axis=1), np.stack([begins, ends], axis=1)], axis=1).reshape(-1, 2)
    spans = np.concatenate([spans, [[ends[-1], stop]]])
    filled = np.full((len(spans), values.shape[1]), np.nan)
    filled[1:-1:2] = values[present]
    real = spans[:, 1] > spans[:, 0]
    return Samples(filled[real], np.concatenate([[start], spans[real, 1]]))


def joined(name: str, samples: dict[str, Samples], edges: np.ndarray) -> np.ndarray:
    """Samples of one channel for the new intervals."""
    place, _, kind = name.rpartition("/")
    own, gyroscope = samples[name], samples.get(f"{place}/gyr")
    if kind not in ("gyr", "acc") or gyroscope is None or not gyroscope.values.shape[1] == own.values.shape[1] == 3:
        return mean(own, edges)
    return angular_rate(own, edges) if kind == "gyr" else specific_force(gyroscope, own, edges)


def mark_missing(result: np.ndarray, samples: Samples, edges: np.ndarray) -> np.ndarray:
    """NaN where an interval overlaps a missing sample by more than rounding."""
    absent = (~np.isfinite(samples.values).all(axis=1)).astype(float)[:, None]
    overlap = np.diff(integral_at(absent * np.diff(samples.knots)[:, None], samples.knots, edges), axis=0)[:, 0]
    return np.where((overlap > 1e-5 * np.diff(edges))[:, None], np.nan, result)


def integral_at(increments: np.ndarray, knots: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Running sum of increments ``(S, n)`` over the intervals between knots, linear within each."""
    total = np.concatenate([np.zeros((1, increments.shape[1])), np.cumsum(increments, axis=0)])
    return np.stack([np.interp(at, knots, column) for column in total.T], axis=1)


def mean(samples: Samples, edges: np.ndarray) -> np.ndarray:
    """Mean of piecewise constant samples over the new intervals."""
    increments = np.nan_to_num(samples.values) * np.diff(samples.knots)[:, None]
    result = np.diff(integral_at(increments, samples.knots, edges), axis=0) / np.diff(edges)[:, None]
    return mark_missing(result, samples, edges)


def running_product(q: np.ndarray) -> np.ndarray:
    """Products ``q[0] ⊗ … ⊗ q[k]`` ``(T, 4)`` of quaternions ``(T, 4)``, by doubling."""
    reach = 1
    while reach < len(q):
        q = np.concatenate([q[:reach], rotation.multiply(q[:-reach], q[reach:])])
        reach *= 2
    return rotation.normalize(q)


def attitude_at(gyroscope: Samples, at: np.ndarray) -> np.ndarray:
    """Attitude ``(N, 4)`` relative to the start, after piecewise constant angular rates (missing ones are zero)."""
    knots, rates = gyroscope.knots, np.nan_to_num(gyroscope.values)
    steps = rotation.exp(rates * np.diff(knots)[:, None])
    attitude = running_product(np.concatenate([[[1.0, 0.0, 0.0, 0.0]], steps]))
    interval = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(steps) - 1)
    return rotation.multiply(attitude[interval], rotation.exp(rates[interval] * (at - knots[interval])[:, None]))


def turns(gyroscope: Samples, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes ``(N, 4)`` at the start of every new interval, and its rotation vector ``(N, 3)``."""
    attitude = attitude_at(gyroscope, edges)
    return attitude[:-1], rotation.log(rotation.multiply(rotation.conjugate(attitude[:-1]), attitude[1:]))


def angular_rate(gyroscope: Samples, edges: np.ndarray) -> np.ndarray:
    """Angular rates whose rotation over each new interval is that of the old rates."""
    _, turn = turns(gyroscope, edges)
    return mark_missing(turn / np.diff(edges)[:, None], gyroscope, edges)


def specific_force(gyroscope: Samples, accelerometer: Samples, edges: np.ndarray) -> np.ndarray:
    """Specific force with the velocity increments of the old samples, in the attitude half-way through each turn."""
    knots = accelerometer.knots
    old_middle = attitude_at(gyroscope, 0.5 * (knots[1:] + knots[:-1]))
    increments = rotation.rotate(old_middle, np.nan_to_num(accelerometer.values)) * np.diff(knots)[:, None]
    velocity = np.diff(integral_at(increments, knots, edges), axis=0)
    start, turn = turns(gyroscope, edges)
    new_middle = rotation.multiply(start, rotation.exp(0.5 * turn))
    result = rotation.rotate_back(new_middle, velocity) / np.diff(edges)[:, None]
    return mark_missing(mark_missing(result, accelerometer, edges), gyroscope, edges)
