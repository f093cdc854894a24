r"""Pose of a whole bicycle rider from few worn sensors and the constraints at hands and feet.

Y. Zhang, K. Chen, J. Yi, T. Liu, Q. Pan, "Whole-Body Pose Estimation in Human Bicycle Riding Using a Small Set of
Wearable Sensors", 2016; equation numbers are the paper's, * marks those that were corrected. Axes are the paper's
inside (x forward, y up, z to the right) and the environment's at every interface (:mod:`.whole_body.linkage`).

State X = [φ, ϑ̈, Θ, a_ts, Φ_r, Ψ_r, Φ_l, Ψ_l] (20): roll, yaw acceleration, trunk, acceleration of the trunk's sensor
relative to the seat, right shoulder and hip, left shoulder and hip. Six gyroscopes are inputs: with the rates w of the
child and q of the parent segment, Θ̇ = M w + G q (6), likewise hips (15) and shoulders (10); φ̇ from (2). Outputs (17),
with f the specific force that the bicycle's accelerometer gives at the trunk's pivot:

    a_bz = −g sin φ − p_y tan φ ω_y² − p_x cos φ ϑ̈ − v ω_y + p_y φ̈              (3*)
    a_t  = R_BTᵀ (f + a_ts)                                                      (8)
    τ    = [(k_S + R_BT k_T) × f]_x                                              (9*)
    C1–C3 of each arm, C5–C7 of each leg equal their values                      (11)–(17)

Differences from the paper: (3) has the wrong sign of gravity and lacks the centripetal acceleration v ϑ̇, without which
the estimate of φ tends to zero in a turn; (9) holds in a balanced steady turn only. Residuals of C2, C3, C6 and C7 are
divided by lengths. C7 is about the forward axis (``knee_axis="y"`` is as published). k_T is the trunk's first moment of
mass about its pivot, and k_S that of what is fixed between saddle and pivot. ``seat_share`` is the part of the trunk's
lean that the seat carries, not the hands. Legs and pedal forces are covered by the noise. Q is that of the gyroscopes'
noise, which correlates trunk and arms. The correlation of φ, trunk and legs through the bicycle's gyroscope is
neglected, so that four subsystems are decoupled: {φ, ϑ̈}, {Θ, a_ts, Φ_r, Φ_l}, {Ψ_r}, {Ψ_l}. A shock (|f| far from g)
increases the variances of a_bz, a_t and τ for a while (``shock_guard``). Biases and yaw are not estimated. The model
assumes flat ground, no pitch, no side slip, a fixed pelvis and fixed ankles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from ...core.backend import Array, constant, expand, namespace
from ...core.held_inputs import ridden
from ...core.matrices import diagonal_matrix, identity, times
from ...core.model import Gain, Model
from ...core.quantity import STANDARD_GRAVITY, Measurement
from ...core.rotation import cross, euler_axes, euler_matrix, norm, skew
from ...support.parameters import check_positive
from ..geometry import Point, RiderGeometry
from . import constraints as limb_constraints
from .blocks import BLOCKS, assemble, row_of
from .linkage import (
    CRANK,
    ERROR_PARTS,
    ERROR_SIZE,
    HIP,
    RELATIVE_ACCELERATION,
    ROLL,
    SHOULDER,
    SIDES,
    STEER,
    TRUNK,
    USUAL,
    YAW_ACCELERATION,
    RiderLinkage,
    paper_axes,
    seat_moments,
)
from .rates import Rates, advance

RATE, ACCELERATION_OF_RATE, SEAT_FORCE, SPEED, SHOCK = map(slice, (22, 25, 28, 31, 32), (25, 28, 31, 32, 33))
CONSTRAINTS = ("C1", "C2", "C3", "C5", "C6", "C7")
TURNING, SITTING = seat_moments(USUAL)
NOISES = ("lateral", "trunk", "torque", "length", "hinge", "swivel", "twist")
TIMES = ("yaw_acceleration_time", "relative_acceleration_time", "shock_time", "shock_scale")
POSITIVE = (*(f"{name}_noise" for name in NOISES), *TIMES)
"""Parameters in denominators, and standard deviations of measurements."""


@dataclass(frozen=True)
class WholeBody(RiderLinkage, Model):
    """The paper's extended Kalman filter, corrected.

    State: the 22 numbers of :class:`.RiderLinkage`; remembered: bicycle's rate (3), its derivative (3,
    low-passed), f (3), speed (1, low-passed), level of a shock (1, m/s²).
    """

    constraints: tuple[str, ...] = CONSTRAINTS
    """which constraints are used, of both arms or both legs"""
    knee_axis: Literal["x", "y"] = "x"
    """axis of the bicycle that the leg's plane contains in C7; y as published"""
    lateral: Literal["corrected", "sign", "published"] = "corrected"
    """(3): corrected, with only the sign of gravity corrected, or as published"""
    torque: Literal["seat_force", "published"] = "seat_force"
    """(9): corrected, or as published"""
    usual_twist: bool = False
    """an additional measurement, not in the paper: θ₃ is about ``twist_follow`` times the steering angle, as shoulders
    follow hands. Where hands support the trunk's lean, the seat torque does not determine the trunk's heading"""
    shock_guard: bool = True
    """increase the variances of a_bz, a_t and τ during shocks"""
    sampling: Literal["interval", "instant"] = "interval"
    """meaning of a gyroscope sample: mean rate of the interval that it ends, or rate at its end (as in the paper)"""
    turning_moment: Point = TURNING
    """k_T, kg·m, trunk axes from the pivot"""
    sitting_moment: Point = SITTING
    """k_S, kg·m, bicycle axes from the saddle"""
    seat_share: float = 0.0
    """share of the trunk's sideways lean that the seat carries; 1 in the paper, 0 for riders who support themselves on
    the handlebar, as in the environment"""
    cells_wide: float = USUAL.cells_wide
    """m between the rear load cells"""

    bicycle_gyroscope_noise: float = 1.0e-2
    """rad/s/√Hz (0.6 °/s/√Hz): ten times the device's, so that the effect of a bias decays within two seconds"""
    trunk_gyroscope_noise: float = 7.0e-3
    """rad/s/√Hz (0.4 °/s/√Hz)"""
    limb_gyroscope_noise: float = 7.0e-3
    """rad/s/√Hz (0.4 °/s/√Hz)"""
    yaw_acceleration_std: float = 0.5
    """rad/s², stationary"""
    yaw_acceleration_time: float = 1.0
    """s (table II)"""
    relative_acceleration_std: float = 0.8
    """m/s², stationary, of a_ts"""
    relative_acceleration_time: float = 1.0
    """s (table II)"""
    lateral_noise: float = 0.5
    """m/s², of a_bz"""
    trunk_noise: float = 0.4
    """m/s², of a_t"""
    torque_noise: float = 6.0
    """N·m, of τ"""
    length_noise: float = 0.02
    """of C1 and C5, dimensionless: 5 to 10 mm"""
    hinge_noise: float = 0.03
    """of C2 and C6, sine of an angle"""
    swivel_noise: float = 3.0
    """of C3 and C7, sine of an angle: elbows of leaning riders deviate by about 0.25 rms for about 0.6 s,
    equivalent to white noise of about 0.25 √(2 · 0.6 s · 100 Hz)"""
    twist_noise: float = 0.7
    """rad, of ``usual_twist``, per sample at 100 Hz: takes effect within some seconds"""
    twist_follow: float = 0.3
    """ratio of shoulder rotation to steering angle; assumed"""
    roll_prior: float = 0.087
    """rad"""
    trunk_prior: float = 0.12
    """rad"""
    limb_prior: float = 0.2
    """rad"""
    difference_time: float = 0.05
    """s, of the low-pass on the derivative of the bicycle's rate"""
    speed_time: float = 0.1
    """s, of the low-pass on the wheel's speed"""
    shock_threshold: float = 1.5
    """m/s² of ||f| − g|"""
    shock_scale: float = 0.2
    """m/s²: variances are multiplied by 1 + ((peak − threshold) / scale)²"""
    shock_time: float = 0.3
    """s, time constant of the decay of the peak"""
    gravity: float = STANDARD_GRAVITY
    """m/s²"""

    state_size: ClassVar[int] = 33
    error_size: ClassVar[int] = ERROR_SIZE
    error_parts: ClassVar = ERROR_PARTS
    held_inputs: ClassVar = (
        ridden("bicycle_imu/gyr", "bicycle_gyroscope_noise"),
        ridden("trunk_imu/gyr", "trunk_gyroscope_noise", part="trunk"),
        *(ridden(f"upper_arm_{side}/gyr", "limb_gyroscope_noise", part="arm") for side in ("right", "left")),
        *(ridden(f"thigh_{side}/gyr", "limb_gyroscope_noise", part="leg") for side in ("right", "left")),
    )
    gains: ClassVar = {
        "bicycle": Gain("bicycle_gyroscope_noise", description="process variance of roll"),
        "trunk": Gain("trunk_gyroscope_noise", description="process variance of the trunk's angles"),
        "limb": Gain("limb_gyroscope_noise", description="process variance of the limbs' angles"),
        "acceleration": Gain("trunk_noise", description="variance of the trunk's accelerometer"),
        "lateral": Gain("lateral_noise", description="variance of the bicycle's lateral acceleration"),
        "swivel": Gain("swivel_noise", description="variance of C3 and C7"),
    }

    def __post_init__(self) -> None:
        """Check the constraints, and the parameters in denominators."""
        super().__post_init__()
        object.__setattr__(self, "constraints", tuple(self.constraints))
        if not set(self.constraints) <= set(CONSTRAINTS) or len(set(self.constraints)) < len(self.constraints):
            raise ValueError(f"constraints must be distinct names from {CONSTRAINTS}, got {self.constraints}")
        check_positive(self, *POSITIVE)

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """Lengths and joint positions of the linkage, and the first moments of the rider's mass."""
        turning, sitting = seat_moments(geometry)
        return super().rider_parameters(geometry) | {"turning_moment": turning, "sitting_moment": sitting}

    @property
    def residual_size(self) -> int:  # type: ignore[override]
        """m: five accelerations and torques, two rows per constraint, the twist."""
        return 5 + 2 * len(self.constraints) + self.usual_twist

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Upright with the usual trunk flexion, limbs by inverse kinematics; P₀ diagonal."""
        x = self.start(z)
        xp = namespace(x)
        zero = 0.0 * x[..., :1]
        speed = xp.where(xp.isfinite(z["wheel/speed"]), z["wheel/speed"], zero)
        rate = self.bicycle_axes(z["bicycle_imu/gyr"])
        force = self._seat_force(z, rate, 0.0 * rate)
        x = xp.concat([x, rate, 0.0 * rate, force, speed, zero], axis=-1)
        deviations = [self.roll_prior, self.yaw_acceleration_std, *[self.trunk_prior] * 3]
        deviations += [*[self.relative_acceleration_std] * 3, *[self.limb_prior] * 12]
        variances = xp.concat([1.0 + zero * 0.0 + expand(value**2 - 1.0, 1) for value in deviations], axis=-1)
        return x, diagonal_matrix(variances)

    def _seat_force(self, z: Measurement, rate: Array, change: Array) -> Array:
        """f: specific force at the trunk's pivot ``(..., 3)``, from the bicycle's accelerometer."""
        arm = paper_axes(constant([a - b for a, b in zip(self.trunk_pivot, self.bicycle_imu, strict=True)], rate))
        return self.bicycle_axes(z["bicycle_imu/acc"]) + cross(change, arm) + cross(rate, cross(rate, arm + 0.0 * rate))

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Midpoint rule on (2), (4)*, (6), (7), (10), (15), with the exact derivative; Q from the gyroscopes' noise."""
        xp = namespace(x)
        dt, one = self.dt, 1.0 + 0.0 * x[..., :1]
        now = self.rates(z)
        rates = now
        if self.sampling == "instant":
            before = self.rates(previous)
            rates = {name: 0.5 * (now[name] + before[name]) for name in now}
        # roll (2), block 0
        parts: dict[int, Array] = {0: x[..., ROLL] + expand(dt, 1) * rates["bicycle_imu/gyr"][..., :1]}
        F: dict[tuple[int, int], Array] = {(0, 0): one[..., None]}
        Q: dict[tuple[int, int], Array] = {(0, 0): one[..., None] * expand(dt * self.bicycle_gyroscope_noise**2, 2)}
        # Gauss–Markov processes (4)*, (7): ϑ̈ (block 1) and a_ts (block 3)
        memories = (
            (1, YAW_ACCELERATION, self.yaw_acceleration_time, self.yaw_acceleration_std),
            (3, RELATIVE_ACCELERATION, self.relative_acceleration_time, self.relative_acceleration_std),
        )
        for index, part, time, deviation in memories:
            keep = xp.exp(-(dt / time) * one)
            parts[index] = keep * x[..., part]
            F[index, index] = keep[..., None] * identity(part.stop - part.start, x)
            spread = expand(deviation**2, 2) * (1.0 - keep * keep)[..., None]
            Q[index, index] = spread * identity(part.stop - part.start, x)
        noise = {name: expand(dt * deviation**2, 2) for name, deviation in self._gyroscope_noises().items()}
        steps = self._turned(x, rates)
        for index, (angles, by_angles, step) in steps.items():
            parts[index], F[index, index] = angles, by_angles
            M, G = step.by_child, step.by_parent
            own = "trunk" if index == 2 else "arm" if index in (4, 6) else "leg"
            its = "trunk" if own == "arm" else "bicycle"
            Q[index, index] = noise[own] * (M @ M.mT) + noise[its] * (G @ G.mT)
        # the trunk's gyroscope is that of the child for the trunk and of the parent for the arms: cross-covariances
        for row, column in ((2, 4), (2, 6), (4, 6)):
            first = steps[row][2].by_child if row == 2 else steps[row][2].by_parent
            Q[row, column] = noise["trunk"] * (first @ steps[column][2].by_parent.mT)
            Q[column, row] = Q[row, column].mT
        error = xp.concat([parts[index] for index in range(len(BLOCKS))], axis=-1)
        memory = self._remember(x, z, now["bicycle_imu/gyr"])
        return xp.concat([error, memory], axis=-1), assemble(F, x), assemble(Q, x)

    def _gyroscope_noises(self) -> dict[str, float]:
        """Part of the body → noise of its gyroscope, rad/s/√Hz."""
        limb = self.limb_gyroscope_noise
        return {"bicycle": self.bicycle_gyroscope_noise, "trunk": self.trunk_gyroscope_noise, "arm": limb, "leg": limb}

    def _turned(self, x: Array, rates: Mapping[str, Array]) -> dict[int, tuple[Array, Array, Rates]]:
        """Block of trunk (6), shoulders (10) or hips (15) → result of :func:`.rates.advance` from its parent."""
        bicycle, trunk = rates["bicycle_imu/gyr"], rates["trunk_imu/gyr"]
        steps = {2: advance("zxy", x[..., TRUNK], trunk, bicycle, self.dt)}
        for side, (arm, leg) in zip(SIDES, ((4, 5), (6, 7)), strict=True):
            steps[arm] = advance("yxy", x[..., SHOULDER[side]], rates[f"upper_arm_{side}/gyr"], trunk, self.dt)
            steps[leg] = advance("zxy", x[..., HIP[side]], rates[f"thigh_{side}/gyr"], bicycle, self.dt)
        return steps

    def _remember(self, x: Array, z: Measurement, rate: Array) -> Array:
        """Encoders, rate and its derivative, f, speed, shock: last valid samples for the measurement equations."""
        xp = namespace(x)
        share = self.dt / (self.dt + self.difference_time)
        change = x[..., ACCELERATION_OF_RATE]
        change = change + share * ((rate - x[..., RATE]) / self.dt - change)
        force = self._seat_force(z, rate, change)
        speed = x[..., SPEED] + self.dt / (self.dt + self.speed_time) * (z["wheel/speed"] - x[..., SPEED])
        deviation = xp.abs(norm(force) - self.gravity)
        faded = x[..., SHOCK] * xp.exp(-(self.dt / self.shock_time) * (1.0 + 0.0 * deviation))
        shock = xp.where(xp.greater(deviation, faded), deviation, faded)
        return xp.concat([z["steer/angle"], z["crank/angle"], rate, change, force, speed, shock], axis=-1)

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """(3*), (8), (9*), C1–C3, C5–C7; a row whose samples are missing is NaN, and its update is skipped."""
        xp = namespace(x)
        zero = 0.0 * x[..., :1]
        bicycle = xp.all(xp.isfinite(z["bicycle_imu/acc"]), axis=-1)[..., None]
        rows: list[tuple[Array, dict[int, Array], Any]] = []
        # (3*): lateral specific force of the bicycle's accelerometer
        calm = self._calm(x)
        expected, slope, by_change = self._lateral(x)
        rows.append(
            (
                -z["bicycle_imu/acc"][..., 1:2] - expected,
                {0: slope[..., None, :], 1: by_change[..., None, :]},
                calm * expand(self.lateral_noise**2, 1),
            )
        )
        # (8): the trunk's accelerometer reads R_BTᵀ (f + a_ts), three rows
        R, J = euler_matrix("zxy", x[..., TRUNK]), euler_axes("zxy", x[..., TRUNK])
        total = x[..., SEAT_FORCE] + x[..., RELATIVE_ACCELERATION]
        residual = paper_axes(z["trunk_imu/acc"]) - times(R.mT, total)
        by_trunk = R.mT @ skew(total) @ J
        for i in range(3):
            rows.append(
                (
                    xp.where(bicycle, residual[..., i : i + 1], xp.nan),
                    {2: by_trunk[..., i : i + 1, :], 3: R.mT[..., i : i + 1, :]},
                    calm * expand(self.trunk_noise**2, 1),
                )
            )
        # (9*): moment of the seat about the forward axis, from the rear load cells
        torque, by_trunk = self._torque(x, R, J)
        cells = z["seat/load_cells"]
        measured = 0.5 * self.cells_wide * (cells[..., 1:2] - cells[..., 2:3])
        rows.append(
            (
                xp.where(bicycle, measured - torque, xp.nan),
                {2: by_trunk[..., None, :]},
                calm * expand(self.torque_noise**2, 1),
            )
        )
        # (11)–(17): C1–C3 of the arms, C5–C7 of the legs
        rows += self._limb_rows(x, z)
        if self.usual_twist:
            difference = expand(self.twist_follow, 1) * x[..., STEER] - x[..., TRUNK][..., 2:]
            by_twist = constant([[0.0, 0.0, 1.0]], x) + 0.0 * x[..., :1, None]
            rows.append((difference, {2: by_twist}, expand(self.twist_noise**2, 1)))
        r = xp.concat([row[0] for row in rows], axis=-1)
        H = xp.concat([row_of(row[1], x) for row in rows], axis=-2)
        variances = xp.concat([row[2] + zero for row in rows], axis=-1)
        return r, H, diagonal_matrix(variances)

    def _calm(self, x: Array) -> Array:
        """Factor ``(..., 1)`` on variances: 1, larger during a shock."""
        xp = namespace(x)
        one = 1.0 + 0.0 * x[..., SHOCK]
        if not self.shock_guard:
            return one
        over = x[..., SHOCK] - self.shock_threshold
        return xp.where(xp.greater(over, 0.0), 1.0 + (over / self.shock_scale) ** 2, one)

    def _lateral(self, x: Array) -> tuple[Array, Array, Array]:
        """(3*) ``(..., 1)`` and its derivatives by φ and ϑ̈; ω_y = ϑ̇ cos φ is measured."""
        xp = namespace(x)
        px, _, py = self.bicycle_imu
        s, c = xp.sin(x[..., ROLL]), xp.cos(x[..., ROLL])
        rate = x[..., RATE][..., 1:2]
        gravity = self.gravity if self.lateral == "published" else -self.gravity
        yaw = x[..., YAW_ACCELERATION]
        # gravity, centripetal and Euler term of the yaw at the sensor
        expected = gravity * s - py * s / c * rate * rate - px * c * yaw
        if self.lateral == "corrected":
            # the centripetal acceleration v ϑ̇ and the Euler term of the roll, which the paper omits
            expected = expected - x[..., SPEED] * rate + py * x[..., ACCELERATION_OF_RATE][..., :1]
        return expected, gravity * c - py * rate * rate / (c * c) + px * s * yaw, -px * c

    def _torque(self, x: Array, R: Array, J: Array) -> tuple[Array, Array]:
        """(9*) ``(..., 1)`` and its derivative ``(..., 3)`` by Θ; the support's moment on the rider about x."""
        xp = namespace(x)
        turning = paper_axes(constant([*self.turning_moment], x))
        k = times(R, turning)
        if self.torque == "published":
            s, c = xp.sin(x[..., TRUNK]), xp.cos(x[..., TRUNK])
            weight, zero = turning[..., 1:2] * self.gravity, 0.0 * s[..., :1]
            return -weight * s[..., 1:2], xp.concat([zero, -weight * c[..., 1:2], zero], axis=-1)
        # x component of (k_S + R_BT k_T) × f; the seat carries only a share of the sideways lean
        f, share = x[..., SEAT_FORCE], self.seat_share
        still = paper_axes(constant([*self.sitting_moment], x))
        torque = (still[..., 1] + k[..., 1]) * f[..., 2] - share * (still[..., 2] + k[..., 2]) * f[..., 1]
        dk = -skew(k) @ J
        return torque[..., None], f[..., 2:3] * dk[..., 1, :] - share * f[..., 1:2] * dk[..., 2, :]

    def _limb_rows(self, x: Array, z: Measurement) -> list[tuple[Array, dict[int, Array], Any]]:
        """Rows of the chosen constraints: right arm, right leg, left arm, left leg."""
        xp = namespace(x)
        deviations = (self.length_noise, self.hinge_noise, self.swivel_noise)
        pivot, rows = self.point(self.trunk_pivot, "left", x), []
        known = {name: xp.isfinite(z[f"{name}/angle"]) for name in ("steer", "crank")}
        for side, (arm, leg) in zip(SIDES, ((4, 5), (6, 7)), strict=True):
            hand, foot = self.hand(side, x[..., STEER]), self.pedal(side, x[..., CRANK])
            joint = self.point(self.shoulder, side, x)
            upper = limb_constraints.arm(
                x[..., TRUNK], x[..., SHOULDER[side]], pivot, joint, hand, self.upper_arm, self.forearm
            )
            hip = self.point(self.hip, side, x)
            lower = limb_constraints.leg(x[..., HIP[side]], hip, foot, self.thigh, self.knee_to_pedal, self.knee_axis)
            for limb, block, names, encoder in (
                (upper, arm, CONSTRAINTS[:3], "steer"),
                (lower, leg, CONSTRAINTS[3:], "crank"),
            ):
                for i, name in enumerate(names):
                    if name not in self.constraints:
                        continue
                    by = {block: limb.by_joint[..., i : i + 1, :]}
                    if limb.by_trunk is not None:
                        by[2] = limb.by_trunk[..., i : i + 1, :]
                    r = xp.where(known[encoder], -limb.residuals[..., i : i + 1], xp.nan)
                    rows.append((r, by, expand(deviations[i] ** 2, 1)))
        return rows

    def retract(self, x: Array, dx: Array) -> Array:
        """Additive for angles and accelerations; remembered samples stay."""
        return namespace(x).concat([x[..., :ERROR_SIZE] + dx, x[..., ERROR_SIZE:]], axis=-1)
