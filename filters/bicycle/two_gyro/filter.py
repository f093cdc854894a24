r"""Roll of a bicycle and attitude of its rider's trunk from two gyroscopes and a camera, without drift.

Y. Zhang, K. Chen, J. Yi and colleagues, drift-free attitude estimation of a rigid body on a moving platform from two
gyroscopes and relative measurements; equation numbers are the paper's. There is no accelerometer. The roll is
observable while the platform turns because it does not pitch (:mod:`.two_gyro.kinematics`).

State: φ, θ (3), biases of the body's gyroscope (3) and of the platform's (x and z in Σ2, all three in Σ1); yaw is not
estimated. All rates below are bias-corrected, x(k+1) = x(k) + T [dφ/dt, dθ/dt, −b/τ] (23), and the process covariance
is Q = T² C (24), (25) with

    C = blkdiag(Â C_vh Âᵀ + D̂ C_vp D̂ᵀ, σ_uh² 1, σ_up² 1),    Â = [0; A],  D̂ = [1 0; D]

where C_v is the variance of one sample of a gyroscope. Parameters are densities, which hold at any rate: C_v = σ²/T.
A sample is the mean rate of the interval that it ends, so the sample of k propagates the state from k−1 to k.

Errata and differences: the paper uses the sample of k−1; (26) has Â₃₃ and D̂₄₃ instead of D̂₃₂ and D̂₄₂; the second
variance of the platform's biases in (25) is that of z; Q is T² C, and (27) lacks the power of T. Σ2 is exact only
without pitch, not "without any approximation". The paper gives neither noises nor T nor a prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self

from ...core.backend import Array, constant, expand, namespace
from ...core.held_inputs import HeldInput, ridden
from ...core.matrices import (
    block_diagonal,
    block_matrix,
    covariance_of,
    diagonal,
    identity,
    times,
    vector_of,
    zero_where_known,
    zeros,
)
from ...core.model import Gain, Model
from ...core.quantity import DEG, Channel, Measurement, Quantity
from ...core.rotation import rotate_back, wrap
from ...support.parameters import check_positive
from ..geometry import Point, RiderEquations, RiderGeometry
from ..platform_gyro import ROLL
from ..relative_sensor import MarkerPlaces, marker_distances, relative_angles, relative_orientation
from .kinematics import (
    SIGNS,
    Platform,
    body_rate_derivative,
    body_rate_matrix,
    in_paper_axes,
    level_constraint,
    platform_rate,
    platform_rate_derivative,
    platform_rate_matrix,
    substitution,
    substitution_derivative,
)
from .truth import true_angles

RELATIVE_ANGLES = Quantity("two-gyro/relative_angles", "angle", 3, "rad")
"""θ₁, θ₂, θ₃ in the paper's axes."""
PITCH = Quantity("two-gyro/pitch", "angle", 1, "rad")
"""χ of a Segway, nose up positive."""
UP = Quantity("two-gyro/body_up", "direction", 3, "1")
"""Inclination vector in the axes of the body's sensor."""
TRUNK = MarkerPlaces.of_trunk(RiderGeometry())


