"""Train a gain policy by the exact gradient of its reward: it passes through the filter, which is differentiable.

A policy gradient estimates from noisy rollouts how an action changes the errors that follow. In simulation all of that
is known: the derivative of every estimate with respect to every gain, computed backwards in time by the compiled
filter (:mod:`poise.filters.compile.differentiable`). What is minimised is what PPO is rewarded for, the logarithmic
error of an episode relative to that of the published gains (:class:`poise.envs.gain_reward.GainReward`): where those
are good, a policy must not be worse. The way of an action through the next observations is neglected; observations are
recorded anew after every pass.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.gain_episode import GainEpisode
from ...envs.gain_reward import GainReward, scored_quantities
from ...filters.adaptation.rows import TunedRows
from ...filters.adaptation.tuned import TunedFilter
from ...filters.compile.differentiable import DifferentiableEquations
from ...filters.core.metrics import error
from ...filters.core.model import structure_of
from ...filters.support.optional import extra
from .policy import GainPolicy, rule_skip

with extra("rl"):
    import torch

ROWS = 5
"""Episodes of one update."""
NO_ERROR = 1e-6
"""rad, added to the square of the errors of several quantities, whose root has no derivative at zero."""
BEYOND = 1.0
"""Weight of the squared distance of an action from its range, where it has no effect on the filter."""


@dataclass(eq=False)
class Episodes:
    """Episodes of one rate and one structure of the equations, side by side; short ones end with unknown samples.

    Attributes:
        tuned: the filter at that rate.
        episodes: the N episodes.
        samples: ``(T, N, d)``, T a multiple of the interval.
        truth: ``(T, N, size)``.
        counted: ``(T, N)`` whether the error of a sample counts.
        weight: ``(N,)`` factors on the costs.
    """

    tuned: TunedFilter
    episodes: list[GainEpisode]
    samples: np.ndarray
    truth: np.ndarray
    counted: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, tuned: TunedFilter, episodes: list[GainEpisode]) -> Episodes:
        """Episodes side by side."""
        interval = episodes[0].interval_samples
        length = interval * max(one.decisions for one in episodes)
        samples, truth, counted = [], [], []
        for one in episodes:
            stop = one.decisions * interval
            fill = [(0, length - stop), (0, 0)]
            samples.append(np.pad(np.concatenate([*one.samples.values()], -1)[:stop], fill, constant_values=np.nan))
            truth.append(np.pad(one.truth[:stop], fill))
            known = one.trajectory.mask[:stop] & np.isfinite(one.truth[:stop]).all(axis=-1)
            counted.append(np.pad(known, (0, length - stop)))
        weight = np.array([one.weight for one in episodes])
        stacked = [np.stack(part, axis=1) for part in (samples, truth, counted)]
        return cls(tuned, episodes, stacked[0], np.nan_to_num(stacked[1]), stacked[2], weight)

    def part(self, rows: np.ndarray) -> Episodes:
        """Some of the episodes."""
        chosen = [self.episodes[row] for row in rows]
        arrays = (self.samples[:, rows], self.truth[:, rows], self.counted[:, rows])
        return Episodes(self.tuned, chosen, *arrays, self.weight[rows])

    @property
    def interval(self) -> int:
        """Samples between decisions."""
        return self.episodes[0].interval_samples

    def measurements(self) -> dict[str, np.ndarray]:
        """Channel → ``(T, N, size)``."""
        found, start = {}, 0
        for channel in self.tuned.kalman.channels:
            found[channel.name] = np.ascontiguousarray(self.samples[..., start : start + channel.size])
            start += channel.size
        return found

    def observations(self, policy: GainPolicy) -> np.ndarray:
        """What a policy sees at each of its decisions ``(decisions, N, n)``."""
        rows = TunedRows(self.tuned, len(self.episodes))
        for row, one in enumerate(self.episodes):
            rows.begin(row, one.kalman)
        every, seen = np.arange(len(self.episodes)), []
        for start in range(0, len(self.samples), self.interval):
            seen.append(rows.observe())
            actions, chunk = policy(seen[-1]), self.samples[start : start + self.interval]
            for group, members in rows.groups(every):
                rows.advance(group, members, actions[members], np.ascontiguousarray(chunk[:, members]))
        return np.stack(seen)


class Actor(torch.nn.Module):
    """Normalisation and layers with tanh between them, as of :class:`.GainPolicy`.

    Args:
        mean: ``(n,)`` of the observations.
        std: their standard deviations ``(n,)``.
        start: action ``(k,)`` at the beginning.
        net_arch: units of the hidden layers.
        small: factor on the weights of the last layer at the beginning.
    """

    def __init__(
        self, mean: np.ndarray, std: np.ndarray, start: np.ndarray, net_arch: Sequence[int], small: float = 0.01
    ) -> None:
        super().__init__()
        self.mean, self.std = mean, std
        self.linear = torch.nn.ModuleList(
            torch.nn.Linear(a, b) for a, b in pairwise([len(mean), *net_arch, len(start)])
        )
        with torch.no_grad():
            last: Any = self.linear[-1]
            last.weight.mul_(small)
            last.bias.copy_(torch.as_tensor(0.95 * start))

    def forward(self, observations: np.ndarray) -> torch.Tensor:
        """Actions before the clip."""
        x = torch.as_tensor((observations - self.mean) / self.std, dtype=torch.float32)
        for layer in self.linear[:-1]:
            x = torch.tanh(layer(x))
        return self.linear[-1](x)

    def policy(self, tuned: TunedFilter) -> GainPolicy:
        """The same on plain arrays."""
        return GainPolicy.of_network(tuned, list(self.linear), self.mean, self.std)


class Costs:
    """Costs of episodes and their derivatives with respect to the actions.

    Args:
        tuned: the filter with its actions.
        reward: how errors count.
        quantity: output that is scored, or several, whose root mean square is; None for ``up``, or the first.
    """

    def __init__(self, tuned: TunedFilter, reward: GainReward, quantity: str | Sequence[str] | None = None) -> None:
        self.tuned, self.reward = tuned, reward
        self.quantities = scored_quantities(tuned.kalman, quantity)
        self.gains = tuple(part.gain for part in tuned.ranges)
        self._equations: dict[Any, DifferentiableEquations] = {}

    def episodes(self, trajectories: Sequence[Trajectory], start: np.ndarray) -> list[Episodes]:
        """Trajectories as episodes whose reference is the constant action ``start``, one entry a rate and structure."""
        groups: dict[Any, list[GainEpisode]] = {}
        for trajectory in trajectories:
            one = GainEpisode.of(trajectory, self.tuned, self.quantities, self.reward, start)
            groups.setdefault((round(1e6 * trajectory.dt), structure_of(one.kalman.model)), []).append(one)
        return [Episodes.of(self.tuned.with_dt(group[0].trajectory.dt), group) for group in groups.values()]

    def of_policy(self, sets: Sequence[Episodes], policy: GainPolicy) -> float:
        """Mean weighted cost of a policy."""
        found = []
        for each in sets:
            seen = each.observations(policy)
            for rows in np.array_split(np.arange(len(each.episodes)), -(-len(each.episodes) // ROWS)):
                found.append(self.gradient(each.part(rows), policy(seen[:, rows]))[0])
        return float(np.concatenate(found).mean())

    def gradient(self, part: Episodes, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted costs of the episodes ``(N,)``, and the derivative of their mean with respect to the actions.

        Args:
            part: episodes.
            actions: ``(decisions, N, k)``; beyond [−1, 1] they have no effect.
        """
        kalman = part.episodes[0].kalman
        key = structure_of(kalman.model)
        if key not in self._equations:
            self._equations[key] = DifferentiableEquations(kalman, self.gains)
        equations = self._equations[key].of_rows([one.kalman.model for one in part.episodes])
        bounded = np.clip(actions, -1.0, 1.0)
        limited, free = self.tuned.gains(bounded), np.where(bounded < 0.0, *self._reach())
        factors = np.stack([limited[name] for name in self.gains], axis=-1)
        inside = (np.abs(actions) <= 1.0) & (np.abs(factors - free * bounded) < 1e-9)
        table = np.repeat(factors, part.interval, axis=0)
        measurements = part.measurements()
        state = kalman.init({name: values[0] for name, values in measurements.items()})
        followed, after = equations.follow(state, measurements, table)
        places = np.arange(followed.poses.shape[-1])
        columns = np.concatenate([places[equations.form.columns[one.name]] for one in self.quantities])
        poses = torch.from_numpy(followed.poses[..., columns].copy()).requires_grad_()
        counted = torch.from_numpy(part.counted & np.isfinite(followed.poses[..., columns]).all(axis=-1))
        errors = self._errors(torch.nan_to_num(poses), torch.from_numpy(part.truth))
        cost = torch.log1p(errors / self.reward.error_scale) * self.reward.error_scale
        per_episode = torch.where(counted, cost, 0.0).sum(dim=0) / counted.sum(dim=0).clamp(min=1)
        weighted = per_episode * torch.from_numpy(part.weight)
        weighted.mean().backward()
        assert poses.grad is not None
        wanted = np.zeros_like(followed.poses)
        wanted[..., columns] = poses.grad.numpy()
        found, _, _ = equations.back(
            followed,
            wanted,
            np.zeros_like(followed.covariances),
            np.zeros_like(followed.nis),
            np.zeros_like(followed.logarithms),
            np.zeros_like(after.x),
            np.zeros_like(after.covariance),
        )
        summed = found.reshape(len(actions), part.interval, *found.shape[1:]).sum(axis=1)
        return weighted.detach().numpy(), np.where(inside, summed * free, 0.0)

    def _errors(self, poses: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
        """Errors ``(T, N)``, as of :func:`poise.envs.gain_reward.errors_of`, but with a derivative at zero."""
        sizes = [one.size for one in self.quantities]
        pairs = zip(self.quantities, poses.split(sizes, dim=-1), truth.split(sizes, dim=-1), strict=True)
        found = [error(*each) for each in pairs]
        return found[0] if len(found) == 1 else (torch.stack(found).square().mean(dim=0) + NO_ERROR**2).sqrt()

    def _reach(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([-part.lower for part in self.tuned.ranges]), np.array([p.upper for p in self.tuned.ranges])


def train_analytically(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    start: np.ndarray,
    *,
    reference: np.ndarray | None = None,
    epochs: int = 30,
    learning_rate: float = 2e-3,
    net_arch: Sequence[int] = (64, 64),
    error_scale: float = 5.0,
    seed: int = 0,
    quantity: str | Sequence[str] | None = None,
    noise: float = 0.6,
    validation: Sequence[Trajectory] = (),
    report: Callable[[int, float, float], None] | None = None,
    save: Callable[[dict[str, Any]], None] | None = None,
    state: dict[str, Any] | None = None,
) -> GainPolicy:
    """Train a policy from constant gains on, or from a rule.

    Args:
        tuned: the filter with its actions and features.
        trajectories: simulated, with truth.
        start: constant action ``(k,)`` that the network begins with, of features with a rule what it adds to that.
        reference: constant action ``(k,)`` whose errors weight the trajectories; None for the published gains.
        epochs: passes over the trajectories.
        learning_rate: of Adam; falls to zero along a cosine.
        net_arch: units of the hidden layers.
        error_scale: deg; errors far above it count by their logarithm.
        seed: of weights and order.
        quantity: output that is scored, or several together; None for ``up``, or the first.
        noise: added to the observations of a training, in their standard deviations.
        validation: trajectories that are not trained on; the policy of least cost on them is returned, otherwise the
            last one.
        report: called after every pass with its number, the mean cost before it and that on ``validation`` after it
            (NaN without); of a resumed training also for the passes before.
        save: called after every pass with all that the rest of the training depends on.
        state: from ``save``: continue there, bit by bit as if there had been no interruption.
    """
    reward = GainReward("relative", error_scale=np.radians(error_scale))
    costs, skip = Costs(tuned, reward, quantity), rule_skip(tuned.features, tuned.actions)
    compared = np.zeros(tuned.actions) if reference is None else reference
    sets, unseen = (costs.episodes(some, compared) for some in (trajectories, validation))
    generator = np.random.default_rng(seed)
    best, least, history = None, np.inf, []
    if state is None:
        neutral = replace(GainPolicy.constant(tuned, start), skip=skip)
        first = np.concatenate([each.observations(neutral).reshape(-1, tuned.observation_size) for each in sets])
        mean, std = first.mean(axis=0), first.std(axis=0) + 1e-2
    else:
        mean, std = state["normalisation"]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        actor = Actor(mean, std, np.asarray(start, float), net_arch, small=0.01 if skip is None else 0.0)
    optimizer = torch.optim.Adam(actor.parameters(), lr=learning_rate)
    updates = epochs * sum(-(-len(each.episodes) // ROWS) for each in sets)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, updates)
    if state is not None:
        actor.load_state_dict(state["actor"])
        optimizer.load_state_dict(state["optimizer"])
        schedule.load_state_dict(state["schedule"])
        generator.bit_generator.state = json.loads(state["generator"])
        history, least = state["history"], state["least"]
        if state["best"] is not None:
            best = replace(actor.policy(tuned), layers=tuple((a, b) for a, b in state["best"]))
        for epoch, (cost, unseen_cost) in enumerate(history):
            if report is not None:
                report(epoch, cost, unseen_cost)
    elif skip is not None and unseen:
        best, least = actor.policy(tuned), costs.of_policy(unseen, actor.policy(tuned))
    for epoch in range(len(history), epochs):
        policy, total = actor.policy(tuned), []
        seen = [each.observations(policy) for each in sets]
        jobs = [
            (index, rows)
            for index, each in enumerate(sets)
            for rows in np.array_split(generator.permutation(len(each.episodes)), -(-len(each.episodes) // ROWS))
        ]
        for job in generator.permutation(len(jobs)):
            index, rows = jobs[job]
            some = seen[index][:, rows]
            actions = actor(some + noise * actor.std * generator.standard_normal(some.shape))
            if skip is not None:
                actions = actions + torch.as_tensor(some @ skip.T, dtype=torch.float32)
            cost, slope = costs.gradient(sets[index].part(rows), actions.detach().numpy().astype(float))
            beyond = (actions - actions.detach().clamp(-1.0, 1.0)).square().sum(dim=-1).mean()
            optimizer.zero_grad()
            ((actions * torch.as_tensor(slope, dtype=torch.float32)).sum() + BEYOND * beyond).backward()
            torch.nn.utils.clip_grad_norm_(actor.parameters(), 1.0)
            optimizer.step()
            schedule.step()
            total.append(cost)
        held_out = costs.of_policy(unseen, actor.policy(tuned)) if unseen else np.nan
        if held_out < least:
            best, least = actor.policy(tuned), held_out
        history.append([float(np.concatenate(total).mean()), float(held_out)])
        if report is not None:
            report(epoch, *history[-1])
        if save is not None:
            save(
                {
                    "normalisation": [mean, std],
                    "actor": dict(actor.state_dict()),
                    "optimizer": optimizer.state_dict(),
                    "schedule": schedule.state_dict(),
                    "generator": json.dumps(generator.bit_generator.state),
                    "history": history,
                    "least": float(least),
                    "best": None if best is None else [list(layer) for layer in best.layers],
                }
            )
    return best or actor.policy(tuned)
