"""Consistency of a gyroscope with the direction that another sensor at the same site measures.

Rotated by the integrated gyroscope, gravity (or the magnetic field) is constant. Short windows are rotated under each
hypothesis about the gyroscope's unit and axes, and the one with the most constant direction is compared with "as
given". Accelerations average out over the segments of a window, because velocity stays bounded: the mean of a specific
force over a window is gravity, however strong the motion is.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....filters.core import rotation
from .integration import attitudes

SEGMENT = 1.0
"""s over which acceleration averages out; three of them are one window."""
SEGMENTS, FEWEST_SEGMENTS = 3, 6
"""Of a window, and of a recording: those of a short recording are shorter."""
SHORTEST = 0.67
"""Share of a whole segment that they have at least."""
FEWEST_STEPS, MOST_STEPS = 10, 25
"""Integration steps a segment: samples are averaged down to at most so many."""
MOST_WINDOWS = 24
"""Windows that are looked at: those in which the direction and the rates move most."""
LIVELY = 0.1
"""Share of the motion of the liveliest window, below which a window tells nothing: most of a recording may be rest."""
LONGEST_STEP = 3.0
"""A window with an interval longer than so many median ones spans a gap, and is left out."""
CLEARLY = 0.6
"""A hypothesis is preferred to the data as given if it leaves less than this share."""
STEADY = 0.6
"""Residual as given, below which vectors have a direction in common; of vectors without one it is 0.8."""
NEARLY, FEW_WINDOWS = 0.25, 4
"""What a unit that differs by a factor of two only may leave of the motion: a disturbed field may look like it. So much
for axes, too, in fewer windows: of 48 arrangements one fits by chance."""
SMALL, CLEAR = 0.01, 0.05
"""rad of motion of a direction below which it tells nothing, and beyond which it tells axes, too."""
SPUN = 0.01
"""Variance within a segment, relative to the squared length, that tells nothing."""
RIGHT = 0.2
"""Share of the motion that data which are right may leave: noise decides between hypotheses below it."""
FASTEST_TURN = 70.0
"""rad/s (4,000 °/s): the largest range of the gyroscopes in use."""

SCALES: dict[str, float] = {
    "rad/s that were converted from deg/s once too often": 180.0 / np.pi,
    "an eighth of rad/s (another full scale than assumed)": 8.0,
    "rev/s": 2.0 * np.pi,
    "a quarter of rad/s (another full scale than assumed, or a clock of four times the rate)": 4.0,
    "half rad/s (another full scale than assumed, or a clock of twice the rate)": 2.0,
    "rad/s": 1.0,
    "twice rad/s (another full scale than assumed, or a clock of half the rate)": 0.5,
    "four times rad/s (another full scale than assumed, or a clock of a quarter of the rate)": 0.25,
    "eight times rad/s (another full scale than assumed)": 0.125,
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
        length: of the mean vector of a window, turned back as given, in the unit of the vector.
        longest: the same under the hypothesis where it is longest.
        windows: how many were compared.
    """

    as_given: float
    at_rest: float
    unit: str
    unit_residual: float
    axes: np.ndarray
    axes_residual: float
    length: float
    longest: float
    windows: int

    @property
    def steady(self) -> bool:
        """Whether the mean of a window is one: otherwise the vector points anywhere."""
        return self.as_given < STEADY

    @property
    def explains(self) -> bool:
        """Whether the best hypothesis explains most of the motion (of a small one nearly all)."""
        small = self.at_rest > SMALL and self.windows >= FEW_WINDOWS and self.axes_residual < NEARLY * self.at_rest
        return small or (self.at_rest > CLEAR and self.axes_residual < 0.5 * self.at_rest)

    @property
    def confirmed(self) -> bool:
        """Whether the data as given explain most of the motion."""
        return self.explains and self.as_given < 0.5 * self.at_rest and self.other_unit is None

    @property
    def other_unit(self) -> str | None:
        """A unit that fits clearly better than rad/s, or None."""
        better = self.unit_residual < CLEARLY * self.as_given and (self.explains or self.too_much)
        if "full scale" in self.unit:
            sure = self.windows > FEW_WINDOWS + 1 and self.as_given > self.at_rest
            enough = self.as_given if sure else self.at_rest
            better = better and self.unit_residual < NEARLY * enough and self.at_rest > CLEAR
        return self.unit if self.unit != "rad/s" and better else None

    @property
    def too_much(self) -> bool:
        """Whether the rates turn a vector that nearly stands still."""
        return self.as_given > 0.2 and self.as_given > 3.0 * self.at_rest

    @property
    def worsens(self) -> bool:
        """Whether the rates as given are further from the motion than none, and no hypothesis explains it."""
        moves = self.at_rest > CLEAR and self.windows >= FEW_WINDOWS and not self.explains
        return moves and self.as_given > 1.25 * self.at_rest

    @property
    def other_axes(self) -> np.ndarray | None:
        """An arrangement of the axes that fits clearly better than the one given, or None."""
        better = self.axes_residual < CLEARLY * self.unit_residual and self.explains
        better = better and self.unit_residual > RIGHT * self.at_rest and self.at_rest > CLEAR
        if self.windows < FEW_WINDOWS:
            better = better and self.axes_residual < NEARLY * self.at_rest
        return self.axes if better and not np.array_equal(self.axes, np.eye(3)) else None


