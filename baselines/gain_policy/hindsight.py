"""A first policy from hindsight: what constant gains would have cost from every moment on, and which features told so.

On simulated trajectories the cost of many constant actions can be computed for every decision. The logarithm of the
cost of the seconds that follow is fitted by a cubic polynomial of the action, and a network from features to actions is
trained on the expectation of what the polynomials say. Nothing is sampled, so there is none of the variance that a
policy gradient has to begin with. What it cannot see is the price of changing gains; that is left to the
reinforcement learning that goes on from here.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement, pairwise
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.gain_tuning import scored_quantity
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.backend import namespace
from ...filters.core.metrics import error
from .policy import GainPolicy, Layer

BEHAVIOURS = 4
"""Candidates under which the features are recorded, besides the policy itself."""
ROUNDS = 3
"""Trainings, each with the features of the policy before as well."""
REACH = 0.7
"""How far candidates lie from the start: within one valley of the cost, since what lies between two is bad."""
SMALL_COST = 0.05
"""Added to relative costs before their logarithm is taken."""


class HindsightGroup:
    """Costs and features of trajectories of one rate.

    Args:
        tuned: the filter.
        trajectories: of one rate; the shortest decides about the length of all.
        discount: factor on the cost from decision to decision.
        small: rad, added to the mean error that costs are divided by.
    """

    def __init__(
        self, tuned: TunedFilter, trajectories: Sequence[Trajectory], discount: float, small: float = np.radians(0.2)
    ) -> None:
        self.tuned, self.discount, self.small = tuned.with_dt(trajectories[0].dt), discount, small
        self.decisions = min(len(trajectory) for trajectory in trajectories) // self.tuned.ticks
        length = self.decisions * self.tuned.ticks
        self.quantity = scored_quantity(tuned.kalman, None)
        self.channels = {
            channel.name: np.stack([trajectory.measurements[channel.name][:length] for trajectory in trajectories], 1)
            for channel in tuned.kalman.channels
        }
        self.truth = np.stack([trajectory.truth_of(self.quantity.name)[:length] for trajectory in trajectories], 1)
        self.scored = np.stack([trajectory.mask[:length] for trajectory in trajectories], 1)

    def costs(self, actions: np.ndarray) -> np.ndarray:
        """Discounted mean cost from every decision on ``(decisions, trajectories, actions)``.

        Errors are divided by their mean over the trajectory under the first action.
        """
        tables = []
        for action in actions:
            pose = self.tuned.kalman.run(self.channels, self.tuned.gains(action)).pose[self.quantity.name]
            errors = error(self.quantity, pose, self.truth)
            errors = np.where(self.scored & np.isfinite(errors), errors, 0.0)
            tables.append(errors.reshape(self.decisions, self.tuned.ticks, -1).mean(axis=1))
        table = np.stack(tables, axis=-1)
        table = table / (table[..., :1].mean(axis=0) + self.small)
        ahead = np.zeros_like(table)
        total, weight = np.zeros_like(table[0]), 0.0
        for decision in reversed(range(self.decisions)):
            total = table[decision] + self.discount * total
            weight = 1.0 + self.discount * weight
            ahead[decision] = total / weight
        return ahead

    def features(self, policy: GainPolicy) -> np.ndarray:
        """Observations at every decision of a policy ``(decisions, trajectories, n)``, float32."""
        state = self.tuned.init({name: values[0] for name, values in self.channels.items()})
        seen = []
        for decision in range(self.decisions):
            seen.append(self.tuned.observe(state))
            state = self.tuned.decide(state, policy(seen[-1]))
            ticks = slice(decision * self.tuned.ticks, (decision + 1) * self.tuned.ticks)
            _, state = self.tuned.advance(state, {name: values[ticks] for name, values in self.channels.items()})
        return np.stack(seen)


def fit_hindsight(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    start: np.ndarray,
    *,
    hidden: tuple[int, ...] = (64, 64),
    discount: float = 0.98,
    candidates: int = 63,
    epochs: int = 6,
    seed: int = 0,
) -> Chooser:
    """Fit a policy to hindsight.

    Args:
        tuned: the filter, what may be chosen of it and what is seen.
        trajectories: simulated, with truth.
        start: constant action ``(k,)``, the first of the candidates; the others lie within :data:`REACH` of it.
        hidden: units of the layers.
        discount: how far ahead costs count, per decision.
        candidates: further actions, spread evenly.
        epochs: passes over the recorded features in each round.
        seed: of candidates, weights and order.

    Returns:
        The trained network; :meth:`Chooser.policy` makes it a policy.
    """
    from scipy.stats import qmc

    rng = np.random.default_rng(seed)
    lowest, highest = np.maximum(start - REACH, -1.0), np.minimum(start + REACH, 1.0)
    spread = qmc.Sobol(tuned.actions, rng=rng.spawn(1)[0]).random(candidates + 1)[1:]
    actions = np.concatenate([start[None], lowest + (highest - lowest) * spread])
    rates: dict[int, list[Trajectory]] = {}
    for trajectory in trajectories:
        rates.setdefault(round(1e6 * trajectory.dt), []).append(trajectory)
    groups = [HindsightGroup(tuned, part, discount) for part in rates.values()]
    costs = [group.costs(actions) for group in groups]
    order = np.argsort(sum(cost.mean(axis=(0, 1)) for cost in costs))
    behaviours = [GainPolicy.constant(tuned, actions[index]) for index in (0, *order[: 4 * BEHAVIOURS : 4])]
    inputs: list[np.ndarray] = []
    targets: list[np.ndarray] = []
    width = tuned.observation_size
    fit = np.linalg.pinv(cubic(actions)).T
    chooser = Chooser(width, hidden, start, seed, lowest, highest)
    for _ in range(ROUNDS):
        for behaviour in behaviours:
            for group, cost in zip(groups, costs, strict=True):
                inputs.append(group.features(behaviour).reshape(-1, width))
                targets.append((np.log(cost.reshape(-1, len(actions)) + SMALL_COST) @ fit).astype(np.float32))
        chooser.train(np.concatenate(inputs), np.concatenate(targets), epochs)
        behaviours = [chooser.policy(tuned)]
    return chooser


def cubic(action: Any) -> Any:
    """All products of up to three entries of ``(n, k)``, the constant included: ``(n, terms)``; arrays or tensors."""
    xp = namespace(action)
    columns = [xp.ones_like(action[:, 0])]
    for order in (1, 2, 3):
        for entries in combinations_with_replacement(range(action.shape[1]), order):
            columns.append(xp.prod(action[:, list(entries)], axis=-1))
    return xp.stack(columns, axis=-1)


class Chooser:
    """A network from features to actions, trained on polynomials of the logarithm of costs.

    Args:
        inputs: number of features.
        hidden: units of the layers.
        start: action at the beginning.
        seed: of weights and order.
        lowest: smallest action ``(k,)`` of which the polynomials know.
        highest: largest likewise.
    """

    def __init__(
        self,
        inputs: int,
        hidden: tuple[int, ...],
        start: np.ndarray,
        seed: int,
        lowest: np.ndarray | float = -1.0,
        highest: np.ndarray | float = 1.0,
    ) -> None:
        import torch

        none = np.zeros(len(start))
        self.lowest, self.highest = (torch.as_tensor(none + bound, dtype=torch.float32) for bound in (lowest, highest))

        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            sizes = [inputs, *hidden, len(start)]
            self.linear = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
        with torch.no_grad():
            self.linear[-1].weight *= 0.1
            self.linear[-1].bias.copy_(torch.as_tensor(0.95 * start))
        self.generator = torch.Generator().manual_seed(seed)
        self.mean, self.deviation = np.zeros(inputs), np.ones(inputs)

    def train(self, inputs: np.ndarray, polynomials: np.ndarray, epochs: int) -> None:
        """Go through features ``(n, inputs)`` and coefficients ``(n, terms)`` several times."""
        import torch

        if not self.mean.any():
            self.mean, self.deviation = inputs.mean(axis=0), inputs.std(axis=0) + 1e-3
        x = torch.as_tensor((inputs - self.mean) / self.deviation, dtype=torch.float32)
        coefficients = torch.as_tensor(polynomials)
        optimiser = torch.optim.Adam([p for layer in self.linear for p in layer.parameters()], lr=1e-3)
        for _ in range(epochs):
            for rows in torch.randperm(len(x), generator=self.generator).split(4096):
                action = x[rows]
                for layer in self.linear[:-1]:
                    action = torch.tanh(layer(action))
                action = self.linear[-1](action)
                bounded = torch.minimum(torch.maximum(action, self.lowest), self.highest)
                cost = torch.exp((cubic(bounded) * coefficients[rows]).sum(dim=-1)).mean()
                loss = cost + (action - bounded).square().sum(dim=-1).mean()
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()

    def policy(self, tuned: TunedFilter) -> GainPolicy:
        """The network as plain arrays, the normalisation of features in the first layer."""
        arrays: list[Layer] = [
            (layer.weight.detach().numpy().astype(float), layer.bias.detach().numpy().astype(float))
            for layer in self.linear
        ]
        weight, bias = arrays[0]
        arrays[0] = (weight / self.deviation, bias - (weight / self.deviation) @ self.mean)
        return GainPolicy(tuned.name, tuned.ranges, tuned.features, tuple(arrays))
