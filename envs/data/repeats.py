"""Samples that are none, because a recorder wrote its last one, or a block of earlier ones, again where nothing came.

No sensor with noise gives one sample several times in a row: three axes with a standard deviation of one step of
their digits repeat by chance in 2 % of the samples, five times in a row in less than one of a million. Nor does it give
ten samples that it gave before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

CHANNELS = ("gyr", "acc", "mag")
"""Kinds of channels, of three axes, in which repeats are looked for."""
HELD = 0.5
"""s for which no sensor in use gives one sample again and again."""
RARELY = 0.05
"""Share of samples that repeat the one before, up to which a sensor shows noise."""
LONGEST = 4
"""Longest run of one sample, in usual ones, that counts as the sensor's own."""
HARMLESS = 0.03
"""s for which a sample may stand in for others whatever it is."""
FEWEST_CHANGES = 20
"""Of a channel that shows noise, or how slow it is."""
RESTLESS = 0.5
"""m/s² of scatter that no accelerometer shows at rest."""
AT_ONCE = 0.1
"""rad/s beside zeros: a motion, or a simulation without errors, comes to rest in smaller steps."""
STANDSTILL = 1e-6
"""rad/s below which no gyroscope reads but a simulated one without errors, or one that writes zeros at rest."""
BLOCK = 10
"""Samples that a block which is written again has at least."""
BY_CHANCE = 1e-6
"""Probability of such a block anywhere in a recording whose samples come in any order."""
PERIODIC = 0.3
"""Share of a recording that repeats itself, from which on that is a motion without noise, or a recording in a loop."""


