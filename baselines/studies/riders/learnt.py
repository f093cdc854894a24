"""What the references of a paper learn from training rides: means, a regression, the best constant gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.recipes.rides import SETTLED, RideSource, drawn
from ....filters.adaptation.gains import gain_sizes
from ....filters.adaptation.tuned import TunedFilter
from ....filters.core import rotation
from ....filters.registry import make
from ...gain_policy.constant_gains import best_constant_gains
from ...learned.data import sequence_of
from ...learned.head import AngleHead
from ...learned.inputs.filter_features import FilterFeatures
from ..averages import circular_mean
from .errors import angles_of, truth_of

THINNED = 8
"""every so many updates count in the regression: neighbours are alike"""
PENALTIES = (1e1, 1e2, 1e3, 1e4)
"""of the regression, in updates; the best on a quarter of the rides that it is not fitted to is taken"""
TUNED_RIDES = 8
"""rides on which gains are tuned, one draw of each"""
SPANS = (1, 25, 125)
"""updates (0.04 s, 1 s, 5 s) of the moving averages, besides the mean of all so far"""


def moving_averages(features: np.ndarray) -> np.ndarray:
    """Causal means ``(N, 4 F)`` of features ``(N, F)`` over :data:`SPANS` and over all updates so far."""
    total = np.concatenate([np.zeros((1, features.shape[1])), np.cumsum(features, axis=0, dtype=float)])
    index = np.arange(1, len(total))
    starts = [np.maximum(index - span, 0) for span in SPANS] + [np.zeros_like(index)]
    return np.concatenate([(total[index] - total[start]) / (index - start)[:, None] for start in starts], axis=1)


@dataclass(frozen=True, eq=False)
class Ridge:
    """A linear regression with a penalty on its standardised coefficients.

    Attributes:
        mean: ``(P,)`` of the inputs.
        factor: ``(P,)`` 1 / standard deviation; 0 for an input that does not vary.
        weights: ``(P, K)``.
        offset: ``(K,)``.
    """

    mean: np.ndarray
    factor: np.ndarray
    weights: np.ndarray
    offset: np.ndarray

    @classmethod
    def fit(cls, inputs: np.ndarray, targets: np.ndarray, penalty: float) -> Self:
        """The regression of targets ``(N, K)`` on inputs ``(N, P)`` of all updates.

        The penalty counts in updates: so many with standardised inputs of 1 and no target.
        """
        if not penalty > 0.0:
            raise ValueError(f"penalty must be positive, got {penalty}")
        mean, deviation = inputs.mean(axis=0), inputs.std(axis=0)
        factor = np.where(deviation > 1e-9, 1.0 / np.maximum(deviation, 1e-9), 0.0)
        scaled, offset = (inputs - mean) * factor, targets.mean(axis=0)
        normal = scaled.T @ scaled + penalty * np.eye(len(mean))
        return cls(mean, factor, np.linalg.solve(normal, scaled.T @ (targets - offset)), offset)

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Targets ``(N, K)``."""
        return (inputs - self.mean) * self.factor @ self.weights + self.offset


@dataclass(frozen=True, eq=False)
class Learnt:
    """What the references of one paper know.

    Attributes:
        paper: whose.
        mean: ``(K,)`` mean of the true angles, rad.
        bias: ``(K,)`` mean error of the published filter, rad.
        ridge: correction of the filter that ``front_end`` runs.
        front_end: what the regression sees.
        head: of the angles.
        tuned: parameters of the published filter with the best constant gains.
    """

    paper: str
    mean: np.ndarray
    bias: np.ndarray
    ridge: Ridge
    front_end: FilterFeatures
    head: AngleHead
    tuned: dict[str, float]


def learn(paper: str, start: str, source: RideSource, seed: int) -> Learnt:
    """Learn from the training rides of ``source``, with ``seed`` as their root seed.

    ``start`` names the filter that the regression corrects, that of the network.
    """
    published: Any = make(paper)
    outputs = tuple(quantity for quantity in published.outputs if quantity.kind == "angle")
    head = AngleHead(outputs, (1.0,) * sum(quantity.size for quantity in outputs))
    kalman: Any = make(start)
    front_end = FilterFeatures(kalman)
    truths, biases, inputs, targets, rides = [], [], [], [], []
    tuning: list[Trajectory] = []
    for index in range(source.rides):
        draws = drawn(source, seed, index)
        if float(draws[0].time[-1]) < 2.0 * SETTLED:
            continue
        if len(tuning) < TUNED_RIDES:
            tuning.append(draws[0])
        for each in draws:
            own: Any = make(paper, dt=each.dt, metadata=each.metadata)
            truth = angles_of(outputs, truth_of(own, each))[each.mask][:: 4 * THINNED]
            estimated = angles_of(outputs, own.run(each.measurements).pose)[each.mask][:: 4 * THINNED]
            truths.append(truth)
            biases.append(rotation.wrap(estimated - truth))
            features, target, _, mask = sequence_of(each, front_end, head)
            inputs.append(moving_averages(features)[mask][::THINNED])
            targets.append(target[mask][::THINNED])
            rides.append(index)
    found = best_constant_gains(
        published, tuning, quantity=[quantity.name for quantity in outputs], samples=32, refinements=40
    )
    sizes = gain_sizes(published.model, TunedFilter.of(published).gains(found.action))
    return Learnt(
        paper,
        circular_mean(np.concatenate(truths)),
        circular_mean(np.concatenate(biases)),
        best_ridge(inputs, targets, rides),
        front_end,
        head,
        {published.model.gains[name].parameter: float(size) for name, size in sizes.items()},
    )


def best_ridge(inputs: list[np.ndarray], targets: list[np.ndarray], rides: list[int]) -> Ridge:
    """The regression with the penalty that is best on every fourth ride, fitted to all rides."""
    kept = np.array(rides) % 4 == 0

    def joined(parts: list[np.ndarray], chosen: np.ndarray) -> np.ndarray:
        return np.concatenate([part for part, here in zip(parts, chosen, strict=True) if here])

    losses = {}
    if kept.any() and not kept.all():
        for penalty in PENALTIES:
            ridge = Ridge.fit(joined(inputs, ~kept), joined(targets, ~kept), penalty)
            losses[penalty] = float(np.mean((ridge.predict(joined(inputs, kept)) - joined(targets, kept)) ** 2))
    penalty = min(losses, key=losses.__getitem__) if losses else PENALTIES[1]
    return Ridge.fit(np.concatenate(inputs), np.concatenate(targets), penalty)
