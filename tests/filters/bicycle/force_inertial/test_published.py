"""Equations (5) and (8) of the force/inertial paper, written out as they are published."""

from __future__ import annotations

import numpy as np

from poise.filters.bicycle.force_inertial.accelerometer import accelerometer_accelerations, yaw_acceleration
from poise.filters.bicycle.force_inertial.filter import ForceInertial
from poise.filters.bicycle.force_inertial.kinematics import Angles, Rates, Travel

RIDER = ForceInertial.published()
PX, PZ, LS, HS, H, G = 0.37, 0.71, 0.26, 0.38, 0.42, 9.8
"""Of table I, as the rider has them."""


def published_seat(phi_b, rate, yaw, speed_change):
    """(5) for the seat: [v̇_b, 0, g] + ω × (ω × r) + ω̇ × r with ω = [φ̇_b, 0, ψ̇] and ω̇ = [0, 0, ψ̈]."""
    r = np.array([LS, HS * np.sin(phi_b), -HS * np.cos(phi_b)])
    omega = np.array([rate.phi_b, 0.0, rate.psi])
    return np.array([speed_change, 0.0, G]) + np.cross(omega, np.cross(omega, r)) + np.cross([0.0, 0.0, yaw], r)


def published_accelerations(angles, rate, a_h, yaw, seat):
    """(8), both rows in the order in which they are printed."""
    s_h, c_h, s_t, c_t = (f(x) for x in (angles.phi_h, angles.theta) for f in (np.sin, np.cos))
    lean = (
        a_h[1] / (s_t * H)
        + s_h * c_h * rate.psi**2
        + c_h * rate.psi * rate.theta
        - s_h * c_t / s_t * rate.phi_h * rate.psi
        - c_t / s_t * rate.phi_h * rate.theta
        - c_h * c_t / s_t * yaw
        - c_h / (s_t * H) * seat[1]
        - s_h / (s_t * H) * seat[2]
    )
    pitch = (
        -a_h[2] / H
        - c_h * rate.phi_h * rate.psi
        + 2.0 * c_h * c_t**2 * rate.phi_h * rate.psi
        - s_t * c_t * c_h**2 * rate.psi**2
        + s_t * c_t * rate.phi_h**2
        - s_h * yaw
        + s_t * seat[0] / H
        - c_t * s_h * seat[1] / H
        + c_h * seat[2] * c_t / H
    )
    return lean, pitch


def test_the_published_form_is_the_printed_one():
    rng = np.random.default_rng(0)
    for _ in range(20):
        angles = Angles(*rng.uniform((-0.6, 0.6, -0.6, -0.4), (0.6, 1.5, 0.6, 0.4)))
        rate = Rates(*rng.normal(0.0, 0.8, len(Rates._fields)))
        travel, a_h, a_by = Travel(rng.uniform(1.0, 5.0), rng.normal()), rng.normal(0.0, 3.0, 3), rng.normal()
        yaw = yaw_acceleration(a_by, angles.phi_b, rate, 0.0, travel, RIDER, published=True)
        tangent = np.tan(angles.phi_b)
        printed = (
            a_by / (PX * np.cos(angles.phi_b))
            - np.sin(angles.phi_b) * PZ / PX * rate.psi**2
            - tangent * rate.psi * rate.phi_b
            - tangent * G / PX
        )
        np.testing.assert_allclose(yaw, printed, rtol=1e-12)
        found = accelerometer_accelerations(
            angles, rate, tuple(a_h), a_by, rng.normal(), 0.0, travel, RIDER, published=True
        )
        seat = published_seat(angles.phi_b, rate, yaw, travel.acceleration)
        np.testing.assert_allclose(found[:2], published_accelerations(angles, rate, a_h, yaw, seat), rtol=1e-10)
