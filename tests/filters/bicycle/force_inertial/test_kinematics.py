"""Kinematics of the force/inertial filter against frames of sympy.physics.mechanics; static poses; steady turns."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from sympy.physics.mechanics import Point, ReferenceFrame, dynamicsymbols

from poise.filters.bicycle.force_inertial.accelerometer import accelerometer_accelerations, yaw_acceleration
from poise.filters.bicycle.force_inertial.filter import ForceInertial
from poise.filters.bicycle.force_inertial.kinematics import (
    Angles,
    Rates,
    Travel,
    axis_motion,
    gyroscope_accelerations,
    point_acceleration,
    rate_jacobians,
    rates,
    trunk_axis,
)

ALPHA, P_X, P_Z, L_S, H_S, H, G = 0.17, 0.37, 0.71, 0.26, 0.9, 0.42, 9.8
RIDER = ForceInertial.published(pivot_height=H_S, trunk_imu_height=H)
"""With the lengths above."""


@pytest.fixture(scope="module")
def oracle():
    """Sensors of a trunk on a bicycle as functions of 5 angles, their first and second derivatives, v and v'."""
    t = dynamicsymbols._t
    q = dynamicsymbols("phi_h theta phi phi_b psi")
    v = dynamicsymbols("v")
    ground, R, B = ReferenceFrame("N"), ReferenceFrame("R"), ReferenceFrame("B")
    R.orient_axis(ground, ground.z, q[4])
    B.orient_axis(R, R.x, q[3])
    imu, trunk = ReferenceFrame("Ib"), ReferenceFrame("Ih")
    imu.orient_axis(B, B.y, ALPHA)
    trunk.orient_body_fixed(R, (q[0], q[1], q[2]), "XYX")
    contact = Point("C2")
    contact.set_vel(ground, v * R.x)

    def moved(name, place):
        point = contact.locatenew(name, place)
        point.set_vel(ground, contact.vel(ground) + place.dt(ground))
        return point.vel(ground).dt(ground)

    seat = L_S * B.x - H_S * B.z
    down = G * ground.z
    w_h, w_b = trunk.ang_vel_in(ground), imu.ang_vel_in(ground)
    columns = [
        *w_h.to_matrix(trunk),
        *w_b.to_matrix(imu),
        *w_h.to_matrix(trunk).diff(t),
        *w_b.to_matrix(imu).diff(t),
        *(moved("imu", P_X * B.x - P_Z * B.z) - down).to_matrix(imu),
        *(moved("trunk", seat + H * trunk.x) - down).to_matrix(trunk),
        *moved("seat", seat).to_matrix(R),
        *trunk.x.to_matrix(R),
        *trunk.x.dt(ground).to_matrix(R),
        *trunk.x.dt(ground).dt(ground).to_matrix(R),
    ]
    names = sympy.symbols("x0:17")
    replaced = [*(x.diff(t, 2) for x in q), *(x.diff(t) for x in q), v.diff(t), *q, v]
    order = [*range(10, 15), *range(5, 10), 16, *range(5), 15]
    table = list(zip(replaced, [names[k] for k in order], strict=True))
    formulas = [column.subs(table) for column in columns]
    compute = sympy.lambdify(names, formulas, cse=True)

    def sensors(x):
        values = np.array(compute(*x), dtype=float).reshape(-1, 3)
        return dict(
            zip(("w_h", "w_b", "dw_h", "dw_b", "a_b", "a_h", "seat", "u", "du", "ddu"), map(tuple, values), strict=True)
        )

    return sensors


def draw(rng):
    """Angles, rates, accelerations (the trunk's spin as its own), travel, and the oracle's 17 numbers."""
    q = np.array([*rng.uniform(-0.5, 0.5, 1), rng.uniform(0.6, 1.5), *rng.uniform(-0.6, 0.6, 2), rng.uniform(-3, 3)])
    dq, ddq = rng.uniform(-1.0, 1.0, 5), rng.uniform(-2.0, 2.0, 5)
    speed, push = rng.uniform(0.5, 6.0), rng.uniform(-2.0, 2.0)
    return q, dq, ddq, speed, push, np.concatenate([q, dq, ddq, [speed, push]])


