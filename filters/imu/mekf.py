r"""Multiplicative extended Kalman filter: attitude and gyroscope bias.

F. L. Markley, J. L. Crassidis, "Fundamentals of Spacecraft Attitude Determination and Control", Springer 2014, section
6.2 (after E. J. Lefferts, F. L. Markley, M. D. Shuster, "Kalman Filtering for Spacecraft Attitude Estimation", Journal
of Guidance, Control, and Dynamics 5(5), 1982, doi 10.2514/3.56190); error in world axes as in J. Solà, "Quaternion
kinematics for the error-state Kalman filter", arXiv:1711.02508, section 7.

The state is q (sensor to world) and the gyroscope bias b. With the error [δθ (world), δb], R the matrix of q, and
samples that describe the interval that they end,

    q ← q ⊗ exp((ω − b) Δt),   F = [[1, −R Δt], [0, 1]],   Q = Δt blkdiag(σ_g² 1, σ_b² 1)
    f = Rᵀ g e₃ + n,   H = [g Rᵀ [e₃]×, 0],   var n = σ_a² / Δt + (κ (‖f‖ − g))²

All noises are densities, so the filter does not depend on the sampling rate. σ_a represents the acceleration of the
motion rather than the noise of the sensor, which is a hundred times smaller. It is set for recorded hand motion
(BROAD), where the published choice of σ_a as sensor noise fails.

κ > 0 (``norm_adaptation``) increases the variance of samples whose norm differs from g. This option is off. In vigorous
motion it selects those samples in which acceleration and gravity happen to add up to g. These are biased, and the mean
inclination error on ten BROAD trials grows from 1.2° to 2.2° at κ = 1.

The magnetometer corrects the heading and, through the covariance, the bias about the vertical. Its residual is one
angle about the vertical, and its Jacobian has no entry for the inclination (:mod:`poise.filters.imu.magnetic_heading`).

With nine axes the total error on the same ten trials, heading included, is 3.2° (bounded motion 2.7°, VQF 3.2°).

External acceleration and magnetic field are not estimated. Sustained acceleration cannot be distinguished from tilt.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..core.backend import Array, constant, expand, namespace
from ..core.held_inputs import HeldInput
from ..core.matrices import block_diagonal, block_matrix, covariance_of, identity
from ..core.model import Gain, Model
from ..core.quantity import (
    ACCELEROMETER,
    GRAVITY,
    GYROSCOPE,
    GYROSCOPE_BIAS,
    MAGNETOMETER,
    ORIENTATION,
    RELATIVE_ORIENTATION,
    UP,
    Channel,
    Measurement,
    Quantity,
)
from ..core.rotation import exp, level, multiply, norm, normalize, to_matrix, up_in_body
from .magnetic_heading import MagneticHeading

UP_CROSS = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]


@dataclass(frozen=True)
class MEKF(Model):
    """Six axes: inclination and gyroscope bias; the heading is zero at the start and drifts.

    State: q (4), b (3).
    """

    gyroscope_noise: float = 5e-3
    """σ_g, rad/s/√Hz; larger than in a data sheet, to cover scale and alignment errors in motion"""
    bias_noise: float = 2e-5
    """σ_b, rad/s²/√Hz"""
    accelerometer_noise: float = 0.5
    """σ_a, m/s²/√Hz: acceleration of the motion"""
    norm_adaptation: float = 0.0
    """κ: share of | ‖f‖ − g | added as a standard deviation; 0 is the textbook filter"""
    tilt_prior: float = 0.05
    """rad"""
    bias_prior: float = 8.727e-3
    """rad/s (0.5 °/s)"""
    gravity: float = GRAVITY
    """g, m/s²"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP, RELATIVE_ORIENTATION, GYROSCOPE_BIAS)
    state_size: ClassVar[int] = 7
    error_size: ClassVar[int] = 6
    residual_size: ClassVar[int] = 3
    error_parts: ClassVar[dict[str, tuple[int, int]]] = {"relative_orientation": (0, 3), "gyroscope_bias": (3, 6)}
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("gyroscope_noise", description="process variance σ_g² of the attitude"),
        "bias": Gain("bias_noise", description="process variance σ_b² of the gyroscope bias"),
        "measurement": Gain("accelerometer_noise", description="measurement variance σ_a²"),
    }

    held_inputs: ClassVar[tuple[HeldInput, ...]] = (HeldInput("imu/gyr", "gyroscope_noise"),)

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Sensor at rest: inclination from the first accelerometer sample, heading and bias zero."""
        f = z["imu/acc"]
        x = namespace(f).concat([level(f), 0.0 * f], axis=-1)
        return x, covariance_of([*[self.tilt_prior] * 3, *[self.bias_prior] * 3], 0.0 * f[..., :1])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Integrate the bias-corrected gyroscope; F and Q as in the module docstring."""
        xp = namespace(x)
        q, b = x[..., :4], x[..., 4:7]
        unit = identity(3, x)
        turned = normalize(multiply(q, exp(expand(self.dt, 1) * (z["imu/gyr"] - b))))
        F = block_matrix([[unit, -expand(self.dt, 2) * to_matrix(q)], [0.0 * unit, unit]])
        powers = (self.gyroscope_noise, self.bias_noise)
        Q = block_diagonal([expand(power**2 * self.dt, 2) * unit for power in powers])
        return xp.concat([turned, x[..., 4:]], axis=-1), F, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Measured specific force less gravity, in sensor axes."""
        xp = namespace(x)
        f, q = z["imu/acc"], x[..., :4]
        g = expand(self.gravity, 1)
        deviation = expand(self.norm_adaptation, 1) * (norm(f) - g)
        deviation = xp.where(xp.isfinite(deviation), deviation, xp.zeros_like(deviation))
        variance = expand(self.accelerometer_noise**2 / self.dt, 1) + deviation * deviation
        unit = identity(3, x)
        turn = expand(self.gravity, 2) * (to_matrix(q).mT @ constant(UP_CROSS, x))
        return f - g * up_in_body(q), xp.concat([turn, 0.0 * unit], axis=-1), variance[..., None] * unit

    def retract(self, x: Array, dx: Array) -> Array:
        """The attitude is corrected by a rotation in the world frame, the bias additively."""
        q = multiply(exp(dx[..., :3]), x[..., :4])
        return namespace(x).concat([q, x[..., 4:7] + dx[..., 3:6], x[..., 7:]], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Normalise the quaternion."""
        return namespace(x).concat([normalize(x[..., :4]), x[..., 4:]], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Inclination vector, orientation and bias (rad/s), in sensor axes."""
        q = x[..., :4]
        return {"up": up_in_body(q), "relative_orientation": q, "gyroscope_bias": x[..., 4:7]}


@dataclass(frozen=True)
class MEKF9(MagneticHeading, MEKF):
    """Nine axes: orientation in the world (x east, y north, z up) and gyroscope bias.

    State: q (4), b (3), expected norm and dip of the magnetic field (2).
    """

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP, GYROSCOPE_BIAS)
    state_size: ClassVar[int] = 9
    residual_size: ClassVar[int] = 4
    gains: ClassVar[dict[str, Gain]] = MEKF.gains | {
        "heading": Gain("magnetometer_noise", description="variance σ_m² of the magnetic heading")
    }
