r"""Classical references without covariance: gyroscope integration, accelerometer tilt, and Mahony's filter.

None of them is tuned to data. Integration and tilt have no parameters, and Mahony's filters keep the published gains.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..core.backend import Array, expand, namespace
from ..core.model import Recurrence
from ..core.quantity import (
    ACCELEROMETER,
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
from ..core.rotation import cross, exp, level, multiply, normalize, rotate, rotate_back, up_in_body
from .magnetic_heading import align, known


@dataclass(frozen=True)
class GyroscopeIntegration(Recurrence):
    """Integration of the gyroscope from the inclination of the first accelerometer sample; the heading starts at zero.

    Each sample is the mean rate of the interval that it ends. One rotation vector integrates it exactly if the axis is
    constant. The error consists of that of the first sample and of the integrated bias and noise of the gyroscope.

    State: q (4).
    """

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP, RELATIVE_ORIENTATION)
    state_size: ClassVar[int] = 4

    def prior(self, z: Measurement) -> Array:
        """Inclination of the first accelerometer sample."""
        return level(z["imu/acc"])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Rotate by the rotation vector of the interval."""
        return normalize(multiply(x, exp(expand(self.dt, 1) * z["imu/gyr"])))

    def pose(self, x: Array) -> dict[str, Array]:
        """Inclination vector and orientation."""
        return {"up": up_in_body(x), "relative_orientation": x}


@dataclass(frozen=True)
class Tilt(Recurrence):
    """The direction of each accelerometer sample: exact at rest, in error by the acceleration of the motion.

    A missing sample is replaced by the last one.

    State: inclination vector in the sensor frame (3).
    """

    channels: ClassVar[tuple[Channel, ...]] = (ACCELEROMETER,)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP,)
    state_size: ClassVar[int] = 3

    def prior(self, z: Measurement) -> Array:
        """Direction of the first sample."""
        return normalize(z["imu/acc"])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """No motion model: the state stays."""
        return x

    def finish(self, x: Array, z: Measurement) -> Array:
        """Direction of the sample, if there is one (free fall has none)."""
        xp = namespace(x)
        up = normalize(z["imu/acc"])
        return xp.where(xp.isfinite(up), up, x)

    def pose(self, x: Array) -> dict[str, Array]:
        """Inclination vector."""
        return {"up": x}


@dataclass(frozen=True)
class Mahony(Recurrence):
    """Explicit complementary filter with bias, six axes.

    R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear Complementary Filters on the Special Orthogonal Group", IEEE
    Transactions on Automatic Control 53(5), 2008, doi 10.1109/TAC.2008.923738, equation (32): with the measured and the
    expected direction v, v̂ in sensor axes,

        e = v × v̂,   q̇ = ½ q ⊗ (ω − b + k_P e),   ḃ = −k_I e

    in two steps per sample, rotation by the gyroscope and correction. Gains are those of continuous time, so the filter
    does not depend on the rate. Where an accelerometer sample is missing, the correction is skipped.

    State: q (4), b (3). Not estimated: heading, external acceleration.
    """

    proportional_gain: float = 1.0
    """k_P, rad/s (section VI of the paper)"""
    integral_gain: float = 0.3
    """k_I, rad/s² (section VI of the paper)"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP, RELATIVE_ORIENTATION, GYROSCOPE_BIAS)
    state_size: ClassVar[int] = 7

    def prior(self, z: Measurement) -> Array:
        """Inclination of the first accelerometer sample; heading and bias zero."""
        f = z["imu/acc"]
        return namespace(f).concat([level(f), 0.0 * f], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Rotate by the bias-corrected gyroscope sample."""
        q, b = x[..., :4], x[..., 4:]
        return namespace(x).concat([multiply(q, exp(expand(self.dt, 1) * (z["imu/gyr"] - b))), b], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Correct attitude and bias by the errors of the directions for which there are valid samples."""
        xp = namespace(x)
        q, b = x[..., :4], x[..., 4:]
        e = self._error(q, z)
        q = multiply(q, exp(expand(self.proportional_gain * self.dt, 1) * e))
        return xp.concat([normalize(q), b - expand(self.integral_gain * self.dt, 1) * e], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Inclination vector, orientation and bias (rad/s), in sensor axes."""
        q = x[..., :4]
        return {"up": up_in_body(q), "relative_orientation": q, "gyroscope_bias": x[..., 4:]}

    def _error(self, q: Array, z: Measurement) -> Array:
        f, there = known(z["imu/acc"])
        e = cross(normalize(f), up_in_body(q))
        return namespace(q).where(there, e, 0.0 * e)


@dataclass(frozen=True)
class Mahony9(Mahony):
    """The same with a magnetometer; orientation in the world.

    The expected field is the measured one, rotated in the world to magnetic north (S. O. H. Madgwick, "An efficient
    orientation filter for inertial and inertial/magnetic sensor arrays", report, 2010, section 3.4, as in most
    implementations of Mahony's filter). Its error acts on all axes, so a magnetic disturbance also tilts the estimate.

    State: q (4), b (3).
    """

    declination: float = 0.0
    """of the magnetic field, rad, positive east; with 0 the heading refers to magnetic north"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP, GYROSCOPE_BIAS)

    def prior(self, z: Measurement) -> Array:
        """Inclination from the accelerometer, heading from the magnetometer, bias zero."""
        f = z["imu/acc"]
        return namespace(f).concat([align(f, z["imu/mag"], self.declination), 0.0 * f], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Orientation, inclination vector and bias (rad/s)."""
        q = x[..., :4]
        return {"orientation": q, "up": up_in_body(q), "gyroscope_bias": x[..., 4:]}

    def _error(self, q: Array, z: Measurement) -> Array:
        xp = namespace(q)
        field, there = known(z["imu/mag"])
        field = normalize(field)
        world = rotate(q, field)
        horizontal = xp.sqrt(world[..., :1] * world[..., :1] + world[..., 1:2] * world[..., 1:2])
        declination = expand(self.declination, 1) + 0.0 * horizontal
        north = xp.concat([horizontal * xp.sin(declination), horizontal * xp.cos(declination), world[..., 2:]], axis=-1)
        e = cross(field, rotate_back(q, north))
        return super()._error(q, z) + xp.where(there, e, 0.0 * e)
