"""Kinematics of a trunk on a bicycle for the force/inertial filter: (1)–(8) of the paper, corrected.

Y. Zhang, K. Chen, J. Yi, "Rider Trunk and Bicycle Pose Estimation With Fusion of Force/Inertial Sensors", IEEE
Transactions on Biomedical Engineering 60, 2013, doi 10.1109/TBME.2013.2260339. The paper's axes: R has its origin in
the rear contact, x forward along the contact line, y right, **z down**, and yaws by ψ; the bicycle is B = R Rx(φ_b),
its IMU B Ry(α), the trunk R Rx(φ_h) Ry(θ) Rx(φ), whose **x axis points up the trunk**: θ = 90° is upright.

This package's axes are x forward, y left, z up, and z up the trunk. Both changes of axes are half turns (:data:`DOWN`,
:data:`UP_THE_TRUNK`), so each function is its own inverse.

All functions accept and return scalars: arrays ``(...)`` or :class:`.Dual`. SI units, rad.

Differences from the paper: (7) and (8) are an option, with and without their errata (:mod:`.accelerometer`). The
default differentiates the gyroscopes, which is exact, does not involve gravity and needs no division by p_x.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...analysis.forward_mode import Scalar, cos, sin
from ...core import rotation
from ...core.backend import Array, namespace, rows
from ...core.quantity import DEG

Triple = tuple[Scalar, Scalar, Scalar]
DOWN = np.diag([1.0, -1.0, -1.0])
"""A vector of the bicycle from this package's axes to the paper's."""
UP_THE_TRUNK = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""A vector of the trunk from this package's axes to the paper's."""
THETA_LIMIT = 5.0 * DEG
"""θ keeps this distance from 0 and 180°, where the trunk angles are singular."""


def down(v: Array) -> Triple:
    """A vector ``(..., 3)`` of the bicycle, its IMU or its seat in the paper's axes."""
    return v[..., 0], -v[..., 1], -v[..., 2]


def up_the_trunk(v: Array) -> Triple:
    """A vector ``(..., 3)`` of the trunk in the paper's axes."""
    return v[..., 2], -v[..., 1], v[..., 0]


def from_trunk(x: Scalar, y: Scalar, z: Scalar) -> Array:
    """A vector in the paper's trunk axes in this package's ``(..., 3)``."""
    return namespace(x).stack([z, -y, x], axis=-1)


def regular(theta: Array) -> Array:
    """θ ``(...)`` at :data:`THETA_LIMIT` from its singularities at least."""
    xp, low, high = namespace(theta), THETA_LIMIT, math.pi - THETA_LIMIT
    theta = xp.where(xp.less(theta, low), low + 0.0 * theta, theta)
    return xp.where(xp.greater(theta, high), high + 0.0 * theta, theta)


class Angles(NamedTuple):
    """The first four states, rad."""

    phi_h: Scalar
    """trunk to the right"""
    theta: Scalar
    """90° upright, less is forward"""
    phi: Scalar
    """about the trunk's own axis"""
    phi_b: Scalar
    """roll of the bicycle to the right"""


class Rates(NamedTuple):
    """Rates of the angles and of the yaw (to the right), rad/s."""

    phi_h: Scalar
    theta: Scalar
    phi: Scalar
    phi_b: Scalar
    psi: Scalar


class Accelerations(NamedTuple):
    """Second derivatives, rad/s²; that of φ is expressed by the trunk's rate about its own axis."""

    phi_h: Scalar
    theta: Scalar
    axial: Scalar
    """derivative of the trunk's angular rate about its own axis"""
    phi_b: Scalar
    psi: Scalar


class Travel(NamedTuple):
    """Motion of the rear contact."""

    speed: Scalar
    """v_b, m/s"""
    acceleration: Scalar
    """its derivative, m/s²"""


def triple(v: Array) -> Triple:
    """Elements of vectors ``(..., 3)``."""
    return v[..., 0], v[..., 1], v[..., 2]


def rates(angles: Angles, omega_h: Triple, omega_b: Triple, alpha: Scalar) -> Rates:
    """Equations (3) and (4).

    Args:
        angles: of trunk and bicycle.
        omega_h: trunk's angular rate in its own axes, rad/s.
        omega_b: bicycle's angular rate in the axes of its IMU.
        alpha: tilt of that IMU, nose up.
    """
    # yaw rate Ω from the bicycle's gyroscope (3)
    s_phi, c_phi = sin(angles.phi), cos(angles.phi)
    s_theta, c_theta = sin(angles.theta), cos(angles.theta)
    s_a, c_a = sin(alpha), cos(alpha)
    yaw = (-s_a * omega_b[0] + c_a * omega_b[2]) / cos(angles.phi_b)
    # the trunk's rates in its axes before the spin φ, ω'_y and ω'_z (4)
    y, z = c_phi * omega_h[1] - s_phi * omega_h[2], s_phi * omega_h[1] + c_phi * omega_h[2]
    c_lean = cos(angles.phi_h)
    return Rates(
        (z - c_theta * c_lean * yaw) / s_theta,
        y - sin(angles.phi_h) * yaw,
        omega_h[0] + (c_lean * yaw - c_theta * z) / s_theta,
        c_a * omega_b[0] + s_a * omega_b[2],
        yaw,
    )


