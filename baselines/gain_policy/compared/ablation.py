"""What a policy needs: its error without a group of its observations, and with a gain that it leaves alone.

Nothing is trained anew. An observation that is taken away stays at its mean over the trajectories, and a gain that is
held stays at the constant that the training started from, so a row tells what this policy uses, not how well another
one could do without.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....filters.core.kalman import KalmanFilter
from ..adaptive import AdaptiveEstimator
from ..constant_gains import policy_errors
from ..policy import GainPolicy
from .contenders import improvement, percent


@dataclass(frozen=True)
class Watched(GainPolicy):
    """A policy that notes what it sees.

    Attributes:
        seen: observations ``(n,)``, one a decision.
    """

    seen: list[np.ndarray] = field(default_factory=list)

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """The action of an observation."""
        self.seen.append(np.asarray(observation, dtype=float))
        return super().__call__(observation)


def observation_groups(policy: GainPolicy) -> dict[str, np.ndarray]:
    """Group → indices of observations: all of a stream or channel, all of a time scale, the actions before."""
    names = policy.features.names
    groups: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        word = name.split()[0].split("[")[0]
        groups.setdefault({"norm": "norm excess", "time": "time since start"}.get(word, word), []).append(index)
    for scale in policy.features.scales:
        ends = f" {scale:g} s"
        groups[f"time scale{ends}"] = [index for index, name in enumerate(names) if name.endswith(ends)]
    groups["actions before"] = [len(names) + index for index in range(len(policy.ranges))]
    return {name: np.array(members) for name, members in groups.items()}


def mean_observation(kalman: KalmanFilter, policy: GainPolicy, trajectories: Sequence[Trajectory]) -> np.ndarray:
    """Mean ``(n,)`` over all decisions of a policy on trajectories."""
    watched = Watched(**{part.name: getattr(policy, part.name) for part in fields(policy)})
    for trajectory in trajectories:
        AdaptiveEstimator(filter_for(kalman, trajectory), watched).run(trajectory.measurements)
    return np.mean(watched.seen, axis=0)


def blinded(policy: GainPolicy, places: np.ndarray, values: np.ndarray) -> GainPolicy:
    """The policy for which the observations at ``places`` are always those of ``values`` ``(n,)``."""
    (weight, bias), *rest = policy.layers
    kept = weight.copy()
    kept[..., places] = 0.0
    layers, skip = [(kept, bias + weight[..., places] @ values[places]), *rest], policy.skip
    if skip is not None:
        (last, least), skip = layers[-1], skip.copy()
        layers[-1] = (last, least + skip[:, places] @ values[places])
        skip[:, places] = 0.0
    return replace(policy, layers=tuple(layers), skip=skip)


def holding(policy: GainPolicy, gain: int, action: float) -> GainPolicy:
    """The policy with one of its gains held at an action."""
    *rest, (weight, bias) = policy.layers
    weight, bias = weight.copy(), bias.copy()
    weight[..., gain, :], bias[..., gain] = 0.0, action
    skip = None if policy.skip is None else policy.skip * (np.arange(len(bias.T)) != gain)[:, None]
    return replace(policy, layers=(*rest, (weight, bias)), skip=skip)


def ablation(
    kalman: KalmanFilter, policy: GainPolicy, trajectories: Sequence[Trajectory], constant: np.ndarray
) -> list[dict[str, Any]]:
    """Rows: what is taken away, mean error, deg, and how much smaller that is than the policy's, with its interval.

    Args:
        kalman: the filter.
        policy: sets its gains.
        trajectories: to measure on.
        constant: action ``(k,)`` of gains that are held.
    """
    mean = mean_observation(kalman, policy, trajectories)
    changed = {"nothing": policy}
    for name, places in observation_groups(policy).items():
        changed[f"observation: {name}"] = blinded(policy, places, mean)
    for index, part in enumerate(policy.ranges):
        changed[f"gain: {part.gain}"] = holding(policy, index, float(constant[index]))
    whole, rows = policy_errors(kalman, policy, trajectories), []
    for name, other in changed.items():
        errors = whole if other is policy else policy_errors(kalman, other, trajectories)
        rows.append(
            {"without": name, "mean": float(np.degrees(errors.mean())), "saved": percent(improvement(errors, whole))}
        )
    return rows
