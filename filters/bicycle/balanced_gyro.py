r"""Roll, pitch and speed of a bicycle from its gyroscope alone: level on average, and balanced in its turns.

A filter of this package, not of a paper. With the rates ω of the platform (x forward, y right, z down) and ψ̇ about the
vertical, roll φ and pitch χ of a rigid body move with

    dφ/dt = ω_x + tan χ (sin φ ω_y + cos φ ω_z)                             (1)
    dχ/dt = cos φ ω_y − sin φ ω_z,    ψ̇ cos χ = sin φ ω_y + cos φ ω_z       (2)

The pseudo-measurement of :mod:`.platform_gyro` says dχ/dt = 0 at every sample. On rough ground it is wrong by more than
it tells: the derivative of (2) by φ contains the same shaking ω_y, which drives the roll away from zero. Pitch rates
are large, pitch angles are not, so here the pitch is a state, and measured as

    0 = χ + n                                                               (3)

Where the bicycle turns, a wrong roll becomes a wrong pitch. A bicycle has a second constraint. It does not fall over,
so gravity and the centripetal acceleration balance about the line of its wheels, not at every instant but in the mean
of a second, marked by a bar (steady turning on thin tyres, as in V. Cossalter, "Motorcycle Dynamics"):

    tan φ̄ = u ψ̇̄ + n,    u = v / g                                           (4)

The speed v is not measured. It is a state: a bicycle that leans and turns shows it, since (1) knows all changes of the
roll. Where it does neither, (4) says that the bicycle is upright, whatever u is.

State: φ, χ, gyroscope bias (3), u, and the means of ψ̇ and φ, which follow with the time constant T. The noises are
no noises of a sample: (3) stands for slopes of the road, (4) for a rider who leans beside the bicycle, gusts and what
balancing takes. (4) does not hold for a bicycle that is leaned against something or on which a foot is on the ground.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ..core.backend import Array, constant, expand, namespace
from ..core.held_inputs import ridden
from ..core.matrices import block_matrix, covariance_of, diagonal, identity, zero_where_known
from ..core.model import Gain, Model
from ..core.quantity import DEG, GRAVITY, Measurement, Quantity
from ..core.rotation import rotate_back, wrap
from ..support.parameters import check_positive
from .geometry import RiderEquations
from .odometry_aided import BIAS, PITCH, mounting
from .platform_gyro import PLATFORM_GYROSCOPE, ROLL
from .two_gyro.kinematics import SIGNS, platform_rate

SPEED = Quantity("balanced-gyro/speed", "vector", 1, "m/s")
"""g u: that of a thin wheel below a rider who does not lean beside the bicycle."""


@dataclass(frozen=True)
class BalancedGyro(RiderEquations, Model):
    """Roll (to the right positive), pitch (nose down positive), bias of the gyroscope, and speed.

    Noises were chosen on simulated rides of training riders with the papers' sensors, by the mean error of the roll and
    its NEES together, what the bias and the speed may do also with sensors of phone grade and riders who stop and go.
    """

    gyroscope_noise: float = 0.13 * DEG
    """σ_g, rad/s/√Hz: larger than in a data sheet, to cover scale and alignment errors"""
    bias_noise: float = 0.015 * DEG
    """σ_b, rad/s²/√Hz"""
    pitch_noise: float = 2.3 * DEG
    """of (3), rad √s: standard deviation of the mean over one second"""
    balance_noise: float = 0.85 * DEG
    """of (4), rad √s, likewise"""
    speed_noise: float = 0.3
    """m/s/√s: changes of the speed"""
    averaging: float = 1.0
    """T, s"""
    roll_prior: float = 5.0 * DEG
    """rad: standard deviation of φ at the start"""
    pitch_prior: float = 2.0 * DEG
    """rad"""
    bias_prior: float = 2.0 * DEG
    """rad/s: standard deviation at the start; gyroscopes of phone grade have more, those of the papers less"""
    initial_speed: float = 4.0
    """m/s"""
    speed_prior: float = 3.0
    """m/s: standard deviation at the start"""
    turning_prior: float = 11.0 * DEG
    """rad/s: standard deviation of the mean of ψ̇ at the start"""
    imu_tilt: float = 10.0 * DEG
    """rad: tilt of the gyroscope, nose up"""
    gravity: float = GRAVITY
    """g, m/s²"""

    channels: ClassVar = (PLATFORM_GYROSCOPE,)
    outputs: ClassVar[tuple[Quantity, ...]] = (ROLL, PITCH, BIAS, SPEED)
    state_size: ClassVar[int] = 8
    error_size: ClassVar[int] = 8
    residual_size: ClassVar[int] = 2
    error_parts: ClassVar[Mapping[str, tuple[int, int]]] = {ROLL.name: (0, 1), PITCH.name: (1, 2)}
    held_inputs: ClassVar = (ridden("bicycle_imu/gyr", "gyroscope_noise"),)
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("gyroscope_noise", description="process variance σ_g² of roll and pitch"),
        "level": Gain("pitch_noise", description="variance of the pitch about level"),
        "balance": Gain("balance_noise", description="variance of the roll about that of a balanced turn"),
    }

    def __post_init__(self) -> None:
        """Check the parameters in denominators, and that measurements have noise."""
        super().__post_init__()
        check_positive(self, "pitch_noise", "balance_noise", "averaging", "gravity", "gyroscope_noise")

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Upright, level, straight ahead, at a usual speed."""
        known = zero_where_known(z["bicycle_imu/gyr"])
        u, spread = self.initial_speed / self.gravity, self.speed_prior / self.gravity
        x = namespace(known).concat([*[known] * 5, expand(u, 1) + known, known, known], axis=-1)
        deviations = [self.roll_prior, self.pitch_prior, *[self.bias_prior] * 3, spread]
        return x, covariance_of([*deviations, self.turning_prior, self.roll_prior], known)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equations (1) and (2); both means move towards what they are the mean of."""
        xp, T, share = namespace(x), expand(self.dt, 1), expand(1.0 / self.averaging, 1)
        phi, chi, mean_turning, mean_roll = x[..., :1], x[..., 1:2], x[..., 6:7], x[..., 7:8]
        rate = platform_rate(z["bicycle_imu/gyr"], self.imu_tilt) - x[..., 2:5]
        s, c, sec, tan = xp.sin(phi), xp.cos(phi), 1.0 / xp.cos(chi), xp.tan(chi)
        across = s * rate[..., 1:2] + c * rate[..., 2:]  # ψ̇ cos χ
        pitching = c * rate[..., 1:2] - s * rate[..., 2:]
        zero, one = 0.0 * phi, 1.0 + 0.0 * phi
        angles = [rate[..., :1] + tan * across, pitching]
        means = [share * (sec * across - mean_turning), share * (phi - mean_roll)]
        moved = x + T * xp.concat([*angles, *[zero] * 4, *means], axis=-1)
        # the derivative of ``across`` by φ is the pitch rate, and that of the pitch rate is −``across``
        rows = [
            [tan * pitching, sec * sec * across, -one, -tan * s, -tan * c, zero, zero, zero],
            [-across, zero, zero, -c, s, zero, zero, zero],
            *[[zero] * 8] * 4,
            [
                *[share * sec * each for each in (pitching, tan * across, zero, -s, -c)],
                *[zero, -share * one, zero],
            ],
            [share * one, *[zero] * 6, -share * one],
        ]
        G = block_matrix([[each[..., None] for each in row] for row in rows])
        angle, bias = self.dt * self.gyroscope_noise**2, self.dt * self.bias_noise**2
        speed = self.dt * (self.speed_noise / self.gravity) ** 2
        Q = diagonal([angle, angle, bias, bias, bias, speed, 0.0 * self.dt, 0.0 * self.dt], zero)
        return moved, identity(8, x) + expand(self.dt, 2) * G, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Equations (3) and (4) at a sample; without one it is NaN."""
        xp = namespace(x)
        seen = xp.all(xp.isfinite(z["bicycle_imu/gyr"]), axis=-1)[..., None]
        chi, u, turning, roll = x[..., 1:2], x[..., 5:6], x[..., 6:7], x[..., 7:8]
        zero, one = 0.0 * chi, 1.0 + 0.0 * chi
        r = xp.where(seen, xp.concat([-chi, u * turning - xp.tan(roll)], axis=-1), xp.nan)
        rows = [
            [zero, one, *[zero] * 6],
            [*[zero] * 5, -turning, -u, 1.0 / xp.cos(roll) ** 2],
        ]
        H = block_matrix([[each[..., None] for each in row] for row in rows])
        return r, H, diagonal([self.pitch_noise**2 / self.dt, self.balance_noise**2 / self.dt], zero)

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll and pitch (rad), the bias in the sensor's axes (rad/s), the speed (m/s)."""
        return {
            ROLL.name: wrap(x[..., :1]),
            PITCH.name: -wrap(x[..., 1:2]),
            BIAS.name: rotate_back(mounting(self.imu_tilt, x), x[..., 2:5] * constant(SIGNS, x)),
            SPEED.name: expand(self.gravity, 1) * x[..., 5:6],
        }
