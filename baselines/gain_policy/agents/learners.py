"""The agents by name: a new model of each, and the policy that comes out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.adaptation.tuned import TunedFilter
from ....filters.core.kalman import KalmanFilter
from ..config import AgentName, TrainingConfig
from ..constant_gains import policy_errors
from ..policy import GainPolicy
from .recurrent import RecurrentGainPolicy, recurrent_errors

Trained = GainPolicy | RecurrentGainPolicy
"""What comes out of a training."""


def make_learner(config: TrainingConfig, env: Any, start: np.ndarray, logs: Path | None) -> Any:
    """A new model of the agent that the configuration names, which acts about ``start`` ``(k,)``."""
    if config.agent == "ppo":
        from ..actor_critic import make_model

        return make_model(config, env, start, logs)
    if config.agent == "recurrent-ppo":
        from .recurrent import make_recurrent

        return make_recurrent(config, env, start, logs)
    from .off_policy import make_off_policy

    return make_off_policy(config, env, start, logs)


def exported_policy(model: Any, env: Any, tuned: TunedFilter, agent: AgentName) -> Trained:
    """The deterministic policy of a model as plain arrays, with the normalisation of ``env`` in its first layer.

    Args:
        model: from :func:`make_learner`.
        env: its ``VecNormalize``.
        tuned: the filter that it sets.
        agent: its name.
    """
    seen, statistics = tuned.observation_size, env.obs_rms
    mean, std = statistics.mean[:seen], np.sqrt(statistics.var[:seen] + env.epsilon)
    if agent == "ppo":
        from ..actor_critic import actor_layers

        return GainPolicy.of_network(tuned, actor_layers(model), mean, std)
    if agent == "recurrent-ppo":
        from .recurrent import export_recurrent

        return export_recurrent(model, tuned, mean, std)
    from .off_policy import export_squashed

    return export_squashed(model, tuned, mean, std)


def policy_errors_of(
    kalman: KalmanFilter,
    policy: Trained,
    trajectories: Sequence[Trajectory],
    quantity: str | Sequence[str] | None = None,
) -> np.ndarray:
    """Root mean square error of any policy on each trajectory ``(trajectories,)``, rad.

    Raises:
        ValueError: several quantities of a recurrent policy.
    """
    if isinstance(policy, GainPolicy):
        return policy_errors(kalman, policy, trajectories, quantity)
    own = replace(policy, tuned=replace(policy.tuned, kalman=kalman))
    if not (quantity is None or isinstance(quantity, str)):
        raise ValueError(f"a recurrent policy is scored by one quantity, got {list(quantity)}")
    return recurrent_errors(own, trajectories, quantity)


def arrays_of_policy(policy: Trained) -> list[np.ndarray]:
    """The weights of a policy, in order."""
    if isinstance(policy, GainPolicy):
        return [array for layer in policy.layers for array in layer]
    return [*policy.cell, *policy.output]


def policy_of_arrays(arrays: list[np.ndarray], like: Trained) -> Trained:
    """Inverse of :func:`arrays_of_policy`, for a policy that otherwise resembles ``like``."""
    if isinstance(like, GainPolicy):
        return replace(like, layers=tuple(zip(arrays[::2], arrays[1::2], strict=True)))
    return replace(like, cell=(arrays[0], arrays[1], arrays[2]), output=(arrays[3], arrays[4]))