def rate_consistency(
    time: np.ndarray, rate: np.ndarray, vector: np.ndarray, constant: bool = False
) -> RateConsistency | None:
    """Compare reported rates with the motion of a measured direction.

    Args:
        time: ``(T,)`` s, increasing.
        rate: ``(T, 3)`` as the gyroscope reports it, NaN where missing.
        vector: ``(T, 3)`` of an accelerometer or magnetometer, any unit, NaN where missing.
        constant: the direction is constant in the world at every instant, as that of a field, not only in the mean.

    Returns:
        The comparison; None if the recording has no complete window.
    """
    windows = cut(time, rate, vector)
    if windows is None:
        return None
    turns, vectors, size = windows
    axes = signed_permutations()
    fastest = float(np.nanquantile(np.linalg.norm(rate, axis=1), 0.99))
    small = float(np.nanmax(np.abs(rate))) < SMALL_UNITS_FROM
    units = {
        unit: scale
        for unit, scale in SCALES.items()
        if unit == "rad/s" or (scale * fastest < FASTEST_TURN and not (small and unit.startswith("m")))
    }
    # The rates as none, in each unit, and in rad/s the other way round.
    scales = np.array([0.0, *units.values(), -1.0])
    sequences = scales[:, None, None, None] * turns
    hypotheses = [(index, np.eye(3)) for index in range(len(units) + 1)]
    hypotheses += rearranged(axes, 1 + [*units].index("rad/s"), len(units) + 1)
    left, lengths = residuals(sequences, vectors, constant, hypotheses)
    at_rest, *rest = left.tolist()
    by_unit, by_axes = dict(zip(units, rest, strict=False)), rest[len(units) :]
    given, length = by_unit["rad/s"], size * float(lengths[len(units) + 1])
    longest = size * float(lengths.max())
    # Too small a unit is as good as none: the largest that fits is meant.
    unit = next(name for name in units if by_unit[name] <= 1.15 * min(by_unit.values()))
    if by_unit[unit] > CLEARLY * given or by_unit[unit] > min(by_axes):
        unit = "rad/s"
    elif by_unit[unit] > 0.5 * at_rest:
        both = SCALES[unit] * np.stack([turns, -turns])
        by_axes = residuals(both, vectors, constant, rearranged(axes, 0, 1))[0].tolist()
    else:
        return RateConsistency(given, at_rest, unit, by_unit[unit], axes[0], by_unit[unit], length, longest, len(turns))
    best = int(np.argmin(by_axes))
    return RateConsistency(given, at_rest, unit, by_unit[unit], axes[best], by_axes[best], length, longest, len(turns))


def rearranged(axes: Sequence[np.ndarray], forward: int, backward: int) -> list[tuple[int, np.ndarray]]:
    """The hypotheses of :func:`residuals` of arrangements of the axes: the rates of two sequences, turned."""
    proper = [float(np.linalg.det(matrix)) > 0.0 for matrix in axes]
    return [(forward, one.T) if turns else (backward, -one.T) for one, turns in zip(axes, proper, strict=True)]


