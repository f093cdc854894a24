"""Bounded motion of a device that sometimes lies still: at rest the gyroscope shows its bias.

The filter of :mod:`.bounded_motion` finds the bias of the gyroscope from the velocity alone, which takes half a minute
and never tells the part about the vertical. A device that is put down, or held still before a motion begins, tells all
three within seconds. Rest is recognised as in VQF (D. Laidig, T. Seel, Information Fusion 91, 2023, section 3.4, with
the constants given there): for 1.5 s no sample of the gyroscope differs from its low-pass by 2 °/s, and none of the
accelerometer by 0.5 m/s². Then, with the low-pass ω̄ of the gyroscope, the pseudo-measurement

    ω̄ = b + n,   var n = σ_R² / Δt   at every sample

is made beside that of the velocity. A rotation as slow and steady as this is taken for a bias only if it is about the
vertical, since otherwise gravity turns in sensor axes; what the bias may be at most bounds the harm.

The bias at rest is not that in motion, since it depends on the specific force and on the temperature. However long the
rest, the bias is therefore not known better than to a deviation σ_D: at rest it has a process noise of the density
σ_D⁴ / σ_R², with which the variance of a bias that is measured with σ_R ends at σ_D². The default is about the root
mean square of what a turn by 90° and warming by 5 K change in devices that lie, log-uniformly, between the grades
:data:`~poise.envs.sensors.assumptions.INDUSTRIAL` and :data:`~poise.envs.sensors.assumptions.CONSUMER`.

Since nothing is known of the device and of how it begins, the bias has a wider prior than there, and so has the tilt of
the first sample: an acceleration that changes the length of the specific force by d turns its direction by about d / g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..core.backend import Array, expand, namespace
from ..core.matrices import block_diagonal, identity
from ..core.model import Gain
from ..core.quantity import Channel, Measurement, Quantity
from .bounded_motion import BoundedMotion, BoundedMotion9
from .magnetic_heading import MagneticHeading


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
    rest_deviation: float = math.radians(0.05)
    """σ_D, rad/s: between the bias at rest and that in motion"""
    bias_prior: float = math.radians(1.5)
    """rad/s; a wider prior finds a large bias sooner and costs accuracy where the bias is small"""

    state_size: ClassVar[int] = 22
    residual_size: ClassVar[int] = 6
    gains: ClassVar[dict[str, Gain]] = BoundedMotion.gains | {
        "rest": Gain("rest_noise", description="variance σ_R² of the rate at rest as a measurement of the bias")
    }

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """As there, less certain of the tilt in motion; the low-passes start at the first samples."""
        xp, f, g = namespace(z["imu/acc"]), z["imu/acc"], expand(self.gravity, 1)
        x, P = super().prior(z)
        lean = (xp.sqrt(xp.sum(f * f, axis=-1, keepdims=True)) - g) / g
        none = 0.0 * lean
        P = P + block_diagonal([part[..., None] * identity(3, x) for part in (lean * lean, none, none)])
        return xp.concat([x, z["imu/gyr"], z["imu/acc"], 0.0 * x[..., :1]], axis=-1), P

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
        rested = xp.where(calm, x[..., 21:22] + dt, 0.0 * x[..., 21:22])
        return xp.concat([first, smooth, rested, x[..., 22:]], axis=-1)

    def _bias_variance(self, x: Array, z: Measurement) -> Array:
        """As there, and at rest as much as keeps its deviation at that between rest and motion."""
        xp = namespace(x)
        usual = expand(self.bias_noise**2 * self.dt, 1) + 0.0 * x[..., :1]
        known = expand(self.rest_deviation**4 / self.rest_noise**2 * self.dt, 1)
        return xp.where(self._rests(x, z), usual + known, usual)[..., 0]

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


@dataclass(frozen=True)
class RestingBoundedMotion9(MagneticHeading, RestingBoundedMotion):
    """Nine axes: outputs as of :class:`.bounded_motion.BoundedMotion9`.

    The bias about the vertical is known after a rest, so that the gyroscope keeps the heading for longer.

    State: as for six axes (22), expected norm and dip of the magnetic field (2).
    """

    channels: ClassVar[tuple[Channel, ...]] = BoundedMotion9.channels
    outputs: ClassVar[tuple[Quantity, ...]] = BoundedMotion9.outputs
    state_size: ClassVar[int] = 24
    residual_size: ClassVar[int] = 7
    gains: ClassVar[dict[str, Gain]] = BoundedMotion9.gains | RestingBoundedMotion.gains