def runs_of(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row and length of each run of equal rows of ``(T, d)``; a row with NaN equals none."""
    begins = np.flatnonzero(np.append(True, (values[1:] != values[:-1]).any(axis=1)))
    return begins, np.diff(np.append(begins, len(values)))


def usual_run(lengths: np.ndarray) -> int:
    """Samples for which one reading stands in a table: more than one of a sensor that is slower than the table."""
    return int(np.median(lengths)) if len(lengths) > FEWEST_CHANGES else 1


def longest_own(usual: int, dt: float) -> int:
    """Samples of the longest run that may be the sensor's own."""
    return max(LONGEST * usual, round((HELD if usual > 1 else HARMLESS) / dt) + 1)


def foreign_runs(values: np.ndarray, dt: float, moving: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """First row and length of the runs of one sample in ``(T, 3)`` that are not the sensor's own.

    Runs of a sensor that is slower than its table, or whose digits are coarse, are its own.

    Args:
        values: of one channel, on a grid.
        dt: s between samples.
        moving: ``(T,)`` bool, :func:`moves` of the gyroscope at the same site: what is still beside one that is still
            may rest, in a simulation without errors. None without a gyroscope.
    """
    begins, lengths = runs_of(values)
    usual = usual_run(lengths)
    own = lengths <= longest_own(usual, dt)
    coarse = usual == 1 and float((lengths[own] - 1).sum()) > RARELY * len(values)
    noisy = int(own.sum()) > FEWEST_CHANGES or (moving is not None and float(moving.mean()) > 0.5)
    if coarse or not noisy:
        return begins[:0], lengths[:0]
    if moving is not None:
        own |= np.add.reduceat(moving.astype(float), begins) < 0.5 * lengths
    return begins[~own], lengths[~own]


def repeated(values: np.ndarray, dt: float, moving: np.ndarray | None = None) -> np.ndarray:
    """Samples ``(T,)`` bool that repeat an earlier one in place of a missing one; arguments as above."""
    found = np.zeros(len(values), bool)
    for begin, length in zip(*foreign_runs(values, dt, moving), strict=True):
        found[begin + 1 : begin + length] = values[begin].any()
    for _, begin, length in stuck_axes(values, dt):
        found[begin + 1 : begin + length] = True
    return found


def stuck_axes(values: np.ndarray, dt: float) -> list[tuple[int, int, int]]:
    """Axis, first row and length of the runs in which one axis of ``(T, 3)`` stands still and another does not.

    Such runs are longer than any of a sensor; what stands at the largest reading may be saturated.
    """
    largest, found = float(np.nanmax(np.abs(values), initial=0.0)), []
    for axis in range(values.shape[1]):
        column = values[:, axis : axis + 1]
        for begin, length in zip(*foreign_runs(column, dt), strict=True):
            part = values[begin : begin + length]
            others = int((np.diff(part, axis=0) != 0.0).any(axis=1).sum())
            if length * dt >= HELD and others > 0.5 * length and abs(part[0, axis]) < 0.99 * largest:
                found.append((axis, int(begin), int(length)))
    return found


def repeated_blocks(values: np.ndarray) -> np.ndarray:
    """Samples ``(T,)`` bool of ``(T, 3)`` in blocks that are equal to earlier ones, sample by sample.

    The rarer its samples are, the less likely is a block by chance. One that stands as long as the one before counts
    once.
    """
    found = np.zeros(len(values), bool)
    if len(values) < 2 * BLOCK:
        return found
    known = np.isfinite(values).all(axis=1)
    present = known[:, None] & (np.abs(values) > STANDSTILL)
    bits = np.where(present, values, 0.0).view(np.uint64)
    mixed = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    rows = ((bits ^ (bits >> np.uint64(29))) * mixed).sum(axis=1, dtype=np.uint64)
    _, place, count = np.unique(rows, return_inverse=True, return_counts=True)
    changed = known & np.append(True, rows[1:] != rows[:-1])
    rarity = np.where(changed, np.log(len(values) / count[place]), 0.0)
    # The hash of each block of the shortest length, and the place at which it stood before.
    powers = np.cumprod(np.full(BLOCK, mixed[0], np.uint64))
    windows = np.lib.stride_tricks.sliding_window_view
    whole = windows(known, BLOCK).all(axis=1)
    blocks = (windows(rows, BLOCK) * powers).sum(axis=1, dtype=np.uint64)
    order = np.argsort(blocks, kind="stable")
    again = np.flatnonzero(blocks[order[1:]] == blocks[order[:-1]])
    lags = np.zeros(len(blocks), int)
    lags[order[again + 1]] = order[again + 1] - order[again]
    lags[~whole] = 0
    total = np.append(0.0, np.cumsum(rarity))
    begins = np.flatnonzero(np.append(True, lags[1:] != lags[:-1]))
    for begin, end in zip(begins, np.append(begins[1:], len(lags)), strict=True):
        stop = end - 1 + BLOCK
        if lags[begin] and total[stop] - total[begin] > 2.0 * np.log(len(values)) - np.log(BY_CHANCE):
            found[begin:stop] = True
    return found if found.mean() < PERIODIC else np.zeros(len(values), bool)


def zeros_in_motion(gyroscope: np.ndarray, force: np.ndarray, dt: float) -> np.ndarray:
    """Samples ``(T,)`` bool in which a gyroscope ``(T, 3)`` reads 0, 0, 0 at once, while the force ``(T, 3)`` moves."""
    found = np.zeros(len(gyroscope), bool)
    for begin, length in zip(*foreign_runs(gyroscope, dt), strict=True):
        rows = slice(begin, begin + length)
        known = force[rows][np.isfinite(force[rows]).all(axis=1)]
        beside = gyroscope[max(begin - 1, 0) : begin + length + 1]
        at_once = float(np.abs(beside).max()) > AT_ONCE
        if not gyroscope[begin].any() and at_once and len(known) > 1 and float(known.std(axis=0).max()) > RESTLESS:
            found[rows] = True
    return found


def moves(gyroscope: np.ndarray) -> np.ndarray:
    """Where ``(T,)`` bool a gyroscope ``(T, 3)`` does not read exactly nothing."""
    return ~np.asarray((np.abs(gyroscope) <= STANDSTILL).all(axis=1))


@dataclass
class RunsSoFar:
    """The runs of a stream so far: repeats are none from the first that is one too many for a run of the sensor."""

    _last: dict[str, list[float]] = field(default_factory=dict)
    _run: dict[str, int] = field(default_factory=dict)
    _changes: dict[str, int] = field(default_factory=dict)
    _repeats: dict[str, int] = field(default_factory=dict)

    def without_repeats(self, measurement: Mapping[str, np.ndarray], dt: float) -> dict[str, np.ndarray]:
        """The next sample (channel → ``(size,)``), NaN where it repeats one in place of a missing one."""
        result, longest = dict(measurement), longest_own(1, dt)
        for name, values in measurement.items():
            site, _, kind = name.rpartition("/")
            if kind not in CHANNELS or len(values) != 3:
                continue
            now = values.tolist()
            if now != self._last.get(name):
                own = self._run.get(name, 0)
                self._repeats[name] = self._repeats.get(name, 0) + (own - 1 if 0 < own <= longest else 0)
                self._changes[name] = self._changes.get(name, 0) + 1
                self._last[name], self._run[name] = now, 1
                continue
            self._run[name] += 1
            changes, repeats = self._changes[name], self._repeats[name]
            if self._run[name] > longest and changes > FEWEST_CHANGES and repeats <= RARELY * (changes + repeats):
                rates = measurement.get(f"{site}/gyr")
                if any(now) and (rates is None or bool(moves(rates[None])[0])):
                    result[name] = np.full(3, np.nan)
        return result
