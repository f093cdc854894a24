"""Add a Kalman filter
===================

A filter is a dataclass with its equations, written once: it then runs as NumPy arrays, as torch tensors with gradients, and compiled, it is
smoothed, and it is compared with all others.
"""

# %%
# The equations
# -------------
# The gravity direction :math:`u` in the sensor frame turns with the device, :math:`\\dot u = -\\omega \\times u`, and the accelerometer
# measures :math:`g u` plus the acceleration of the hand, which is noise here.

from dataclasses import dataclass
from typing import ClassVar

import poise
from poise.filters.core.backend import constant, expand
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model
from poise.filters.core.quantity import ACCELEROMETER, GYROSCOPE, UP
from poise.filters.core.rotation import normalize, skew

UNIT = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


@dataclass(frozen=True)
class GravityTracker(Model):
    """Gravity direction from six axes."""

    gyroscope_noise: float = 0.01
    accelerometer_noise: float = 1.0
    gravity: float = 9.81
    channels: ClassVar = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar = (UP,)
    state_size: ClassVar = 3
    error_size: ClassVar = 3
    residual_size: ClassVar = 3

    def prior(self, z):
        """State and covariance from the first sample."""
        u = normalize(z["imu/acc"])
        return u, 0.01 * constant(UNIT, u) + 0.0 * u[..., None]

    def predict(self, x, z, previous):
        """Next state, its Jacobian, process noise."""
        F = constant(UNIT, x) - expand(self.dt, 2) * skew(z["imu/gyr"])
        Q = expand(self.gyroscope_noise**2 * self.dt, 2) * constant(UNIT, x) + 0.0 * x[..., None]
        return (F @ x[..., None])[..., 0], F, Q

    def residual(self, x, z):
        """Measured minus expected, its Jacobian, measurement noise."""
        unit = constant(UNIT, x) + 0.0 * x[..., None]
        expected = expand(self.gravity, 1) * x
        return z["imu/acc"] - expected, expand(self.gravity, 2) * unit, expand(self.accelerometer_noise**2, 2) * unit

    def pose(self, x):
        """The outputs."""
        return {"up": normalize(x)}


# %%
# Run, smooth, compare
# --------------------

from poise.filters.core.offline import Offline

mine = KalmanFilter(GravityTracker())
trajectory = poise.record("poise/HandMotion-v0", seed=0)
contenders = {"mine": mine, "mine (offline)": Offline(mine), "mekf": "mekf", "tilt": "tilt"}
table = poise.evaluate(contenders, trajectory)
print(table[table.metric == "inclination"].to_string())
