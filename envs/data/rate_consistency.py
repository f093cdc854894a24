"""Consistency of a gyroscope with the direction that another sensor at the same site measures.

Rotated by the integrated gyroscope, gravity (or the magnetic field) is constant. Short windows are rotated under each
hypothesis about the gyroscope's unit and axes, and the one with the most constant direction is compared with "as
given". Accelerations average out over the segments of a window, because velocity stays bounded.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ...filters.core import rotation

SEGMENT = 1.0
"""s over which acceleration averages out; three of them are one window."""
SEGMENTS = 3
FEWEST_STEPS, MOST_STEPS = 10, 25
"""Integration steps a segment: samples are averaged down to at most so many."""
WINDOWS = 24
"""Windows that are looked at: those with the largest rotation."""
LONGEST_STEP = 3.0
"""A window with an interval longer than so many median ones spans a gap, and is left out."""
CLEARLY = 0.6
"""A hypothesis is preferred to the data as given if it leaves less than this share."""

SCALES: dict[str, float] = {
    "rad/s that were converted from deg/s once too often": 180.0 / np.pi,
    "rev/s": 2.0 * np.pi,
    "half rad/s (another full scale than assumed)": 2.0,
    "rad/s": 1.0,
    "twice rad/s (another full scale than assumed)": 0.5,
    "rpm": 2.0 * np.pi / 60.0,
    "deg/s": np.pi / 180.0,
    "mrad/s": 1e-3,
    "mdeg/s": 1e-3 * np.pi / 180.0,
}
"""Unit → rad/s, the largest first."""
SMALL_UNITS_FROM = 500.0
"""Reported rates below which the thousandth parts of a unit are not considered."""


def signed_permutations() -> list[np.ndarray]:
    """All 48 matrices ``(3, 3)`` that permute axes and reverse some; the unit matrix first."""
    matrices = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            matrices.append(matrix)
    return matrices


@dataclass(frozen=True)
class RateConsistency:
    """How the rates that a gyroscope reports relate to those under which a measured direction stands still.

    Attributes:
        as_given: residual motion of the direction, root mean square, as a share of its length (rad, if small).
        at_rest: the same for a gyroscope that reports zero, as a reference.
        unit: unit of :data:`SCALES` that leaves least.
        unit_residual: residual with this unit.
        axes: ``(3, 3)`` signed permutation of the reported axes that leaves least, at that unit.
        axes_residual: residual with these axes.
    """

    as_given: float
    at_rest: float
    unit: str
    unit_residual: float
    axes: np.ndarray
    axes_residual: float

    @property
    def explains(self) -> bool:
        """Whether the best hypothesis explains most of the motion: otherwise nothing is decided."""
        return self.at_rest > 0.05 and self.axes_residual < 0.5 * self.at_rest

    @property
    def other_unit(self) -> str | None:
        """A unit that fits clearly better than rad/s, or None."""
        too_much = self.as_given > 0.3 and self.as_given > 3.0 * self.at_rest
        better = self.unit_residual < CLEARLY * self.as_given and (self.explains or too_much)
        return self.unit if self.unit != "rad/s" and better else None

    @property
    def other_axes(self) -> np.ndarray | None:
        """An arrangement of the axes that fits clearly better than the one given, or None."""
        better = self.axes_residual < CLEARLY * self.unit_residual and self.explains
        return self.axes if better and not np.array_equal(self.axes, np.eye(3)) else None


def rate_consistency(time: np.ndarray, rate: np.ndarray, vector: np.ndarray) -> RateConsistency | None:
    """Compare reported rates with the motion of a measured direction.

    Args:
        time: ``(T,)`` s, increasing.
        rate: ``(T, 3)`` as the gyroscope reports it, NaN where missing.
        vector: ``(T, 3)`` of an accelerometer or magnetometer, any unit, NaN where missing.

    Returns:
        The comparison; None if the recording has no complete window.
    """
    windows = cut(time, rate, vector)
    if windows is None:
        return None
    turns, vectors = windows
    axes = signed_permutations()
    small = float(np.nanmax(np.abs(rate))) < SMALL_UNITS_FROM
    units = {unit: scale for unit, scale in SCALES.items() if not (small and unit.startswith("m"))}
    scales = np.array([0.0, *units.values()])[:, None, None, None]
    at_rest, *rest = residuals(np.concatenate([scales * turns, rearranged(axes, turns)]), vectors).tolist()
    by_unit, by_axes = dict(zip(units, rest, strict=False)), rest[len(units) :]
    given = by_unit["rad/s"]
    # Too small a unit is as good as none: the largest that fits is meant.
    unit = next(name for name in units if by_unit[name] <= 1.15 * min(by_unit.values()))
    if by_unit[unit] > CLEARLY * given or by_unit[unit] > min(by_axes):
        unit = "rad/s"
    elif by_unit[unit] > 0.5 * at_rest:
        by_axes = residuals(rearranged(axes, SCALES[unit] * turns), vectors).tolist()
    else:
        return RateConsistency(given, at_rest, unit, by_unit[unit], axes[0], by_unit[unit])
    best = int(np.argmin(by_axes))
    return RateConsistency(given, at_rest, unit, by_unit[unit], axes[best], by_axes[best])


def rearranged(axes: list[np.ndarray], turns: np.ndarray) -> np.ndarray:
    """Rotation vectors ``(hypotheses, windows, steps, 3)`` under every arrangement of the axes."""
    return np.einsum("hij,wtj->hwti", np.stack(axes), turns)


def cut(time: np.ndarray, rate: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Windows of a recording: rotation vectors as reported, and measured vectors of length about 1.

    Returns:
        Two arrays ``(windows, steps, 3)``; None without a complete window.
    """
    present = np.isfinite(rate).all(axis=1) & np.isfinite(vector).all(axis=1) & (vector != 0.0).any(axis=1)
    time, rate, vector = time[present], rate[present], vector[present]
    if len(time) < SEGMENTS * FEWEST_STEPS + 1:
        return None
    step = float(np.median(np.diff(time)))
    # A clock in another unit than seconds still gets windows of a sensible number of samples.
    samples = int(np.clip(round(SEGMENT / step), FEWEST_STEPS, 2000))
    together = -(-samples // MOST_STEPS)
    length = samples // together * together * SEGMENTS
    count = (len(time) - 1) // length
    if count == 0:
        return None
    size = np.median(np.linalg.norm(vector, axis=1))
    intervals = np.diff(time)[: count * length].reshape(count, length)
    # A sample describes the interval that it ends.
    turns = (rate[1 : count * length + 1] * np.diff(time)[: count * length, None]).reshape(count, -1, together, 3)
    vectors = (vector[1 : count * length + 1] / size).reshape(count, -1, together, 3)
    turns, vectors = turns.sum(axis=2), vectors.mean(axis=2)
    whole = intervals.max(axis=1) < LONGEST_STEP * step
    if not whole.any():
        return None
    amount = np.where(whole, np.linalg.norm(turns, axis=2).sum(axis=1), -1.0)
    chosen = np.argsort(-amount, kind="stable")[: min(WINDOWS, int(whole.sum()))]
    return turns[chosen], vectors[chosen]


def residuals(turns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Motion of the mean vectors of the segments, turned back to the start of their window, as a share of their mean.

    Args:
        turns: ``(hypotheses, windows, steps, 3)`` rotation vectors.
        vectors: ``(windows, steps, 3)``.

    Returns:
        ``(hypotheses,)`` root of the median over windows of the relative variance of the means.
    """
    q = np.zeros((*turns.shape[:2], 4))
    q[..., 0] = 1.0
    turned = np.empty(turns.shape)
    for t in range(turns.shape[2]):
        # A mean over an interval belongs to the attitude in its middle.
        half = rotation.exp(0.5 * turns[:, :, t])
        q = rotation.multiply(q, half)
        turned[:, :, t] = rotation.rotate(q, vectors[:, t])
        q = rotation.multiply(q, half)
    means = turned.reshape(*turns.shape[:2], SEGMENTS, -1, 3).mean(axis=3)
    variance = np.var(means, axis=2).sum(axis=-1)
    # Relative, since vectors that are spun around vanish in the mean.
    return np.sqrt(np.median(variance / (np.square(means.mean(axis=2)).sum(axis=-1) + variance), axis=1))
