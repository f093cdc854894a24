r"""Methods without covariance for every comparison: gyroscope alone, accelerometer alone, and Mahony's.

None of them is tuned to the data at hand: integration and tilt have no constant, Mahony's filters keep the published
gains.
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
    """The gyroscope alone, from an inclination that the first accelerometer sample gives; heading zero at the start.

    Each sample is taken as the mean rate of the interval that it ends, which one rotation vector integrates exactly if
    the axis stays. The error is that of the first sample, plus what bias and noise of the gyroscope add up to.

    State: q (4).
    """

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP, RELATIVE_ORIENTATION)
    state_size: ClassVar[int] = 4

    def prior(self, z: Measurement) -> Array:
        """Inclination of the first accelerometer sample."""
        return level(z["imu/acc"])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Turn by the rotation vector of the interval."""
        return normalize(multiply(x, exp(expand(self.dt, 1) * z["imu/gyr"])))

    def pose(self, x: Array) -> dict[str, Array]:
        """Upward vertical and orientation."""
        return {"up": up_in_body(x), "relative_orientation": x}


@dataclass(frozen=True)
class Tilt(Recurrence):
    """The direction of each accelerometer sample: right at rest, and wrong by the acceleration in motion.

    A missing sample is replaced by the last one.

    State: the upward vertical in sensor coordinates (3).
    """

    channels: ClassVar[tuple[Channel, ...]] = (ACCELEROMETER,)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP,)
    state_size: ClassVar[int] = 3

    def prior(self, z: Measurement) -> Array:
        """Direction of the first sample."""
        return normalize(z["imu/acc"])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Nothing is known of the motion."""
        return x

    def finish(self, x: Array, z: Measurement) -> Array:
        """Direction of the sample, if there is one (free fall has none)."""
        xp = namespace(x)
        up = normalize(z["imu/acc"])
        return xp.where(xp.isfinite(up), up, x)

    def pose(self, x: Array) -> dict[str, Array]:
        """The upward vertical."""
        return {"up": x}


@dataclass(frozen=True)
class Mahony(Recurrence):
    """Explicit complementary filter with bias, six axes.

    R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear Complementary Filters on the Special Orthogonal Group", IEEE
    Transactions on Automatic Control 53(5), 2008, doi 10.1109/TAC.2008.923738, equation (32): with the measured and the
    expected direction v, v̂ in sensor axes,

        e = v × v̂,   q̇ = ½ q ⊗ (ω − b + k_P e),   ḃ = −k_I e

    in two steps a sample, the rotation by the gyroscope and the correction; gains are those of continuous time, so the
    filter is the same at any rate. Where an accelerometer sample is missing, the correction is skipped.

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
        """Turn by the gyroscope less its bias."""
        q, b = x[..., :4], x[..., 4:]
        return namespace(x).concat([multiply(q, exp(expand(self.dt, 1) * (z["imu/gyr"] - b))), b], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Correct attitude and bias by the error of the directions, as far as there are samples."""
        xp = namespace(x)
        q, b = x[..., :4], x[..., 4:]
        e = self._error(q, z)
        q = multiply(q, exp(expand(self.proportional_gain * self.dt, 1) * e))
        return xp.concat([normalize(q), b - expand(self.integral_gain * self.dt, 1) * e], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Upward vertical, orientation and bias (rad/s), in sensor coordinates."""
        q = x[..., :4]
        return {"up": up_in_body(q), "relative_orientation": q, "gyroscope_bias": x[..., 4:]}

    def _error(self, q: Array, z: Measurement) -> Array:
        f, there = known(z["imu/acc"])
        e = cross(normalize(f), up_in_body(q))
        return namespace(q).where(there, e, 0.0 * e)


@dataclass(frozen=True)
class Mahony9(Mahony):
    """The same with a magnetometer; orientation in the world.

    The expected field is the measured one, turned in the world to magnetic north (S. O. H. Madgwick, "An efficient
    orientation filter for inertial and inertial/magnetic sensor arrays", report, 2010, section 3.4, as in most programs
    that bear Mahony's name). It enters like the vertical, so a magnetic disturbance also tilts the estimate.

    State: q (4), b (3).
    """

    declination: float = 0.0
    """of the magnetic field, rad, positive east; 0 takes magnetic for geographic north"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP, GYROSCOPE_BIAS)

    def prior(self, z: Measurement) -> Array:
        """Inclination from the accelerometer, heading from the magnetometer, bias zero."""
        f = z["imu/acc"]
        return namespace(f).concat([align(f, z["imu/mag"], self.declination), 0.0 * f], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Orientation, upward vertical and bias (rad/s)."""
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
