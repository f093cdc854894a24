"""The multiplicative filter: Jacobians, bias, rates, consistency, and what the magnetometer may and may not do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from poise.filters.core import metrics, rotation
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model
from poise.filters.imu.bounded_motion import BoundedMotion
from poise.filters.imu.mekf import MEKF, MEKF9

GRAVITY = np.array([0.0, 0.0, 9.81])
FIELD = np.array([0.0, 20.0, -45.0])
BIAS = np.array([0.01, -0.02, 0.015])


def rocking(
    length: int, dt: float, rng: np.random.Generator, *, gyroscope: float = 1e-3, accelerometer: float = 0.5
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A sensor that turns in all directions, with white noise of given densities and a gyroscope bias."""
    t = dt * np.arange(length)
    rate = np.stack([0.8 * np.sin(0.9 * t), 0.7 * np.cos(1.3 * t), 0.6 * np.sin(0.7 * t + 1.0)], axis=-1)
    q = [np.array([1.0, 0.0, 0.0, 0.0])]
    for omega in rate[1:]:
        q.append(rotation.multiply(q[-1], rotation.exp(dt * omega)))
    orientation = np.array(q)
    return {
        "imu/gyr": rate + BIAS + rng.normal(0.0, gyroscope / np.sqrt(dt), rate.shape),
        "imu/acc": rotation.rotate_back(orientation, GRAVITY[None])
        + rng.normal(0.0, accelerometer / np.sqrt(dt), rate.shape),
        "imu/mag": rotation.rotate_back(orientation, FIELD[None]) + rng.normal(0.0, 0.2, rate.shape),
    }, orientation


