r"""Angles of a rider's trunk and roll of the bicycle from two inertial units and forces at seat and handlebar.

Y. Zhang, K. Chen, J. Yi, "Rider Trunk and Bicycle Pose Estimation With Fusion of Force/Inertial Sensors", IEEE
Transactions on Biomedical Engineering 60, 2013, doi 10.1109/TBME.2013.2260339. Equation numbers are the paper's;
frames, axes and letters are in :mod:`.force_inertial.kinematics`.

    X = [φ_h θ φ φ_b b]                trunk X-Y-X angles, roll of the bicycle, bias of the trunk's gyroscope
    Ẋ = f(X, ω_h − b, ω_b)             (3), (4), (15), one Euler step per sample (16)
    y = [τ̂_φh τ̂_θ φ̂_b 0]               (11), (12), (13), (17)

The moments of seat and hands about the trunk's pivot equal those that the trunk's motion requires (9), the seat force
has the direction of the apparent vertical, and the shoulders are level. Yaw is not estimated.

Differences from the paper, each with an option that selects the published form:

* ``acceleration``: q̈ from differentiated gyroscopes. With the accelerometers of (7), (8), gravity cancels in (9); (7)
  and (8) also have errata (:mod:`.force_inertial.accelerometer`).
* ``torque_reading``: τ̂_θ = c_δ N_y − s_δ N_z, δ = φ_b − φ_h; (12) drops N_z, and has the wrong sign of
  R_z (x_C − x_V).
* ``roll_model``: the seat force points along the **apparent** vertical, R_y / R_z = tan(φ_b − φ_c) with
  φ_c ≈ atan(v_b ψ̇ / g); (13) has φ_c = 0, which holds in straight riding only.
* ``form``: F_17 has a minus, and H_14 is a derivative by φ_b (published: by φ̇_b).
* ``jacobian``: H is the complete derivative of the residual; (21) treats rates and accelerations as constant.
* ``ahead_share``: level shoulders (17) have weight 0.8, a chest that faces forward has weight 0.2. A rider who leans
  tilts the shoulders, which causes an error of φ of their tilt over cos θ.
* The bias is the Gauss–Markov process of (15), not the random walk of the text.
* A rider is not a point mass on a seat: the seat also carries the pelvis and part of the legs, the pivot is above it,
  and each hand pushes at its own grip (:mod:`.force_inertial.forces`). :meth:`ForceInertial.published` omits all this.

Gyroscope offsets (14) must be subtracted from the samples beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

from ...analysis.forward_mode import Scalar, atan2, cos, gradient, sin, value, variables
from ...core.backend import Array, constant, namespace, rows
from ...core.held_inputs import ridden
from ...core.matrices import diagonal
from ...core.model import Gain, Model
from ...core.quantity import DEG, Channel, Measurement, Quantity
from ...core.rotation import wrap
from .accelerometer import accelerometer_accelerations
from .forces import Needed, apparent_vertical, in_bicycle, needed_load, pedal_moment
from .kinematics import (
    Accelerations,
    Angles,
    Rates,
    Travel,
    Triple,
    down,
    from_trunk,
    gyroscope_accelerations,
    rate_jacobians,
    rates,
    regular,
    triple,
    up_the_trunk,
)
from .parameters import CHANNELS, ForceInertialParameters
from .readings import Readings, readings, static_angles, steering

TRUNK_ANGLES = Quantity("force-inertial/trunk_angles", "angle", 3, "rad")
"""φ_h, θ, φ."""
ROLL = Quantity("bicycle/roll", "angle", 1, "rad")
TRUNK_BIAS = Quantity("trunk_imu/gyroscope_bias", "vector", 3, "rad/s")
# indices in the state
ANGLES, BIAS, OMEGA_H, OMEGA_B, SPEED = slice(0, 4), slice(4, 7), slice(7, 10), slice(10, 13), slice(13, 14)
TURN_H, TURN_B, PUSH, ACC_H, ACC_B = slice(14, 17), slice(17, 20), slice(20, 21), slice(21, 24), slice(24, 27)


@dataclass(frozen=True)
class ForceInertial(ForceInertialParameters, Model):
    """The paper's filter with 7 states.

    State: φ_h, θ, φ, φ_b, b (3); remembered: ω_h (3), ω_b (3), v_b, low-passed derivatives of the three (7),
    accelerometers (6).
    """

    acceleration: Literal["gyroscope", "accelerometer"] = "gyroscope"
    """q̈ from differentiated gyroscopes, or from (7), (8)"""
    torque_model: Literal["dynamic", "static"] = "dynamic"
    """(9), or gravity alone (static torque)"""
    torque_reading: Literal["exact", "without-z", "published"] = "exact"
    """c_δ N_y − s_δ N_z; N_y / c_δ; the latter with the published sign of R_z (x_C − x_V)"""
    roll_model: Literal["apparent-vertical", "published", "none"] = "apparent-vertical"
    """φ_b − φ_c; φ_b as in (13); or no roll from the seat"""
    handlebar_load: Literal["each", "sum", "none"] = "each"
    """moment of each hand at its grip; F_hx d_z + F_hz d_x of (12) only; none"""
    form: Literal["corrected", "published"] = "corrected"
    """of (7), (8), (20) and (21)"""
    jacobian: Literal["full", "partial"] = "full"
    """H of the complete residual, or with constant rates, accelerations and readings as in (21)"""
    bias_model: bool = True
    """estimate the bias; otherwise it stays zero"""
    gyroscope_sample: Literal["current", "previous"] = "current"
    """sample used in (16): ``previous`` as published; ``current`` for samples that describe the interval they end"""

    channels: ClassVar[tuple[Channel, ...]] = CHANNELS
    outputs: ClassVar[tuple[Quantity, ...]] = (ROLL, TRUNK_ANGLES, TRUNK_BIAS)
    state_size: ClassVar[int] = 27
    error_size: ClassVar[int] = 7
    error_parts: ClassVar = {"force-inertial/trunk_angles": (0, 3), "bicycle/roll": (3, 4)}
    residual_size: ClassVar[int] = 4
    held_inputs: ClassVar = tuple(
        ridden(f"{part}_imu/gyr", "gyroscope_noise", power=2, part=part) for part in ("trunk", "bicycle")
    )
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("gyroscope_noise", description="process variance of the angles, from the gyroscopes"),
        "bias": Gain("bias_std", description="process variance of the gyroscope bias"),
        "torque": Gain("torque_noise", description="measurement variance of the two torques"),
        "roll": Gain("roll_noise", description="measurement variance of the roll from the seat's force"),
        "shoulder": Gain("shoulder_noise", description="variance of the shoulders' tilt"),
    }

    @classmethod
    def published(cls, **parameters: Any) -> Self:
        """The paper's rider: a point mass that rotates about a point of the seat (table I; the rest is assumed)."""
        return cls(**(PUBLISHED | parameters))

    # ---- the model ------------------------------------------------------------------------------------------------

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Angles from the static torque and the apparent vertical (v_b ψ̇ known), zero bias."""
        xp = namespace(z["seat/wrench"])
        omega_h, omega_b = z["trunk_imu/gyr"], z["bicycle_imu/gyr"]
        speed = z["wheel/speed"]
        s_a, c_a = sin(self.imu_tilt), cos(self.imu_tilt)
        gyroscope = down(omega_b)
        yaw = c_a * gyroscope[2] - s_a * gyroscope[0]
        # the angles for which a trunk at rest in a steady turn requires the measured forces
        steer = steering(self, speed[..., 0], yaw)
        phi_h, theta, phi, phi_b = static_angles(self, self._readings(z, steer), speed[..., 0] * yaw)
        start = xp.stack([phi_h, theta, phi, phi_b], axis=-1)
        # NaN until every channel has had a valid sample
        start = start + 0.0 * xp.sum(z["seat/load_cells"], axis=-1, keepdims=True)
        none = 0.0 * omega_h
        memory = [omega_h, omega_b, speed, none, none, 0.0 * speed, z["trunk_imu/acc"], z["bicycle_imu/acc"]]
        bias = self.bias_prior if self.bias_model else 0.0
        deviations = [self.lean_prior, self.pitch_prior, self.spin_prior, self.roll_prior, bias, bias, bias]
        return xp.concat([start, none, *memory], axis=-1), diagonal([d * d for d in deviations], 0.0 * start[..., :1])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """(16) with F = I + ΔT F_X (20) and Q = ΔT² G Σ_ω Gᵀ, 2σ² ΔT/τ for the bias."""
        xp = namespace(x)
        dt = self.dt
        used = z if self.gyroscope_sample == "current" else previous
        bias = triple(x[..., BIAS])
        omega_h = self._without_bias(up_the_trunk(used["trunk_imu/gyr"]), bias)
        omega_b = down(used["bicycle_imu/gyr"])
        angles = Angles(*(x[..., index] for index in range(4)))
        rate = rates(angles, omega_h, omega_b, self.imu_tilt)
        # Euler step (16) of the four angles; the bias decays with τ (15)
        moved = [angle + dt * change for angle, change in zip(angles, rate[:4], strict=True)]
        decay = (1.0 - dt / self.bias_time) if self.bias_model else 1.0
        # F = I + ΔT F_X (20): rows of the angles, then those of the bias
        F_X, G = rate_jacobians(angles, omega_h, omega_b, self.imu_tilt, published=self.form == "published")
        zero = 0.0 * x[..., 0]
        unit = [[float(row == column) for column in range(7)] for row in range(7)]
        upper = rows([[unit[row][column] + dt * F_X[..., row, column] for column in range(7)] for row in range(4)])
        lower = rows([[zero + (decay if row == column else 0.0) for column in range(7)] for row in range(4, 7)])
        # Q: ΔT² G Σ_ω Gᵀ of the angles, 2σ² ΔT/τ of the bias
        scale = (dt * self.gyroscope_noise) * (dt * self.gyroscope_noise)
        spread = G @ G.mT
        drift = 2.0 * self.bias_std * self.bias_std * dt / self.bias_time if self.bias_model else 0.0
        Q = rows(
            [
                [
                    scale * spread[..., row, column]
                    if row < 4 and column < 4
                    else zero + (drift if row == column else 0.0)
                    for column in range(7)
                ]
                for row in range(7)
            ]
        )
        memory = self._remember(x, z, previous)
        new = xp.concat([xp.stack([*moved, *(decay * b for b in bias)], axis=-1), memory], axis=-1)
        return new, xp.concat([upper, lower], axis=-2), Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Measured less required moments, the roll, and the tilt of the shoulders."""
        xp = namespace(x)
        parts = variables(x[..., :7])
        angles = Angles(*parts[:4])
        whole = self.jacobian == "full"
        # q̇ and q̈ of the state, and the load that they require from seat and hands (9)
        rate, acceleration, axial = self._motion(x, angles if whole else Angles(*map(value, angles)), parts[4:7], whole)
        needed = self._needed(x, angles, rate, acceleration, axial)
        known, z = self._known_forces(z)
        read = self._readings(z, steering(self, x[..., 13], rate.psi))
        delta = angles.phi_b - angles.phi_h
        if not whole:
            delta = value(delta)
        # moment about the pivot (11), (12), with that of the pedals, which carry the remaining load
        N_x, N_y, N_z = read.moment
        load = in_bicycle(needed.force, angles.phi_b if whole else value(angles.phi_b))
        down = -1.0 * (read.whole[2] + load[2])
        N_y = N_y + self.pedal_share * pedal_moment(down if whole else value(down), self)
        tau_theta = cos(delta) * N_y - sin(delta) * N_z if self.torque_reading == "exact" else N_y / cos(delta)
        # (13): direction of the seat force, and φ_c, the apparent vertical
        if self.roll_model == "apparent-vertical":
            # along z the seat carries the load less that of the pedals
            z_B = (1.0 - self.pedal_share) * read.whole[2] - self.pedal_share * load[2]
            roll = atan2(read.whole[1], z_B) - angles.phi_b + apparent_vertical(needed.force)
        else:
            roll = atan2(read.seat[1], read.seat[2]) - angles.phi_b
        # (17): tilt of the shoulders, and rotation of the chest from straight ahead
        s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
        s_p, c_p, c_t = sin(angles.phi), cos(angles.phi), cos(angles.theta)
        turn = angles.phi_b - angles.phi_h
        tilt, aside = s_h * c_p + c_h * c_t * s_p, cos(turn) * s_p - sin(turn) * c_t * c_p
        square = (1.0 - self.ahead_share) * tilt + self.ahead_share * aside
        residuals = [N_x - needed.tau_phi_h, tau_theta - needed.tau_theta, roll, -square]
        r = [value(each) for each in residuals]
        lost = [known, known, known if self.roll_model != "none" else xp.logical_and(known, xp.logical_not(known))]
        r = xp.stack([*(xp.where(row, part, part + xp.nan) for row, part in zip(lost, r, strict=False)), r[3]], axis=-1)
        H = xp.stack([-gradient(each, x[..., :7]) for each in residuals], axis=-2)
        if self.form == "published" and not whole:
            # H_14 as published: −2 m_h h_s h_h s_δ s_θ φ̇_b
            product = self.trunk_mass * self.pivot_height * self.trunk_height
            entry = -2.0 * product * sin(x[..., 3] - x[..., 0]) * sin(x[..., 1]) * rate.phi_b
            H = rows([[entry if (i, j) == (0, 3) else H[..., i, j] for j in range(7)] for i in range(4)])
        deviations = [self.torque_noise, self.torque_noise, self.roll_noise, self.shoulder_noise]
        return r, H, diagonal([d * d for d in deviations], 0.0 * x[..., :1])

    def retract(self, x: Array, dx: Array) -> Array:
        """Additive; angles are wrapped and θ keeps its distance from the singularities."""
        xp = namespace(x)
        parts = [x[..., index] + dx[..., index] for index in range(7)]
        parts[:4] = wrap(parts[0]), regular(parts[1]), wrap(parts[2]), wrap(parts[3])
        return xp.concat([xp.stack(parts, axis=-1), x[..., 7:]], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll (right positive), trunk angles in the paper's frame R, and the bias in the sensor's axes."""
        return {
            "bicycle/roll": x[..., 3:4],
            "force-inertial/trunk_angles": x[..., :3],
            "trunk_imu/gyroscope_bias": from_trunk(*triple(x[..., BIAS])),
        }

    # ---- parts ------------------------------------------------------------------------------------------------------

    def _without_bias(self, omega: Triple, bias: Any) -> Triple:
        return omega[0] - bias[0], omega[1] - bias[1], omega[2] - bias[2]

    def _readings(self, z: Measurement, steer: Scalar) -> Readings:
        return readings(self, z, steer, self.handlebar_load, published=self.torque_reading == "published")

    def _known_forces(self, z: Measurement) -> tuple[Any, Measurement]:
        """Whether seat and hands have valid samples, and the samples with finite values in place of missing ones."""
        xp = namespace(z["seat/wrench"])
        names = ("seat/wrench", "handlebar/force")
        known = [xp.all(xp.isfinite(z[name]), axis=-1) for name in names]
        # an unused number, so that derivatives stay finite
        whole = {
            name: xp.where(row[..., None], z[name], -1.0 + 0.0 * xp.zeros_like(z[name]))
            for name, row in zip(names, known, strict=True)
        }
        return xp.logical_and(*known), {**z, **whole}

    def _remember(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """The inputs of this sample and their low-passed backward differences."""
        xp = namespace(x)
        fast = self.dt / (self.dt + self.gyroscope_filter)
        slow = self.dt / (self.dt + self.speed_filter)
        names = ("trunk_imu/gyr", "bicycle_imu/gyr", "wheel/speed")
        differences = []
        for name, part, share in zip(names, (TURN_H, TURN_B, PUSH), (fast, fast, slow), strict=True):
            raw = (z[name] - previous[name]) * constant([1.0] * (part.stop - part.start), x)
            held = [x[..., part.start + k] for k in range(part.stop - part.start)]
            found = [h + share * (raw[..., k] / self.dt - h) for k, h in enumerate(held)]
            differences.append(xp.stack(found, axis=-1))
        now = [z[name] for name in names]
        return xp.concat([*now, *differences, z["trunk_imu/acc"], z["bicycle_imu/acc"]], axis=-1)

    def _motion(self, x: Array, angles: Angles, bias: Any, whole: bool) -> tuple[Rates, Accelerations, Any]:
        """Rates, accelerations and the trunk's rate about its axis, from the remembered inputs."""
        bias = bias if whole else [value(each) for each in bias]
        omega_h = self._without_bias(up_the_trunk(x[..., OMEGA_H]), bias)
        omega_b, turn_h, turn_b = down(x[..., OMEGA_B]), up_the_trunk(x[..., TURN_H]), down(x[..., TURN_B])
        rate = rates(angles, omega_h, omega_b, self.imu_tilt)
        found = gyroscope_accelerations(angles, rate, omega_h, turn_h, turn_b, self.imu_tilt)
        if self.acceleration == "accelerometer":
            found = accelerometer_accelerations(
                angles,
                rate,
                up_the_trunk(x[..., ACC_H]),
                down(x[..., ACC_B])[1],
                found.phi_b,
                found.axial,
                self._travel(x),
                self,
                published=self.form == "published",
            )
        return rate, found, omega_h[0]

    def _travel(self, x: Array) -> Travel:
        return Travel(x[..., 13], x[..., 20])

    def _needed(self, x: Array, angles: Angles, rate: Rates, acceleration: Accelerations, axial: Any) -> Needed:
        moving = needed_load(angles, rate, acceleration, axial, self._travel(x), self)
        if self.torque_model == "dynamic":
            return moving
        zero = 0.0 * x[..., 0]
        still = needed_load(angles, Rates(*[zero] * 5), Accelerations(*[zero] * 5), zero, Travel(zero, zero), self)
        return still._replace(force=moving.force)


PUBLISHED: dict[str, float] = {
    "dt": 0.02,
    "gravity": 9.8,
    "imu_tilt": 10.0 * DEG,
    "imu_forward": 0.37,
    "imu_height": 0.71,
    "pivot_forward": 0.26,
    "pivot_height": 0.38,
    "seat_forward": 0.0,
    "seat_below": 0.0,
    "post_length": 0.13,
    "post_tilt": 20.0 * DEG,
    "cells_long": 0.20,
    "cells_wide": 0.12,
    "cells_behind": 0.043,
    "trunk_mass": 45.0,
    "trunk_height": 0.33,
    "trunk_across": 0.0,
    "trunk_along": 0.0,
    "trunk_imu_height": 0.42,
    "torque_noise": 6.0,
    "shoulder_noise": 0.05,
    "carried_mass": 0.0,
    "carried_forward": 0.0,
    "carried_up": 0.0,
    "pedal_share": 0.0,
    "pedal_down": 0.0,
    "pedal_back": 0.0,
    "wheelbase": 0.0,
    "ahead_share": 0.0,
}
"""Table I of the paper; m_h, h_h, h and all noises are not published, and assumed here."""
