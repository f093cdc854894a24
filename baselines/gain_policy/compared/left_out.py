"""Policies of recordings that they were not trained on: trials are left out in turn, a policy is trained on the others.

A recording is cut into parts, each an episode with a start of its own. Training begins with the constant gains that are
best on the other recordings, and follows the exact gradient for a number of passes that is given: nothing of the
recordings that are left out decides anything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.adaptation.tuned import TunedFilter
from ..analytic import train_analytically
from ..constant_gains import constant_errors, policy_errors

PART = 30.0
"""s: length of the parts; what is left at the end of a recording belongs to the last one."""
PASSES = 8
"""Passes over the parts, as many as suit simulated motions."""


def parts_of(trajectory: Trajectory, seconds: float = PART) -> list[Trajectory]:
    """A recording in parts; those without a scored sample are dropped."""
    size = max(1, round(seconds / trajectory.dt))
    edges = [*range(0, max(1, len(trajectory) // size) * size, size), len(trajectory)]
    parts = [trajectory[a:b] for a, b in pairwise(edges)]
    return [part for part in parts if part.mask.any()]


def left_out_policy_errors(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    actions: np.ndarray,
    folds: int,
    *,
    quantity: str | None = None,
    passes: int = PASSES,
    seed: int = 0,
    report: Callable[[int], None] | None = None,
) -> np.ndarray:
    """Root mean square error ``(E,)``, rad, of each trajectory under a policy trained on those of all other folds.

    Args:
        tuned: the filter with its actions.
        trajectories: with their truth.
        actions: constant gains ``(n, k)``; training begins with the best of them on the other folds.
        folds: number of parts into which the trajectories are divided, in turn.
        quantity: output that is scored; None for ``up``, or the first.
        passes: over the parts of the recordings.
        seed: of weights and order.
        report: called before every fold with its number.

    Raises:
        ValueError: fewer than two folds, or more than trajectories.
    """
    if not 2 <= folds <= len(trajectories):
        raise ValueError(f"folds must be between 2 and the number of trajectories ({len(trajectories)}), got {folds}")
    tried = np.stack([constant_errors(tuned, trajectories, action, quantity) for action in actions])
    fold, errors = np.arange(len(trajectories)) % folds, np.empty(len(trajectories))
    for number in range(folds):
        if report is not None:
            report(number)
        others = np.flatnonzero(fold != number)
        start = actions[int(tried[:, others].mean(axis=1).argmin())]
        parts = [part for index in others.tolist() for part in parts_of(trajectories[index])]
        policy = train_analytically(tuned, parts, start, epochs=passes, net_arch=(32, 32), seed=seed, quantity=quantity)
        mine = np.flatnonzero(fold == number)
        errors[mine] = policy_errors(tuned.kalman, policy, [trajectories[index] for index in mine.tolist()], quantity)
    return errors
