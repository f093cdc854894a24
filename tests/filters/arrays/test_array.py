"""Geometry of arrays against a body moved in sympy's frames, against differences, and the published figures."""

import json
import math

import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation
from sympy.physics import mechanics

from poise.filters.arrays.array import (
    ARRAYS,
    CONTROLLER,
    OCTA,
    PLANAR,
    TRIAXIAL,
    AccelerometerArray,
    controller,
    recorded_channel,
)
from poise.filters.arrays.files import describe_array, load_array, read_array
from poise.filters.arrays.products import centripetal, product_jacobian, products, symmetric

G = 9.81
UP = np.array([0.0, 0.0, G])


def attitude(t):
    return Rotation.from_euler("zyx", [0.7 * t + 0.4 * np.sin(3 * t), 1.1 * np.sin(2 * t), 0.5 * t**2])


def place(t):
    return np.array([0.3 * np.sin(5 * t), 0.2 * np.cos(4 * t), 0.1 * t**3])


def second_difference(path, t, h=1e-3):
    """Fourth-order central difference."""
    return (-path(t - 2 * h) + 16 * path(t - h) - 30 * path(t) + 16 * path(t + h) - path(t + 2 * h)) / (12 * h * h)


def body_rate(t, h=1e-4):
    return (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2 * h)


@pytest.mark.parametrize("array", [OCTA, CONTROLLER, TRIAXIAL], ids=lambda array: array.name)
@pytest.mark.parametrize("t", [0.2, 0.9, 1.7])
def test_readings_are_those_of_sensors_carried_along(array, t):
    """Each sensor's own path is differentiated twice; nothing of the array's formulas enters."""
    Q = attitude(t).as_matrix()
    direct = []
    for r, e in zip(array.r, array.e, strict=True):
        acceleration = second_difference(lambda s, r=r: place(s) + attitude(s).as_matrix() @ r, t)
        direct.append((Q @ e) @ (acceleration + UP))
    force = Q.T @ (second_difference(place, t) + UP)
    alpha = (body_rate(t + 1e-3) - body_rate(t - 1e-3)) / 2e-3
    np.testing.assert_allclose(array.readings(force, alpha, body_rate(t)), direct, atol=2e-4)


def test_readings_agree_with_sympy_frames():
    """OCTA on a body that turns about three dynamic axes, differentiated by sympy."""
    yaw, pitch, roll = mechanics.dynamicsymbols("yaw pitch roll")
    x, y, z = mechanics.dynamicsymbols("x y z")
    t = mechanics.dynamicsymbols._t
    world = mechanics.ReferenceFrame("W")
    body = world.orientnew("B", "Body", [yaw, pitch, roll], "ZYX")
    origin, centre = mechanics.Point("O"), mechanics.Point("P")
    origin.set_vel(world, 0)
    centre.set_pos(origin, x * world.x + y * world.y + z * world.z)
    centre.set_vel(world, centre.pos_from(origin).dt(world))
    values = {f: float(v) for f, v in zip((x, y, z, yaw, pitch, roll), (0, 0, 0, 0.3, -0.5, 1.1), strict=True)}
    rates = {f.diff(t): v for f, v in zip((x, y, z, yaw, pitch, roll), (0.1, 0.2, -0.4, 1.3, -2.0, 3.1), strict=True)}
    second = {f.diff(t, 2): v for f, v in zip((x, y, z, yaw, pitch, roll), (2, -3, 1, 4.0, 7.0, -5.0), strict=True)}

    def numbers(vector):
        entries = [sympy.sympify(vector.dot(axis)).subs(second).subs(rates).subs(values) for axis in body]
        return np.array(entries, float)

    omega = body.ang_vel_in(world)
    force = numbers(centre.acc(world) + G * world.z)
    alpha, rate = numbers(omega.dt(world)), numbers(omega)
    sensor = centre.locatenew("S", sum(c * axis for c, axis in zip(OCTA.r[4], body, strict=True)))
    sensor.v2pt_theory(centre, world, body)
    reading = OCTA.e[4] @ numbers(sensor.a2pt_theory(centre, world, body) + G * world.z)
    assert OCTA.readings(force, alpha, rate)[4] == pytest.approx(reading, abs=1e-9)


