"""Gauss–Newton quaternion and Kalman filter of Marins et al., against SciPy, finite differences and filterpy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy.spatial.transform import Rotation

from poise.filters.core import metrics, rotation
from poise.filters.core.backend import Array, expand
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model
from poise.filters.core.quantity import Measurement
from poise.filters.imu.marins import Marins, matrix_jacobian, solve_orientation

G = 9.81
UP = np.array([0.0, 0.0, 1.0])


def swaying(length: int, seed: int, *, acceleration: float = 0.0, dip: float = 0.0, noise: float = 1.0) -> tuple:
    """A sensor that turns to and fro at some rad/s while the hand accelerates slowly; the thesis' noises."""
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(length)
    angles = np.stack([0.6 * np.sin(2.0 * t), 0.5 * np.sin(2.7 * t + 1.0), 0.7 * np.sin(1.6 * t + 2.0)], axis=-1)
    turn = Rotation.from_euler("zyx", angles)
    orientation = rotation.from_xyzw(turn.as_quat())
    later = Rotation.from_euler("zyx", np.vstack([angles[1:], angles[-1:]]))
    rate = (turn.inv() * later).as_rotvec() / 0.01
    push = acceleration * np.stack([np.sin(5.0 * t), np.cos(4.0 * t), np.sin(6.0 * t + 1.0)], axis=-1)
    field = np.array([0.0, np.cos(dip), -np.sin(dip)])
    return {
        "imu/gyr": rate + noise * rng.normal(0.0, 0.1, rate.shape),
        "imu/acc": turn.inv().apply(push + G * UP) + noise * rng.normal(0.0, 0.5, rate.shape),
        "imu/mag": turn.inv().apply(np.tile(field, (length, 1))) + noise * rng.normal(0.0, 0.01, rate.shape),
    }, orientation


def total(model: Model, data: dict[str, np.ndarray], orientation: np.ndarray) -> np.ndarray:
    """Error over time, degrees; equations of the tests alone, which cannot be compiled, run as arrays."""
    estimate = KalmanFilter(model, compiled=type(model) is Marins, keep_covariance=False).run(data)
    return np.degrees(metrics.total_error(estimate.pose["orientation"], orientation))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_jacobian_of_the_quaternion_matrix_is_its_derivative() -> None:
    rng = np.random.default_rng(1)

    def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        r0, r = q[0], q[1:]
        return ((r0**2 - r @ r) * np.eye(3) + 2.0 * np.outer(r, r) + 2.0 * r0 * rotation.skew(r)) @ v

    for _ in range(5):
        q, v = rng.standard_normal(4), rng.standard_normal(3)
        numeric = [(turned(q + d, v) - turned(q - d, v)) / 2e-6 for d in 1e-6 * np.eye(4)]
        np.testing.assert_allclose(matrix_jacobian(q, v), np.array(numeric).T, atol=1e-8)


def test_the_first_step_finds_the_rotation_of_scipy() -> None:
    rng = np.random.default_rng(2)
    q = rotation.random(rng, (100,))
    world = UP + np.zeros((100, 3)), rotation.normalize(np.array([0.2, 0.9, -0.4])) + np.zeros((100, 3))
    exact = tuple(rotation.rotate_back(q, v) for v in world)
    near = rotation.multiply(q, rotation.exp(rng.normal(0.0, 0.3, (100, 3))))
    found = solve_orientation(near, world, exact)
    np.testing.assert_allclose(metrics.total_error(found, q), 0.0, atol=1e-6)
    np.testing.assert_array_less(0.0, np.sum(found * near, axis=-1))
    # disturbed vectors: the least squares of Wahba's problem, as SciPy solves it by singular values
    seen = tuple(rotation.normalize(v + rng.normal(0.0, 0.05, (100, 3))) for v in exact)
    found = solve_orientation(near, world, seen)
    for index in range(100):
        oracle, _ = Rotation.align_vectors([v[index] for v in world], [v[index] for v in seen])
        expected = rotation.from_xyzw(oracle.as_quat())
        # the quaternion's length is free in (5.41), so the two differ by the square of the disturbance
        assert float(metrics.total_error(found[index], expected)) < 0.01


def test_the_transition_is_its_derivative() -> None:
    rng = np.random.default_rng(3)
    model = Marins()
    for _ in range(5):
        x = np.concatenate([rng.normal(0.0, 3.0, 3), rotation.random(rng), [0.0, 1.0, 0.0]])
        F = model.predict(x, {}, {})[1]
        numeric = []
        for index in range(7):
            d = np.zeros(10)
            d[index] = 1e-6
            numeric.append((model.predict(x + d, {}, {})[0][:7] - model.predict(x - d, {}, {})[0][:7]) / 2e-6)
        np.testing.assert_allclose(F, np.array(numeric).T, atol=2e-6)


