"""Sensors that write a file each, with a clock of their own: joined on the stamps of the gyroscope.

A stream that is as fast as the gyroscope (0.7 of its rate or more) is interpolated between its samples, as its instants
lie anywhere between those of the gyroscope. A slower one keeps its samples, each at the next stamp, and is missing
between.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...resampling import between, neighbours

FAST = 0.7
LONGEST_STEP = 3.5
"""Intervals of a stream without a sample, beyond which nothing is interpolated."""


class Stream(NamedTuple):
    """Samples ``(N, size)`` of one sensor at times ``(N,)`` s, on a clock that all streams share."""

    time: np.ndarray
    values: np.ndarray


def joined(streams: Mapping[str, Stream], base: str = "imu/gyr") -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Put streams on the stamps of one of them, within the time that gyroscope and accelerometer share.

    Args:
        streams: channel → samples.
        base: whose stamps are kept.

    Returns:
        Time ``(T,)`` s and channels ``(T, size)``, NaN where there is no sample.

    Raises:
        ValueError: the base is missing or empty, or its time and that of the accelerometer do not meet.
    """
    if base not in streams:
        raise ValueError(f"there is no stream {base}; there are {sorted(streams)}")
    ordered = {name: in_order(stream) for name, stream in streams.items() if len(stream.time)}
    if base not in ordered:
        raise ValueError(f"the stream {base} is empty")
    own_time, own_values = streams[base]
    time = own_time
    # A row that repeats the one before was written twice.
    kept = ~np.append(False, (np.diff(time) == 0.0) & (own_values[1:] == own_values[:-1]).all(axis=1))
    for name in ("imu/gyr", "imu/acc"):
        if name in ordered:
            own = ordered[name].time
            kept &= (time >= own[0] - 1e-9) & (time <= own[-1] + 1e-9)
    if kept.sum() < 2:
        spans = {name: f"{stream.time[0]:.3f} to {stream.time[-1]:.3f} s" for name, stream in ordered.items()}
        raise ValueError(f"gyroscope and accelerometer share no time: {spans}")
    time = time[kept]
    measurements = {name: at(stream, time, name) for name, stream in ordered.items() if name != base}
    measurements[base] = own_values[kept]
    return time, {name: measurements[name] for name in streams if name in measurements}


def in_order(stream: Stream) -> Stream:
    """Samples with strictly increasing stamps; of those that share a stamp the last."""
    order = np.argsort(stream.time, kind="stable")
    time, values = stream.time[order], stream.values[order]
    last = np.append(np.diff(time) > 0.0, True)
    return Stream(time[last], values[last])


def at(stream: Stream, time: np.ndarray, name: str) -> np.ndarray:
    """A stream at the stamps ``(T,)``, interpolated if it is fast enough, else each sample at the next stamp."""
    if len(stream.time) < 2:
        return nearest(stream, time)
    own = float(np.median(np.diff(stream.time)))
    base = float(np.median(np.diff(time)[np.diff(time) > 0.0])) if len(time) > 1 else own
    if base < FAST * own and not name.endswith("orientation"):
        return nearest(stream, time)
    return interpolated(stream, time, name)


def interpolated(stream: Stream, time: np.ndarray, name: str) -> np.ndarray:
    """A stream between its samples; NaN outside, and in gaps of more than LONGEST_STEP of its intervals."""
    own = float(np.median(np.diff(stream.time)))
    left, right, weight = neighbours(stream.time, time)
    outside = (time < stream.time[0] - 1e-6 * own) | (time > stream.time[-1] + 1e-6 * own)
    gap = stream.time[right] - stream.time[left] > LONGEST_STEP * own
    with np.errstate(invalid="ignore"):
        values = between(name, stream.values[left], stream.values[right], weight)
    return np.where((outside | gap)[:, None], np.nan, values)


def nearest(stream: Stream, time: np.ndarray) -> np.ndarray:
    """Every sample at the first stamp that is not before it."""
    values = np.full((len(time), stream.values.shape[1]), np.nan)
    index = np.searchsorted(time, stream.time - 1e-9)
    inside = (index < len(time)) & (stream.time >= time[0] - np.median(np.diff(time)) if len(time) > 1 else True)
    values[index[inside]] = stream.values[inside]
    return values