@pytest.mark.parametrize("t", [0.1, 0.8, 2.3])
def test_planar_readings_are_those_of_sensors_carried_along(t):
    def phi(s):
        return 0.4 + 2.0 * np.sin(1.7 * s)

    def turn(s):
        return np.array([[np.cos(phi(s)), -np.sin(phi(s))], [np.sin(phi(s)), np.cos(phi(s))]])

    def origin(s):
        return np.array([0.5 * np.sin(3 * s), 0.25 * np.sin(6 * s)])

    up = np.array([0.0, G])
    direct = [
        (turn(t) @ e) @ (second_difference(lambda s, r=r: origin(s) + turn(s) @ r, t) + up)
        for r, e in zip(PLANAR.r, PLANAR.e, strict=True)
    ]
    force = turn(t).T @ (second_difference(origin, t) + up)
    omega, alpha = 3.4 * np.cos(1.7 * t), -5.78 * np.sin(1.7 * t)
    np.testing.assert_allclose(PLANAR.readings(force, np.array([alpha]), np.array([omega])), direct, atol=1e-5)
    at_rest = PLANAR.readings(G * np.array([np.sin(0.3), np.cos(0.3)]), np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(at_rest, G * np.array([np.sin(0.3), np.cos(0.3)] * 2))


def test_published_figures_of_octa():
    assert (OCTA.size, OCTA.rank, OCTA.redundancy) == (12, 12, 0)
    assert OCTA.condition_number == pytest.approx(18.33, abs=0.005)
    gains = [0.66, 0.83, 1.63, 6.98, 7.09, 7.06, 5.34, 5.34, 5.34, 6.98, 7.09, 7.06]
    np.testing.assert_allclose(OCTA.noise_gains, gains, atol=0.005)
    np.testing.assert_allclose(np.diag(OCTA.B_T), 49.6, atol=1.0)
    assert np.abs(OCTA.B_TC).max() == pytest.approx(19.1, abs=0.1)
    np.testing.assert_allclose(OCTA.B, np.linalg.inv(OCTA.A.T @ OCTA.A), rtol=1e-9, atol=1e-9)
    assert OCTA.B_P.shape == OCTA.B_T.shape == (3, 3)
    assert OCTA.B_C.shape == (6, 6)


def test_controller_leaves_open_what_only_a_gyroscope_tells():
    assert CONTROLLER.rank == 6
    assert math.isinf(CONTROLLER.condition_number)
    assert not CONTROLLER.A_T[:, 1].any()
    np.testing.assert_array_equal(CONTROLLER.determined, [True] * 3 + [False] * 9)
    np.testing.assert_allclose(CONTROLLER.noise_gains[:3], math.sqrt(0.5))
    assert controller(0.15).r[0, 1] == 0.15
    with pytest.raises(ValueError, match=r"rank 6 of 12.*alpha_x"):
        CONTROLLER.solve(np.zeros(6))


def test_planar_controller_is_orthogonal():
    np.testing.assert_allclose(PLANAR.A.T @ PLANAR.A, np.diag([2.0, 2.0, 2 * 0.15**2, 2 * 0.15**2]), atol=1e-15)
    assert TRIAXIAL.rank == 3


def test_solve_undoes_readings_and_noise_has_the_stated_gain():
    generator = np.random.default_rng(3)
    force, alpha, rate = generator.normal(size=(3, 20_000, 3))
    noise = 0.3 * generator.standard_normal((20_000, 12))
    got = OCTA.solve(OCTA.readings(force, alpha, rate) + noise)
    errors = np.concatenate([got[0] - force, got[1] - alpha, got[2] - products(rate)], axis=-1)
    np.testing.assert_allclose(errors.std(axis=0), 0.3 * OCTA.noise_gains, rtol=0.03)
    np.testing.assert_allclose(np.concatenate(OCTA.solve(OCTA.readings(force, alpha, rate)), axis=-1)[:, :3], force)


def test_products_and_their_jacobian():
    generator = np.random.default_rng(0)
    rate, r = generator.normal(size=(2, 5, 3))
    np.testing.assert_allclose(symmetric(rate) @ r[..., None], symmetric(r) @ rate[..., None])
    turned = (centripetal(r) @ products(rate)[..., None])[..., 0]
    np.testing.assert_allclose(turned, np.cross(rate, np.cross(rate, r)))
    numeric = [(products(rate + h) - products(rate - h)) / 2e-6 for h in 1e-6 * np.eye(3)]
    np.testing.assert_allclose(product_jacobian(rate), np.stack(numeric, axis=-1), atol=1e-8)


def test_other_reference_point_moves_the_force_only():
    moved = OCTA.about((0.1, 0.02, -0.03))
    force, alpha, rate = np.random.default_rng(1).normal(size=(3, 3))
    there = force + np.cross(alpha, moved.reference) + np.cross(rate, np.cross(rate, moved.reference))
    np.testing.assert_allclose(moved.readings(there, alpha, rate), OCTA.readings(force, alpha, rate), atol=1e-12)


def test_arrays_are_values_and_travel_as_json(tmp_path):
    for name, array in ARRAYS.items():
        again = read_array(json.loads(json.dumps(array.describe())))
        assert again == array
        assert hash(again) == hash(array)
        assert load_array(name) is array
    path = tmp_path / "mine.json"
    path.write_text(json.dumps({"positions": [[0, 0, 0.1], [0, 0, -0.1]], "axes": [[1, 0, 0], [1, 0, 0]]}))
    mine = load_array(path)
    assert (mine.name, mine.size, mine.rank) == ("mine", 2, 2)
    report = {row["quantity"]: row for row in describe_array(mine)}
    assert report["force_x"]["determined"]
    assert report["force_x"]["deviation"] == pytest.approx(math.sqrt(0.5))
    assert report["alpha_y"]["deviation"] is None
    assert not OCTA.A.flags.writeable


@pytest.mark.parametrize(
    ("positions", "axes", "message"),
    [
        (((0, 0, 0),), ((1, 1, 0),), "unit vectors, row 0"),
        (((0, 0, 0),), ((1, 0, 0), (0, 1, 0)), "a row for each of 1 positions, got 2"),
        (((0, 0),), ((1, 0, 0),), "positions must have 3 finite numbers"),
        (((0, 0, math.nan),), ((1, 0, 0),), "positions must have 3 finite numbers"),
        ((), (), "positions must have a row"),
        (3, (), "positions must have 3 numbers in each row, got 3"),
        ([0.0, 0.0, 0.0], (), "positions must have 3 numbers in each row"),
    ],
)
def test_bad_geometry_is_refused(positions, axes, message):
    with pytest.raises(ValueError, match=message):
        AccelerometerArray(positions, axes)


def test_bad_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="octa, controller, planar, triaxial or a JSON file"):
        load_array("okta")
    (tmp_path / "a.json").write_text("{")
    with pytest.raises(ValueError, match="is not JSON"):
        load_array(tmp_path / "a.json")
    (tmp_path / "b.json").write_text('{"positions": [[0, 0, 0]], "direction": []}')
    for positions in ("3", '[["a", 0, 0]]', "[1, 2]"):
        (tmp_path / "c.json").write_text(f'{{"positions": {positions}, "axes": [[1, 0, 0]]}}')
        with pytest.raises(ValueError, match="positions of an array must be a list of numbers"):
            load_array(tmp_path / "c.json")
    with pytest.raises(ValueError, match=r"missing \['axes'\], unknown \['direction'\]"):
        load_array(tmp_path / "b.json")


def test_one_triaxial_accelerometer_stays_one_when_its_axes_are_calibrated():
    assert recorded_channel(TRIAXIAL).name == "imu/acc"
    turned = Rotation.from_rotvec([0.02, -0.01, 0.03]).apply(np.eye(3))
    calibrated = AccelerometerArray([[1e-3, 0, 0], [0, 2e-3, 0], [0, 0, 0]], turned)
    assert recorded_channel(calibrated).name == "imu/acc"
    for other in (OCTA, PLANAR, AccelerometerArray([[0.1, 0, 0], [0, 0, 0], [0, 0, 0]], np.eye(3))):
        assert recorded_channel(other).name == "array/acc"
    assert recorded_channel(AccelerometerArray(np.zeros((3, 3)), np.eye(3)[[1, 2, 0]])).name == "array/acc"
