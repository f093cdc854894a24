"""Motions of a point-mass trunk on a bicycle, and exactly what the force/inertial paper's sensors would read.

Nothing here uses the filter's equations: positions and rotation matrices are functions of time, their derivatives are
taken numerically, and seat forces follow from Newton and Euler. Frames are the paper's (z down) inside, ours outside.

Y. Zhang, K. Chen, J. Yi, "Rider Trunk and Bicycle Pose Estimation With Fusion of Force/Inertial Sensors", IEEE
Transactions on Biomedical Engineering 60, 2013. What the paper does not give (masses, noises, motions) is assumed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.bicycle.force_inertial.kinematics import DOWN, UP_THE_TRUNK
from ....filters.core import rotation
from ....filters.core.quantity import DEG
from ..signals import STEP, Function, Waves, derivative, gauss_markov, second_derivative

X, Y, Z = np.eye(3)
Course = Literal["indoor", "outdoor"]


@dataclass(frozen=True)
class Errors:
    """Errors of sensors and rider; all assumed."""

    gyroscope: float = 0.3 * DEG
    """rad/s a sample"""
    bias: float = 0.15 * DEG
    """standard deviation of the trunk gyroscope's bias, rad/s"""
    bias_time: float = 1800.0
    """s"""
    bicycle_offset: float = 0.0
    """rad/s on every axis of the bicycle's gyroscope"""
    accelerometer: float = 0.05
    """m/s² a sample"""
    force: float = 3.0
    """N a sample"""
    moment: float = 0.5
    """N·m a sample"""
    cell: float = 2.0
    """N a sample"""
    speed: float = 0.02
    """m/s a sample"""
    tilt: float = 2.5 * DEG
    """standard deviation of the shoulders' tilt, rad"""
    disturbance: float = 3.0
    """standard deviation of an unknown moment on each axis of the trunk, N·m"""
    inertia: tuple[float, float, float] = (0.5, 1.2, 1.2)
    """moments of inertia of the trunk that the filter does not know: along, and twice across, kg·m²"""


NO_ERRORS = Errors(0.0, 0.0, 1800.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0))
"""A point mass with level shoulders and perfect sensors."""


@dataclass(frozen=True)
class Motion:
    """A ride as functions of time (s): arrays of times to arrays of the same shape, rad and m/s, z down."""

    phi_h: Function
    theta: Function
    tilt: Function
    """of the shoulders"""
    phi_b: Function
    psi: Function
    speed: Function

    def phi(self, t: np.ndarray) -> np.ndarray:
        """Spin at which the shoulders have their tilt."""
        a, b = np.sin(self.phi_h(t)), np.cos(self.phi_h(t)) * np.cos(self.theta(t))
        return np.arctan2(b, a) - np.arccos(np.clip(np.sin(self.tilt(t)) / np.hypot(a, b), -1.0, 1.0))

    def yawed(self, t: np.ndarray) -> np.ndarray:
        """R to ground: quaternions ``(T, 4)``."""
        return rotation.from_axis_angle(Z, self.psi(t))

    def bicycle(self, t: np.ndarray) -> np.ndarray:
        """B to ground: quaternions ``(T, 4)``."""
        return rotation.multiply(self.yawed(t), rotation.from_axis_angle(X, self.phi_b(t)))

    def trunk(self, t: np.ndarray) -> np.ndarray:
        """Trunk to ground: quaternions ``(T, 4)``."""
        q = self.yawed(t)
        for axis, angle in ((X, self.phi_h), (Y, self.theta), (X, self.phi)):
            q = rotation.multiply(q, rotation.from_axis_angle(axis, angle(t)))
        return q


def draw_motion(rng: np.random.Generator, course: Course, errors: Errors, pitch: float = 60.0 * DEG) -> Motion:
    """A left circle of 2.5 m at 2 m/s with the trunk 20° inside, or wandering at 1 to 5 m/s; ``pitch``: mean θ.

    Raises:
        ValueError: another course than ``indoor`` and ``outdoor``.
    """
    if course not in ("indoor", "outdoor"):
        raise ValueError(f"course must be 'indoor' or 'outdoor', got {course!r}")
    indoor = course == "indoor"
    lean = Waves.draw(rng, 4.0 * DEG if indoor else 3.0 * DEG, 0.2, 0.6)
    bend = Waves.draw(rng, 4.0 * DEG if indoor else 3.0 * DEG, 0.2, 0.7, offset=pitch)
    tilt = Waves.draw(rng, errors.tilt, 0.05, 0.3)
    wobble = Waves.draw(rng, 1.5 * DEG, 0.3, 0.9)
    yaw_rate, speed = (-0.8, 2.0) if indoor else (0.0, 3.5)
    pace = Waves.draw(rng, 0.1 if indoor else 1.0, 0.03, 0.1, offset=speed)
    turning = Waves.draw(
        rng, 0.06 if indoor else 0.25, 0.1 if indoor else 0.05, 0.4 if indoor else 0.25, offset=yaw_rate
    )

    def roll(t: np.ndarray) -> np.ndarray:
        return wobble(t) + (-5.2 * DEG if indoor else 0.8 * np.arctan(speed * turning(t) / 9.8))

    def side(t: np.ndarray) -> np.ndarray:
        return lean(t) + (-20.0 * DEG if indoor else 0.5 * roll(t))

    return Motion(side, bend, tilt, roll, turning.integral, pace)


def angular_velocity(orientation: Callable[[np.ndarray], np.ndarray], t: np.ndarray) -> np.ndarray:
    """Of a body, in its own axes, rad/s: rotation vectors of small steps."""

    def step(h: float) -> np.ndarray:
        return rotation.log(rotation.multiply(rotation.conjugate(orientation(t - h)), orientation(t + h))) / (2.0 * h)

    return (4.0 * step(STEP) - step(2.0 * STEP)) / 3.0


