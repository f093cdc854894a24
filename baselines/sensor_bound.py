"""What the errors of an IMU alone leave of the inclination: a bound for every estimator of a simulated trajectory.

The posterior Cramér–Rao bound of an estimator that knows the external acceleration, at the true attitude R (sensor
to world). With the rotation vector δ of the attitude error in world axes, the biases b_g and b_a, the white noises w_g
and w_a of the simulated sensors, and gravity g e₃,

    dδ/dt = −R (b_g + w_g),   z = R (f − a) − g e₃ = g [e₃]× δ + R (b_a + w_a)

A bias is the sum of a Gauss-Markov process and of a random walk that starts at the turn-on bias. No real estimator
knows the acceleration, so the ratio of an error to the bound tells how much of the error is due to the motion. Scale
factors, misalignment, quantisation, temperature, and lost samples of the gyroscope, which could only raise the bound,
are left out. It does not hold for smoothers, and a magnetometer may lower it by what it tells of the biases.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..envs.data.trajectory import Trajectory
from ..filters.analysis.bounds import Linearisation, measured, riccati
from ..filters.core import rotation
from ..filters.core.quantity import GRAVITY, ORIENTATION

WIDE = 1.0
"""rad: what is known of each component of δ before the first sample"""


def inclination_bound(trajectory: Trajectory) -> float | None:
    """Root mean square of the bound over the mask, deg; None where the errors of an IMU are not known, or zero.

    The trajectory is on its grid, with ``imu/gyr``, ``imu/acc`` and the true orientation; simulated, so that its
    metadata hold the parameters of its sensors.
    """
    noises = [noise_of(trajectory, kind) for kind in ("gyr", "acc")]
    known = [noise for noise in noises if noise is not None and noise["white_noise"] > 0.0]
    if len(known) < 2 or ORIENTATION.name not in trajectory.truth or not trajectory.mask.any():
        return None
    system, prior = linear_system(trajectory, *known)
    covariance = riccati(system, measured(prior, system, 0))
    variance = np.trace(covariance[trajectory.mask, :2, :2], axis1=1, axis2=2)
    return float(np.degrees(np.sqrt(variance.mean())))


def noise_of(trajectory: Trajectory, kind: str) -> Mapping[str, Any] | None:
    """Parameters (:class:`.NoiseModel`) of the errors of ``imu/<kind>``; None if they are not known."""
    site = trajectory.metadata.get("site", "imu")
    described = trajectory.metadata.get("sensors") or {}
    if trajectory.metadata.get("source") != "simulation" or f"imu/{kind}" not in trajectory.measurements:
        return None
    for sensor in described.get("sensors", ()):
        if sensor["channel"] == f"{site}/{kind}":
            return sensor["noise"]
    return None


def linear_system(
    trajectory: Trajectory, gyroscope: Mapping[str, Any], accelerometer: Mapping[str, Any]
) -> tuple[Linearisation, np.ndarray]:
    """Matrices of all samples and the covariance ``(15, 15)`` before the first one.

    The state is δ (3), of each sensor the Gauss-Markov bias (3) and the random walk (3).
    """
    dt, R = trajectory.dt, np.asarray(rotation.to_matrix(trajectory.truth[ORIENTATION.name]))
    samples, turned = len(R), dt * R[:-1]
    F, Q = (np.zeros((samples - 1, 15, 15)) for _ in range(2))
    F[:] = np.eye(15)
    F[:, :3, 3:6], F[:, :3, 6:9] = -turned, -turned
    H, variances = np.zeros((samples, 3, 15)), [WIDE**2] * 3
    H[:, :, :3] = GRAVITY * np.asarray(rotation.skew(np.array([0.0, 0.0, 1.0])))
    H[:, :, 9:12], H[:, :, 12:15] = R, R
    Q[:, :3, :3] = dt * gyroscope["white_noise"] ** 2 * np.eye(3)
    for start, noise in ((3, gyroscope), (9, accelerometer)):
        kept, stationary = np.exp(-dt / noise["bias_correlation_time"]), noise["bias_instability"] ** 2
        for axis in range(start, start + 3):
            F[:, axis, axis] = kept
            Q[:, axis, axis] = (1.0 - kept**2) * stationary
            Q[:, axis + 3, axis + 3] = dt * noise["bias_random_walk"] ** 2
        variances += [stationary] * 3 + [noise["turn_on_bias"] ** 2] * 3
    white = np.broadcast_to(accelerometer["white_noise"] ** 2 / dt * np.eye(3), (samples, 3, 3))
    seen = np.isfinite(trajectory.measurements["imu/acc"])
    return Linearisation(F, Q, H, white, seen), np.diag(variances)
