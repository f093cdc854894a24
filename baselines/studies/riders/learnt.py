"""What the references of a paper learn from training rides: means, a regression, the best constant gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.recipes.rides import SETTLED, RideSource, drawn
from ....filters.adaptation.gains import gain_sizes
from ....filters.adaptation.tuned import TunedFilter
from ....filters.core import rotation
from ....filters.core.kalman import KalmanFilter
from ....filters.registry import make
from ...gain_policy.constant_gains import best_constant_gains
from ...learned.data import sequence_of
from ...learned.head import AngleHead
from ...learned.inputs.filter_features import FilterFeatures
from ..averages import circular_mean
from .errors import angles_of, truth_of
from .references import Ridge, moving_averages

THINNED = 8
"""every so many updates count in the regression: neighbours are alike"""
PENALTIES = (1e1, 1e2, 1e3, 1e4)
"""of the regression, in updates; the best on a quarter of the rides that it is not fitted to is taken"""
TUNED_RIDES = 8
"""rides on which gains are tuned, one draw of each"""


@dataclass(frozen=True, eq=False)
class Learnt:
    """What the references of one paper know.

    Attributes:
        mean: ``(K,)`` mean of the true angles, rad.
        bias: ``(K,)`` mean error of the published filter, rad.
        ridge: correction of the filter that ``front_end`` runs.
        front_end: what the regression sees.
        head: of the angles.
        tuned: parameters of the published filter with the best constant gains.
    """

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
    return Learnt(
        circular_mean(np.concatenate(truths)),
        circular_mean(np.concatenate(biases)),
        best_ridge(inputs, targets, rides),
        front_end,
        head,
        tuned_parameters(published, tuning, [quantity.name for quantity in outputs]),
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


def tuned_parameters(kalman: KalmanFilter, rides: list[Trajectory], quantities: list[str]) -> dict[str, float]:
    """Noises of the filter with the constant gains that are best for all angles of these rides."""
    found = best_constant_gains(kalman, rides, quantity=quantities, samples=32, refinements=40)
    sizes = gain_sizes(kalman.model, TunedFilter.of(kalman).gains(found.action))
    return {kalman.model.gains[name].parameter: float(size) for name, size in sizes.items()}
