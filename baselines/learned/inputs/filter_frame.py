"""Features in the level frame of a Kalman filter, and of the magnetic field where the filter reads one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ....filters.core.backend import Array, expand, namespace
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import ACCELEROMETER, GYROSCOPE, MAGNETOMETER, Channel, Measurement, Quantity
from ....filters.core.rotation import exp, multiply, normalize, rotate
from ....filters.imu.magnetic_heading import known, norm_and_dip
from .gravity_aligned_frame import DUE, FEATURES, GravityAlignedFrame

ATTITUDE = Channel("filter/orientation", 4, "1")
BIAS = Channel("filter/gyroscope_bias", 3, "rad/s")
TILT_STD = Channel("filter/tilt_std", 1, "rad")
"""Outputs of a filter, as channels of :class:`FilterFrame`."""
FILTERED = Quantity("features", "vector", FEATURES.size + 1, "1")
"""The features of :class:`GravityAlignedFrame` and the logarithm of the filter's deviation."""


@dataclass(frozen=True)
class FilterFrame(GravityAlignedFrame):
    """The features of its base class in the level frame of a filter, whose outputs it reads as channels."""

    tilt_gain: float = 0.0
    """the filter corrects the tilt"""
    bias_gain: float = 0.0
    """and the bias"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER, ATTITUDE, BIAS, TILT_STD)
    outputs: ClassVar[tuple[Quantity, ...]] = (*GravityAlignedFrame.outputs[:1], FILTERED, DUE)
    state_size: ClassVar[int] = 33

    def prior(self, z: Measurement) -> Array:
        """The filter's attitude at its first sample."""
        xp, x = namespace(z["imu/acc"]), super().prior(z)
        return xp.concat([z[ATTITUDE.name], z[BIAS.name], x[..., 7:], xp.log(z[TILT_STD.name])], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """The attitude of the filter; the force in the middle of the interval that ends there."""
        xp = namespace(x)
        q, b = z[ATTITUDE.name], z[BIAS.name]
        moved = super().predict(xp.concat([q, b, x[..., 7:32]], axis=-1), z, previous)
        middle = multiply(q, exp(-0.5 * self.dt * (z["imu/gyr"] - b)))
        force = rotate(middle, z["imu/acc"])
        spread = xp.log(z[TILT_STD.name] + 1e-6)
        return xp.concat([q, b, moved[..., 7:10], force, moved[..., 13:], spread], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Integrals and sums."""
        return namespace(x).concat([super().finish(x[..., :32], z), x[..., 32:]], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Attitude of the frame, features, whether the interval ends."""
        xp, pose = namespace(x), super().pose(x[..., :32])
        return {**pose, "features": xp.concat([pose["features"], 0.25 * x[..., 32:33] + 1.0], axis=-1)}


@dataclass(frozen=True)
class FieldFrame(FilterFrame):
    """As its base class, and how the magnetic field in that frame differs from what it was.

    Four more features: norm (logarithm) and dip less their means over ``field_time``, how far the direction swings from
    its mean over ``field_swing``, and the share of samples that came. None depends on heading or unit of the field.

    State: as there (33), means of norm, dip and direction (5), sums over the interval of the differences (3) and of the
    samples (1).
    """

    field_time: float = 20.0
    """s"""
    field_swing: float = 1.0
    """s"""

    channels: ClassVar[tuple[Channel, ...]] = (*FilterFrame.channels, MAGNETOMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (
        *GravityAlignedFrame.outputs[:1], Quantity("features", "vector", FILTERED.size + 4, "1"), DUE,
    )  # fmt: skip
    state_size: ClassVar[int] = 42

    def prior(self, z: Measurement) -> Array:
        """The means are those of the first sample."""
        x = super().prior(z)
        found = _norm_dip_direction(x[..., :4], z["imu/mag"])
        return namespace(x).concat([x, found, 0.0 * found[..., :4]], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """A new interval begins if the last sample ended one."""
        xp = namespace(x)
        sums = xp.where(self._due(x), 0.0 * x[..., 38:], x[..., 38:])
        return xp.concat([super().predict(x[..., :33], z, previous), x[..., 33:38], sums], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Means and sums, of samples that came."""
        xp = namespace(x)
        field, there = known(z["imu/mag"])
        found, slow = _norm_dip_direction(x[..., :4], field), x[..., 33:38]
        swing = found[..., 2:] - slow[..., 2:]
        far = xp.sqrt(xp.sum(swing * swing, axis=-1, keepdims=True) + 1e-12)
        difference = xp.concat([found[..., :2] - slow[..., :2], far, 1.0 + 0.0 * far], axis=-1)
        dt = expand(self.dt, 1)
        followed = [
            (dt / (dt + expand(time, 1))) * (found[..., part] - slow[..., part])
            for time, part in ((self.field_time, slice(0, 2)), (self.field_swing, slice(2, 5)))
        ]
        moved = xp.where(there, slow + xp.concat(followed, axis=-1), slow)
        sums = xp.where(there, x[..., 38:] + difference, x[..., 38:])
        return xp.concat([super().finish(x[..., :33], z), moved, sums], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """As there, with the features of the field."""
        xp, pose = namespace(x), super().pose(x)
        count = x[..., 41:42]
        means = x[..., 38:41] / xp.where(xp.greater(count, 0.0), count, 1.0 + 0.0 * count)
        share = count * expand(self.dt / self.interval, 1)
        of_field = [means[..., :2], xp.log(0.01 + means[..., 2:]) / 3.0 + 1.0, share]
        return {**pose, "features": xp.concat([pose["features"], *of_field], axis=-1)}


def _norm_dip_direction(q: Array, field: Array) -> Array:
    """Logarithm of the norm, dip (rad) and direction in the level frame of a field in sensor axes, ``(..., 5)``."""
    xp, both = namespace(q), norm_and_dip(q, field)
    return xp.concat([xp.log(both[..., :1] + 1e-9), both[..., 1:], rotate(q, normalize(field))], axis=-1)


def frame_of(kalman: KalmanFilter) -> type[FilterFrame]:
    """The frame for a filter of six or nine axes."""
    return FieldFrame if MAGNETOMETER in kalman.channels else FilterFrame