def gyroscope_accelerations(
    angles: Angles, rate: Rates, omega_h: Triple, turn_h: Triple, turn_b: Triple, alpha: Scalar
) -> Accelerations:
    """Accelerations from differentiated gyroscopes: the time derivative of (3) and (4), exact.

    Args:
        angles: of trunk and bicycle.
        rate: theirs, from :func:`rates`.
        omega_h: trunk's angular rate, trunk axes, rad/s.
        turn_h: its derivative in trunk axes, rad/s².
        turn_b: of the bicycle's angular rate, IMU axes.
        alpha: tilt of the bicycle's IMU.
    """
    s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
    s_t, c_t = sin(angles.theta), cos(angles.theta)
    s_p, c_p = sin(angles.phi), cos(angles.phi)
    s_a, c_a = sin(alpha), cos(alpha)
    s_b, c_b = sin(angles.phi_b), cos(angles.phi_b)
    # ψ̈: derivative of (3), with that of 1 / cos φ_b
    yaw = (-s_a * turn_b[0] + c_a * turn_b[2]) / c_b + rate.psi * rate.phi_b * s_b / c_b
    # ω'_y, ω'_z and their derivatives, in axes without the rotation by φ
    y, z = c_p * omega_h[1] - s_p * omega_h[2], s_p * omega_h[1] + c_p * omega_h[2]
    turn_y = c_p * turn_h[1] - s_p * turn_h[2] - rate.phi * z
    turn_z = s_p * turn_h[1] + c_p * turn_h[2] + rate.phi * y
    # φ̈_h: derivative of s_θ φ̇_h = ω'_z − c_θ c_φh ψ̇, divided by s_θ
    lean = (
        turn_z
        + s_t * c_h * rate.theta * rate.psi
        + c_t * s_h * rate.phi_h * rate.psi
        - c_t * c_h * yaw
        - c_t * rate.theta * rate.phi_h
    ) / s_t
    return Accelerations(
        lean, turn_y - c_h * rate.phi_h * rate.psi - s_h * yaw, turn_h[0], c_a * turn_b[0] + s_a * turn_b[2], yaw
    )


def point_acceleration(
    l: Scalar,  # noqa: E741
    h: Scalar,
    phi_b: Scalar,
    rate: Rates,
    acceleration: Accelerations,
    travel: Travel,
) -> Triple:
    """Acceleration (without gravity, axes of R) of the point ``l`` ahead of the contact at height ``h``, m/s².

    With l_s and h_s it is exactly that of the seat; the paper's (5) lacks v_b ψ̇ and the rotation of φ̇_b by ψ̇.
    """
    s_b, c_b = sin(phi_b), cos(phi_b)
    squared = rate.psi * rate.psi
    # x: v̇_b, Euler, Coriolis and centripetal term of the yaw; y: v_b ψ̇, Euler and centripetal terms of yaw and roll;
    # z: those of the roll
    return (
        travel.acceleration - h * s_b * acceleration.psi - 2.0 * h * c_b * rate.phi_b * rate.psi - l * squared,
        travel.speed * rate.psi
        + l * acceleration.psi
        + h * (c_b * acceleration.phi_b - s_b * rate.phi_b * rate.phi_b - s_b * squared),
        h * (s_b * acceleration.phi_b + c_b * rate.phi_b * rate.phi_b),
    )


def trunk_axis(angles: Angles) -> Triple:
    """Unit vector u up the trunk, axes of R."""
    s_t = sin(angles.theta)
    return cos(angles.theta), sin(angles.phi_h) * s_t, -cos(angles.phi_h) * s_t


def axis_motion(angles: Angles, rate: Rates, acceleration: Accelerations) -> tuple[Triple, Triple]:
    """First and second derivative of the trunk's axis, seen from the ground, axes of R."""
    s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
    s_t, c_t = sin(angles.theta), cos(angles.theta)
    lean, pitch = rate.phi_h, rate.theta
    x, y, z = c_t, s_h * s_t, -c_h * s_t
    # u = (c_θ, s_φh s_θ, −c_φh s_θ): first and second derivative of its components in R
    dx, dy, dz = -s_t * pitch, c_h * s_t * lean + s_h * c_t * pitch, s_h * s_t * lean - c_h * c_t * pitch
    both = lean * lean + pitch * pitch
    ddx = -s_t * acceleration.theta - c_t * pitch * pitch
    ddy = c_h * s_t * acceleration.phi_h + s_h * c_t * acceleration.theta + 2.0 * c_h * c_t * lean * pitch - y * both
    ddz = s_h * s_t * acceleration.phi_h - c_h * c_t * acceleration.theta + 2.0 * s_h * c_t * lean * pitch - z * both
    # R rotates by ψ̇ about z: u̇ + ψ̇ z × u, and ü + 2 ψ̇ z × u̇ + ψ̈ z × u − ψ̇² (u without its z)
    yaw, squared = rate.psi, rate.psi * rate.psi
    first = (dx - yaw * y, dy + yaw * x, dz)
    second = (
        ddx - 2.0 * yaw * dy - acceleration.psi * y - squared * x,
        ddy + 2.0 * yaw * dx + acceleration.psi * x - squared * y,
        ddz,
    )
    return first, second


