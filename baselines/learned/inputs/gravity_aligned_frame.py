"""Front end of the learned estimator: samples in a gravity-aligned frame, accumulated over short intervals.

In sensor axes gravity rotates with the hand, and a network would have to learn strapdown integration first. In a frame
that the gyroscope keeps level, gravity is constant, and only the tilt of the frame remains to be learned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ....filters.core.backend import Array, constant, expand, namespace
from ....filters.core.model import Recurrence
from ....filters.core.quantity import (
    ACCELEROMETER,
    GYROSCOPE,
    RELATIVE_ORIENTATION,
    STANDARD_GRAVITY,
    Channel,
    Measurement,
    Quantity,
)
from ....filters.core.rotation import cross, exp, level, multiply, normalize, rotate, rotate_back

VECTORS = 6
"""Features that are vectors in the gravity-aligned frame; they rotate with its heading."""
SCALARS = 4
"""Features that do not."""
FEATURES = Quantity("features", "vector", 3 * VECTORS + SCALARS, "1")
"""Input of the network for an interval: first the vectors, then the scalars, all of the order of one."""
DUE = Quantity("due", "vector", 1, "1")
"""1 at the sample that ends an interval of the network, else 0."""
VERTICAL = [0.0, 0.0, 1.0]


@dataclass(frozen=True)
class GravityAlignedFrame(Recurrence):
    r"""A gravity-aligned frame from gyroscope and accelerometer by an observer with fixed gains, and features in it.

    Like :class:`~poise.filters.imu.bounded_motion.BoundedMotion`, without covariance and so a tenth of its work: the
    velocity v, the leaky integral of the specific force f, is attributed to errors of tilt and bias,

        q̇ = ½ q ⊗ (ω − b) + ½ (k_θ v × e₃) ⊗ q,   v̇ = q f q* − g e₃ − k_v v,   ḃ = −k_b q* (v × e₃) q

    The gains are those in which the Kalman filter with its published settings ends, k_θ = σ_g / σ_V,
    k_v² = 2 g k_θ + (σ_a / σ_V)², except that of the bias, which is chosen larger, to settle within a trial. The last
    sample replaces missing ones; after ``hold`` without the accelerometer all integrals of force are reset.

    Heading is that of the start, drifting. State: q (4), b (3), v (3), f in the frame (3), its leaking integrals over
    0.25 s and 4 s (6), sums over the interval of force and rate (6), of their squares and of | ‖f‖ − g | (3), length
    and clock of the interval (2), youth (1), age of the accelerometer sample (1).
    """

    interval: float = 0.04
    """s between updates of the network; an interval ends at the sample nearest to its end"""
    tilt_gain: float = 0.025
    """k_θ, rad/m"""
    velocity_gain: float = 0.74
    """k_v, 1/s"""
    bias_gain: float = 5e-4
    """k_b, rad/(m s)"""
    fast_leak: float = 0.25
    """s"""
    slow_leak: float = 4.0
    """s"""
    settling: float = 10.0
    """s: time constant of the youth, which is 1 at the start and indicates the initial transient to the network"""
    hold: float = 0.05
    """s: longest time for which the last accelerometer sample replaces missing ones"""
    gravity: float = STANDARD_GRAVITY
    """g, m/s²"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (RELATIVE_ORIENTATION, FEATURES, DUE)
    state_size: ClassVar[int] = 32

    def prior(self, z: Measurement) -> Array:
        """Inclination of the first accelerometer sample; the first interval begins."""
        f = z["imu/acc"]
        one = 1.0 + 0.0 * f[..., :1]
        return namespace(f).concat([level(f), *[0.0 * f] * 8, 0.0 * f[..., :2], one, 0.0 * one], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Rotate by the gyroscope; a new interval begins if the last sample ended one."""
        xp = namespace(x)
        dt = expand(self.dt, 1)
        q, b = x[..., :4], x[..., 4:7]
        rate = z["imu/gyr"] - b
        force = rotate(multiply(q, exp(0.5 * dt * rate)), z["imu/acc"])
        q = normalize(multiply(q, exp(dt * rate)))
        due = self._due(x)
        sums = xp.where(due, 0.0 * x[..., 19:29], x[..., 19:29])
        clock = xp.where(due, x[..., 29:30] - expand(self.interval, 1), x[..., 29:30])
        turned = dt * rotate(q, rate)
        swing = dt * xp.sum(rate * rate, axis=-1, keepdims=True)
        sums = xp.concat(
            [sums[..., :3], sums[..., 3:6] + turned, sums[..., 6:7], sums[..., 7:8] + swing, sums[..., 8:9]], axis=-1
        )
        length = xp.where(due, 0.0 * clock, x[..., 28:29]) + dt
        youth = x[..., 30:31] * (1.0 - dt / expand(self.settling, 1))
        tail = [sums, length, clock + dt, youth, x[..., 31:] + dt]
        return xp.concat([q, x[..., 4:10], force, x[..., 13:19], *tail], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Integrate the force, correct tilt and bias, add to the sums."""
        xp = namespace(x)
        dt, f, g = expand(self.dt, 1), z["imu/acc"], expand(self.gravity, 1)
        none = 0.0 * x[..., :1]
        brought = xp.all(xp.isfinite(f), axis=-1)[..., None]
        age = xp.where(brought, none, x[..., 31:])
        known = xp.where(xp.less(age, expand(self.hold, 1)), 1.0 + none, none)
        a = known * (x[..., 10:13] - g * constant(VERTICAL, x))
        size = xp.sqrt(xp.sum(x[..., 10:13] * x[..., 10:13], axis=-1, keepdims=True))
        q, b = x[..., :4], x[..., 4:7]
        v = known * (x[..., 7:10] + dt * (a - expand(self.velocity_gain, 1) * x[..., 7:10]))
        blame = dt * cross(v, constant(VERTICAL, x) + 0.0 * v)
        q = normalize(multiply(exp(expand(self.tilt_gain, 1) * blame), q))
        b = b - expand(self.bias_gain, 1) * rotate_back(q, blame)
        fast = known * (x[..., 13:16] + dt * (a - x[..., 13:16] / expand(self.fast_leak, 1)))
        slow = known * (x[..., 16:19] + dt * (a - x[..., 16:19] / expand(self.slow_leak, 1)))
        squares = x[..., 25:26] + dt * xp.sum(a * a, axis=-1, keepdims=True)
        excesses = x[..., 27:28] + dt * known * xp.abs(size - g)
        sums = [x[..., 19:22] + dt * a, x[..., 22:25], squares, x[..., 26:27], excesses]
        return xp.concat([q, b, v, x[..., 10:13], fast, slow, *sums, x[..., 28:31], age], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Attitude of the frame; features of the interval so far; whether this sample ends it."""
        xp = namespace(x)
        q, b, v = x[..., :4], x[..., 4:7], x[..., 7:10]
        length = xp.where(xp.greater(x[..., 28:29], 0.0), x[..., 28:29], 1.0 + 0.0 * x[..., 28:29])
        mean = x[..., 19:28] / length
        features = [
            mean[..., :3] / 5.0,
            v / 0.5,
            x[..., 13:16],
            x[..., 16:19] / 4.0,
            mean[..., 3:6] / 3.0,
            20.0 * rotate(q, b),
            xp.log(1e-3 + mean[..., 6:7]) / 4.0,
            xp.log(1e-4 + mean[..., 7:8]) / 4.0,
            xp.log(1e-2 + mean[..., 8:9]) / 3.0,
            x[..., 30:31],
        ]
        due = xp.where(self._due(x), 1.0 + 0.0 * length, 0.0 * length)
        return {"relative_orientation": q, "features": xp.concat(features, axis=-1), "due": due}

    def _due(self, x: Array) -> Array:
        """Whether the interval ends at this sample ``(..., 1)``: of all samples it is the nearest to its end."""
        return namespace(x).greater(x[..., 29:30], expand(self.interval - 0.5 * self.dt, 1))
