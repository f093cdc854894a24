r"""Baselines for the two-gyroscope filter: roll from the platform's gyroscope alone, and integration alone.

While a bicycle does not pitch, (5) of the paper (:mod:`.two_gyro`) relates two rates of its gyroscope to its roll,

    0 = cos φ δω_y − sin φ δω_z,    dφ/dt = δω_x

This needs neither the body nor the camera. The comparison with this filter shows what they contribute.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.backend import Array, constant, expand, namespace
from ..core.held_inputs import ridden
from ..core.matrices import covariance_of, diagonal, zero_where_known
from ..core.model import Gain, Model, Recurrence
from ..core.quantity import DEG, Channel, Measurement, Quantity
from ..core.rotation import conjugate, exp, from_euler_xyz, multiply, normalize, to_euler_zyx
from ..support.parameters import check_positive
from .geometry import RiderEquations
from .relative_sensor import relative_angles
from .two_gyro.kinematics import SIGNS, level_constraint, platform_rate
from .two_gyro.truth import true_angles

ROLL = Quantity("bicycle/roll", "angle", 1, "rad")
"""Right positive."""
PLATFORM_GYROSCOPE = Channel("bicycle_imu/gyr", 3, "rad/s")


@dataclass(frozen=True)
class PlatformGyro(RiderEquations, Model):
    """Extended Kalman filter on (8) with (5) as pseudo-measurement: the platform's gyroscope alone.

    State: φ, bias (3, paper's axes: x forward, y right, z down). The noise of the pseudo-measurement covers
    the gyroscope and the pitch rate of the road. It is modelled as white, so ``pitch_rate_noise`` must be large.
    """

    gyroscope_noise: float = 0.05 * DEG
    """rad/s/√Hz (gyroscope 605)"""
    bias_drift: float = 0.15 * DEG
    """rad/s: standard deviation of the Markov process (2)"""
    bias_time: float = 1800.0
    """s"""
    pitch_rate_noise: float = 1.0 * DEG
    """rad/s/√Hz: pitch rate and other violations of (5)"""
    roll_rate_noise: float = 0.0
    """rad/s/√Hz on φ: the neglected term sin χ dψ/dt"""
    process_scale: float = 1.0
    """factor on all standard deviations of the process noise"""
    roll_prior: float = 10.0 * DEG
    """rad: standard deviation of φ at the start"""
    initial_roll: float = 0.0
    """rad"""
    bias_prior: float = 0.15 * DEG
    """rad/s: standard deviation at the start"""
    imu_tilt: float = 10.0 * DEG
    """rad: tilt of the gyroscope, nose up"""

    channels: ClassVar[tuple[Channel, ...]] = (PLATFORM_GYROSCOPE,)
    outputs: ClassVar[tuple[Quantity, ...]] = (ROLL, Quantity("platform-gyro/bias", "vector", 3, "rad/s"))
    state_size: ClassVar[int] = 4
    error_size: ClassVar[int] = 4
    residual_size: ClassVar[int] = 1
    error_parts: ClassVar[Mapping[str, tuple[int, int]]] = {ROLL.name: (0, 1)}
    held_inputs: ClassVar = (ridden("bicycle_imu/gyr", "gyroscope_noise"),)
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("process_scale", description="process variance"),
        "measurement": Gain(
            "pitch_rate_noise",
            description="variance of what violates the pseudo-measurement",
            bounds=(0.1 * DEG, 100.0 * DEG),
        ),
    }

    def __post_init__(self) -> None:
        """Check the parameters in denominators."""
        super().__post_init__()
        check_positive(self, "gyroscope_noise", "bias_time")

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """The given roll, no bias."""
        known = zero_where_known(z["bicycle_imu/gyr"])
        x = namespace(known).concat([expand(self.initial_roll, 1) + known, known, known, known], axis=-1)
        return x, covariance_of([self.roll_prior, *[self.bias_prior] * 3], known)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equation (8); biases as in (2)."""
        xp, dt, zero = namespace(x), expand(self.dt, 1), 0.0 * x[..., :1]
        # dφ/dt = δω_x (8), which depends on the bias of x only
        rate = platform_rate(z["bicycle_imu/gyr"], self.imu_tilt)[..., :1] - x[..., 1:2]
        kept = 1.0 - self.dt / self.bias_time
        moved = xp.concat([x[..., :1] + dt * rate, expand(kept, 1) * x[..., 1:]], axis=-1)
        coupling = constant([[0.0, -1.0, 0.0, 0.0], *[[0.0] * 4] * 3], x) * expand(self.dt, 2)
        F = diagonal([1.0, kept, kept, kept], zero) + coupling
        angle = self.dt * (self.gyroscope_noise**2 + self.roll_rate_noise**2)
        scale = self.process_scale**2
        bias = 2.0 * self.dt * self.bias_drift**2 / self.bias_time
        return moved, F, diagonal([scale * angle, *[scale * bias] * 3], zero)

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """0 − (cos φ δω_y − sin φ δω_z); without a sample it is NaN."""
        xp = namespace(x)
        rate = platform_rate(z["bicycle_imu/gyr"], self.imu_tilt) - x[..., 1:]
        value, by_angle, by_rate = level_constraint(x[..., :1], rate)
        H = xp.concat([by_angle, -by_rate], axis=-1)[..., None, :]
        variance = (self.gyroscope_noise**2 + self.pitch_rate_noise**2) / self.dt
        return -value, H, diagonal([variance], 0.0 * x[..., :1])

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll; bias in bicycle axes (x forward, y left, z up)."""
        return {"bicycle/roll": x[..., :1], "platform-gyro/bias": x[..., 1:] * constant(SIGNS, x)}


@dataclass(frozen=True)
class TwoGyroIntegration(RiderEquations, Recurrence):
    """Both gyroscopes integrated, from the first frame of the camera and a given roll; there is no measurement update.

    The rotation vector of each interval is exact if the axis of rotation is constant within the interval.

    State: quaternion of the bicycle to a frame that is level at the start (4), of the body to the bicycle (4).
    """

    initial_roll: float = 0.0
    """rad: of the bicycle at the start"""
    imu_tilt: float = 10.0 * DEG
    """rad: tilt of the platform's gyroscope, nose up"""

    channels: ClassVar[tuple[Channel, ...]] = (
        PLATFORM_GYROSCOPE,
        Channel("trunk_imu/gyr", 3, "rad/s"),
        Channel("relative/orientation", 4, "1"),
    )
    outputs: ClassVar[tuple[Quantity, ...]] = (ROLL, Quantity("two-gyro/relative_angles", "angle", 3, "rad"))
    state_size: ClassVar[int] = 8

    def prior(self, z: Measurement) -> Array:
        """The given roll, zero pitch, and the orientation from the camera."""
        camera = z["relative/orientation"]
        known = zero_where_known(*(z[channel.name] for channel in self.channels))
        roll = from_euler_xyz(expand(self.initial_roll, 0) + known[..., 0], known[..., 0], known[..., 0])
        return namespace(camera).concat([roll, camera + known], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Rotate both by the rotation vectors of the interval."""
        dt = expand(self.dt, 1)
        platform = platform_rate(z["bicycle_imu/gyr"], self.imu_tilt)
        turn = exp(dt * platform * constant(SIGNS, x))
        body = exp(dt * z["trunk_imu/gyr"])
        relative = multiply(conjugate(turn), multiply(x[..., 4:], body))
        return namespace(x).concat([normalize(multiply(x[..., :4], turn)), normalize(relative)], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll, and the relative angles in the paper's axes."""
        return {
            "bicycle/roll": to_euler_zyx(x[..., :4])[2][..., None],
            "two-gyro/relative_angles": relative_angles(x[..., 4:]),
        }

    def truth(self, truth: Mapping[str, Any]) -> dict[str, Any]:
        """Roll and relative angles, from the orientations of bicycle and trunk."""
        orientations = {"bicycle/orientation", "trunk/orientation"}
        return true_angles(truth, imu_tilt=self.imu_tilt) if orientations <= set(truth) else {}
