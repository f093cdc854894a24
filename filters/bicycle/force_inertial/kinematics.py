"""Kinematics of a trunk on a bicycle for the force/inertial filter: (1)–(8) of the paper, corrected.

Y. Zhang, K. Chen, J. Yi, "Rider Trunk and Bicycle Pose Estimation With Fusion of Force/Inertial Sensors", IEEE
Transactions on Biomedical Engineering 60, 2013, doi 10.1109/TBME.2013.2260339. The paper's axes: R has its origin in
the rear contact, x forward along the contact line, y right, **z down**, and turns by ψ; the bicycle is B = R Rx(φ_b),
its IMU B Ry(α), the trunk R Rx(φ_h) Ry(θ) Rx(φ), whose **x axis points up the trunk**: θ = 90° is upright.

Everything takes and gives scalars: arrays ``(...)`` or :class:`.Dual`. SI units, rad.

Differs from the publication: (7) and (8) are an option, with and without their errors (:mod:`.accelerometer`). The
default differentiates the gyroscopes, which is exact, holds no gravity and divides by no p_x.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ...analysis.forward_mode import Scalar, cos, sin
from ...core.backend import Array, rows

Triple = tuple[Scalar, Scalar, Scalar]


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
    """Second derivatives, rad/s²; the trunk's spin is told by its rate about its own axis."""

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
    s_phi, c_phi = sin(angles.phi), cos(angles.phi)
    s_theta, c_theta = sin(angles.theta), cos(angles.theta)
    s_a, c_a = sin(alpha), cos(alpha)
    yaw = (-s_a * omega_b[0] + c_a * omega_b[2]) / cos(angles.phi_b)
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
    yaw = (-s_a * turn_b[0] + c_a * turn_b[2]) / c_b + rate.psi * rate.phi_b * s_b / c_b
    y, z = c_p * omega_h[1] - s_p * omega_h[2], s_p * omega_h[1] + c_p * omega_h[2]
    turn_y = c_p * turn_h[1] - s_p * turn_h[2] - rate.phi * z
    turn_z = s_p * turn_h[1] + c_p * turn_h[2] + rate.phi * y
    lean = (
        turn_z
        + s_t * c_h * rate.theta * rate.psi
        + c_t * s_h * rate.phi_h * rate.psi
        - c_t * c_h * yaw
        - c_t * rate.theta * rate.phi_h
    ) / s_t
    return Accelerations(
        lean,
        turn_y - c_h * rate.phi_h * rate.psi - s_h * yaw,
        turn_h[0],
        c_a * turn_b[0] + s_a * turn_b[2],
        yaw,
    )


def point_acceleration(
    l: Scalar,  # noqa: E741
    h: Scalar,
    phi_b: Scalar,
    rate: Rates,
    acceleration: Accelerations,
    travel: Travel,
) -> Triple:
    """Acceleration (without gravity, axes of R) of the bicycle's point ``l`` ahead of the contact and ``h`` high, m/s².

    With l_s and h_s it is that of the seat, exactly; the paper's (5) lacks v_b ψ̇ and the rotation of φ̇_b by ψ̇.
    """
    s_b, c_b = sin(phi_b), cos(phi_b)
    squared = rate.psi * rate.psi
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
    # derivatives of the components, then those of the turning axes
    dx, dy, dz = -s_t * pitch, c_h * s_t * lean + s_h * c_t * pitch, s_h * s_t * lean - c_h * c_t * pitch
    both = lean * lean + pitch * pitch
    ddx = -s_t * acceleration.theta - c_t * pitch * pitch
    ddy = c_h * s_t * acceleration.phi_h + s_h * c_t * acceleration.theta + 2.0 * c_h * c_t * lean * pitch - y * both
    ddz = s_h * s_t * acceleration.phi_h - c_h * c_t * acceleration.theta + 2.0 * s_h * c_t * lean * pitch - z * both
    yaw, squared = rate.psi, rate.psi * rate.psi
    first = (dx - yaw * y, dy + yaw * x, dz)
    second = (
        ddx - 2.0 * yaw * dy - acceleration.psi * y - squared * x,
        ddy + 2.0 * yaw * dx + acceleration.psi * x - squared * y,
        ddz,
    )
    return first, second


def rate_jacobians(
    angles: Angles, omega_h: Triple, omega_b: Triple, alpha: Scalar, printed: bool = False
) -> tuple[Array, Array]:
    """Jacobians of the four angle rates: by the seven states (20), and by ω_h and ω_b (G of the process noise).

    Args:
        angles: of trunk and bicycle, arrays.
        omega_h: trunk's angular rate without bias.
        omega_b: the bicycle's.
        alpha: tilt of its IMU.
        printed: take F_17 with the printed sign +c_φ/s_θ; the correct one is minus.

    Returns:
        ``(..., 4, 7)`` and ``(..., 4, 6)``.
    """
    s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
    s_t, c_t = sin(angles.theta), cos(angles.theta)
    s_p, c_p = sin(angles.phi), cos(angles.phi)
    s_a, c_a = sin(alpha), cos(alpha)
    s_b, c_b = sin(angles.phi_b), cos(angles.phi_b)
    kappa = s_a * omega_b[0] - c_a * omega_b[2]
    y, z = c_p * omega_h[1] - s_p * omega_h[2], s_p * omega_h[1] + c_p * omega_h[2]
    rate = rates(angles, omega_h, omega_b, alpha)
    sign = 1.0 if printed else -1.0
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
    # by the yaw rate, which the bicycle's gyroscope gives
    by_yaw = (-c_t * c_h / s_t, -s_h, c_h / s_t)
    by_rate: list[list[Any]] = [
        [*gyroscope, -by * s_a / c_b, 0.0, by * c_a / c_b]
        for gyroscope, by in zip(
            ([0.0, s_p / s_t, c_p / s_t], [0.0, c_p, -s_p], [1.0, -c_t * s_p / s_t, -c_t * c_p / s_t]),
            by_yaw,
            strict=True,
        )
    ]
    zero = 0.0 * angles.phi_h
    by_rate.append([0.0, 0.0, 0.0, c_a + zero, 0.0, s_a + zero])
    return rows(by_state), rows(by_rate)
