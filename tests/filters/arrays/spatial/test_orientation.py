"""Orientation from an array: Jacobians, kinematics, another package's recursion, what the errata do, figures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from poise.envs.hand.controller_gestures import Pointing, pointing_attitude, pointing_direction
from poise.filters.arrays.array import CONTROLLER, OCTA, TRIAXIAL, AccelerometerArray
from poise.filters.arrays.spatial.orientation import ArrayOrientation
from poise.filters.arrays.spatial.pointing import pointing_angles, tilt_error_bound
from poise.filters.arrays.spatial.virtual_controller import advance
from poise.filters.core import metrics, rotation
from poise.filters.core.kalman import KalmanFilter

G = 9.81
FIELD = np.array([0.0, 1.0, 0.0])
HORIZONTAL = {"start": "given", "field": "given"}
USUAL = ArrayOrientation(start="given", field="given")

Data = dict[str, np.ndarray]


def pointing(array: AccelerometerArray, seed: int, duration: float, field: np.ndarray = FIELD) -> tuple[Data, Any]:
    """Readings with the thesis' noises while the hand points at targets and moves, and the true states."""
    motion, noise = np.random.default_rng(seed).spawn(2)
    state = Pointing(rest=0.0).draw(motion, duration + 1.0).sample(np.arange(0.0, duration, 0.01))
    back = lambda v: rotation.rotate_back(state.orientation, v)  # noqa: E731
    rate, turning = back(state.angular_velocity), back(state.angular_acceleration)
    readings = array.readings(back(state.acceleration + np.array([0.0, 0.0, G])), turning, rate)
    name = "imu/acc" if array is TRIAXIAL else "array/acc"
    return {
        name: readings + noise.normal(0.0, 0.1 * G, readings.shape),
        "imu/gyr": rate + noise.normal(0.0, 0.1, rate.shape),
        "imu/mag": back(np.broadcast_to(field, rate.shape)) + noise.normal(0.0, 0.01, rate.shape),
    }, state


def errors(model: ArrayOrientation, data: Data, state: Any) -> dict[str, np.ndarray]:
    """Errors in degrees over time: pitch and azimuth of the pointing axis, and the whole rotation."""
    q = tuple(state.orientation[0].tolist())
    estimate = KalmanFilter(replace(model, start_orientation=q), keep_covariance=False).run(data)
    angles, true = pointing_angles(estimate.pose["orientation"]), pointing_angles(state.orientation)
    named = dict(
        zip(("pitch", "azimuth"), (rotation.wrap(a - b) for a, b in zip(angles, true, strict=True)), strict=True)
    )
    named["total"] = metrics.total_error(estimate.pose["orientation"], state.orientation)
    return {name: np.degrees(value) for name, value in named.items()}


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def some_state(rng: np.random.Generator) -> np.ndarray:
    """A state whose matrix is nearly a rotation."""
    Q = rotation.to_matrix(rotation.random(rng)) + 0.02 * rng.standard_normal((3, 3))
    return np.concatenate([Q.ravel(), rng.normal(0, 5, 3), rng.normal(0, 3, 3), [0.1, 0.8, -0.5], np.zeros(9)])


def differences(function: Any, x: np.ndarray, size: int = 15, step: float = 1e-6) -> np.ndarray:
    """Central differences of ``function`` by the first ``size`` elements."""
    columns = []
    for index in range(size):
        dx = np.zeros(len(x))
        dx[index] = step
        columns.append((function(x + dx) - function(x - dx)) / (2 * step))
    return np.array(columns).T


@pytest.mark.parametrize("array", [CONTROLLER, OCTA, TRIAXIAL], ids=lambda array: array.name)
def test_the_jacobian_of_the_readings_is_their_derivative(array: AccelerometerArray) -> None:
    rng = np.random.default_rng(1)
    model = ArrayOrientation(array=array, magnetometer_mounting=tuple(rotation.random(rng)))
    z = {channel.name: rng.standard_normal(channel.size) for channel in model.channels}
    for _ in range(5):
        x = some_state(rng)
        r, H, R = model.residual(x, z)
        assert r.shape == (model.residual_size,)
        np.testing.assert_allclose(H, -differences(lambda x: model.residual(x, z)[0], x), atol=1e-6)
        assert np.linalg.eigvalsh(R).min() > 0.0


