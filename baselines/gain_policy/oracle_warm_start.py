"""Oracle warm start: a first policy cloned from the hindsight-optimal gains.

On simulated trajectories the cost of many constant actions can be computed for every decision. The logarithm of the
cost of the seconds that follow is fitted by a cubic polynomial of the action, and a network from features to actions is
trained on the expectation of the polynomials' exponentials. Nothing is sampled, which avoids the initial variance of a
policy gradient. The cost neglects the effect of changing gains, which the subsequent reinforcement learning includes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement, pairwise
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.backend import namespace
from .policy import GainPolicy
from .stack import TrajectoryStack

BEHAVIOURS = 4
"""Candidates under which the features are recorded, besides the policy itself."""
ROUNDS = 3
"""Trainings, each with the features of the policy before as well."""
REACH = 0.7
"""Distance of candidates from the start, within one valley of the cost, since the cost between valleys is high."""
SMALL_COST = 0.05
"""Added to relative costs before their logarithm is taken."""


def costs_to_go(
    stack: TrajectoryStack, actions: np.ndarray, gamma: float, small: float = np.radians(0.2)
) -> np.ndarray:
    """Discounted mean cost from every decision on ``(decisions, trajectories, actions)``.

    Errors are divided by their mean over the trajectory under the first action.

    Args:
        stack: trajectories of one rate.
        actions: constant actions ``(n, k)``.
        gamma: discount factor from decision to decision.
        small: rad, added to the mean error that costs are divided by.
    """
    tables = []
    for action in actions:
        errors = stack.errors(action)
        errors = np.where(stack.mask & np.isfinite(errors), errors, 0.0)
        tables.append(errors.reshape(stack.decisions, stack.tuned.interval_samples, -1).mean(axis=1))
    table = np.stack(tables, axis=-1)
    table = table / (table[..., :1].mean(axis=0) + small)
    ahead = np.zeros_like(table)
    total, weight = np.zeros_like(table[0]), 0.0
    for decision in reversed(range(stack.decisions)):
        total = table[decision] + gamma * total
        weight = 1.0 + gamma * weight
        ahead[decision] = total / weight
    return ahead


def observations(stack: TrajectoryStack, policy: GainPolicy) -> np.ndarray:
    """Observations at every decision of a policy ``(decisions, trajectories, n)``, float32."""
    tuned = stack.tuned
    state = tuned.init({name: values[0] for name, values in stack.channels.items()})
    seen = []
    for decision in range(stack.decisions):
        seen.append(tuned.observe(state))
        state = tuned.decide(state, policy(seen[-1]))
        interval = slice(decision * tuned.interval_samples, (decision + 1) * tuned.interval_samples)
        _, state = tuned.advance(state, {name: values[interval] for name, values in stack.channels.items()})
    return np.stack(seen)


def fit_oracle(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    start: np.ndarray,
    *,
    net_arch: tuple[int, ...] = (64, 64),
    gamma: float = 0.98,
    candidates: int = 63,
    n_epochs: int = 6,
    seed: int = 0,
) -> OracleNetwork:
    """Clone the oracle: fit a network to the gains of least future cost.

    Args:
        tuned: the filter with its actions and features.
        trajectories: simulated, with truth.
        start: constant action ``(k,)``, the first of the candidates; the others lie within :data:`REACH` of it.
        net_arch: units of the hidden layers.
        gamma: discount factor of the costs ahead, per decision.
        candidates: further actions, spread evenly (Sobol).
        n_epochs: passes over the recorded features in each round.
        seed: of candidates, weights and order.

    Returns:
        The trained network; :meth:`OracleNetwork.policy` makes it a policy.
    """
    from scipy.stats import qmc

    rng = np.random.default_rng(seed)
    lowest, highest = np.maximum(start - REACH, -1.0), np.minimum(start + REACH, 1.0)
    points = qmc.Sobol(tuned.actions, rng=rng.spawn(1)[0]).random(candidates + 1)[1:]
    actions = np.concatenate([start[None], lowest + (highest - lowest) * points])
    stacks = TrajectoryStack.by_rate(tuned, trajectories)
    costs = [costs_to_go(stack, actions, gamma) for stack in stacks]
    order = np.argsort(sum(cost.mean(axis=(0, 1)) for cost in costs))
    behaviours = [GainPolicy.constant(tuned, actions[index]) for index in (0, *order[: 4 * BEHAVIOURS : 4])]
    inputs: list[np.ndarray] = []
    targets: list[np.ndarray] = []
    width = tuned.observation_size
    fit = np.linalg.pinv(cubic(actions)).T
    network = OracleNetwork(width, net_arch, start, seed, lowest, highest)
    for _ in range(ROUNDS):
        for behaviour in behaviours:
            for stack, cost in zip(stacks, costs, strict=True):
                inputs.append(observations(stack, behaviour).reshape(-1, width))
                targets.append((np.log(cost.reshape(-1, len(actions)) + SMALL_COST) @ fit).astype(np.float32))
        network.train(np.concatenate(inputs), np.concatenate(targets), n_epochs)
        behaviours = [network.policy(tuned)]
    return network


def cubic(action: Any) -> Any:
    """All products of up to three entries of ``(n, k)``, the constant included: ``(n, terms)``; arrays or tensors."""
    xp = namespace(action)
    columns = [xp.ones_like(action[:, 0])]
    for order in (1, 2, 3):
        for entries in combinations_with_replacement(range(action.shape[1]), order):
            columns.append(xp.prod(action[:, list(entries)], axis=-1))
    return xp.stack(columns, axis=-1)


class OracleNetwork:
    """A network from features to actions, trained on polynomials of the logarithm of costs.

    Args:
        inputs: number of features.
        net_arch: units of the hidden layers.
        start: action at the beginning.
        seed: of weights and order.
        lowest: smallest action ``(k,)`` that the polynomials were fitted on.
        highest: largest action likewise.
    """

    def __init__(
        self,
        inputs: int,
        net_arch: tuple[int, ...],
        start: np.ndarray,
        seed: int,
        lowest: np.ndarray | float = -1.0,
        highest: np.ndarray | float = 1.0,
    ) -> None:
        import torch

        zeros = np.zeros(len(start))
        self.lowest, self.highest = (torch.as_tensor(zeros + bound, dtype=torch.float32) for bound in (lowest, highest))
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            sizes = [inputs, *net_arch, len(start)]
            self.linear = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
        with torch.no_grad():
            self.linear[-1].weight *= 0.1
            self.linear[-1].bias.copy_(torch.as_tensor(0.95 * start))
        self.generator = torch.Generator().manual_seed(seed)
        self.mean, self.std = np.zeros(inputs), np.ones(inputs)

    def train(self, inputs: np.ndarray, polynomials: np.ndarray, n_epochs: int) -> None:
        """Minimise the expected cost over features ``(n, inputs)`` and polynomials' coefficients ``(n, terms)``."""
        import torch

        if not self.mean.any():
            self.mean, self.std = inputs.mean(axis=0), inputs.std(axis=0) + 1e-3
        x = torch.as_tensor((inputs - self.mean) / self.std, dtype=torch.float32)
        coefficients = torch.as_tensor(polynomials)
        optimizer = torch.optim.Adam([p for layer in self.linear for p in layer.parameters()], lr=1e-3)
        for _ in range(n_epochs):
            for rows in torch.randperm(len(x), generator=self.generator).split(4096):
                action = x[rows]
                for layer in self.linear[:-1]:
                    action = torch.tanh(layer(action))
                action = self.linear[-1](action)
                bounded = torch.minimum(torch.maximum(action, self.lowest), self.highest)
                cost = torch.exp((cubic(bounded) * coefficients[rows]).sum(dim=-1)).mean()
                loss = cost + (action - bounded).square().sum(dim=-1).mean()
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()

    def policy(self, tuned: TunedFilter) -> GainPolicy:
        """The network as a policy on plain arrays."""
        return GainPolicy.of_network(tuned, self.linear, self.mean, self.std)
