"""The best constant gains by Optuna: the same search as any user would set up, beside that of ``constant_gains``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.adaptation.tuned import TunedFilter
from ....filters.support.optional import extra
from ..constant_gains import ConstantGains, constant_errors


def optuna_constant_gains(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    *,
    trials: int = 100,
    quantity: str | None = None,
    seed: int = 0,
    report: Callable[[int, float], None] | None = None,
) -> ConstantGains:
    """Search the box of actions with Optuna's tree-structured Parzen estimator, from the published gains on.

    Args:
        tuned: the filter with its actions.
        trajectories: training data, with a truth for ``quantity``.
        trials: how many gains are tried.
        quantity: output that is scored; None for ``up``, or the filter's first.
        seed: of the sampler.
        report: called after every trial with its number and the best error so far, rad.

    Raises:
        ValueError: there are no trajectories or trials, or the trajectories cannot be scored.
    """
    if not trajectories or trials < 1:
        raise ValueError(f"there must be trajectories and trials, got {len(trajectories)} and {trials}")
    with extra("rl"):
        import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    tried: list[np.ndarray] = []
    scores: list[np.ndarray] = []

    def evaluate(trial: Any) -> float:
        action = np.array([trial.suggest_float(part.gain, -1.0, 1.0) for part in tuned.ranges])
        tried.append(action)
        scores.append(constant_errors(tuned, trajectories, action, quantity))
        mean = float(np.mean(scores[-1]))
        if not np.isfinite(mean):
            raise ValueError("trajectories must have scored samples with a known truth; some trajectory has none")
        if report is not None:
            report(len(tried), float(np.min(np.mean(scores, axis=1))))
        return mean

    sampler = optuna.samplers.TPESampler(seed=seed, multivariate=len(tuned.ranges) > 1)
    study = optuna.create_study(sampler=sampler)
    study.enqueue_trial({part.gain: 0.0 for part in tuned.ranges})
    study.optimize(evaluate, n_trials=trials)
    best = int(np.argmin(np.mean(scores, axis=1)))
    return ConstantGains(tried[best], float(np.mean(scores[best])), np.stack(tried), np.stack(scores))