@pytest.mark.parametrize("exact", [False, True], ids=["first order", "exponential"])
def test_the_transition_is_its_derivative_and_not_the_printed_one(exact: bool) -> None:
    """(5.29) has the other sign of the derivative of the rows by the rate."""
    rng = np.random.default_rng(2)
    model = ArrayOrientation(exact_rotation=exact, dt=0.01)
    for _ in range(5):
        x = some_state(rng)
        F = model.predict(x, {}, {})[1]
        numeric = differences(lambda x: model.predict(x, {}, {})[0][:15], x)
        np.testing.assert_allclose(F, numeric, atol=1e-5 if exact else 1e-8)
        published = replace(model, coupling_sign=-1.0).predict(x, {}, {})[1]
        np.testing.assert_array_equal(published[:9, 12:], -F[:9, 12:])
        assert np.abs(published - numeric).max() > 0.01


def test_the_transition_turns_as_scipy_does() -> None:
    rng = np.random.default_rng(3)
    x = some_state(rng)
    Q, rate = x[:9].reshape(3, 3), x[12:15]
    turned = ArrayOrientation(dt=0.02).predict(x, {}, {})[0][:9].reshape(3, 3)
    np.testing.assert_allclose(turned, Q @ Rotation.from_rotvec(0.02 * rate).as_matrix(), atol=1e-13)
    first_order = ArrayOrientation(dt=0.02, exact_rotation=False).predict(x, {}, {})[0][:9].reshape(3, 3)
    stretch = np.linalg.norm(first_order, axis=1) / np.linalg.norm(Q, axis=1)
    across = np.linalg.norm(np.cross(Q, rate), axis=1) / np.linalg.norm(Q, axis=1)
    np.testing.assert_allclose(stretch, np.sqrt(1.0 + (0.02 * across) ** 2), rtol=1e-12)


@pytest.mark.parametrize("array", [CONTROLLER, OCTA], ids=lambda array: array.name)
def test_the_readings_are_those_of_points_that_move(array: AccelerometerArray) -> None:
    """Positions of the sensors, differentiated numerically, plus gravity: no formula of the array is used."""
    turn = lambda t: Rotation.from_euler("zyx", [0.9 * np.sin(2 * t), 0.6 * np.cos(3 * t), 1.1 * t])  # noqa: E731
    place = lambda t: np.array([np.sin(4 * t), 0.5 * np.cos(3 * t), t**2])  # noqa: E731
    t, h = 0.37, 1e-4
    points = [place(s) + turn(s).apply(array.r.copy()) for s in (t - h, t, t + h)]
    acceleration = (points[0] - 2 * points[1] + points[2]) / h**2 + [0.0, 0.0, G]
    readings = np.sum(turn(t).inv().apply(acceleration) * array.e, axis=1)
    centre = (place(t - h) - 2 * place(t) + place(t + h)) / h**2

    def rate(s: float) -> np.ndarray:
        return (turn(s).inv() * turn(s + h)).as_rotvec() / h

    Q, alpha = turn(t).as_matrix(), (rate(t) - rate(t - h)) / h
    mounting = Rotation.from_euler("x", 0.7)
    model = ArrayOrientation(array=array, magnetometer_mounting=tuple(rotation.from_xyzw(mounting.as_quat())))
    x = np.concatenate([Q.ravel(), alpha, rate(t - h / 2), [0.0, 0.6, -0.8], np.zeros(9)])
    seen_field = mounting.inv().apply(turn(t).inv().apply([0.0, 0.6, -0.8]))
    z = {"array/acc": readings, "imu/gyr": x[12:15], "imu/mag": 48.0 * seen_field}
    r = model.residual(x, z)[0]
    # what is left of the accelerometers is the acceleration of the hand, along each axis
    np.testing.assert_allclose(r[: array.size], array.e @ turn(t).inv().apply(centre), atol=2e-2)
    np.testing.assert_allclose(r[array.size :], 0.0, atol=1e-9)
    finished = model.finish(x, z)
    np.testing.assert_allclose(finished[24:27], turn(t).inv().apply(centre), atol=2e-2)
    # with the published sign of gravity the readings of a body at rest are off by 2 g
    rest = model.residual(np.concatenate([np.eye(3).ravel(), np.zeros(18)]), z | {"array/acc": G * array.e[:, 2]})[0]
    np.testing.assert_allclose(rest[: array.size], 0.0, atol=1e-12)
    published = replace(model, gravity_sign=-1.0)
    rest = published.residual(np.concatenate([np.eye(3).ravel(), np.zeros(18)]), z | {"array/acc": G * array.e[:, 2]})[
        0
    ]
    np.testing.assert_allclose(rest[: array.size], 2.0 * G * array.e[:, 2])


