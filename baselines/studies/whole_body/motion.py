"""Rides whose kinematics are exact: what the whole-body filter assumes holds to rounding, so every error has a cause.

A bicycle rolls without slip on a plane, a rigid trunk turns about its pivot, hands and feet stay where they hold, the
pelvis is fixed to the frame. Positions and attitudes are closed functions of time; rates and accelerations are their
central differences of fourth order (1e-7 m/s²). Sensors report values at sampling instants (``sampling="instant"``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.constraints import hip_angles, limb_frame, shoulder_angles
from ....filters.bicycle.whole_body.linkage import SIDES, SIGNS, RiderLinkage, paper_axes, seat_moments
from ....filters.core import rotation
from ....filters.core.quantity import DEG, STANDARD_GRAVITY
from ..signals import Waves, derivative, second_derivative

MOST_REACH = 0.998
"""of the straight arm"""
COURSES = ("indoor", "outdoor", "held")
"""A circle of 2.5 m at 1 m/s; 0.5 to 6 m/s with turns both ways; straight on with crank and body held."""


@dataclass(frozen=True)
class SensorErrors:
    """Errors of the synthetic sensors; by default biases lie within 30 % of table I."""

    gyroscope: float = math.radians(0.5)
    """rad/s a sample, bicycle and trunk"""
    gyroscope_bias: float = math.radians(0.3)
    """rad/s: uniform within"""
    accelerometer: float = 0.0098
    """m/s² a sample"""
    accelerometer_bias: float = 0.044
    """m/s²: uniform within"""
    limb: float = math.radians(0.3)
    """rad/s a sample"""
    limb_bias: float = math.radians(200.0 / 3600.0)
    """rad/s: uniform within"""
    limb_step: float = math.radians(0.1)
    """rad/s: resolution"""
    torque: float = 3.0
    """N·m a sample"""
    counts: int = 1024
    """of the encoders a turn; 0 for continuous ones"""

    def without_biases(self) -> SensorErrors:
        """White noise alone: no biases, no steps."""
        return SensorErrors(self.gyroscope, 0.0, self.accelerometer, 0.0, self.limb, 0.0, 0.0, self.torque, 0)


IDEAL = SensorErrors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)


@dataclass(frozen=True)
class ExactRide:
    """One motion.

    Attributes:
        geometry: rider and bicycle.
        course: see :data:`COURSES`.
        swivel: rad, standard deviation of how far elbows and knees stand off their plane, and of their slow wander.
        seed: of motion (and, with another stream, of sensors).
        bumps: (start, end) in s of shocks of 40 m/s² on the bicycle, or None.
        constant_speed: m/s throughout, or None for the speeds of the course.
    """

    geometry: RiderGeometry
    course: Literal["indoor", "outdoor", "held"] = "indoor"
    swivel: float = math.radians(3.0)
    seed: int = 0
    bumps: tuple[float, float] | None = None
    constant_speed: float | None = None
    functions: dict[str, Waves] = field(init=False, repr=False, compare=False)
    linkage: RiderLinkage = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.course not in COURSES:
            raise ValueError(f"course must be one of {COURSES}, got {self.course!r}")
        rng = np.random.default_rng(np.random.SeedSequence(self.seed).spawn(2)[0])
        indoor, still = self.course == "indoor", 1.0 - (self.course == "held")
        speed, yaw = {"indoor": (1.0, 0.4), "outdoor": (3.2, 0.0), "held": (2.0, 0.0)}[self.course]
        lively, turning = {"indoor": (0.1, 0.03), "outdoor": (1.5, 0.18), "held": (0.0, 0.0)}[self.course]

        def draw(mean: float, std: float, low: float, high: float) -> Waves:
            return Waves.draw(rng, std, low, high, offset=mean, count=3, equal=True)

        functions = {
            "speed": draw(speed, 0.5 * lively, 0.02, 0.06),
            "yaw": draw(yaw, turning, 0.04, 0.15),
            "sway": draw(0.0, 0.5 * DEG * still, 0.2, 0.8),
            "flexion": draw(-self.geometry.trunk_flexion, 2.5 * DEG * still, 0.05, 0.4),
            "lean": draw(0.0, 3.0 * DEG * still, 0.05, 0.5),
            # shoulders follow the handlebar, or the outer arm would not reach
            "twist": draw(0.12 if indoor else 0.0, 3.0 * DEG * still, 0.05, 0.5),
            "steer": draw(0.26 if indoor else 0.0, 0.08 * still, 0.1, 0.6),
            "cadence": draw(5.0 * still, 0.6 * still, 0.02, 0.1),
        }
        if self.constant_speed is not None:
            functions["speed"] = Waves(self.constant_speed)
        for side in SIDES:
            for limb in ("arm", "leg"):
                functions[f"{limb}_{side}"] = draw(self.swivel * rng.standard_normal(), self.swivel * still, 0.01, 0.05)
        object.__setattr__(self, "functions", functions)
        object.__setattr__(self, "linkage", RiderLinkage.for_rider(self.geometry))

    def roll(self, t: np.ndarray) -> np.ndarray:
        """φ: leaned into the turn, and swaying."""
        f = self.functions
        return -np.arctan(f["speed"](t) * f["yaw"](t) / STANDARD_GRAVITY) + f["sway"](t)

    def frame(self, t: np.ndarray) -> np.ndarray:
        """Matrix ``(..., 3, 3)`` of the bicycle, paper's axes: R_y(ϑ) R_x(φ)."""
        yaw = self.functions["yaw"].integral(t)
        return rotation.elementary_matrix(1, yaw) @ rotation.elementary_matrix(0, self.roll(t))

    def trunk(self, t: np.ndarray) -> np.ndarray:
        """Θ ``(..., 3)``."""
        return np.stack([self.functions[name](t) for name in ("flexion", "lean", "twist")], axis=-1)

    def pose(self, t: np.ndarray) -> dict[str, np.ndarray]:
        """Angles under the environment's names."""
        f, link = self.functions, self.linkage
        steer, crank = f["steer"](t)[..., None], f["cadence"].integral(t)[..., None] + 0.7
        theta = self.trunk(t)
        R = rotation.euler_matrix("zxy", theta)
        x = np.zeros((*t.shape, 22))
        x[..., 0], x[..., 2:5], x[..., 20:21], x[..., 21:22] = self.roll(t), theta, steer, crank
        for side, arm, leg in zip(SIDES, (8, 14), (11, 17), strict=True):
            root = link.point(link.trunk_pivot, "left", steer) + R @ link.point(link.shoulder, side, steer)
            reach = rotation.norm(link.hand(side, steer) - root).max() / (link.upper_arm + link.forearm)
            if reach > MOST_REACH:
                raise ValueError(f"the {side} hand is out of reach in this motion: {reach:.3f} of the straight arm")
            outward = np.array([0.0, 0.0, -SIGNS[side]])
            frame, _ = limb_frame(
                root, link.hand(side, steer), link.upper_arm, link.forearm, outward, "arm", f[f"arm_{side}"](t)
            )
            x[..., arm : arm + 3] = shoulder_angles(R, frame)
            hip, out = link.point(link.hip, side, steer) + 0.0 * steer, np.array([1.0, 0.0, 0.0])
            frame, _ = limb_frame(
                hip, link.pedal(side, crank), link.thigh, link.knee_to_pedal, out, "leg", f[f"leg_{side}"](t)
            )
            x[..., leg : leg + 3] = hip_angles(frame)
        return link.pose(x) | {
            "bicycle/steer": steer,
            "bicycle/crank": crank,
            "bicycle/speed": f["speed"](t)[..., None],
        }

    def rates(self, t: np.ndarray) -> dict[str, np.ndarray]:
        """Absolute rate ``(..., 3)`` of every body in its axes (the paper's)."""

        def matrices(at: np.ndarray) -> np.ndarray:
            frame, pose = self.frame(at), self.pose(at)
            trunk = frame @ rotation.euler_matrix("zxy", pose["trunk/angles"])
            limbs = [
                part @ rotation.euler_matrix(order, pose[f"{joint}_{side}/angles"])
                for side in SIDES
                for part, order, joint in ((trunk, "yxy", "shoulder"), (frame, "zxy", "hip"))
            ]
            return np.stack([frame, trunk, *limbs])

        # skew-symmetric matrix of the rate: Rᵀ dR/dt
        W = matrices(t).mT @ derivative(matrices, t)
        rates = 0.5 * np.stack(
            [W[..., 2, 1] - W[..., 1, 2], W[..., 0, 2] - W[..., 2, 0], W[..., 1, 0] - W[..., 0, 1]], axis=-1
        )
        names = ("bicycle_imu", "trunk_imu", *(f"{part}_{side}" for side in SIDES for part in ("upper_arm", "thigh")))
        return dict(zip(names, rates, strict=True))

    def forces(self, t: np.ndarray) -> dict[str, np.ndarray]:
        """Specific force, paper's axes: at the bicycle's IMU and the pivot, and in trunk axes at the trunk's IMU."""
        f, g, link = self.functions, self.geometry, self.linkage
        fixed = [paper_axes(np.array(place)) for place in (g.bicycle_imu, g.trunk_pivot)]

        def places(at: np.ndarray) -> np.ndarray:
            """Of the three points against the rear contact, axes that do not turn ``(3, ..., 3)``."""
            moved = rotation.euler_matrix("zxy", self.trunk(at)) @ paper_axes(np.array(g.trunk_imu))
            points = [*(place + 0.0 * moved for place in fixed), link.point(g.trunk_pivot, "left", at) + moved]
            return (self.frame(at) @ np.stack(points)[..., None])[..., 0]

        # the rear contact moves ahead and is led along the path; a specific force holds gravity too
        yaw = f["yaw"].integral(t)
        ahead = np.stack([np.cos(yaw), 0.0 * yaw, -np.sin(yaw)], axis=-1)
        left = np.stack([-np.sin(yaw), 0.0 * yaw, -np.cos(yaw)], axis=-1)
        contact = derivative(f["speed"], t)[..., None] * ahead + (f["speed"](t) * f["yaw"](t))[..., None] * left
        acceleration = contact + np.array([0.0, STANDARD_GRAVITY, 0.0]) + second_derivative(places, t)
        bicycle, pivot, trunk = (self.frame(t).mT @ acceleration[..., None])[..., 0]
        R = rotation.euler_matrix("zxy", self.trunk(t))
        return {"bicycle_imu": bicycle, "pivot": pivot, "trunk_imu": (R.mT @ trunk[..., None])[..., 0]}

    def record(
        self,
        duration: float = 60.0,
        dt: float = 0.01,
        errors: SensorErrors | None = None,
        sampling: Literal["instant", "interval"] = "instant",
    ) -> Trajectory:
        """The ride of ``duration`` s with its sensors every ``dt`` s, in the environment's channels and axes.

        Inertial sensors give the value at the sampling instant, or the mean over the interval before it (Simpson's
        rule, as the environment's sensors do).
        """
        errors = SensorErrors() if errors is None else errors
        rng = np.random.default_rng(np.random.SeedSequence(self.seed).spawn(2)[1])
        t = dt * np.arange(round(duration / dt) + 1)
        pose, rates, forces = self.pose(t), self.rates(t), self.forces(t)
        pivot = forces["pivot"]
        if sampling == "interval":
            earlier = [(self.rates(at), self.forces(at)) for at in (t - 0.5 * dt, t - dt)]
            rates = {name: _simpson(one, *(part[0][name] for part in earlier)) for name, one in rates.items()}
            forces = {name: _simpson(one, *(part[1][name] for part in earlier)) for name, one in forces.items()}
        own, R = forces["trunk_imu"], rotation.euler_matrix("zxy", pose["trunk/angles"])
        if self.bumps is not None:
            shock = 40.0 * rng.uniform(-1.0, 1.0, (t.size, 3)) * ((t >= self.bumps[0]) & (t < self.bumps[1]))[:, None]
            shock *= (rng.random(t.size) < 0.3)[:, None]
            limit = 2.0 * STANDARD_GRAVITY
            forces["bicycle_imu"] = np.clip(forces["bicycle_imu"] + shock, -limit, limit)
            own = own + 0.6 * (R.mT @ shock[..., None])[..., 0]
        turning, sitting = (paper_axes(np.array(part)) for part in seat_moments(self.geometry))
        torque = rotation.cross(sitting + R @ turning, pivot)[..., 0] + errors.torque * rng.standard_normal(t.size)
        tilt = rotation.elementary_matrix(2, np.array(self.geometry.bicycle_imu_tilt))

        def read(values: np.ndarray, noise: float, bias: float, step: float = 0.0) -> np.ndarray:
            values = (
                values + noise * rng.standard_normal(values.shape) + bias * rng.uniform(-1.0, 1.0, values.shape[-1])
            )
            values = step * np.round(values / step) if step else values
            return np.stack([values[..., 0], -values[..., 2], values[..., 1]], axis=-1)

        measurements = {}
        for name, rate in rates.items():
            limb = name not in ("bicycle_imu", "trunk_imu")
            rate = rate @ tilt if name == "bicycle_imu" else rate
            sizes = (
                (errors.limb, errors.limb_bias, errors.limb_step) if limb else (errors.gyroscope, errors.gyroscope_bias)
            )
            measurements[f"{name}/gyr"] = read(rate, *sizes)
        measurements["bicycle_imu/acc"] = read(
            forces["bicycle_imu"] @ tilt, errors.accelerometer, errors.accelerometer_bias
        )
        measurements["trunk_imu/acc"] = read(own, errors.accelerometer, errors.accelerometer_bias)
        half = torque / self.geometry.cells_wide
        measurements["seat/load_cells"] = np.stack([0.0 * half + 100.0, 150.0 + half, 150.0 - half], axis=-1)
        step = 2.0 * math.pi / errors.counts if errors.counts else 0.0
        for name in ("steer", "crank"):
            angle = rotation.wrap(pose[f"bicycle/{name}"])
            measurements[f"{name}/angle"] = step * np.round(angle / step) if step else angle
        measurements["wheel/speed"] = pose["bicycle/speed"]
        metadata: dict[str, Any] = {"name": f"exact-{self.course}-{self.seed}", "geometry": self.geometry.describe()}
        return Trajectory(t, measurements, pose, np.ones(t.size, dtype=bool), metadata)


def _simpson(first: np.ndarray, middle: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Mean over an interval of what is given at its ends and in its middle."""
    return (first + 4.0 * middle + last) / 6.0