def test_the_second_step_equals_filterpy() -> None:
    data, _ = swaying(150, 4, acceleration=2.0)
    data["imu/acc"][60:80] = np.nan
    model = Marins()
    estimate = KalmanFilter(model, compiled=False).run(data)
    x, P = model.prior({name: array[0] for name, array in data.items()})
    oracle = ExtendedKalmanFilter(dim_x=7, dim_z=7)
    oracle.x, oracle.P, field = x[:7].copy(), P, x[7:]
    for t in range(1, 150):
        sample = {name: array[t] for name, array in data.items()}
        after, F, Q = model.predict(np.concatenate([oracle.x, field]), {}, {})
        oracle.x, oracle.P = after[:7], F @ oracle.P @ F.T + Q
        r, H, R = model.residual(after, sample)
        seen = np.isfinite(r)
        assert seen.sum() == (3 if 60 <= t < 80 else 7)
        oracle.dim_z, oracle.R = int(seen.sum()), R[np.ix_(seen, seen)]
        oracle.update(r[seen], HJacobian=lambda x, H=H[seen]: H, Hx=lambda x, r=r[seen]: np.zeros(len(r)))
        oracle.x[3:] /= np.linalg.norm(oracle.x[3:])
        np.testing.assert_allclose(estimate.pose["orientation"][t], oracle.x[3:], atol=1e-9)
        np.testing.assert_allclose(estimate.covariance[t], oracle.P, atol=1e-9)


def test_a_hand_at_constant_speed_is_followed() -> None:
    data, orientation = swaying(1000, 5)
    assert rms(total(Marins(), data, orientation)[100:]) < 2.5
    assert rms(total(Marins(quaternion_std=0.05), data, orientation)[100:]) < 2.0


def test_acceleration_needs_a_large_deviation_and_a_steep_field_leaves_a_bias() -> None:
    """At 0.01 the first step is believed, at 0.5 the gyroscope; equal weights split what two vectors disagree about."""
    data, orientation = swaying(1000, 6, acceleration=5.0)
    model = Marins(field="given", start="given", start_orientation=tuple(orientation[0]))
    believed = rms(total(replace(model, quaternion_std=0.01), data, orientation))
    weighted = rms(total(model, data, orientation))
    assert believed > 8.0
    assert weighted < 0.5 * believed
    dip = np.radians(70.0)
    data, orientation = swaying(1000, 6, acceleration=5.0, dip=dip)
    assert rms(total(replace(model, dip=dip), data, orientation)) > 1.5 * weighted


@dataclass(frozen=True)
class Printed(Marins):
    """(5.46) as published: the product with a scalar-first [0; ω] where q has its scalar last."""

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        after, F, Q = super().predict(x, z, previous)
        # of [x₄ x₅ x₆ x₇] with the scalar last and [0 x₁ x₂ x₃] read alike: vector part (0, x₁, x₂), scalar x₃
        rate = x[..., :3]
        misread = np.concatenate([rate[..., 2:3], 0.0 * rate[..., :1], rate[..., :2]], axis=-1)
        q = x[..., 3:7] + 0.5 * expand(self.dt, 1) * rotation.multiply(x[..., 3:7], misread)
        return np.concatenate([after[..., :3], q, after[..., 7:]], axis=-1), F, Q


def test_the_printed_product_does_not_turn_with_the_sensor() -> None:
    data, orientation = swaying(500, 7)
    wrong = rms(total(Printed(), data, orientation)[100:])
    assert wrong > 5.0 * rms(total(Marins(), data, orientation)[100:])


def test_missing_samples_leave_the_gyroscope() -> None:
    data, orientation = swaying(800, 8)
    data["imu/mag"][300:400], data["imu/acc"][500:600] = np.nan, np.nan
    error = total(Marins(), data, orientation)
    assert np.isfinite(error).all()
    assert error[100:].max() < 8.0


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"field": "north"}, "field must be one of"),
        ({"start_orientation": (0.0, 0.0, 0.0, 0.0)}, "start_orientation must be a unit quaternion"),
        ({"rate_time": 0.0}, "rate_time must be positive"),
    ],
)
def test_what_does_not_fit_is_refused(parameters: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Marins(**parameters)