def test_the_recursion_equals_filterpy() -> None:
    data, _ = pointing(CONTROLLER, 4, 2.0)
    data["array/acc"][50:60] = np.nan
    data["imu/mag"][90:100] = np.nan
    model = ArrayOrientation(orthonormalise=False)
    estimate = KalmanFilter(model, compiled=False).run(data)
    sample = lambda t: {name: array[t] for name, array in data.items()}  # noqa: E731
    x, P = model.prior(sample(0))
    oracle = ExtendedKalmanFilter(dim_x=15, dim_z=model.residual_size)
    oracle.x, oracle.P, rest = x[:15].copy(), P, x[15:]
    for t in range(1, 200):
        full = np.concatenate([oracle.x, rest])
        after, F, Q = model.predict(full, {}, {})
        oracle.x, oracle.P = after[:15], F @ oracle.P @ F.T + Q
        r, H, R = model.residual(after, sample(t))
        seen = np.isfinite(r)
        oracle.dim_z, oracle.R = int(seen.sum()), R[np.ix_(seen, seen)]
        oracle.update(r[seen], HJacobian=lambda x, H=H[seen]: H, Hx=lambda x, r=r[seen]: np.zeros(len(r)))
        np.testing.assert_allclose(estimate.covariance[t], oracle.P, atol=1e-9)
        np.testing.assert_allclose(estimate.pose["angular_rate"][t], oracle.x[12:15], atol=1e-9)
        nearest = np.linalg.svd(oracle.x[:9].reshape(3, 3))
        Q = nearest[0] @ nearest[2]
        np.testing.assert_allclose(rotation.to_matrix(estimate.pose["orientation"][t]), Q, atol=1e-9)


def test_the_controller_points_within_three_degrees() -> None:
    """Figures 5.6 and 5.7, with exact transition and nearest rotation; as published it is worse by half."""
    data, state = pointing(CONTROLLER, 0, 100.0)
    sound = errors(ArrayOrientation(**HORIZONTAL), data, state)
    inside = (np.abs(sound["pitch"]) < 3.0) & (np.abs(sound["azimuth"]) < 3.0)
    assert inside.mean() > 0.99
    assert rms(sound["pitch"]) < 0.55
    assert rms(sound["total"]) < 2.0
    data = {name: array[:4000] for name, array in data.items()}
    published = errors(replace(USUAL, exact_rotation=False, orthonormalise=False), data, state.at(slice(0, 4000)))
    assert rms(published["pitch"]) > 1.3 * rms(sound["pitch"][:4000])
    assert rms(published["total"]) > 1.3 * rms(sound["total"][:4000])


def test_printed_gravity_tips_over() -> None:
    data, state = pointing(CONTROLLER, 1, 80.0)
    assert rms(errors(USUAL, data, state)["total"][7000:]) < 3.0
    wrong = errors(replace(USUAL, gravity_sign=-1.0), data, state)["total"]
    assert rms(wrong[:1000]) < 3.0, "gyroscope and magnetometer hide it at first"
    assert rms(wrong[7000:]) > 20.0