@dataclass(frozen=True)
class TwoGyro(RiderEquations, Model):
    """The paper's extended Kalman filter, with both of its models.

    It uses ``bicycle_imu/gyr``, ``trunk_imu/gyr`` (or ``disk/gyr``) and the camera, which may have a lower rate.
    """

    model: Literal["sigma1", "sigma2"] = "sigma2"
    """Σ2 observes the roll while the platform turns; Σ1 is exact for any motion, but its roll drifts"""
    platform: Platform = "bicycle"
    """``segway``: pitch χ instead of roll φ, by (6)"""
    body: Literal["trunk", "disk"] = "trunk"
    """body of the second gyroscope: a rider's trunk, or the disk of ``poise/BicycleFixture-v0``"""
    sensor: Literal["orientation", "distances"] = "orientation"
    """h(θ) of (16): θ itself, or the distances of three markers"""
    integration: Literal["euler", "midpoint"] = "midpoint"
    """``euler`` as published (23); ``midpoint`` evaluates the kinematics in the middle of the interval. With ``euler``
    the roll error of a moving rider is 1.3 times its standard deviation at 100 Hz"""
    constraint: bool = False
    """Σ1 with (5) as pseudo-measurement, 0 = cos φ δω_y − sin φ δω_z: roll from the platform's gyroscope,
    independent of the camera; not in the paper. The correlation of its noise with that of Σ1 is neglected"""
    constraint_noise: float = 1.0 * DEG
    """rad/s/√Hz: pitch rate and other violations of (5)"""
    body_gyroscope_noise: Point = (0.05 * DEG, 0.05 * DEG, 0.05 * DEG)
    """σ_vh √T, rad/s/√Hz, of each axis (gyroscope 605; the paper gives none)"""
    platform_gyroscope_noise: Point = (0.05 * DEG, 0.05 * DEG, 0.05 * DEG)
    """σ_vp √T, rad/s/√Hz, of x, y, z; y is used in Σ1 of a bicycle, and x in that of a Segway"""
    body_bias_drift: float = 0.15 * DEG
    """σ_b, rad/s: standard deviation of the Markov process (10); σ_u = σ_b √(2 / (T τ))"""
    platform_bias_drift: float = 0.15 * DEG
    """rad/s, of (2)"""
    body_bias_time: float = 1800.0
    """τ_h, s (force-inertial paper, table I)"""
    platform_bias_time: float = 1800.0
    """τ_p, s"""
    orientation_noise: float = 2.0 * DEG
    """rad: standard deviation of each measured θ; larger than the white noise of a frame, to cover alignment errors"""
    distance_noise: float = 0.003
    """m: standard deviation of each measured distance"""
    process_scale: float = 1.0
    """factor on all standard deviations of the process noise"""
    zero_yaw_guard: float = 0.0
    """rad/s: below this yaw rate F has no coupling of θ to φ, because bias and noise of the gyroscope would act as
    false information on the roll (0.5 °/s is useful); 0: off"""
    pitch_rate_noise: float = 0.0
    """rad/s/√Hz along M_:2 / cos φ: unmodelled pitch rate (1.4 °/s/√Hz is useful on rough roads); 0: off"""
    roll_rate_noise: float = 0.0
    """rad/s/√Hz on φ: the neglected term sin χ dψ/dt (1.4 °/s/√Hz is useful); 0: off"""
    roll_prior: float = 10.0 * DEG
    """rad: standard deviation of φ at the start"""
    initial_roll: float = 0.0
    """rad: φ (or χ) at the start"""
    initial_angles: Point = (0.0, -0.5847, 0.0)
    """rad: θ at the start where distances are measured (an orientation determines it)"""
    angle_prior: float = 15.0 * DEG
    """rad: standard deviation of θ at the start where distances are measured"""
    body_bias_prior: float = 0.15 * DEG
    """rad/s: standard deviation at the start"""
    platform_bias_prior: float = 0.15 * DEG
    """rad/s"""
    imu_tilt: float = 10.0 * DEG
    """rad: tilt of the platform's gyroscope, nose up (force-inertial paper, α)"""
    pivot: Point = TRUNK.pivot
    """m: origin of the body's frame in the bicycle frame"""
    markers: tuple[Point, Point, Point] = TRUNK.markers
    """m in the body's frame"""
    viewpoints: tuple[Point, Point, Point] = TRUNK.viewpoints
    """m in the bicycle frame: viewpoints of the markers"""

    def __post_init__(self) -> None:
        """Check standard deviations, and that a constraint is used with Σ1 only."""
        super().__post_init__()
        noises = ("body_gyroscope_noise", "platform_gyroscope_noise", "orientation_noise", "distance_noise")
        drifts = ("constraint_noise", "body_bias_drift", "platform_bias_drift", "process_scale")
        rough = ("zero_yaw_guard", "pitch_rate_noise", "roll_rate_noise")
        times = ("body_bias_time", "platform_bias_time")
        check_positive(self, *noises, *times, "roll_prior", "angle_prior", or_zero=(*drifts, *rough))
        if self.constraint and (self.model, self.platform) != ("sigma1", "bicycle"):
            given = f"model={self.model!r}, platform={self.platform!r}"
            raise ValueError(f"constraint needs the bias of every axis, so model='sigma1', and a bicycle, got {given}")

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """Tilt of the sensor, usual posture, positions of the markers on the back."""
        places = MarkerPlaces.of_trunk(geometry)
        return {
            "imu_tilt": geometry.bicycle_imu_tilt,
            "initial_angles": (0.0, -geometry.trunk_flexion, 0.0),
            "pivot": places.pivot,
            "markers": places.markers,
            "viewpoints": places.viewpoints,
        }

    @classmethod
    def for_disk(cls, **parameters: Any) -> Self:
        """The filter for ``poise/BicycleFixture-v0``: its markers, the gyroscope of the disk, and a wider prior."""
        places = MarkerPlaces.of_disk()
        usual = {
            "body": "disk",
            "sensor": "distances",
            "body_gyroscope_noise": (0.03 * DEG,) * 3,
            "body_bias_drift": 200.0 / 3600.0 * DEG,
            "body_bias_prior": 200.0 / 3600.0 * DEG,
            "initial_angles": (0.0, 0.0, 0.0),
            "angle_prior": 30.0 * DEG,
            "pivot": places.pivot,
            "markers": places.markers,
            "viewpoints": places.viewpoints,
        }
        return cls(**{**usual, **parameters})

    # ---- what depends on the options ---------------------------------------------------------------------------------

    @property
    def body_gyroscope(self) -> str:
        """Channel of the body's gyroscope."""
        return "trunk_imu/gyr" if self.body == "trunk" else "disk/gyr"

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """Both gyroscopes and the camera."""
        camera = ("relative/orientation", 4, "1") if self.sensor == "orientation" else ("relative/distances", 3, "m")
        gyroscopes = (Channel(name, 3, "rad/s") for name in ("bicycle_imu/gyr", self.body_gyroscope))
        return (*gyroscopes, Channel(*camera))

    @property
    def held_inputs(self) -> tuple[HeldInput, ...]:  # type: ignore[override]
        """Both gyroscopes, an axis each."""
        pairs = (self.body_gyroscope, "body"), ("bicycle_imu/gyr", "platform")
        return tuple(
            ridden(name, f"{of}_gyroscope_noise[{axis}]", part="trunk" if of == "body" else "bicycle")
            for name, of in pairs
            for axis in range(3)
        )

    @property
    def outputs(self) -> tuple[Quantity, ...]:  # type: ignore[override]
        """Roll (or pitch), relative angles, the body's inclination vector, and both biases."""
        bias = Quantity(self.body_gyroscope.replace("gyr", "gyroscope_bias"), "vector", 3, "rad/s")
        platform = Quantity("two-gyro/platform_bias", "vector", self.platform_rates, "rad/s")
        return (ROLL if self.platform == "bicycle" else PITCH, RELATIVE_ANGLES, UP, bias, platform)

    @property
    def error_parts(self) -> Mapping[str, tuple[int, int]]:  # type: ignore[override]
        """Roll (or pitch) and relative angles."""
        return {(ROLL if self.platform == "bicycle" else PITCH).name: (0, 1), RELATIVE_ANGLES.name: (1, 4)}

    @property
    def gains(self) -> Mapping[str, Gain]:  # type: ignore[override]
        """Factors on process and measurement noise, and on that of the constraint."""
        noise = f"{self.sensor.removesuffix('s')}_noise"
        gains = {
            "process": Gain("process_scale", description="process variance C"),
            "measurement": Gain(noise, description="measurement variance C_y"),
        }
        if self.constraint:
            level = Gain(
                "constraint_noise",
                description="variance of the pseudo-measurement that the road is level",
                bounds=(0.1 * DEG, 100.0 * DEG),
            )
            gains["constraint"] = level
        return gains

    @property
    def platform_rates(self) -> int:
        """Number of platform rates in use: 2 in Σ2, 3 in Σ1."""
        return 2 if self.model == "sigma2" else 3

    @property
    def state_size(self) -> int:  # type: ignore[override]
        """9 in Σ2, 10 in Σ1."""
        return 7 + self.platform_rates

    @property
    def error_size(self) -> int:  # type: ignore[override]
        """As the state."""
        return self.state_size

    @property
    def residual_size(self) -> int:  # type: ignore[override]
        """3, or 4 with the constraint."""
        return 3 + self.constraint

    # ---- equations ---------------------------------------------------------------------------------------------------

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """θ of the first frame (or the usual posture, if distances are measured), everything else from parameters."""
        xp = namespace(*z.values())
        camera, count = z[self.channels[2].name], self.platform_rates
        known = zero_where_known(*(z[channel.name] for channel in self.channels))
        if self.sensor == "orientation":
            theta, spread = relative_angles(camera), self.orientation_noise
        else:
            theta = xp.concat([expand(angle, 1) + known for angle in self.initial_angles], axis=-1)
            spread = self.angle_prior
        x = xp.concat([expand(self.initial_roll, 1) + known, theta + known, *[known] * (3 + count)], axis=-1)
        deviations = [self.roll_prior, *[spread] * 3, *[self.body_bias_prior] * 3, *[self.platform_bias_prior] * count]
        return x, covariance_of(deviations, known)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equations (23) to (26), and F; a midpoint step has F = 1 + T G(middle) (1 + T G / 2)."""
        T, T3 = expand(self.dt, 1), expand(self.dt, 2)
        samples = in_paper_axes(z[self.body_gyroscope]), self._platform_rates(z)
        rate, G, noise = self._dynamics(x, *samples)
        unit = identity(self.state_size, x)
        if self.integration == "midpoint":
            # the kinematics in the middle of the interval, after half an Euler step
            rate, middle, noise = self._dynamics(x + 0.5 * T * rate, *samples)
            G = middle @ (unit + 0.5 * T3 * G)
        return x + T * rate, unit + T3 * G, self._process(x, noise)

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Measured less expected, y − h(θ), wrapped if it is an angle (16); H = [0 ∂h/∂θ 0]."""
        xp, y = namespace(x), z[self.channels[2].name]
        if self.sensor == "orientation":
            # missing samples are replaced before the angles are computed, because NaN would make gradients NaN
            seen = xp.all(xp.isfinite(y), axis=-1)[..., None]
            angles = relative_angles(xp.where(seen, y, constant([1.0, 0.0, 0.0, 0.0], x)))
            r = xp.where(seen, wrap(angles - x[..., 1:4]), xp.nan)
            slope, spread = identity(3, x), self.orientation_noise
        else:
            distances, slope = marker_distances(x[..., 1:4], MarkerPlaces(self.pivot, self.markers, self.viewpoints))
            r, spread = y - distances, self.distance_noise
        H = xp.concat([zeros(x, 3, 1), slope, zeros(x, 3, 3 + self.platform_rates)], axis=-1)
        variances = [spread**2] * 3
        if self.constraint:
            # one more row, (5): 0 = cos φ δω_y − sin φ δω_z, with its derivatives by φ and by the platform's biases
            rate = platform_rate(z["bicycle_imu/gyr"], self.imu_tilt) - x[..., 7:]
            value, by_angle, by_rate = level_constraint(x[..., :1], rate)
            row = block_matrix([[by_angle[..., None], zeros(x, 1, 6), -by_rate[..., None, :]]])
            r, H = xp.concat([r, -value], axis=-1), xp.concat([H, row], axis=-2)
            # the noise of (5) is that of the gyroscope's y axis for a nearly upright bicycle
            variances.append((self.platform_gyroscope_noise[1] ** 2 + self.constraint_noise**2) / self.dt)
        return r, H, diagonal(variances, 0.0 * x[..., :1])

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll (right positive), θ in the paper's axes, inclination vector and biases in the sensors' axes."""
        xp = namespace(x)
        theta, signs = x[..., 1:4], constant(SIGNS, x)
        angle, zero = x[..., :1], 0.0 * x[..., :1]
        # the inclination vector in the platform's sensor axes, then rotated into the body's
        cosine, sine = xp.cos(angle), xp.sin(angle)
        bicycle = self.platform == "bicycle"
        up = xp.concat([zero, sine, cosine] if bicycle else [sine, zero, cosine], axis=-1)
        used = constant([SIGNS[axis] for axis in self.used_axes], x)
        first, relative, vertical, body, platform = self.outputs
        return {
            first.name: wrap(angle),
            relative.name: wrap(theta),
            vertical.name: rotate_back(relative_orientation(theta), up),
            body.name: x[..., 4:7] * signs,
            platform.name: x[..., 7:] * used,
        }

    def truth(self, truth: Mapping[str, Any]) -> dict[str, Any]:
        """Roll or pitch, θ, inclination vector and the platform's biases, from the orientations of both bodies."""
        orientations = {"bicycle/orientation", f"{self.body}/orientation"}
        return true_angles(truth, self.body, self.imu_tilt, self.used_axes) if orientations <= set(truth) else {}

    # ---- parts -------------------------------------------------------------------------------------------------------

    @property
    def used_axes(self) -> tuple[int, ...]:
        """Axes of the platform rates in use."""
        if self.model == "sigma1":
            return (0, 1, 2)
        return (0, 2) if self.platform == "bicycle" else (1, 2)

    @property
    def _first(self) -> int:
        """Index of the rate about the axis of φ or χ."""
        return self.used_axes.index(0 if self.platform == "bicycle" else 1)

    def _platform_rates(self, z: Measurement) -> Array:
        """The platform rates in use, ``(..., 2 or 3)``, paper's axes."""
        rate = platform_rate(z["bicycle_imu/gyr"], self.imu_tilt)
        return namespace(rate).stack([rate[..., axis] for axis in self.used_axes], axis=-1)

    def _substitution(self, x: Array, used: Array) -> tuple[Array, Array]:
        """S, and the derivative of S ``used`` by φ, which is zero below the guard's yaw rate."""
        xp, angle, yaw_rate = namespace(x), x[..., 0], used[..., -1]
        if self.model == "sigma1":
            return identity(3, x), 0.0 * x[..., 1:4]
        slope = substitution_derivative(angle, yaw_rate, self.platform)
        quiet = xp.less(xp.abs(yaw_rate), expand(self.zero_yaw_guard, 0))[..., None]
        return substitution(angle, self.platform), xp.where(quiet, 0.0 * slope, slope)

    def _dynamics(self, x: Array, body_rate: Array, platform_rates: Array) -> tuple[Array, Array, Array]:
        """Derivative dx/dt, its Jacobian G, and the noise input matrix of φ and θ ``(4, columns)``."""
        xp, count = namespace(x), self.platform_rates
        theta, biases = x[..., 1:4], x[..., 4:]
        # true rates δω^h and δω^p of (1) and (9)
        body, used = body_rate - biases[..., :3], platform_rates - biases[..., 3:]
        # A and M of (13); D = M S of (15), where S gives all three platform rates from those in use
        A, M, S, slope = body_rate_matrix(theta), platform_rate_matrix(theta), *self._substitution(x, used)
        D, platform = M @ S, times(S, used)
        # f of (23): dφ/dt is one of the used rates (8), dθ/dt = A δω^h + M δω^p, biases decay with τ (2), (10)
        first = constant([[float(index == self._first) for index in range(count)]], x) + zeros(x, 1, count)
        decays = [-1.0 / self.body_bias_time] * 3 + [-1.0 / self.platform_bias_time] * count
        angles = times(A, body) + times(M, platform)
        rate = xp.concat([times(first, used), angles, vector_of(decays, 0.0 * x[..., :1]) * biases], axis=-1)

        # G = ∂f/∂x by rows φ, θ, biases; ∂(D δω^p)/∂φ, E of (21), makes the roll observable in Σ2
        by_theta = body_rate_derivative(theta, body) + platform_rate_derivative(theta, platform)
        G = block_matrix(
            [
                [zeros(x, 1, 1), zeros(x, 1, 3), zeros(x, 1, 3), -first],
                [times(M, slope)[..., None], by_theta, -A, -D],
                [zeros(x, 3 + count, 4), diagonal(decays, 0.0 * x[..., :1])],
            ]
        )
        # noise columns: Â and D̂ of (24), then unmodelled motion on a rough road: the pitch rate along M_:2 / cos φ
        # (of a Segway the roll rate along M_:1) and sin χ dψ/dt on φ
        pitching = M[..., 1:2] / xp.cos(x[..., :1])[..., None] if self.platform == "bicycle" else M[..., :1]
        rough = [[zeros(x, 1, 1), zeros(x, 1, 1) + 1.0], [pitching, zeros(x, 3, 1)]]
        return rate, G, block_matrix([[zeros(x, 1, 3), first, *rough[0]], [A, D, *rough[1]]])

    def _process(self, x: Array, noise: Array) -> Array:
        """Q = T² C, with L Lᵀ of the scaled columns of ``noise`` for φ and θ."""
        used = [self.platform_gyroscope_noise[axis] for axis in self.used_axes]
        densities = [*self.body_gyroscope_noise, *used, self.pitch_rate_noise, self.roll_rate_noise]
        # C^v of (25) for φ and θ as a product of its scaled columns
        L = noise * vector_of(densities, 0.0 * x[..., :1])[..., None, :]
        # C^u of (25): variance per √s that keeps the Markov processes (2), (10) at σ_b
        drifts = [(self.body_bias_drift, self.body_bias_time)] * 3
        drifts += [(self.platform_bias_drift, self.platform_bias_time)] * self.platform_rates
        biases = diagonal([2.0 * drift**2 / time for drift, time in drifts], 0.0 * x[..., :1])
        return expand(self.dt * self.process_scale**2, 2) * block_diagonal([L @ L.mT, biases])
