"""Errors of all angles of a paper at the updates of a network, what they amount to on one ride, and their bounds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound
from ....filters.bicycle.two_gyro import truth as two_gyro
from ....filters.core import rotation
from ....filters.core.estimator import Estimator
from ....filters.core.model import equations_of
from ....filters.core.quantity import Estimate, Quantity
from ....filters.registry import make
from ..force_inertial import states as force_inertial
from ..whole_body import states as whole_body

COVERED = 1.6449
"""standard deviations about the mean in which 90 % of a normal variable lie"""


class Errors(NamedTuple):
    """Errors of one method on one ride.

    Attributes:
        values: ``(N, K)`` estimate less truth, rad, where the ride is scored.
        deviations: ``(N, K)`` standard deviations that the method states, rad, NaN of angles that have none; None where
            it states none.
    """

    values: np.ndarray
    deviations: np.ndarray | None = None


class Score(NamedTuple):
    """What errors amount to.

    Attributes:
        angles: ``(K,)`` root mean square error of each angle, deg.
        nees: mean squared normalised error of an angle; NaN without deviations.
        coverage: share of errors within the stated 90 %; NaN without deviations.
    """

    angles: np.ndarray
    nees: float
    coverage: float

    @property
    def mean(self) -> float:
        """Mean over the angles, deg."""
        return float(self.angles.mean())


def score(errors: Errors) -> Score:
    """What errors amount to."""
    angles = np.degrees(np.sqrt(np.mean(errors.values**2, axis=0)))
    if errors.deviations is None:
        return Score(angles, float("nan"), float("nan"))
    normalised = errors.values / errors.deviations
    normalised = normalised[np.isfinite(normalised)]
    return Score(angles, float(np.mean(normalised**2)), float(np.mean(np.abs(normalised) < COVERED)))


def angle_names(outputs: tuple[Quantity, ...]) -> list[str]:
    """``roll``, ``relative_angles 2``, ``hip_left/angles 3``: for each of the K angles a name of its own."""
    ends = [quantity.name.split("/")[-1] for quantity in outputs if quantity.kind == "angle"]
    short = [
        (quantity.name if ends.count(end := quantity.name.split("/")[-1]) > 1 else end, quantity.size)
        for quantity in outputs
        if quantity.kind == "angle"
    ]
    return [name if size == 1 else f"{name} {index + 1}" for name, size in short for index in range(size)]


def angles_of(outputs: tuple[Quantity, ...], values: Mapping[str, Any]) -> np.ndarray:
    """All angles of a paper, ``(T, K)`` rad."""
    return np.concatenate([np.asarray(values[q.name]) for q in outputs if q.kind == "angle"], axis=-1)


def truth_of(estimator: Any, ride: Trajectory) -> dict[str, np.ndarray]:
    """The truth of a ride with the angles that the paper defines."""
    return {**ride.truth, **equations_of(estimator).truth(ride.truth)}


def errors_of(estimator: Estimator[Any], ride: Trajectory, estimate: Estimate, scored: np.ndarray) -> Errors:
    """Errors of an estimate at the samples ``(T,)`` that count, and deviations if it has a covariance of all angles."""
    outputs = tuple(estimator.outputs)
    difference = angles_of(outputs, estimate.pose)[scored] - angles_of(outputs, truth_of(estimator, ride))[scored]
    parts = deviation_parts(estimator)
    if estimate.covariance is None or set(parts) == {None}:
        return Errors(np.asarray(rotation.wrap(difference)))
    variances = np.diagonal(np.asarray(estimate.covariance)[scored], axis1=-2, axis2=-1)
    unknown = np.full(len(variances), np.nan)
    columns = [unknown if part is None else np.maximum(variances[:, part], 1e-16) for part in parts]
    return Errors(np.asarray(rotation.wrap(difference)), np.sqrt(np.stack(columns, axis=-1)))


def deviation_parts(estimator: Any) -> list[int | None]:
    """Place of each angle in the estimator's covariance; None where it is in none."""
    parts = getattr(equations_of(estimator), "error_parts", {})
    found: list[int | None] = []
    for quantity in estimator.outputs:
        if quantity.kind == "angle":
            found += range(*parts[quantity.name]) if quantity.name in parts else [None] * quantity.size
    return found


States = Callable[[Any, Mapping[str, np.ndarray], Mapping[str, np.ndarray]], np.ndarray]

STATES: Mapping[str, States] = {
    "two-gyro": lambda model, samples, truth: two_gyro.true_states(truth, model),
    "force-inertial": force_inertial.true_states,
    "whole-body": whole_body.true_states,
}
"""Paper → true states ``(T, n)`` of its filter from model, samples and truth."""


def angle_bounds(paper: str, ride: Trajectory, scored: np.ndarray) -> np.ndarray:
    """Root mean square ``(K,)`` of the bound of every angle of a paper's filter over the samples that count, deg.

    It is the bound of the published filter's equations and noises, linearised along the ride. An estimator that knows
    more (a network that has seen rides) may fall below it; one without such knowledge stays above if the noises are
    those of the sensors.
    """
    kalman: Any = make(paper, dt=ride.dt, metadata=ride.metadata)
    samples = {channel.name: ride.measurements[channel.name] for channel in kalman.channels}
    held = {name: whole_body.held_samples(values) for name, values in samples.items()}
    states = STATES[paper](kalman.model, held, truth_of(kalman, ride))
    variances = np.diagonal(posterior_bound(kalman.model, states, samples), axis1=1, axis2=2)
    return np.degrees(np.sqrt([np.nanmean(variances[scored, part]) for part in deviation_parts(kalman)]))