def test_the_published_jacobian_is_fatal_without_a_gyroscope() -> None:
    data, state = pointing(OCTA, 0, 20.0)
    model = ArrayOrientation(array="octa", gyroscope=False, **HORIZONTAL)
    right = errors(model, data, state)
    wrong = errors(replace(model, coupling_sign=-1.0), data, state)
    assert rms(right["pitch"]) < 9.0
    assert rms(wrong["pitch"]) > 20.0


def test_tilt_and_integration_are_worse() -> None:
    data, state = pointing(CONTROLLER, 2, 25.0)
    fusion, tilt, integration = (
        errors(ArrayOrientation(method=method, **HORIZONTAL), data, state)["pitch"]  # type: ignore[arg-type]
        for method in ("fusion", "tilt", "integration")
    )
    assert rms(fusion) < 0.7
    assert rms(tilt) > 8.0
    assert rms(integration[1500:]) > 2.0 * rms(fusion[1500:])


def test_a_single_imu_and_a_start_from_samples() -> None:
    data, state = pointing(TRIAXIAL, 3, 15.0)
    calm = slice(0, 1)
    data["imu/acc"][calm] = rotation.rotate_back(state.orientation[calm], np.array([0.0, 0.0, G]))
    estimate = KalmanFilter(ArrayOrientation(array="triaxial"), keep_covariance=False).run(data)
    total = np.degrees(metrics.total_error(estimate.pose["orientation"], state.orientation))
    assert total[0] < 3.0
    assert rms(total) < 5.0
    rates = rotation.rotate_back(state.orientation, state.angular_velocity)
    assert rms(metrics.vector_error(estimate.pose["angular_rate"], rates)) < rms(
        metrics.vector_error(data["imu/gyr"], rates)
    )


def test_a_wrong_start_is_left_with_an_open_prior() -> None:
    data, state = pointing(CONTROLLER, 5, 60.0)
    wrong = rotation.multiply(state.orientation[0], rotation.exp(np.array([0.0, np.radians(40.0), 0.0])))
    model = ArrayOrientation(**HORIZONTAL, start_orientation=tuple(wrong.tolist()))
    total = {
        prior: metrics.total_error(
            KalmanFilter(replace(model, orientation_prior=prior)).run(data).pose["orientation"], state.orientation
        )
        for prior in (0.01, 1.0)
    }
    for error in total.values():
        assert np.degrees(error[0]) == pytest.approx(40.0)
    assert rms(np.degrees(total[1.0][4000:])) < 5.0
    assert rms(total[1.0][:3000]) < rms(total[0.01][:3000])


def test_missing_readings_are_bridged() -> None:
    data, state = pointing(CONTROLLER, 6, 20.0)
    model = ArrayOrientation(**HORIZONTAL)
    whole = errors(model, data, state)["total"]
    data["array/acc"][500:700], data["array/acc"][900:1000, 2], data["imu/mag"][1200:1400] = np.nan, np.nan, np.nan
    gaps = errors(model, data, state)["total"]
    np.testing.assert_array_equal(gaps[:500], whole[:500])
    assert np.isfinite(gaps).all()
    assert gaps.max() < whole.max() + 4.0


def test_the_virtual_controller_settles_and_returns() -> None:
    """An acceleration error c settles at c / (K_b K_v); the path is that of SciPy's solver."""
    dampings = {"velocity_damping": 3.0, "position_damping": 1.5}
    push = np.array([0.2, 0.0, -0.4])
    state, path = np.zeros(6), []
    for _ in range(2000):
        state = advance(state, push, 0.01, **dampings)
        path.append(state[3:])
    np.testing.assert_allclose(path[-1], push / 4.5, rtol=1e-6)
    exact = solve_ivp(
        lambda _, s: np.concatenate([push - 3.0 * s[:3], s[:3] - 1.5 * s[3:]]), (0, 1), np.zeros(6), rtol=1e-9
    )
    np.testing.assert_allclose(path[99], exact.y[3:, -1], rtol=1e-3)
    for _ in range(2000):
        state = advance(state, 0.0 * push, 0.01, **dampings)
    np.testing.assert_allclose(state, 0.0, atol=1e-9)


