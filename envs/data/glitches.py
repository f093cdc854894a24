"""Samples that a recording shows to be none, although each alone could be one: found from what comes before and after.

While samples arrive, :class:`SamplesSoFar` decides as for a recording that ends with the last one, and revises what it
decided on the samples before; bursts and blocks that were written again are looked for in recordings alone.

A glitch of the transmission stands alone: the sample after it is where the sample before was. What a motion or an
impact does to a sensor rings on. In the recordings of BROAD, RepoIMU, EuRoC, smartphones and a bicycle ride no sample
comes near the bounds below; tapping on the sensor of BROAD reaches a third of :data:`ISOLATION`.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .bursts import bursts
from .ranges import at_range, reached_range
from .repeats import CHANNELS, RunsSoFar, moves, repeated, repeated_blocks, runs_of, zeros_in_motion
from .trajectory import Trajectory

LEAST = {"gyr": 3.0, "acc": 30.0}
"""rad/s and m/s²: distance of a glitch from the mean of its neighbours."""
ISOLATION = 6.0
"""The same beside that of the samples two to four intervals away, of which one may be a glitch too."""
RETURN = 0.3
"""Difference of the neighbours, as a share of the distance."""
AWAY = (-4, -3, -2, 2, 3, 4)
REACH = 5
"""Samples before and after that decide on one."""
WRITTEN = 3
"""Times that a glitch may be written."""
SATURATED, BELOW = 5, 0.5
"""Samples in a row at the end of a range that are none where the readings beside them lie below this share of it."""
FEWEST = 9
"""Samples from which on there is a decision."""


def glitches(values: np.ndarray, least: float) -> np.ndarray:
    """Samples ``(T,)`` bool of ``(T, 3)`` that stand alone, far from neighbours that agree.

    At the start and after a gap the neighbours are the next two samples. One sample that was written twice or three
    times is one.
    """
    if len(values) < FEWEST:
        return np.zeros(len(values), bool)
    begins, lengths = runs_of(values)
    if len(begins) < len(values):
        return np.repeat(alone(values[begins], least) & (lengths <= WRITTEN), lengths)
    return alone(values, least)


def alone(values: np.ndarray, least: float) -> np.ndarray:
    """The same of samples of which none is as the one before."""
    found = np.zeros(len(values), bool)
    none = np.full((2, values.shape[1]), np.nan)
    before, after = np.concatenate([none[:1], values[:-1]]), np.concatenate([values[1:], none[:1]])
    with np.errstate(invalid="ignore", over="ignore"):
        first = np.logical_not(np.isfinite(before).all(axis=1, keepdims=True))
        distance = np.linalg.norm(values - np.where(first, after, 0.5 * (before + after)), axis=1)
        far = np.flatnonzero(distance > least)
        if not len(far):
            return found
        index = far[:, None] + AWAY
        there = (index >= 0) & (index < len(values))
        around = np.where(there, np.nan_to_num(distance[np.clip(index, 0, len(values) - 1)]), 0.0)
        other = np.where(first, np.concatenate([values[2:], none]), before)
        beyond = np.linalg.norm(after[far] - other[far], axis=1)
        isolated = distance[far] > ISOLATION * np.sort(around, axis=1)[:, -2]
        found[far] = isolated & (beyond < RETURN * distance[far])
    return found


def sudden(values: np.ndarray, least: float) -> bool:
    """Whether the last of samples ``(T, 3)`` looks like a glitch as long as the next one has not come."""
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.linalg.norm(np.diff(values[runs_of(values)[0]][-REACH:], axis=0), axis=1)
    if len(steps) < REACH - 1 or not steps[-1] > least:
        return False
    return bool(steps[-1] > ISOLATION * np.sort(np.nan_to_num(steps[:-1]))[-2])


def jumps_to_range(values: np.ndarray, limit: float) -> np.ndarray:
    """Samples ``(T,)`` bool of ``(T, 3)`` that reach a range at once, for a few samples.

    A motion that is too strong for a sensor fills its range first. Its readings stay: they are nearer to it than what
    would be held in their place.
    """
    size = np.abs(values).max(axis=1, initial=0.0)
    full = at_range(values, limit)
    with np.errstate(invalid="ignore"):
        beside = np.concatenate([[0.0], np.where(size < BELOW * limit, 0.0, size), [0.0]])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], full, [False]]).astype(int)))
    found = np.zeros(len(values), bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        found[begin:end] = end - begin <= SATURATED and not (beside[begin] > 0.0 or beside[end + 1] > 0.0)
    return found


def reached_ranges(measurements: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Channel → range in its unit, of gyroscopes and accelerometers whose readings show it."""
    kinds = {name: name.rpartition("/")[2] for name, values in measurements.items() if values.shape[1] == 3}
    found = {name: reached_range(kind, measurements[name]) for name, kind in kinds.items() if kind in LEAST}
    return {name: limit for name, limit in found.items() if limit is not None}