def cut(time: np.ndarray, rate: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Windows of a recording: rotation vectors as reported, and measured vectors of length about 1.

    Returns:
        Two arrays ``(windows, steps, 3)``, and the usual length of the vectors; None without a complete window.
    """
    present = np.isfinite(rate).all(axis=1) & np.isfinite(vector).all(axis=1) & (vector != 0.0).any(axis=1)
    time, rate, vector = time[present], rate[present], vector[present]
    if len(time) < SEGMENTS * FEWEST_STEPS + 1:
        return None
    step = float(np.median(np.diff(time)))
    # A clock in another unit than seconds still gets windows of a sensible number of samples.
    samples = int(np.clip(round(SEGMENT / step), FEWEST_STEPS, 2000))
    samples = max(FEWEST_STEPS, round(SHORTEST * samples), min(samples, (len(time) - 1) // FEWEST_SEGMENTS))
    together = -(-samples // MOST_STEPS)
    length = samples // together * together
    count = (len(time) - 1) // length
    if count < SEGMENTS:
        return None
    size = float(np.median(np.linalg.norm(vector, axis=1)))
    intervals = np.diff(time)[: count * length]
    # A sample describes the interval that it ends.
    turns = (rate[1 : count * length + 1] * intervals[:, None]).reshape(count, -1, together, 3).sum(axis=2)
    vectors = (vector[1 : count * length + 1] / size).reshape(count, -1, together, 3).mean(axis=2)
    whole = intervals.reshape(count, length).max(axis=1) < LONGEST_STEP * step
    window = np.arange(count - SEGMENTS + 1)[:, None] + np.arange(SEGMENTS)
    window = window[whole[window].all(axis=1)]
    if not len(window):
        return None
    amount = np.linalg.norm(turns, axis=2).sum(axis=1)[window].sum(axis=1)
    moves = np.sqrt(np.var(vectors.mean(axis=1)[window], axis=1).sum(axis=1))
    lively = (amount / max(amount.max(), 1e-12) + 1e-6) * (moves / max(moves.max(), 1e-12) + 1e-6)
    order = np.argsort(-lively, kind="stable")[:MOST_WINDOWS]
    chosen = window[order[lively[order] >= LIVELY * lively.max()]]
    return turns[chosen].reshape(len(chosen), -1, 3), vectors[chosen].reshape(len(chosen), -1, 3), size


def residuals(
    turns: np.ndarray, vectors: np.ndarray, constant: bool, hypotheses: Sequence[tuple[int, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Motion of the mean vectors of the segments, turned back to the start of their window, as a share of their mean.

    A gyroscope whose axes are rearranged by a rotation M turns v by M R Mᵀ, where R is its turn as given; one whose
    axes are rearranged by −M turns it by that of reversed rates. The first M changes no length, so that the means of
    R and the elements of v, taken once, serve all arrangements.

    Args:
        turns: ``(sequences, windows, steps, 3)`` rotation vectors.
        vectors: ``(windows, steps, 3)``.
        constant: count the motion within a segment, too.
        hypotheses: index of a sequence, and the rotation ``(3, 3)`` of the axes, Mᵀ.

    Returns:
        ``(hypotheses,)`` root of the median over windows of the relative variance of the means; and ``(hypotheses,)``
        median length of the mean over a window.
    """
    # A mean over an interval belongs to the attitude in its middle.
    matrices = rotation.to_matrix(attitudes(turns))
    segments = vectors.reshape(len(vectors), SEGMENTS, -1, 3)
    parts = matrices.reshape(len(turns), *segments.shape[:3], 9)
    products = (parts.swapaxes(-1, -2) @ segments / segments.shape[2]).reshape(*parts.shape[:3], 3, 9)
    means = np.stack([products[sequence] @ turn.ravel() for sequence, turn in hypotheses])
    variance, square = np.var(means, axis=2).sum(axis=-1), np.square(means.mean(axis=2)).sum(axis=-1)
    if constant:
        # A vector that is spun around keeps its part along the axis.
        lengths = np.square(segments).sum(axis=-1).mean(axis=-1)
        within = (lengths - np.square(means).sum(axis=-1)).mean(axis=-1)
        variance += np.maximum(within - 2.0 * within.min(axis=0) - SPUN, 0.0)
    return np.sqrt(np.median(variance / (square + variance), axis=1)), np.sqrt(np.median(square, axis=1))