def boxminus(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Error of state ``x`` relative to ``y``: turn in the world, then differences."""
    turn = rotation.log(rotation.multiply(x[:4], rotation.conjugate(y[:4])))
    return np.concatenate([turn, x[4:] - y[4:]])


@pytest.mark.parametrize("model", [MEKF(dt=0.01), BoundedMotion(dt=0.01)], ids=["mekf", "bounded-motion"])
def test_jacobians_are_derivatives(model: Model) -> None:
    rng = np.random.default_rng(1)
    e = model.error_size
    z = {"imu/gyr": rng.normal(size=3), "imu/acc": rng.normal(size=3) + GRAVITY}
    x = np.concatenate([rotation.random(rng), 0.1 * rng.normal(size=e - 3), np.zeros(model.state_size - e - 1)])
    if isinstance(model, BoundedMotion):
        x[13] = 1.0  # a correction is due
    F, H = model.predict(x, z, z)[1], model.residual(x, z)[1]
    step = 1e-6
    for column in range(e):
        dx = np.zeros(e)
        dx[column] = step
        forward, backward = model.retract(x, dx), model.retract(x, -dx)
        moved = [model.predict(part, z, z)[0] for part in (forward, backward)]
        derivative = (boxminus(moved[0], moved[1]) / (2 * step))[:e]
        # The Jacobian is of first order in the interval: the rest is of the size of the turn of one interval squared.
        np.testing.assert_allclose(F[:, column], derivative, atol=2e-3)
        change = (model.residual(backward, z)[0] - model.residual(forward, z)[0]) / (2 * step)
        np.testing.assert_allclose(H[:, column], change, atol=1e-6)


def test_bias_is_found() -> None:
    data, truth = rocking(20_000, 0.01, np.random.default_rng(2), accelerometer=0.02)
    model = MEKF(dt=0.01, gyroscope_noise=1e-3, accelerometer_noise=0.02, bias_noise=1e-5)
    pose = KalmanFilter(model, keep_covariance=False).run(data).pose
    np.testing.assert_allclose(pose["gyroscope_bias"][-1], BIAS, atol=2e-3)
    assert np.degrees(metrics.rms(metrics.inclination_error(pose["relative_orientation"], truth)[5000:])) < 0.3


def test_consistency() -> None:
    """Normalised errors of a simulation whose noises are those of the filter have the mean of chi-square."""
    model = MEKF(dt=0.02, gyroscope_noise=2e-3, accelerometer_noise=0.05, bias_noise=1e-8, bias_prior=0.02)
    nees, nis = [], []
    for seed in range(12):
        data, truth = rocking(1500, 0.02, np.random.default_rng(seed), gyroscope=2e-3, accelerometer=0.05)
        estimate = KalmanFilter(model).run(data)
        up_error = rotation.rotate(truth, estimate.pose["up"])[500:, :2]  # of the vertical in the world, small angles
        P = estimate.covariance[500:, :2, :2]
        error = np.stack([up_error[:, 1], -up_error[:, 0]], axis=-1)
        nees.append(np.einsum("ti,tij,tj->t", error, np.linalg.inv(P), error).mean())
        nis.append(estimate.nis[500:].mean())
    assert np.mean(nis) == pytest.approx(3.0, rel=0.05)
    assert np.mean(nees) == pytest.approx(2.0, rel=0.4)


def test_the_same_filter_at_every_rate() -> None:
    """The covariance after 20 s at rest does not depend on the sampling interval."""
    spread = []
    for dt in (0.002, 0.01, 0.05):
        length = round(20.0 / dt)
        data = {"imu/gyr": np.zeros((length, 3)), "imu/acc": np.tile(GRAVITY, (length, 1))}
        spread.append(np.sqrt(np.diag(KalmanFilter(MEKF(dt=dt)).run(data).covariance[-1])))
    np.testing.assert_allclose(spread[0], spread[1], rtol=0.02)
    np.testing.assert_allclose(spread[2], spread[1], rtol=0.05)


def test_norm_adaptation_distrusts_what_is_no_gravity() -> None:
    """Acceleration along gravity and across it for a second, sensor at rest in attitude."""
    force = np.tile(GRAVITY, (400, 1))
    force[200:300] += [3.0, 0.0, 8.0]
    data = {"imu/gyr": np.zeros((400, 3)), "imu/acc": force}
    errors = []
    for adaptation in (0.0, 1.0):
        pose = KalmanFilter(MEKF(accelerometer_noise=0.05, norm_adaptation=adaptation)).run(data).pose
        errors.append(float(metrics.direction_error(pose["up"][299], np.array([0.0, 0.0, 1.0]))))
    assert errors[1] < 0.3 * errors[0]


def test_heading_is_that_of_the_field() -> None:
    data, truth = rocking(3000, 0.01, np.random.default_rng(3), accelerometer=0.02)
    pose = KalmanFilter(MEKF9(dt=0.01, accelerometer_noise=0.05)).run(data).pose
    assert np.degrees(metrics.rms(metrics.total_error(pose["orientation"], truth)[500:])) < 1.0
    # East of geographic north by 10°: the same samples then mean a heading 10° further to the right.
    turned = KalmanFilter(MEKF9(dt=0.01, accelerometer_noise=0.05, declination=np.deg2rad(10.0))).run(data).pose
    difference = rotation.multiply(turned["orientation"], rotation.conjugate(pose["orientation"]))
    np.testing.assert_allclose(np.degrees(rotation.log(difference))[500:, 2], -10.0, atol=0.05)


def test_a_magnet_is_left_out() -> None:
    """Half a minute with a field that is 50° off for five seconds."""
    data, truth = rocking(3000, 0.01, np.random.default_rng(4), accelerometer=0.02)
    disturbed = data["imu/mag"].copy()
    disturbed[1500:2000] += rotation.rotate_back(truth[1500:2000], np.array([[25.0, 0.0, 0.0]]))
    clean = KalmanFilter(MEKF9(dt=0.01)).run(data).pose
    heading, inclination = [], []
    for model in (MEKF9(dt=0.01), MEKF9(dt=0.01, norm_tolerance=1e3, dip_tolerance=10.0)):
        pose = KalmanFilter(model).run(data | {"imu/mag": disturbed}).pose
        heading.append(np.degrees(metrics.heading_error(pose["orientation"], truth))[1500:].max())
        inclination.append(np.degrees(metrics.direction_error(pose["up"], clean["up"])).max())
    assert heading[0] < 2.0
    assert inclination[0] < 0.1
    # Taken for true, the field turns the heading; the inclination suffers only through the bias.
    assert heading[1] > 10.0
    assert inclination[1] < 5.0


def test_heading_row_does_not_see_the_inclination() -> None:
    model, rng = MEKF9(), np.random.default_rng(5)
    q = rotation.random(rng)
    field = rotation.rotate_back(q, FIELD)
    x = np.concatenate([q, np.zeros(3), [np.linalg.norm(FIELD), np.arctan2(45.0, 20.0)]])
    r, H, _ = model.residual(x, {"imu/acc": rotation.rotate_back(q, GRAVITY), "imu/mag": field})
    np.testing.assert_allclose(r[3], 0.0, atol=1e-12)
    np.testing.assert_array_equal(H[3], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    turned = model.retract(x, np.array([0.0, 0.0, -0.1, 0.0, 0.0, 0.0]))
    r, _, _ = model.residual(turned, {"imu/acc": rotation.rotate_back(q, GRAVITY), "imu/mag": field})
    assert float(r[3]) == pytest.approx(0.1, abs=1e-12)


def test_recorded_motion(recordings_folder: Path) -> None:
    """Constants hold on motion that they were not fitted to, six axes and nine: bounds for regression."""
    file = scipy.io.loadmat(recordings_folder / "broad" / "02_undisturbed_slow_rotation_B.mat", squeeze_me=True)
    data = {
        channel: file[name]
        for channel, name in (("imu/gyr", "imu_gyr"), ("imu/acc", "imu_acc"), ("imu/mag", "imu_mag"))
    }
    mask, dt = file["movement"].astype(bool), 1.0 / float(file["sampling_rate"])
    six = KalmanFilter(MEKF(dt=dt), keep_covariance=False).run(data).pose["relative_orientation"]
    nine = KalmanFilter(MEKF9(dt=dt), keep_covariance=False).run(data).pose["orientation"]
    assert np.degrees(metrics.rms(metrics.inclination_error(six, file["opt_quat"]), mask)) < 0.6
    assert np.degrees(metrics.rms(metrics.total_error(nine, file["opt_quat"]), mask)) < 1.8