def test_everything_is_that_of_the_frames(oracle):
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, dq, ddq, speed, push, numbers = draw(rng)
        true = oracle(numbers)
        angles, travel = Angles(*q[:4]), Travel(speed, push)
        rate = rates(angles, true["w_h"], true["w_b"], ALPHA)
        np.testing.assert_allclose(rate, dq, atol=1e-12)
        found = gyroscope_accelerations(angles, rate, true["w_h"], true["dw_h"], true["dw_b"], ALPHA)
        wanted = (ddq[0], ddq[1], true["dw_h"][0], ddq[3], ddq[4])
        np.testing.assert_allclose(found, wanted, atol=1e-11)
        np.testing.assert_allclose(trunk_axis(angles), true["u"], atol=1e-14)
        first, second = axis_motion(angles, rate, found)
        np.testing.assert_allclose(first, true["du"], atol=1e-12)
        np.testing.assert_allclose(second, true["ddu"], atol=1e-11)
        seat = point_acceleration(L_S, H_S, angles.phi_b, rate, found, travel)
        np.testing.assert_allclose(seat, true["seat"], atol=1e-11)
        yaw = yaw_acceleration(true["a_b"][1], angles.phi_b, rate, found.phi_b, travel, RIDER)
        assert yaw == pytest.approx(ddq[4], abs=1e-10)
        rest = (true["a_h"], true["a_b"][1], found.phi_b, found.axial, travel, RIDER)
        np.testing.assert_allclose(accelerometer_accelerations(angles, rate, *rest), wanted, atol=1e-10)


def test_printed_accelerations_are_wrong_where_the_errata_say(oracle):
    """(7): without v_b ψ̇ and with +g. Its correct form is right in the same steady turn."""
    q = np.array([-0.35, 1.05, 0.5, -0.09, 0.0])
    numbers = np.concatenate([q, [0.0, 0.0, 0.0, 0.0, -0.8], np.zeros(5), [2.0, 0.0]])
    true, rate, travel = oracle(numbers), Rates(0.0, 0.0, 0.0, 0.0, -0.8), Travel(2.0, 0.0)
    a_by = true["a_b"][1]
    assert yaw_acceleration(a_by, q[3], rate, 0.0, travel, RIDER) == pytest.approx(0.0, abs=1e-12)
    published = yaw_acceleration(a_by, q[3], rate, 0.0, travel, RIDER, published=True)
    s, c = np.sin(q[3]), np.cos(q[3])
    # what (7) leaves out or turns round, divided by p_x c
    lacking = c * 2.0 * -0.8 - 2.0 * s * G - 2.0 * P_Z * s * c * 0.64
    assert published == pytest.approx(lacking / (P_X * c), abs=1e-12)
    assert abs(published) > 0.5


def test_rest_gives_no_acceleration_from_accelerometers(oracle):
    rng = np.random.default_rng(1)
    for _ in range(10):
        q = draw(rng)[0]
        true = oracle(np.concatenate([q, np.zeros(12)]))
        rest = (true["a_h"], true["a_b"][1], 0.0, 0.0, Travel(0.0, 0.0), RIDER)
        found = accelerometer_accelerations(Angles(*q[:4]), Rates(*np.zeros(5)), *rest)
        np.testing.assert_allclose(found, 0.0, atol=1e-12)
        published = accelerometer_accelerations(Angles(*q[:4]), Rates(*np.zeros(5)), *rest, published=True)
        assert np.abs(published).max() > 1.0


def test_jacobians_are_central_differences():
    rng, step = np.random.default_rng(2), 1e-6
    for _ in range(10):
        q, omega_h, omega_b = draw(rng)[0], rng.normal(size=3), rng.normal(size=3)

        def change(y, omega_h=omega_h, omega_b=omega_b):
            angles = Angles(*y[:4])
            return np.array(rates(angles, tuple(omega_h + y[7:10] - y[4:7]), tuple(omega_b + y[10:]), ALPHA)[:4])

        y = np.concatenate([q[:4], np.zeros(9)])
        wanted = np.stack([(change(y + step * e) - change(y - step * e)) / (2 * step) for e in np.eye(13)], axis=-1)
        states, inputs = rate_jacobians(Angles(*(np.array(a) for a in q[:4])), tuple(omega_h), tuple(omega_b), ALPHA)
        np.testing.assert_allclose(states, wanted[:, :7], atol=1e-7)
        np.testing.assert_allclose(inputs, wanted[:, 7:], atol=1e-7)
        published, _ = rate_jacobians(
            Angles(*(np.array(a) for a in q[:4])), tuple(omega_h), tuple(omega_b), ALPHA, published=True
        )
        different = np.argwhere(np.abs(published - states) > 1e-12)
        assert different.tolist() == [[0, 6]]
