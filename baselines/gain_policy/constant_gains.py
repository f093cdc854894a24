"""The best constant gains of a filter: reference for an adaptive policy, and starting point of its training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.gain_episode import filter_for
from ...envs.gain_reward import scored_quantities, true_values
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.kalman import KalmanFilter
from ...filters.core.metrics import error, rms
from ...filters.core.model import parameters_of, structure_of
from .adaptive import AdaptiveEstimator
from .policy import GainPolicy


@dataclass(frozen=True, eq=False)
class ConstantGains:
    """Result of a search over constant gains.

    Attributes:
        action: ``(k,)`` in [−1, 1], best for the mean over the trajectories.
        score: its mean error over the trajectories, rad.
        tried: ``(n, k)`` all actions that were tried; the first is neutral.
        scores: ``(n, trajectories)`` their root mean square errors, rad.
    """

    action: np.ndarray
    score: float
    tried: np.ndarray
    scores: np.ndarray

    @property
    def neutral(self) -> np.ndarray:
        """Error of the published tuning on every trajectory ``(trajectories,)``, rad."""
        return self.scores[0]

    @property
    def oracle(self) -> np.ndarray:
        """Least error of any action tried on each trajectory ``(trajectories,)``, rad: a bound that needs the truth."""
        return np.min(self.scores, axis=0)


def best_constant_gains(
    filter: TunedFilter | KalmanFilter,
    trajectories: Sequence[Trajectory],
    *,
    quantity: str | Sequence[str] | None = None,
    guesses: Sequence[Sequence[float]] = (),
    samples: int = 64,
    refinements: int = 60,
    seed: int = 0,
) -> ConstantGains:
    """Search the box of actions: evenly spread (Sobol) points, then Nelder–Mead from the best of them.

    Args:
        filter: the filter, with all its gains or with chosen ones.
        trajectories: with a truth for ``quantity``.
        quantity: output that is scored, or several whose mean is; None for ``up``.
        guesses: further actions to try in the first stage.
        samples: points of the first stage, besides the neutral one; best a power of two.
        refinements: evaluations of the second stage.
        seed: of the points.

    Raises:
        ValueError: there is no trajectory, or none can be scored.
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    tuned = filter if isinstance(filter, TunedFilter) else TunedFilter.of(filter)
    if not trajectories:
        raise ValueError("trajectories must hold at least one, got none")
    tried: list[np.ndarray] = []
    scores: list[np.ndarray] = []

    def evaluate(action: np.ndarray) -> float:
        tried.append(np.clip(action, -1.0, 1.0))
        scores.append(constant_errors(tuned, trajectories, tried[-1], quantity))
        return float(np.mean(scores[-1]))

    neutral = evaluate(np.zeros(tuned.actions))
    if not np.isfinite(neutral):
        raise ValueError("trajectories must have scored samples with a known truth; some trajectory has none")
    points = 2.0 * qmc.Sobol(tuned.actions, rng=np.random.default_rng(seed)).random(samples) - 1.0 if samples else []
    values = [neutral, *(evaluate(point) for point in points), *(evaluate(np.asarray(point)) for point in guesses)]
    if refinements:
        start = tried[int(np.argmin(values))]
        # Steps inwards, so that the first simplex lies in the box.
        simplex = np.stack([start, *(start + np.where(start > 0.0, -0.3, 0.3) * axis for axis in np.eye(len(start)))])
        options = {"maxfev": refinements, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-7}
        minimize(evaluate, start, method="Nelder-Mead", bounds=[(-1.0, 1.0)] * len(start), options=options)
    means = np.mean(scores, axis=1)
    best = int(np.argmin(means))
    return ConstantGains(tried[best], float(means[best]), np.stack(tried), np.stack(scores))


def left_out_errors(tried: np.ndarray) -> np.ndarray:
    """Error ``(E,)`` of each trajectory under the gains that are best on all others, of errors ``(gains, E)``."""
    others = (tried.sum(axis=1, keepdims=True) - tried).argmin(axis=0)
    return np.asarray(tried[others, np.arange(tried.shape[1])])


def constant_errors(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    action: np.ndarray,
    quantity: str | Sequence[str] | None = None,
) -> np.ndarray:
    """Root mean square error of one action on each trajectory ``(trajectories,)``, rad; of several outputs their mean.

    The filter is that of the rider, vehicle or device of each trajectory.
    """
    outputs = scored_quantities(tuned.kalman, quantity)
    errors = []
    for trajectory in trajectories:
        own = replace(tuned, kalman=filter_for(tuned.kalman, trajectory))
        estimate = own.kalman.run(trajectory.measurements, own.gains(action))
        found = [error(q, estimate.pose[q.name], true_values(trajectory, q, own.kalman)) for q in outputs]
        errors.append(float(np.mean([rms(each, trajectory.mask) for each in found])))
    return np.array(errors)


def policy_errors(
    kalman: KalmanFilter,
    policy: GainPolicy,
    trajectories: Sequence[Trajectory],
    quantity: str | Sequence[str] | None = None,
) -> np.ndarray:
    """Root mean square error of a policy on each trajectory ``(trajectories,)``, rad; of several outputs their mean.

    The filter is that of the rider, vehicle or device of each trajectory; those that share it, and a length, run as one
    batch.
    """
    outputs = scored_quantities(kalman, quantity)
    groups: dict[Any, list[int]] = {}
    filters = [filter_for(kalman, trajectory) for trajectory in trajectories]
    for index, (own, trajectory) in enumerate(zip(filters, trajectories, strict=True)):
        key = (structure_of(own.model), tuple(parameters_of(own.model).values()), len(trajectory))
        groups.setdefault(key, []).append(index)
    errors = np.empty(len(trajectories))
    for members in groups.values():
        estimator = AdaptiveEstimator(filters[members[0]], policy)
        names = [channel.name for channel in estimator.channels]
        batch = {name: np.stack([trajectories[i].measurements[name] for i in members], axis=1) for name in names}
        pose = estimator.run(batch).pose
        for column, index in enumerate(members):
            trajectory, own = trajectories[index], filters[index]
            found = [error(q, pose[q.name][:, column], true_values(trajectory, q, own)) for q in outputs]
            errors[index] = float(np.mean([rms(each, trajectory.mask) for each in found]))
    return errors
