"""The gyroscope bias up to which a policy is trusted: as large as in its training, by a filter that estimates it.

A filter without a bias in its state errs by its time constant times the bias. A policy for it learns time constants
that suit the biases of its training, and nothing that it observes tells a larger bias from a steady acceleration. The
multiplicative extended Kalman filter as published runs beside it and estimates the bias from the same samples. Beyond
the largest estimate of the training, apart from a hundredth of the decisions, and in the first seconds, the estimates
are those of the filter with its published gains, which runs beside it too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.adaptation.gains import tunable_filter
from ...filters.core.kalman import KalmanFilter
from ...filters.core.quantity import GYROSCOPE_BIAS
from ...filters.core.sampling import FilterState

WITNESS = "mekf"
"""The filter that estimates the bias."""
QUANTILE = 0.99
"""Share of the estimates of a training that lie within the limit."""
SETTLING = 12.0
"""s from the start until the estimate is believed: of simulated uncalibrated devices, nine in ten of those whose
estimate ends above 3 °/s exceed 2 °/s by then."""
EVERY = 0.1
"""s between the estimates that are counted."""


def witness_of(kalman: KalmanFilter) -> KalmanFilter | None:
    """The filter beside ``kalman``, at its rate; None if that estimates a bias itself or lacks a channel."""
    witness = tunable_filter(WITNESS).with_dt(kalman.dt)
    read = {channel.name for channel in kalman.channels}
    if GYROSCOPE_BIAS in kalman.outputs or not {channel.name for channel in witness.channels} <= read:
        return None
    return witness


def bias_of(witness: KalmanFilter, state: FilterState) -> np.ndarray:
    """Length of the estimated bias ``(*batch,)``, rad/s."""
    return np.linalg.norm(np.asarray(witness.model.pose(state.x)[GYROSCOPE_BIAS.name]), axis=-1)


def bias_limit(kalman: KalmanFilter, trajectories: Sequence[Trajectory]) -> float:
    """Limit of a policy that is trained on ``trajectories``, rad/s; ∞ for a filter that needs none.

    Raises:
        ValueError: the bias cannot be estimated on any of the trajectories.
    """
    if witness_of(kalman) is None:
        return math.inf
    found = []
    for trajectory in trajectories:
        witness = witness_of(kalman.with_dt(trajectory.dt))
        assert witness is not None
        bias = np.asarray(witness.run(trajectory.measurements).pose[GYROSCOPE_BIAS.name])
        found.append(np.linalg.norm(bias, axis=-1)[:: max(1, round(EVERY / trajectory.dt))])
    estimates = np.concatenate(found) if found else np.zeros(0)
    if not np.isfinite(estimates).any():
        raise ValueError(f"trajectories must hold gyroscope and accelerometer samples, got {len(found)} without")
    return float(np.nanquantile(estimates, QUANTILE))