@dataclass(frozen=True)
class Exact:
    """What truly happens at each sample, paper's axes."""

    force: np.ndarray
    """(T, 3) of the rider on the seat, bicycle axes, N"""
    moment: np.ndarray
    """(T, 3) likewise about the seat, N·m"""
    trunk_rate: np.ndarray
    bicycle_rate: np.ndarray
    """(T, 3) each in its IMU's axes"""
    trunk_force: np.ndarray
    bicycle_force: np.ndarray
    """(T, 3) specific forces of the IMUs, m/s²"""


def exact_readings(motion: Motion, t: np.ndarray, rider: ForceInertial, inertia: tuple[float, float, float]) -> Exact:
    """Newton and Euler for a trunk on a moving seat at times ``(T,)``; its inertia about axes x up the trunk, y, z."""
    gravity = np.array([0.0, 0.0, rider.gravity])

    def contact(time: np.ndarray) -> np.ndarray:
        return rotation.rotate(motion.yawed(time), X) * motion.speed(time)[:, None]

    def carried(arm: tuple[float, float, float]) -> np.ndarray:
        """Acceleration of a point of the bicycle."""
        return derivative(contact, t) + second_derivative(
            lambda time: rotation.rotate(motion.bicycle(time), np.array(arm)), t
        )

    def up(height: float) -> np.ndarray:
        return second_derivative(lambda time: rotation.rotate(motion.trunk(time), height * X), t)

    seat = carried((rider.pivot_forward, 0.0, -rider.pivot_height))
    imu = rotation.exp(rider.imu_tilt * Y)
    force = rider.trunk_mass * (seat + up(rider.trunk_height) - gravity)
    arm = rotation.rotate(motion.trunk(t), rider.trunk_height * X)

    def momentum(time: np.ndarray) -> np.ndarray:
        spin = angular_velocity(motion.trunk, time)
        return rotation.rotate(motion.trunk(time), np.array(inertia) * spin)

    moment = np.cross(arm, force)
    if any(inertia):
        moment = moment + derivative(momentum, t)
    bicycle, trunk = motion.bicycle(t), motion.trunk(t)
    place = carried((rider.imu_forward, 0.0, -rider.imu_height))
    return Exact(
        -rotation.rotate_back(bicycle, force),
        -rotation.rotate_back(bicycle, moment),
        angular_velocity(motion.trunk, t),
        rotation.rotate_back(imu, angular_velocity(motion.bicycle, t)),
        rotation.rotate_back(trunk, seat + up(rider.trunk_imu_height) - gravity),
        rotation.rotate_back(rotation.multiply(bicycle, imu), place - gravity),
    )


def simulate(
    motion: Motion, errors: Errors, rider: ForceInertial, duration: float, rng: np.random.Generator
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """A ride of ``duration`` s as the channels of suite ``force-inertial``, and its truth.

    Returns:
        Channel → ``(T, size)`` in our axes; ``bicycle/roll``, ``force-inertial/trunk_angles`` and
        ``trunk_imu/gyroscope_bias``.
    """
    t = np.arange(round(duration / rider.dt)) * rider.dt
    exact = exact_readings(motion, t, rider, errors.inertia)
    moment = exact.moment.copy()
    for axis in range(3):
        moment[:, axis] += Waves.draw(rng, errors.disturbance, 0.05, 1.0)(t)
    bias = gauss_markov(rng.standard_normal((len(t), 3)), errors.bias, errors.bias_time, rider.dt)

    def noisy(values: np.ndarray, deviation: float) -> np.ndarray:
        return values + deviation * rng.standard_normal(values.shape)

    post = rotation.exp(rider.post_tilt * Y)
    sensor = rider.post_length * np.array([math.sin(rider.post_tilt), 0.0, math.cos(rider.post_tilt)])
    wrench = [rotation.rotate_back(post, part) for part in (exact.force, moment - np.cross(sensor, exact.force))]
    # three cells share the vertical force and the moments about the saddle point
    vertical, x_C, y_C = exact.force[:, 2], -moment[:, 1] / exact.force[:, 2], moment[:, 0] / exact.force[:, 2]
    front = vertical * (x_C + rider.cells_behind) / rider.cells_long
    apart = 2.0 * vertical * y_C / rider.cells_wide
    cells = np.stack([front, 0.5 * (vertical - front - apart), 0.5 * (vertical - front + apart)], axis=-1)
    measurements = {
        "bicycle_imu/gyr": noisy(exact.bicycle_rate, errors.gyroscope) @ DOWN + errors.bicycle_offset,
        "bicycle_imu/acc": noisy(exact.bicycle_force, errors.accelerometer) @ DOWN,
        "trunk_imu/gyr": noisy(exact.trunk_rate, errors.gyroscope) @ UP_THE_TRUNK + bias,
        "trunk_imu/acc": noisy(exact.trunk_force, errors.accelerometer) @ UP_THE_TRUNK,
        "seat/wrench": np.concatenate(
            [noisy(wrench[0], errors.force) @ DOWN, noisy(wrench[1], errors.moment) @ DOWN], axis=-1
        ),
        "seat/load_cells": noisy(cells, errors.cell),
        "handlebar/force": np.zeros((len(t), 6)),
        "wheel/speed": noisy(motion.speed(t)[:, None], errors.speed),
    }
    truth = {
        "bicycle/roll": motion.phi_b(t)[:, None],
        "force-inertial/trunk_angles": np.stack([motion.phi_h(t), motion.theta(t), motion.phi(t)], axis=-1),
        "trunk_imu/gyroscope_bias": bias,
    }
    return measurements, truth