def no_samples(
    measurements: Mapping[str, np.ndarray], ranges: Mapping[str, float], dt: float | None = None
) -> dict[str, dict[str, np.ndarray]]:
    """Channel → kind of what is no sample → where ``(T,)`` bool.

    That is a glitch or a burst of a gyroscope or an accelerometer; a gyroscope's 0, 0, 0 beside an accelerometer's, or
    for a while beside one that moves, which is how a logger writes that nothing came; what jumps to the end of the
    range of a sensor; and samples that were written again where none came (:mod:`.repeats`), one by one or in blocks,
    which those of a saturated sensor are not.

    Args:
        measurements: channel → ``(T, size)``, on a grid.
        ranges: channel → range in its unit, where it is known.
        dt: s between samples; None to look for no repeats and no bursts.
    """
    found: dict[str, dict[str, np.ndarray]] = {}
    for name, values in measurements.items():
        site, _, kind = name.rpartition("/")
        if kind not in CHANNELS or values.shape[1] != 3:
            continue
        if dt is not None:
            rates = measurements.get(f"{site}/gyr")
            moving = None if rates is None else moves(rates)
            repeats = repeated(values, dt, moving)
            if name in ranges:
                repeats &= ~at_range(values, ranges[name])
            blocks = repeated_blocks(values) & ~repeats
            found[name] = {"repeats of an earlier sample": repeats, "samples of blocks that were written again": blocks}
        if kind not in LEAST:
            continue
        found.setdefault(name, {})["glitches"] = single = glitches(values, LEAST[kind])
        if dt is not None:
            found[name]["samples of bursts"] = bursts(values, kind, dt) & ~single
        force = measurements.get(f"{site}/acc")
        if kind == "gyr" and force is not None:
            zeros = np.logical_not(values.any(axis=1) | force.any(axis=1))
            found[name]["rows of zeros"] = zeros if dt is None else zeros | zeros_in_motion(values, force, dt)
        if name in ranges:
            found[name]["jumps to the end of the range"] = jumps_to_range(values, ranges[name])
    return found


def without_glitches(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """The measurements of a trajectory on its grid, NaN where :func:`no_samples` are.

    ``metadata["full_scale"]`` names the ranges of sensors (channel → range); others are seen where readings stop.

    Warns:
        UserWarning: how many samples there are.
    """
    measurements, reports = dict(trajectory.measurements), []
    dt = trajectory.dt if len(trajectory) > 1 else None
    given = trajectory.metadata.get("full_scale", {})
    stated = {str(name): float(limit) for name, limit in given.items()} if isinstance(given, Mapping) else {}
    ranges = reached_ranges(measurements) | stated
    for name, parts in no_samples(measurements, ranges, dt).items():
        wrong = np.logical_or.reduce(list(parts.values()))
        if wrong.any():
            measurements[name] = np.where(wrong[:, None], np.nan, measurements[name])
            reports += [f"{name}: {int(part.sum())} {what}" for what, part in parts.items() if part.any()]
    if reports:
        warnings.warn(f"{trajectory.name}: {', '.join(reports)}; they count as missing samples", stacklevel=4)
    return measurements


@dataclass
class SamplesSoFar:
    """The last samples of a stream, NaN where they are none as far as the samples so far tell.

    Attributes:
        ranges: channel → range of the sensor in its unit.
        dt: s between samples; None to look for no repeats. They count as missing from the first that is too many.
    """

    ranges: Mapping[str, float] = field(default_factory=dict)
    dt: float | None = None
    _runs: RunsSoFar = field(default_factory=RunsSoFar, init=False)
    _raw: deque[dict[str, np.ndarray]] = field(default_factory=lambda: deque(maxlen=2 * REACH + 1), init=False)
    _clean: deque[dict[str, np.ndarray]] = field(default_factory=lambda: deque(maxlen=FEWEST), init=False)
    _watched: int = field(default=0, init=False)

    def add(self, measurement: Mapping[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
        """The sample (channel → ``(size,)``) as it counts now, and before it those that count otherwise from now on.

        All of them are the last ones of the stream, in their order.
        """
        sample = dict(measurement) if self.dt is None else self._runs.without_repeats(measurement, self.dt)
        odd = self._odd(sample)
        self._raw.append(sample)
        self._watched = 2 * REACH + 1 if odd else max(0, self._watched - 1)
        if not self._watched:
            self._clean.append(sample)
            return [sample]
        window = {name: np.array([each[name] for each in self._raw]) for name in sample}
        clean = dict(window)
        for name, parts in no_samples(window, self.ranges).items():
            wrong = np.logical_or.reduce(list(parts.values()))
            wrong[-1] |= sudden(window[name], LEAST[name.rpartition("/")[2]])
            clean[name] = np.where(wrong[:, None], np.nan, window[name])
        count = min(len(self._raw), FEWEST if len(self._raw) == FEWEST else REACH + 1)
        now = [{name: values[row] for name, values in clean.items()} for row in range(-count, 0)]
        before = list(self._clean)[len(self._clean) + 1 - count :]
        same = next((row for row, each in enumerate(before) if not alike(each, now[row])), count - 1)
        for _ in before:
            self._clean.pop()
        self._clean.extend(now)
        return now[same:]

    def _odd(self, sample: Mapping[str, np.ndarray]) -> bool:
        """Whether a sample is one that :func:`no_samples` may find, or that makes it find one."""
        last = self._raw[-1] if self._raw else sample
        for name, values in sample.items():
            kind = name.rpartition("/")[2]
            if kind not in LEAST or len(values) != 3:
                continue
            # The distance of a glitch is at most its larger step; one coordinate has at least 1/√3 of it.
            least, now, before = 0.5 * LEAST[kind], values.tolist(), last[name].tolist()
            if any(abs(one - other) > least for one, other in zip(now, before, strict=True)) or not any(now):
                return True
            if name in self.ranges and at_range(values, self.ranges[name]):
                return True
        return False


def alike(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> bool:
    """Whether two samples have the same numbers, and NaN in the same places."""
    return one.keys() == other.keys() and all(
        np.array_equal(values, other[name], equal_nan=True) for name, values in one.items()
    )
