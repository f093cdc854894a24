"""The yaw of a bicycle, which no sensor of the three works observes: how fast it drifts if its rate is integrated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.bicycle.two_gyro.kinematics import platform_rate
from ...filters.core import rotation
from .averages import mean
from .claims import Claim

SHARES = {"early": 1.0 / 3.0, "end": 1.0}
"""Name → share of the ride after which the error is looked at"""


def yaw_drift(ride: Trajectory, roll: np.ndarray) -> dict[str, float]:
    """Size of the error of the yaw that is integrated from the true start by (7), deg, at :data:`SHARES` of the ride.

    ``roll`` ``(T,)`` is φ of the filter, rad; 0 where it has not started.
    """
    rate = platform_rate(ride.measurements["bicycle_imu/gyr"], RiderGeometry.of(ride.metadata).bicycle_imu_tilt)
    turning = np.nan_to_num(rate[:, 2] / np.cos(np.nan_to_num(roll)))
    # the yaw of the environment is to the left, that of (7) to the right
    true = -np.unwrap(rotation.to_euler_zyx(ride.truth["bicycle/orientation"])[0])
    error = np.degrees(np.cumsum(turning[1:]) * ride.dt - (true[1:] - true[0]))
    return {name: float(abs(error[max(0, round(share * len(error)) - 1)])) for name, share in SHARES.items()}


def yaw_claim(results: Iterable[Mapping[str, Any]]) -> Claim:
    """Whether the error of an integrated yaw grows all the way, on rides with :func:`yaw_drift` under ``yaw``."""
    every = list(results)
    early, end = (mean(each["yaw"][name] for each in every) for name in SHARES)
    statement = "Yaw is not observed: integrated it drifts, more than twice as far as after a third of the ride"
    return Claim.less(statement, early, end, factor=0.5)