def test_the_virtual_controller_follows_the_hand() -> None:
    data, state = pointing(CONTROLLER, 7, 30.0)
    estimate = KalmanFilter(ArrayOrientation(**HORIZONTAL, start_orientation=tuple(state.orientation[0]))).run(data)
    ideal, wanted = np.zeros(6), []
    for acceleration in state.acceleration[1:]:
        ideal = advance(ideal, acceleration, 0.01, velocity_damping=2.0, position_damping=2.0)
        wanted.append(ideal[3:])
    drawn = estimate.pose["virtual_position"][1:]
    assert rms(np.linalg.norm(drawn - wanted, axis=1)) < 0.2 * rms(np.linalg.norm(wanted, axis=1))
    assert np.abs(drawn).max() < 2.0


def test_pitch_and_azimuth_are_those_of_the_targets() -> None:
    """(5.48) as published is no rotation; with the corrected sign it is R_z(−ψ) R_x(θ) and points at (5.50)."""
    psi, theta = np.random.default_rng(8).uniform(-1.2, 1.2, (2, 50))
    q = pointing_attitude(psi, theta)
    pitch, azimuth = pointing_angles(q)
    np.testing.assert_allclose((pitch, azimuth), (theta, psi), atol=1e-12)
    np.testing.assert_allclose(
        rotation.rotate(q, np.array([0.0, 1.0, 0.0])), pointing_direction(psi, theta), atol=1e-12
    )
    s, c, st, ct = np.sin(psi), np.cos(psi), np.sin(theta), np.cos(theta)
    zero = np.zeros(50)
    for sign in (1.0, -1.0):
        Q = np.array([[c, sign * ct * s, -st * s], [-s, ct * c, -st * c], [zero, st, ct]]).transpose(2, 0, 1)
        defect = np.abs(Q.mT @ Q - np.eye(3)).max(axis=(1, 2))
        assert defect.max() < 1e-12 if sign > 0.0 else defect.max() > 0.5
    expected = Rotation.from_euler("z", -psi[:, None]) * Rotation.from_euler("x", theta[:, None])
    np.testing.assert_allclose(rotation.to_matrix(q), expected.as_matrix(), atol=1e-12)


def test_the_bound_of_the_tilt_sensor_is_an_arcsine() -> None:
    """Over all directions of an acceleration of 4 m/s² the largest error is the arcsine; (5.63) prints less."""
    directions = rotation.normalize(np.random.default_rng(9).standard_normal((20_000, 3)))
    reading = 4.0 * directions + [0.0, 0.0, G]
    error = metrics.direction_error(reading, np.array([0.0, 0.0, 1.0]) + 0.0 * reading)
    bound = float(tilt_error_bound(np.array([4.0, 0.0, 0.0])))
    assert error.max() <= bound
    assert error.max() == pytest.approx(bound, abs=1e-3)
    assert np.arctan(4.0 / G) < error.max() - 0.02
    assert float(tilt_error_bound(np.array([0.0, 10.0, 0.0]))) == np.pi


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"array": "nintendo"}, "array must be .*controller"),
        ({"array": "planar"}, "planar array"),
        ({"method": "magic"}, "method must be one of"),
        ({"method": "integration", "gyroscope": False}, "gyroscope must be True"),
        ({"start_orientation": (1.0, 1.0, 0.0, 0.0)}, "start_orientation must be a unit quaternion"),
        ({"position_damping": 0.0}, "position_damping must be positive"),
    ],
)
def test_what_does_not_fit_is_refused(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ArrayOrientation(**parameters)
