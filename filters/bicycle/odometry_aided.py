r"""Roll and pitch of a bicycle from one IMU on its frame and the wheel speed, without slip and lift-off.

A filter of this package, not of a paper. The accelerometer measures gravity plus the acceleration of the bicycle, which
hides the roll in a curve. The velocity of a bicycle, however, is known, since its rear wheel rolls. With the velocity v
of the IMU and the rate ω of the frame (both as below), the point of the frame at the contact of the rear wheel, at the
lever c from the IMU, moves like a wheel that rolls without slip,

    Rᵀv + ω × c = [v_w, 0, 0] + n                                           (1)

in bicycle axes, at any roll. A thin wheel that rotates by Ω in its frame has v_hub = −(ω + Ω e₂) × (−r e₃), so the
point −r e₃ of the frame, below the hub, moves with r Ω e₁. A tilt error δ makes the integrated velocity grow by g δ t,
and (1) corrects it. This also holds in steady curves, since (1) does not involve the accelerometer.

Bicycle axes are x forward, y left, z up; the sensor is mounted nose up by α, and its samples are rotated on input.
The state is q (bicycle to a level frame), gyroscope bias b (bicycle axes), v (level frame), integrated as
:mod:`..strapdown` describes. With the error [δθ (level frame), δb, δv], c× as a matrix [c]×,

    H = [Rᵀ[v]×, [c]×, Rᵀ],   n: σ_w² = (s/Δt)²/12,  σ_y²/Δt,  σ_z²/Δt

with s the distance between two counts of the wheel encoder. Slip and bumps are correlated over time. Dividing by Δt
makes σ_y and σ_z independent of the rate; they are tuning constants rather than noises. The initial state is steady
riding: gravity is the first specific force less ω × v.

Heading (which starts at zero and drifts), wheel radius and accelerometer bias are not estimated; a lateral bias of 5 mg
causes 0.3° of roll. Where the ground changes slope under the wheel (a kerb, the foot of a ramp), the vertical row of
(1) does not hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.backend import Array, expand, namespace
from ..core.held_inputs import ridden
from ..core.matrices import block_matrix, covariance_of, diagonal_matrix, identity, vector_of, zeros
from ..core.model import Gain, Model
from ..core.quantity import GRAVITY, Channel, Measurement, Quantity
from ..core.rotation import cross, level, normalize, roll_pitch, rotate, rotate_back, skew, to_matrix, up_in_body
from ..imu.strapdown import accelerated, advance, clipped_inflation, corrected, process_noise, transition
from ..support.parameters import check_positive
from .geometry import RiderEquations, RiderGeometry

COUNTS = 1024
"""counts per turn of the wheel encoder (256 lines, quadrature)"""
LARGEST_LEAN = math.radians(60.0)
"""Beyond it the first specific force is not gravity."""
ROLL = Quantity("bicycle/roll", "angle", 1, "rad")
PITCH = Quantity("bicycle/pitch", "angle", 1, "rad")
BIAS = Quantity("bicycle_imu/gyroscope_bias", "vector", 3, "rad/s")


@dataclass(frozen=True)
class OdometryAided(RiderEquations, Model):
    """Roll (to the right positive) and pitch (nose down positive) of the bicycle, and the bias of its gyroscope.

    State: q (4), b (3), v (3), seconds since the last accelerometer sample.

    If accelerometer samples are missing for longer than ``hold``, the velocity is constant in bicycle axes up to
    ``lost_noise`` and is updated by (1), and the gyroscope alone gives the attitude. Without the wheel, the other two
    rows of (1) remain.
    """

    gyroscope_noise: float = 2e-3
    """σ_g, rad/s/√Hz; larger than in a data sheet, to cover scale and alignment errors"""
    bias_noise: float = 5e-5
    """σ_b, rad/s²/√Hz"""
    acceleration_noise: float = 0.02
    """σ_a, m/s²/√Hz"""
    wheel_step: float = 2.0 * math.pi * 0.335 / COUNTS
    """s, m: distance between two counts of the wheel encoder"""
    lateral_slip: float = 0.01
    """σ_y, m/s·√s"""
    vertical_slip: float = 0.02
    """σ_z, m/s·√s: bumps and changes of slope of the ground"""
    jump: float = 0.2
    """m/s: variances of residuals r grow by (1 + (r/jump)²)², so residuals beyond this (and one count of the wheel)
    have little weight; a wheel off the ground carries no information"""
    imu_forward: float = 0.37
    """m, of the IMU from the rear contact"""
    imu_height: float = 0.71
    """m, above the rear contact"""
    imu_tilt: float = math.radians(10.0)
    """α, rad, nose up"""
    accelerometer_range: float = 19.5
    """m/s²: samples with a component beyond this count as saturated (range 2 g)"""
    clipped_inflation: float = 300.0
    """factor on σ_a for saturated samples"""
    tilt_prior: float = 0.1
    """rad"""
    bias_prior: float = 0.02
    """rad/s (1.1 °/s): the root mean square offset of an axis of the gyroscopes on the training rides is 0.021; with a
    quarter of it, an offset of 18 °/s was never found"""
    velocity_prior: float = 0.1
    """m/s, in bicycle axes"""
    hold: float = 0.05
    """s: longest time for which the last accelerometer sample replaces missing ones"""
    lost_noise: float = 2.0
    """m/s²/√Hz: process noise of the velocity after that time"""
    gravity: float = GRAVITY
    """g, m/s²"""

    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("bicycle_imu/gyr", 3, "rad/s"),
        Channel("bicycle_imu/acc", 3, "m/s²"),
        Channel("wheel/speed", 1, "m/s"),
    )
    outputs: ClassVar[tuple[Quantity, ...]] = (ROLL, PITCH, BIAS)
    state_size: ClassVar[int] = 11
    error_size: ClassVar[int] = 9
    residual_size: ClassVar[int] = 3
    held_inputs: ClassVar = (ridden("bicycle_imu/gyr", "gyroscope_noise"),)
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("gyroscope_noise", description="process variance σ_g² of the attitude"),
        "bias": Gain("bias_noise", description="process variance σ_b² of the gyroscope bias"),
        "wheel": Gain("wheel_step", description="variance of the wheel's speed"),
        "lateral": Gain("lateral_slip", description="variance σ_y² of the slip to the side"),
        "vertical": Gain("vertical_slip", description="variance σ_z² of the motion upwards"),
    }

    def __post_init__(self) -> None:
        """Check the parameters in denominators, and that measurements have noise."""
        super().__post_init__()
        check_positive(self, "wheel_step", "lateral_slip", "vertical_slip", "jump")

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """Mounting of the IMU, and the distance between two counts of the wheel encoder."""
        forward, _, height = geometry.bicycle_imu
        return {
            "imu_forward": forward,
            "imu_height": height,
            "imu_tilt": geometry.bicycle_imu_tilt,
            "wheel_step": 2.0 * math.pi * geometry.wheel_radius / COUNTS,
        }

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Steady riding along the wheel: specific force less ω × v is gravity; heading and bias zero.

        Where that leans further than a bicycle rides (a first sample on a bump), the bicycle begins upright.
        """
        xp = namespace(z["bicycle_imu/acc"])
        rate, f = self._bicycle_axes(z["bicycle_imu/gyr"]), self._bicycle_axes(z["bicycle_imu/acc"])
        wheel, zero = z["wheel/speed"], 0.0 * f
        along = xp.concat([wheel, zero[..., :2]], axis=-1) - cross(rate, self._lever(f))
        up = f - cross(rate, along)
        length = xp.sqrt(xp.sum(up * up, axis=-1)[..., None] + 1e-30)
        fallen = xp.less(up[..., 2:3], math.cos(LARGEST_LEAN) * length)
        none, one = zero[..., :1], 1.0 + zero[..., :1]
        q = level(xp.where(fallen, xp.concat([none, none, one], axis=-1), up))
        v = rotate(q, along)
        tilt = [self.tilt_prior, self.tilt_prior, 0.0 * self.tilt_prior]
        D = covariance_of([*tilt, *[self.bias_prior] * 3, *[self.velocity_prior] * 3], zero[..., :1])
        # the velocity is known in bicycle axes, so a tilt error rotates it
        unit, none = identity(3, f), zeros(f, 3, 3)
        J = block_matrix([[unit, none, none], [none, unit, none], [-skew(v), none, to_matrix(q)]])
        return xp.concat([q, zero, v, zero[..., :1]], axis=-1), J @ D @ J.mT

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Strapdown integration; F and Q of :mod:`..strapdown`."""
        xp = namespace(x)
        q, b, v, sample = x[..., :4], x[..., 4:7], x[..., 7:10], z["bicycle_imu/acc"]
        dt = expand(self.dt, 1)
        rate, f = self._bicycle_axes(z["bicycle_imu/gyr"]), self._bicycle_axes(sample)
        after, force = advance(q, dt * (rate - b), f)
        known = xp.less(x[..., 10:11], expand(self.hold, 1))
        one = 1.0 + 0.0 * q[..., :1]
        felt = xp.where(known, one, 0.0 * one)
        F = transition(q, force, expand(self.dt, 2), felt[..., None], one[..., None])
        # A bicycle whose accelerometer is silent keeps its velocity in its own axes: it turns with the attitude, and
        # so with all errors of that. Otherwise its course would seem to tell the attitude after a gap.
        carried = rotate(after, rotate_back(q, v))
        turned, across, unit = to_matrix(after) @ to_matrix(q).mT, skew(carried), identity(3, f)
        none = 0.0 * unit
        kept = [across @ (turned - unit), expand(self.dt, 2) * (across @ to_matrix(q)), turned]
        turning = block_matrix([[unit, -expand(self.dt, 2) * to_matrix(q), none], [none, unit, none], kept])
        F = xp.where(known[..., None], F, turning)
        inflation = clipped_inflation(sample, self.accelerometer_range, self.clipped_inflation)
        spread = expand(self.acceleration_noise**2 * self.dt, 1) * inflation
        spread = xp.where(known, spread, expand(self.lost_noise**2 * self.dt, 1) + 0.0 * spread)
        Q = process_noise(self.gyroscope_noise**2 * self.dt, self.bias_noise**2 * self.dt, spread)
        coupling = xp.where(known[..., None], none, -across)
        L = block_matrix([[unit, none, none], [none, unit, none], [coupling, none, unit]])
        Q = L @ Q @ L.mT
        v = xp.where(known, accelerated(v, force, dt, self.gravity), carried)
        return xp.concat([after, b, v, x[..., 10:]], axis=-1), F, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Equation (1): wheel speed and zero slip, less the predicted velocity of the contact point."""
        xp = namespace(x)
        q, b, v, wheel = x[..., :4], x[..., 4:7], x[..., 7:10], z["wheel/speed"]
        c = self._lever(x)
        contact = rotate_back(q, v) + cross(self._bicycle_axes(z["bicycle_imu/gyr"]) - b, c)
        r = xp.concat([wheel - contact[..., :1], -contact[..., 1:]], axis=-1)
        turned = to_matrix(q).mT
        H = xp.concat([turned @ skew(v), skew(c), turned], axis=-1)
        zero = 0.0 * x[..., :1]
        variances = [(self.wheel_step / self.dt) ** 2 / 12.0, self.lateral_slip**2 / self.dt]
        variances.append(self.vertical_slip**2 / self.dt)
        usual = vector_of([self.wheel_step / self.dt, 0.0, 0.0], zero)
        far = xp.where(xp.isfinite(r), r, 0.0 * usual) / (usual + expand(self.jump, 1))
        weight = 1.0 + far * far
        return r, H, diagonal_matrix(vector_of(variances, zero) * weight * weight)

    def retract(self, x: Array, dx: Array) -> Array:
        """The attitude is corrected by a rotation in the level frame, the rest additively."""
        return corrected(x, dx)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Normalise; advance or reset the age of the accelerometer sample."""
        xp = namespace(x)
        present = xp.all(xp.isfinite(z["bicycle_imu/acc"]), axis=-1)[..., None]
        age = xp.where(present, 0.0 * x[..., 10:11], x[..., 10:11] + expand(self.dt, 1))
        return xp.concat([normalize(x[..., :4]), x[..., 4:10], age], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll, pitch (rad) and the bias in the sensor's axes (rad/s)."""
        roll, pitch = roll_pitch(up_in_body(x[..., :4]))
        bias = rotate_back(mounting(self.imu_tilt, x), x[..., 4:7])
        return {"bicycle/roll": roll[..., None], "bicycle/pitch": pitch[..., None], BIAS.name: bias}

    def _bicycle_axes(self, sample: Array) -> Array:
        """A sample of the IMU ``(..., 3)`` in bicycle axes."""
        return rotate(mounting(self.imu_tilt, sample), sample)

    def _lever(self, like: Array) -> Array:
        """Lever c ``(..., 3)`` from the IMU to the contact, bicycle axes."""
        zero = 0.0 * like[..., :1]
        return namespace(like).concat(
            [zero - expand(self.imu_forward, 1), zero, zero - expand(self.imu_height, 1)], axis=-1
        )


def mounting(tilt: Array, like: Array) -> Array:
    """Quaternion ``(..., 4)`` from the axes of a sensor to the bicycle's: nose up by ``tilt``, rad."""
    xp = namespace(like)
    half = expand(0.5 * tilt, 1) + 0.0 * like[..., :1]
    return xp.concat([xp.cos(half), 0.0 * half, -xp.sin(half), 0.0 * half], axis=-1)
