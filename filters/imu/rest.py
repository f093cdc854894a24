"""Bounded motion of a device that sometimes lies still: at rest the gyroscope shows its bias.

The filter of :mod:`.bounded_motion` finds the bias of the gyroscope from the velocity alone, which takes half a minute
and never tells the part about the vertical. A device that is put down, or held still before a motion begins, tells all
three within seconds. Rest is recognised as in VQF (D. Laidig, T. Seel, Information Fusion 91, 2023, section 3.4, with
the constants given there): for 1.5 s no sample of the gyroscope differs from its low-pass by 2 °/s, and none of the
accelerometer by 0.5 m/s². Then, with the low-pass ω̄ of the gyroscope, the pseudo-measurement

    ω̄ = b + n,   var n = σ_R² / Δt   at every sample

is made beside that of the velocity. A rotation as slow and steady as this is taken for a bias only if it is about the
vertical, since otherwise gravity turns in sensor axes; what the bias may be at most bounds the harm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..core.backend import Array, expand, namespace
from ..core.matrices import block_diagonal, identity
from ..core.quantity import Measurement
from .bounded_motion import BoundedMotion


@dataclass(frozen=True)
class RestingBoundedMotion(BoundedMotion):
    """Six axes: outputs as of :class:`.bounded_motion.BoundedMotion`.

    State: as there (15), low-passes of gyroscope and accelerometer (6), seconds since they last differed from a sample
    (1).
    """

    rest_noise: float = math.radians(0.03)
    """σ_R, rad/s·√s: the mean rate of one second at rest as a measurement of the bias"""
    rest_rate: float = math.radians(2.0)
    """rad/s: largest difference between a sample and its low-pass at rest"""
    rest_force: float = 0.5
    """m/s², likewise"""
    rest_smoothing: float = 0.5
    """s: time constant of the low-passes"""
    rest_time: float = 1.5
    """s after which it is rest"""
    largest_bias: float = math.radians(10.0)
    """rad/s: a faster rotation is none of a device at rest"""

    state_size: ClassVar[int] = 22
    residual_size: ClassVar[int] = 6

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """As there; the low-passes start at the first samples."""
        xp = namespace(z["imu/acc"])
        x, P = super().prior(z)
        return xp.concat([x, z["imu/gyr"], z["imu/acc"], 0.0 * x[..., :1]], axis=-1), P

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """As there."""
        after, F, Q = super().predict(x[..., :15], z, previous)
        return namespace(x).concat([after, x[..., 15:]], axis=-1), F, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """The velocity, and at rest the bias; else NaN: the update is skipped."""
        xp = namespace(x)
        r, H, R = super().residual(x, z)
        bias = xp.where(self._rests(x, z), x[..., 15:18] - x[..., 4:7], xp.nan + 0.0 * x[..., 4:7])
        unit = identity(3, x)
        of_bias = xp.concat([0.0 * unit, unit, 0.0 * unit], axis=-1)
        variance = unit * expand(self.rest_noise**2 / self.dt, 2)
        return xp.concat([r, bias], axis=-1), xp.concat([H, of_bias], axis=-2), block_diagonal([R, variance])

    def finish(self, x: Array, z: Measurement) -> Array:
        """As there; the low-passes follow the samples, and what differs from them ends the rest."""
        xp = namespace(x)
        first = super().finish(x[..., :15], z)
        dt = expand(self.dt, 1)
        share = dt / (expand(self.rest_smoothing, 1) + dt)
        both = xp.concat([z["imu/gyr"], z["imu/acc"]], axis=-1)
        known = xp.isfinite(both)
        smooth = xp.where(known, x[..., 15:21] + share * (both - x[..., 15:21]), x[..., 15:21])
        calm = self._calm(x, z)
        return xp.concat([first, smooth, xp.where(calm, x[..., 21:22] + dt, 0.0 * x[..., 21:22])], axis=-1)

    def _calm(self, x: Array, z: Measurement) -> Array:
        """Whether this sample is one of rest ``(..., 1)``; a missing one is not."""
        xp = namespace(x)
        parts = ((z["imu/gyr"], x[..., 15:18], self.rest_rate), (z["imu/acc"], x[..., 18:21], self.rest_force))
        turned, pushed = (
            xp.less(xp.sum((sample - mean) ** 2, axis=-1, keepdims=True), expand(limit**2, 1))
            for sample, mean, limit in parts
        )
        rate = xp.sum(x[..., 15:18] * x[..., 15:18], axis=-1, keepdims=True)
        return xp.logical_and(xp.logical_and(turned, pushed), xp.less(rate, expand(self.largest_bias**2, 1)))

    def _rests(self, x: Array, z: Measurement) -> Array:
        """Whether the device has been at rest for long enough ``(..., 1)``."""
        xp = namespace(x)
        return xp.logical_and(self._calm(x, z), xp.greater(x[..., 21:22], expand(self.rest_time, 1)))