def rate_jacobians(
    angles: Angles, omega_h: Triple, omega_b: Triple, alpha: Scalar, published: bool = False
) -> tuple[Array, Array]:
    """Jacobians of the four angle rates: by the seven states (20), and by ω_h and ω_b (G of the process noise).

    Args:
        angles: of trunk and bicycle, arrays.
        omega_h: trunk's angular rate without bias.
        omega_b: the bicycle's.
        alpha: tilt of its IMU.
        published: F_17 with the published sign +c_φ/s_θ; the correct one is minus.

    Returns:
        ``(..., 4, 7)`` and ``(..., 4, 6)``.
    """
    s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
    s_t, c_t = sin(angles.theta), cos(angles.theta)
    s_p, c_p = sin(angles.phi), cos(angles.phi)
    s_a, c_a = sin(alpha), cos(alpha)
    s_b, c_b = sin(angles.phi_b), cos(angles.phi_b)
    # κ = −c_φb ψ̇, and the trunk's rates ω'_y, ω'_z in its axes before the spin φ
    kappa = s_a * omega_b[0] - c_a * omega_b[2]
    y, z = c_p * omega_h[1] - s_p * omega_h[2], s_p * omega_h[1] + c_p * omega_h[2]
    rate = rates(angles, omega_h, omega_b, alpha)
    sign = 1.0 if published else -1.0
    # F_X of (20), columns φ_h, θ, φ, φ_b, b: derivatives of (4) for φ̇_h, θ̇ and φ̇; φ̇_b of (3) is state-independent
    by_state: list[list[Any]] = [
        [
            -c_t * s_h * kappa / (s_t * c_b),
            (rate.phi - omega_h[0]) / s_t,
            y / s_t,
            s_b * c_t * c_h * kappa / (c_b * c_b * s_t),
            0.0,
            -s_p / s_t,
            sign * c_p / s_t,
        ],
        [c_h * kappa / c_b, 0.0, -z, s_b * s_h * kappa / (c_b * c_b), 0.0, -c_p, s_p],
        [
            s_h * kappa / (c_b * s_t),
            rate.phi_h / s_t,
            -c_t * y / s_t,
            -s_b * c_h * kappa / (c_b * c_b * s_t),
            -1.0,
            c_t * s_p / s_t,
            c_t * c_p / s_t,
        ],
        [0.0] * 7,
    ]
    # derivatives of φ̇_h, θ̇, φ̇ by the yaw rate ψ̇ = (−s_α ω_bx + c_α ω_bz) / c_φb of (3)
    by_yaw = (-c_t * c_h / s_t, -s_h, c_h / s_t)
    # G, columns ω_h, ω_b: derivatives of (4) by the trunk's gyroscope, and through ψ̇ by the bicycle's
    by_rate: list[list[Any]] = [
        [*gyroscope, -by * s_a / c_b, 0.0, by * c_a / c_b]
        for gyroscope, by in zip(
            ([0.0, s_p / s_t, c_p / s_t], [0.0, c_p, -s_p], [1.0, -c_t * s_p / s_t, -c_t * c_p / s_t]),
            by_yaw,
            strict=True,
        )
    ]
    # φ̇_b = c_α ω_bx + s_α ω_bz
    zero = 0.0 * angles.phi_h
    by_rate.append([0.0, 0.0, 0.0, c_a + zero, 0.0, s_a + zero])
    return rows(by_state), rows(by_rate)


def true_angles(truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The quantities of the filter from the truth of the environment.

    Args:
        truth: with ``bicycle/orientation`` and ``trunk/orientation`` ``(T, 4)``, body to world.

    Returns:
        ``force-inertial/trunk_angles`` ``(T, 3)``: φ_h, θ, φ of the trunk relative to R, which yaws but does not roll
        with the bicycle, rad.

    Raises:
        ValueError: an orientation is missing.
    """
    for name in ("bicycle/orientation", "trunk/orientation"):
        if name not in truth:
            raise ValueError(f"the truth must contain {name!r}, got {sorted(truth)}")
    bicycle, trunk = truth["bicycle/orientation"], truth["trunk/orientation"]
    yaw = rotation.to_euler_zyx(bicycle)[0]
    level = rotation.from_euler_zyx(yaw, 0.0 * yaw, 0.0 * yaw)
    seen = rotation.to_matrix(rotation.multiply(rotation.conjugate(level), trunk))
    M = DOWN @ seen @ UP_THE_TRUNK.T
    # M = Rx(φ_h) Ry(θ) Rx(φ) with 0 < θ < π
    angles = [
        np.arctan2(M[..., 1, 0], -M[..., 2, 0]),
        np.arctan2(np.hypot(M[..., 1, 0], M[..., 2, 0]), M[..., 0, 0]),
        np.arctan2(M[..., 0, 1], M[..., 0, 2]),
    ]
    return {"force-inertial/trunk_angles": np.stack(angles, axis=-1)}
