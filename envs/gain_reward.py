"""What an agent that tunes a filter earns: one definition for one episode and for many at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np

from ..filters.core.kalman import KalmanFilter
from ..filters.core.metrics import error
from ..filters.core.quantity import Quantity
from .data.trajectory import Trajectory

RewardKind = Literal["error", "improvement", "relative"]
NIS_FLOOR = 1e-6
"""Smallest mean NIS of the consistency term."""
SMALL_ERROR = math.radians(0.2)
"""rad, added to the mean error that relative rewards are divided by"""


class Scored(NamedTuple):
    """Scores of one interval of B episodes: rewards ``(B,)``, and mean errors ``(B,)``, NaN where none is known."""

    reward: np.ndarray
    mean_error: np.ndarray


@dataclass(frozen=True)
class GainReward:
    """How errors become rewards.

    Raises:
        ValueError: an unknown kind, or a number out of its range.
    """

    kind: RewardKind = "error"
    """``error``: minus the mean error over the interval, rad; ``improvement``: that of the reference gains minus the
    agent's; ``relative``: likewise, of the errors' logarithm, and divided by the mean of the reference"""
    consistency: float = 0.0
    """weight of ``|ln(mean NIS / m)|`` of the m innovations of the interval, in the unit of the reward"""
    error_scale: float = math.radians(5.0)
    """rad: in relative rewards errors e count as s ln(1 + e / s), so that a few seconds do not dominate"""

    def __post_init__(self) -> None:
        if self.kind not in get_args(RewardKind):
            raise ValueError(f"reward must be one of {list(get_args(RewardKind))}, got {self.kind!r}")
        if not 0.0 <= self.consistency < math.inf:
            raise ValueError(f"consistency must be a weight of 0 or more, got {self.consistency}")
        if not 0.0 < self.error_scale < math.inf:
            raise ValueError(f"error_scale must be positive, got {math.degrees(self.error_scale)} deg")

    @property
    def needs_reference(self) -> bool:
        """Whether the reference gains run beside the agent."""
        return self.kind != "error"

    def cost(self, errors: np.ndarray) -> np.ndarray:
        """Errors as they count."""
        return self.error_scale * np.log1p(errors / self.error_scale) if self.kind == "relative" else errors

    def weight(self, reference: np.ndarray, scored: np.ndarray) -> float:
        """Factor on the rewards of an episode whose reference has the costs ``(T,)``."""
        if self.kind != "relative":
            return 1.0
        counted = reference[scored & np.isfinite(reference)]
        return 1.0 / (float(counted.mean()) + SMALL_ERROR) if counted.size else 0.0

    def scored(
        self,
        errors: np.ndarray,
        mask: np.ndarray,
        reference: np.ndarray,
        weight: np.ndarray,
        nis: np.ndarray,
        innovations: int,
    ) -> Scored:
        """Scores of one interval; samples without a known error or outside the evaluation mask do not count.

        Args:
            errors: ``(T, B)``.
            mask: ``(T, B)`` bool.
            reference: costs ``(T, B)`` of the reference gains; of no effect with ``error``.
            weight: ``(B,)`` of the episodes.
            nis: ``(T, B)``, zero where there was no innovation.
            innovations: degrees of freedom m of the NIS.
        """
        gained = reference - self.cost(errors) if self.needs_reference else -errors
        known = mask & np.isfinite(errors)
        reward = mean_over_time(gained, known & np.isfinite(gained))
        reward = np.where(np.isfinite(reward), reward, 0.0) * weight
        if self.consistency:
            ratio = mean_over_time(nis, nis > 0.0) / innovations
            reward = reward - self.consistency * np.abs(np.log(np.where(ratio > 0.0, np.fmax(ratio, NIS_FLOOR), 1.0)))
        return Scored(reward, mean_over_time(errors, known))


def mean_over_time(values: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Means ``(B,)`` of the counted values among ``(T, B)``; NaN without any.

    Values are added one after the other, so that one episode and many give the same sums bit by bit.
    """
    total = np.add.accumulate(np.where(counted, values, 0.0), axis=0)[-1]
    number = counted.sum(axis=0)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def errors_of(quantities: Sequence[Quantity], pose: Mapping[str, np.ndarray], truth: np.ndarray) -> np.ndarray:
    """Errors ``(...)``: of one quantity, or the root mean square over several.

    ``pose`` has estimates ``(..., size)`` by name, ``truth`` ``(..., sizes)`` the quantities one after the other.
    """
    squares, start = [], 0
    for quantity in quantities:
        one = error(quantity, pose[quantity.name], truth[..., start : start + quantity.size])
        if len(quantities) == 1:
            return one
        squares.append(one * one)
        start += quantity.size
    total = squares[0]
    for square in squares[1:]:
        total = total + square
    return np.sqrt(total / len(squares))


def scored_quantity(kalman: KalmanFilter, name: str | None) -> Quantity:
    """The output of a filter whose error counts; None for ``up``, or its first output.

    Raises:
        ValueError: the filter has no such output.
    """
    outputs = {output.name: output for output in kalman.outputs}
    if name is None:
        return outputs.get("up", kalman.outputs[0])
    if name not in outputs:
        raise ValueError(f"quantity must be one of {sorted(outputs)}, got {name!r}")
    return outputs[name]


def scored_quantities(kalman: KalmanFilter, names: str | Sequence[str] | None) -> tuple[Quantity, ...]:
    """The outputs of a filter whose errors count together.

    Raises:
        ValueError: the filter lacks one, or one is named twice, or none is.
    """
    if names is None or isinstance(names, str):
        return (scored_quantity(kalman, names),)
    found = tuple(scored_quantity(kalman, name) for name in names)
    if not found or len(set(names)) < len(found):
        raise ValueError(f"quantity must name at least one output, each once, got {list(names)}")
    return found


def true_values(trajectory: Trajectory, quantity: Quantity, kalman: KalmanFilter) -> np.ndarray:
    """The truth ``(T, size)`` of an output: as recorded, or of a paper's own quantity derived from it.

    Raises:
        ValueError: the trajectory does not know it.
    """
    if quantity.name not in trajectory.truth:
        derived = kalman.model.truth(trajectory.truth)
        if quantity.name in derived:
            return derived[quantity.name]
    return trajectory.truth_of(quantity.name)
