"""Posterior Cramér–Rao bounds of the angles of a paper along one ride, for the noises of its published filter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound
from ....filters.bicycle.two_gyro import truth as two_gyro
from ....filters.registry import make
from ..force_inertial import states as force_inertial
from ..whole_body import states as whole_body
from .errors import deviation_parts, truth_of

States = Callable[[Any, Mapping[str, np.ndarray], Mapping[str, np.ndarray]], np.ndarray]

STATES: Mapping[str, States] = {
    "two-gyro": lambda model, samples, truth: two_gyro.true_states(truth, model),
    "force-inertial": force_inertial.true_states,
    "whole-body": whole_body.true_states,
}
"""Paper → true states ``(T, n)`` of its filter from model, samples and truth."""


def angle_bounds(paper: str, ride: Trajectory, scored: np.ndarray) -> np.ndarray:
    """Root mean square ``(K,)`` of the bound of every angle over the samples that count, deg.

    It is the bound of the published filter's equations and noises, linearised along the ride. An estimator that knows
    more (a network that has seen rides) may fall below it; one without such knowledge stays above if the noises are
    those of the sensors.

    Args:
        paper: name of its filter.
        ride: on its grid, with truth.
        scored: ``(T,)`` samples that count.
    """
    kalman: Any = make(paper, dt=ride.dt, metadata=ride.metadata)
    samples = {channel.name: ride.measurements[channel.name] for channel in kalman.channels}
    held = {name: whole_body.held_samples(values) for name, values in samples.items()}
    states = STATES[paper](kalman.model, held, truth_of(kalman, ride))
    variances = np.diagonal(posterior_bound(kalman.model, states, samples), axis1=1, axis2=2)
    return np.degrees(np.sqrt([np.nanmean(variances[scored, part]) for part in deviation_parts(kalman)]))
