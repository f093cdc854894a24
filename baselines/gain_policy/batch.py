"""Many gain-tuning episodes in one process: the environments of :mod:`poise.envs.gain_tuning`, batched for training.

One call of the filter serves all episodes of a sampling rate, which is an order of magnitude faster than one
environment after the other. Observations, actions and rewards are the same numbers (up to rounding).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from ...envs.data.trajectory import Trajectory
from ...filters.adaptation.tuned import TunedFilter, TunedState
from ...filters.core.metrics import error
from ...filters.support.optional import extra
from .stack import TrajectoryStack

with extra("rl"):
    from stable_baselines3.common.vec_env import VecEnv

AHEAD = (1, 10, 40)
"""Decisions over which the critic looks ahead."""
PRIVILEGED = 2 + 2 * len(AHEAD)
"""Number of privileged inputs at the end of an observation, for the critic only."""
SMALL_ERROR = math.radians(0.2)
"""Added to the error that relative rewards are divided by."""


class RateGroup:
    """Episodes that advance together: same rate, one row each.

    Args:
        stack: the trajectories that episodes are drawn from.
        rows: number of episodes.
        generator: of the choice of trajectories.
        reference: constant action whose error the reward is relative to.
        error_scale: see :class:`TuningBatch`, rad.
        relative: likewise.
    """

    def __init__(
        self,
        stack: TrajectoryStack,
        rows: int,
        generator: np.random.Generator,
        reference: np.ndarray,
        error_scale: float,
        relative: bool,
    ) -> None:
        self.stack, self.tuned, self.error_scale = stack, stack.tuned, error_scale
        self.rows, self.generator = rows, generator
        self.reference = self._cost(stack.errors(reference))
        # Contiguous rows, so that the sums below have one order whatever the layout of the stack.
        by_trajectory = np.ascontiguousarray(np.where(stack.mask, self.reference, np.nan).T)
        mean = np.nanmean(by_trajectory, axis=1)
        self.weight = 1.0 / (mean + SMALL_ERROR) if relative else np.full(len(mean), np.degrees(1.0))
        self.foresight = self._foresight()
        self.start()

    def _foresight(self) -> np.ndarray:
        """Privileged information for every decision ``(N, decisions + 1, PRIVILEGED - 1)``.

        The gyroscope's bias, and over each of :data:`AHEAD` the mean cost of the reference and the mean acceleration.
        """
        samples, length = self.tuned.interval_samples, len(self.reference)
        absent = np.zeros((length, 3))
        bias, force = (
            np.stack([np.linalg.norm(t.truth.get(name, absent)[:length], axis=-1) for t in self.stack.trajectories])
            for name in ("gyroscope_bias", "external_acceleration")
        )
        columns = [np.log1p(np.degrees(bias[:, ::samples]))]
        for values in (np.degrees(np.ascontiguousarray(self.reference.T)), force):
            means = np.nan_to_num(values).reshape(len(values), self.stack.decisions, samples).mean(axis=-1)
            columns += [np.log1p(mean_ahead(means, ahead)) for ahead in AHEAD]
        table = np.stack(columns, axis=-1)
        return np.concatenate([table, table[:, -1:]], axis=1)

    def _cost(self, errors: np.ndarray) -> np.ndarray:
        """Errors as they count in the reward."""
        if np.isinf(self.error_scale):
            return errors
        return self.error_scale * np.log1p(errors / self.error_scale)

    def start(self) -> None:
        """Begin all episodes; the first ones end at random times, so that later ones do not end together."""
        self.trajectory = self.generator.integers(len(self.weight), size=self.rows)
        self.decision = np.zeros(self.rows, int)
        self.end = self.generator.integers(1, self.stack.decisions + 1, size=self.rows)
        self.initial = self.tuned.init(
            {name: values[0, self.trajectory] for name, values in self.stack.channels.items()}
        )
        self.state, self.error = self.initial, np.zeros(self.rows)

    def observe(self) -> np.ndarray:
        """Observations with the privileged inputs of the critic ``(rows, n + PRIVILEGED)``."""
        own = np.log1p(np.degrees(self.error))[:, None]
        parts = [self.tuned.observe(self.state), self.foresight[self.trajectory, self.decision], own]
        return np.concatenate(parts, axis=-1).astype(np.float32)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Advance by one interval.

        Returns:
            Observations at the end of the interval, see :meth:`observe`, rewards ``(rows,)``, and which
            episodes are over ``(rows,)``; :meth:`restart` begins these anew.
        """
        stack, quantity = self.stack, self.stack.quantity
        length = self.tuned.interval_samples
        now = self.decision * length + np.arange(length)[:, None], self.trajectory
        chunk = {name: values[now] for name, values in stack.channels.items()}
        estimate, self.state = self.tuned.advance(self.tuned.decide(self.state, actions), chunk)
        errors = error(quantity, estimate.pose[quantity.name], stack.truth[now])
        gained = self.reference[now] - self._cost(errors)
        counted = stack.mask[now] & np.isfinite(gained)
        gains = np.where(counted, gained, 0.0).sum(axis=0) / np.maximum(counted.sum(axis=0), 1)
        rewards = gains * self.weight[self.trajectory]
        self.decision, self.error = self.decision + 1, np.nan_to_num(errors[-1])
        return self.observe(), rewards, self.decision >= self.end

    def restart(self, over: np.ndarray) -> None:
        """Begin new episodes in the rows ``over`` ``(rows,)`` bool."""
        count = int(over.sum())
        self.trajectory = self.trajectory.copy()
        self.trajectory[over] = self.generator.integers(len(self.weight), size=count)
        self.decision[over], self.end[over], self.error[over] = 0, self.stack.decisions, 0.0

        def mixed(new: np.ndarray, old: np.ndarray) -> np.ndarray:
            if new.ndim == 0:
                return old
            return np.where(over.reshape(-1, *(1,) * (new.ndim - 1)), new, old)

        self.state = TunedState(
            type(self.initial.filter)(*map(mixed, self.initial.filter, self.state.filter)),
            type(self.initial.memory)(*map(mixed, self.initial.memory, self.state.memory)),
            mixed(self.initial.action, self.state.action),
        )

    def snapshot(self) -> dict[str, Any]:
        """All that changes while episodes run: arrays, and the generator as JSON."""
        return {
            "generator": json.dumps(self.generator.bit_generator.state),
            "rows": [np.array(array) for array in (self.trajectory, self.decision, self.end, self.error)],
            "state": [np.array(array) for array in (*self.state.filter, *self.state.memory, self.state.action)],
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue exactly from a :meth:`snapshot`."""
        self.generator.bit_generator.state = json.loads(snapshot["generator"])
        self.trajectory, self.decision, self.end, self.error = (np.array(array) for array in snapshot["rows"])
        arrays = [np.array(array) for array in snapshot["state"]]
        split = len(self.initial.filter)
        filter, memory = type(self.initial.filter)(*arrays[:split]), type(self.initial.memory)(*arrays[split:-1])
        self.state = TunedState(filter, memory, arrays[-1])


def mean_ahead(values: np.ndarray, ahead: int) -> np.ndarray:
    """Mean of each entry of ``(n, decisions)`` and those after it, ``ahead`` in all or as many as there are."""
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    first = np.arange(values.shape[1])
    last = np.minimum(first + ahead, values.shape[1])
    return (total[:, last] - total[:, first]) / (last - first)


class TuningBatch(VecEnv):
    """A Stable-Baselines3 vector environment over a fixed set of trajectories.

    An observation is that of the registered environment, followed by :data:`PRIVILEGED` numbers that take the truth
    or the future to know: for the critic (:mod:`.actor_critic`), whose value is a baseline and reaches no policy.

    The reward is the mean error of a constant ``reference`` action over the interval minus that of the agent, in
    degrees.

    Args:
        tuned: the filter with its actions and features.
        trajectories: drawn from with replacement; every rate among them gets its share of the episodes.
        n_envs: episodes that run at a time, at least one for each rate.
        seed: of the choice of trajectories.
        quantity: output that is scored; None for ``up``.
        reference: action ``(k,)``; None for the published tuning.
        error_scale: errors far above this count by their logarithm, s ln(1 + e / s), so that a few seconds do not
            dominate the reward; deg; infinite for unscaled errors.
        relative: whether rewards are divided by the mean error of the reference on the trajectory, so that easy and
            hard trajectories count the same.

    Raises:
        ValueError: fewer ``n_envs`` than rates.
    """

    def __init__(
        self,
        tuned: TunedFilter,
        trajectories: Sequence[Trajectory],
        n_envs: int,
        *,
        seed: int = 0,
        quantity: str | None = None,
        reference: np.ndarray | None = None,
        error_scale: float = math.inf,
        relative: bool = False,
    ) -> None:
        stacks = TrajectoryStack.by_rate(tuned, trajectories, quantity)
        if not stacks or n_envs < len(stacks):
            raise ValueError(f"n_envs must be at least the number of rates ({len(stacks)}, not 0), got {n_envs}")
        rows = [len(part) for part in np.array_split(np.arange(n_envs), len(stacks))]
        generators = np.random.default_rng(seed).spawn(len(stacks))
        action = np.zeros(tuned.actions) if reference is None else np.asarray(reference, float)
        self.groups = [
            RateGroup(stack, count, generator, action, math.radians(error_scale), relative)
            for stack, count, generator in zip(stacks, rows, generators, strict=True)
        ]
        self.bounds = np.cumsum([0, *rows])
        self.tuned, self.actions = tuned, np.zeros((n_envs, tuned.actions))
        self.returns = np.zeros(n_envs)
        super().__init__(
            n_envs,
            spaces.Box(-np.inf, np.inf, (tuned.observation_size + PRIVILEGED,), np.float32),
            spaces.Box(-1.0, 1.0, (tuned.actions,), np.float32),
        )

    def privileged_statistics(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the privileged inputs, each ``(PRIVILEGED,)``."""
        known = np.concatenate([group.foresight.reshape(-1, PRIVILEGED - 1) for group in self.groups])
        # The agent's own error is not known beforehand; it is about that of the reference.
        table = np.concatenate([known, known[:, 1:2]], axis=1)
        return table.mean(axis=0), table.std(axis=0) + 1e-3

    def snapshot(self) -> dict[str, Any]:
        """All that changes while episodes run, for :meth:`restore`."""
        return {"returns": self.returns.copy(), "groups": [group.snapshot() for group in self.groups]}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from a :meth:`snapshot` of a batch with the same arguments."""
        self.returns = np.array(snapshot["returns"])
        for group, kept in zip(self.groups, snapshot["groups"], strict=True):
            group.restore(kept)

    def reset(self) -> np.ndarray:
        """Begin all episodes."""
        for group in self.groups:
            group.start()
        self.returns[:] = 0.0
        return np.concatenate([group.observe() for group in self.groups])

    def step_async(self, actions: np.ndarray) -> None:
        """Remember the actions ``(envs, k)``."""
        self.actions = np.asarray(actions, float)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Advance all episodes by one interval; finished ones restart."""
        observations, rewards, overs = [], [], []
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for group, first, last in zip(self.groups, self.bounds[:-1], self.bounds[1:], strict=True):
            observation, reward, over = group.step(self.actions[first:last])
            lengths = group.decision.copy()
            self.returns[first:last] += reward
            if over.any():
                terminal = observation
                group.restart(over)
                observation = np.where(over[:, None], group.observe(), observation)
                for row in np.flatnonzero(over):
                    index = first + row
                    mean = float(self.returns[index] / lengths[row])
                    infos[index] = {
                        "TimeLimit.truncated": True,
                        "terminal_observation": terminal[row],
                        "episode": {"r": mean, "l": int(lengths[row]), "t": 0.0},
                    }
                    self.returns[index] = 0.0
            observations.append(observation)
            rewards.append(reward)
            overs.append(over)
        return (
            np.concatenate(observations),
            np.concatenate(rewards).astype(np.float32),
            np.concatenate(overs),
            infos,
        )

    def close(self) -> None:
        """Nothing to free."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, once for each episode."""
        return [getattr(self, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: episodes have no attributes of their own."""
        raise NotImplementedError("the episodes of a batch have no attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused: episodes have no methods of their own."""
        raise NotImplementedError("the episodes of a batch have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Never wrapped."""
        return [False for _ in self._get_indices(indices)]
