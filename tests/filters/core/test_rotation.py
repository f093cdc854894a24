"""Rotations against SciPy, SymPy's reference frames, finite differences, and torch."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp
from sympy.physics.mechanics import ReferenceFrame

from poise.filters.core import rotation

N = 300


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture
def q(rng: np.random.Generator) -> np.ndarray:
    return rotation.random(rng, (N,))


def scipy_of(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(rotation.to_xyzw(q))


def same_rotation(a: np.ndarray, b: np.ndarray, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(rotation.angle(rotation.multiply(rotation.conjugate(a), b)), 0.0, atol=atol)


unit = st.floats(-1.0, 1.0)
axes = (
    st.tuples(unit, unit, unit)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: v / np.linalg.norm(v))
)
angles = st.one_of(
    st.floats(0.0, math.pi),
    st.floats(-300.0, -3.0).map(lambda exponent: 10.0**exponent),
    st.floats(-15.0, -3.0).map(lambda exponent: math.pi - 10.0**exponent),
    st.sampled_from([0.0, 1e-4, math.nextafter(1e-4, 0.0), 2e-4, math.pi, math.pi / 2]),
)


# Against SciPy


def test_products_and_turned_vectors_equal_scipy(q, rng):
    p, v = rotation.random(rng, (N,)), rng.standard_normal((N, 3))
    same_rotation(rotation.multiply(p, q), rotation.from_xyzw((scipy_of(p) * scipy_of(q)).as_quat()))
    np.testing.assert_allclose(rotation.rotate(q, v), scipy_of(q).apply(v), atol=1e-13)
    np.testing.assert_allclose(rotation.rotate_back(q, v), scipy_of(q).inv().apply(v), atol=1e-13)
    np.testing.assert_allclose(rotation.to_matrix(q), scipy_of(q).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(rotation.angle(q), scipy_of(q).magnitude(), atol=1e-14)
    np.testing.assert_allclose(rotation.angle(-5.0 * q), scipy_of(q).magnitude(), atol=1e-14)


def test_exponential_and_logarithm_equal_scipy(q, rng):
    vectors = scipy_of(q).as_rotvec()
    np.testing.assert_allclose(rotation.log(q), vectors, atol=1e-13)
    long = 10.0 * rng.standard_normal((N, 3))
    same_rotation(rotation.exp(long), rotation.from_xyzw(Rotation.from_rotvec(long).as_quat()))
    np.testing.assert_allclose(rotation.exp_matrix(long), Rotation.from_rotvec(long).as_matrix(), atol=1e-13)
    axis, angle = rotation.normalize(vectors), rotation.norm(vectors)[:, 0]
    same_rotation(rotation.from_axis_angle(axis, angle), q)


def test_yaw_pitch_roll_equal_scipy(q):
    expected = scipy_of(q).as_euler("ZYX")
    found = rotation.to_euler_zyx(q)
    np.testing.assert_allclose(np.stack(found, axis=-1), expected, atol=1e-10)
    same_rotation(rotation.from_euler_zyx(*found), q)


def test_x_y_z_angles_equal_scipy(q):
    found = rotation.to_euler_xyz(q)
    np.testing.assert_allclose(np.stack(found, axis=-1), scipy_of(q).as_euler("XYZ"), atol=1e-10)
    same_rotation(rotation.from_euler_xyz(*found), q)


def test_slerp_by_exponential_equals_scipy(q):
    a, b = q[0], q[1]
    step = rotation.log(rotation.multiply(rotation.conjugate(a), b))
    weights = np.linspace(0, 1, 11)
    between = rotation.multiply(a, rotation.exp(weights[:, None] * step))
    same_rotation(between, rotation.from_xyzw(Slerp([0, 1], scipy_of(q[:2]))(weights).as_quat()))


# Against SymPy's frames: independent of any quaternion convention


def test_angles_and_up_vector_equal_the_symbolic_frames(rng):
    yaw, pitch, roll = sympy.symbols("yaw pitch roll")
    world, body = ReferenceFrame("W"), ReferenceFrame("B")
    body.orient_body_fixed(world, (yaw, pitch, roll), "ZYX")
    # dcm turns world components into body components.
    body_to_world = sympy.lambdify((yaw, pitch, roll), body.dcm(world).T, "numpy")
    up = sympy.lambdify((yaw, pitch, roll), world.z.to_matrix(body), "numpy")
    for angles in rng.uniform((-3.1, -1.5, -3.1), (3.1, 1.5, 3.1), (20, 3)):
        q = rotation.from_euler_zyx(*(np.array(value) for value in angles))
        np.testing.assert_allclose(rotation.to_matrix(q), body_to_world(*angles), atol=1e-13)
        np.testing.assert_allclose(rotation.up_in_body(q), np.ravel(up(*angles)), atol=1e-13)
        np.testing.assert_allclose(rotation.to_euler_zyx(q), angles, atol=1e-9)
        np.testing.assert_allclose(rotation.roll_pitch(rotation.up_in_body(q)), angles[:0:-1], atol=1e-12)


def test_the_frame_turned_by_an_axis_and_angle(rng):
    world, body = ReferenceFrame("W"), ReferenceFrame("B")
    axis = rotation.normalize(rng.standard_normal(3))
    body.orient_axis(world, sum(c * v for c, v in zip(axis, (world.x, world.y, world.z), strict=True)), 0.7)
    expected = np.array(body.dcm(world).T, dtype=float)
    np.testing.assert_allclose(rotation.exp_matrix(0.7 * axis), expected, atol=1e-13)


# Identities


def test_up_is_the_vertical_in_body_coordinates_and_level_restores_it(q):
    up = rotation.up_in_body(q)
    np.testing.assert_allclose(up, rotation.rotate_back(q, np.array([0.0, 0.0, 1.0])), atol=1e-13)
    level = rotation.level(9.81 * up)
    np.testing.assert_allclose(rotation.up_in_body(level), up, atol=1e-12)
    yaw, _, _ = rotation.to_euler_zyx(level)
    np.testing.assert_allclose(yaw, 0.0, atol=1e-12)


@pytest.mark.parametrize("up", [(0, 0, -1.0), (1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0)])
def test_level_where_angles_are_singular(up):
    np.testing.assert_allclose(rotation.up_in_body(rotation.level(np.array(up))), up, atol=1e-15)


def test_products_with_matrices(q, rng):
    a, b = rng.standard_normal((2, N, 3))
    np.testing.assert_allclose(rotation.cross(a, b), np.cross(a, b))
    np.testing.assert_allclose((rotation.skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)
    same_rotation(rotation.multiply(q, rotation.conjugate(q)), rotation.identity(q))
    np.testing.assert_array_equal(rotation.from_xyzw(rotation.to_xyzw(q)), q)
    np.testing.assert_allclose(rotation.norm(q), 1.0)


def test_leading_dimensions_broadcast(rng):
    q, v = rotation.random(rng, (4, 1)), rng.standard_normal((5, 3))
    turned = rotation.rotate(q, v)
    assert turned.shape == (4, 5, 3)
    np.testing.assert_allclose(turned[2, 3], rotation.rotate(q[2, 0], v[3]))
    assert rotation.to_matrix(q).shape == (4, 1, 3, 3)
    assert rotation.identity(v).shape == (5, 4)


@given(st.floats(-1e3, 1e3))
def test_wrapping_keeps_the_angle(value):
    wrapped = float(rotation.wrap(np.array(value)))
    assert abs(wrapped) <= math.pi
    assert math.isclose(math.cos(wrapped - value), 1.0, abs_tol=1e-12)


# Every angle, tiny and half a turn included


@settings(max_examples=300)
@given(axes, angles)
def test_logarithm_undoes_the_exponential(axis, angle):
    vector = angle * axis
    found = rotation.log(rotation.exp(vector))
    if angle < math.pi - 1e-7:
        # Numbers below 1e-300 have fewer digits.
        np.testing.assert_allclose(found, vector, rtol=1e-9, atol=4e-15 if angle > 1e-3 else 1e-15 * angle + 1e-300)
    # At half a turn the axis may come back reversed.
    same_rotation(rotation.exp(found), rotation.exp(vector), atol=1e-14)
    assert rotation.norm(found)[0] <= math.pi + 1e-14
    assert abs(float(rotation.norm(rotation.exp(vector))[0]) - 1.0) < 1e-15 * 4


@settings(max_examples=300)
@given(st.floats(-3.1, 3.1), st.sampled_from([-1.0, 1.0]), angles, st.floats(-3.1, 3.1))
def test_angles_give_the_rotation_back_also_beside_the_vertical(yaw, sign, away, roll):
    q = rotation.from_euler_zyx(*(np.array(x) for x in (yaw, sign * (math.pi - away) / 2.0, roll)))
    for same in (q, -q):
        found = rotation.to_euler_zyx(same)
        same_rotation(rotation.from_euler_zyx(*found), q, atol=1e-14)
        assert abs(found[1]) <= math.pi / 2 + 1e-15


@settings(max_examples=300)
@given(axes, angles)
def test_matrices_give_their_quaternion_back(axis, angle):
    q = rotation.exp(angle * axis)
    found = rotation.from_matrix(rotation.to_matrix(q))
    assert found[0] >= 0.0
    same_rotation(found, q, atol=1e-14)


def test_half_turns_have_a_quaternion():
    for axis in np.eye(3):
        q = rotation.from_matrix(2.0 * np.outer(axis, axis) - np.eye(3))
        np.testing.assert_allclose(np.abs(q), [0.0, *axis], atol=1e-15)


def test_the_series_joins_its_closed_form():
    edge = math.sqrt(rotation.SMALL_ANGLE_SQUARED)
    for size in (edge * (1 - 1e-9), edge * (1 + 1e-9), 2 * edge):
        q = rotation.exp(np.array([size, 0.0, 0.0]))
        assert q[0] == pytest.approx(math.cos(size / 2), rel=1e-15)
        assert q[1] == pytest.approx(math.sin(size / 2), rel=1e-15)
        assert rotation.log(q)[0] == pytest.approx(size, rel=1e-15)


# Derivatives


def test_derivative_of_a_turned_vector_is_the_cross_product(q, rng):
    """R(q ⊗ exp(ε)) v = R v − R skew(v) ε, on which every error-state filter rests."""
    v, step = rng.standard_normal((N, 3)), 1e-6
    for i in range(3):
        nudge = step * np.eye(3)[i]
        plus = rotation.rotate(rotation.multiply(q, rotation.exp(nudge)), v)
        minus = rotation.rotate(rotation.multiply(q, rotation.exp(-nudge)), v)
        expected = -(rotation.to_matrix(q) @ rotation.skew(v))[..., i]
        np.testing.assert_allclose((plus - minus) / (2 * step), expected, atol=1e-8)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-4, 2e-4, 1.0, 3.0])
def test_gradients_of_exp_and_log_are_finite_and_right(size, rng):
    axis = torch.tensor(rotation.normalize(rng.standard_normal(3)))
    vector = (size * axis).requires_grad_()
    jacobian = torch.autograd.functional.jacobian(lambda v: rotation.log(rotation.exp(v)), vector)
    np.testing.assert_allclose(jacobian, np.eye(3), atol=1e-7)
    jacobian = torch.autograd.functional.jacobian(rotation.exp, vector)
    step = 1e-5
    numeric = [
        (rotation.exp(vector.detach().numpy() + d) - rotation.exp(vector.detach().numpy() - d)) / (2 * step)
        for d in step * np.eye(3)
    ]
    np.testing.assert_allclose(jacobian.T, numeric, atol=1e-9)


# torch


def test_torch_gives_the_same(q, rng):
    p, v = rotation.random(rng, (N,)), rng.standard_normal((N, 3))
    cases = [
        (rotation.multiply, (p, q)),
        (rotation.rotate, (q, v)),
        (rotation.rotate_back, (q, v)),
        (rotation.to_matrix, (q,)),
        (rotation.from_matrix, (rotation.to_matrix(q),)),
        (rotation.exp, (v,)),
        (rotation.exp, (1e-6 * v,)),
        (rotation.log, (q,)),
        (rotation.to_euler_zyx, (q,)),
        (rotation.from_euler_zyx, tuple(v.T)),
        (rotation.up_in_body, (q,)),
        (rotation.level, (v,)),
        (rotation.angle, (q,)),
        (rotation.wrap, (9 * v,)),
        (rotation.identity, (q,)),
        (rotation.skew, (v,)),
        (rotation.from_xyzw, (q,)),
        (rotation.from_axis_angle, (rotation.normalize(v), v[:, 0])),
    ]
    for function, arguments in cases:
        expected = function(*arguments)
        found = function(*(torch.tensor(np.ascontiguousarray(argument)) for argument in arguments))
        pairs = zip(found, expected, strict=True) if isinstance(expected, tuple) else [(found, expected)]
        for a, b in pairs:
            assert a.dtype == torch.float64
            np.testing.assert_allclose(a, b, atol=1e-12, err_msg=function.__name__)


def test_random_rotations_are_uniform():
    q = rotation.random(np.random.default_rng(0), (20_000,))
    np.testing.assert_allclose(rotation.to_matrix(q).mean(0), 0.0, atol=0.02)
    # Of uniform rotations the density of the angle is (1 − cos) / pi, its mean pi / 2 + 2 / pi.
    assert rotation.angle(q).mean() == pytest.approx(math.pi / 2 + 2 / math.pi, abs=0.02)


def test_nearest_matrix_equals_the_singular_value_decomposition(q, rng):
    for spread in (0.0, 0.05, 0.4, 1.0):
        m = rotation.to_matrix(q) + spread * rng.standard_normal((N, 3, 3))
        left, values, right = np.linalg.svd(m)
        values[:, 2] *= np.sign(np.linalg.det(m))
        sign = np.ones((N, 3))
        sign[:, 2] = np.sign(np.linalg.det(left @ right))
        expected = (left * sign[:, None, :]) @ right
        well = values[:, 1] + values[:, 2] > 0.3 * values[:, 0]  # two large singular values: well conditioned
        assert well.mean() > 0.5
        np.testing.assert_allclose(rotation.nearest_matrix(m)[well], expected[well], atol=1e-9)
    mirror = np.diag([1.0, 0.9, -0.2])
    np.testing.assert_allclose(rotation.nearest_matrix(mirror), np.eye(3), atol=1e-12)
