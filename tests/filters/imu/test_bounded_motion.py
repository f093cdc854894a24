"""Bounded motion: bias and external acceleration in simulated motion, rates, drop-outs, and the BROAD recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from poise.envs.hand.gestures import make_gesture
from poise.envs.sensors.ideal import interval_readings
from poise.filters.core import metrics, rotation
from poise.filters.core.kalman import KalmanFilter
from poise.filters.imu.bounded_motion import BoundedMotion, BoundedMotion9
from poise.filters.imu.external_acceleration import ExternalAcceleration

GRAVITY = np.array([0.0, 0.0, 9.81])
BIAS = np.deg2rad([0.3, -0.2, 0.4])


def shaken(gesture: str, rate: float, duration: float = 60.0) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Samples of a hand's motion with bias and noise; its orientation; its acceleration in sensor axes."""
    rng = np.random.default_rng(7)
    motion = make_gesture(gesture, rng, duration)
    state = motion.sample(np.arange(round(duration * rate) + 1) / rate)
    gyroscope, force = interval_readings(state.at(slice(0, -1)), state.at(slice(1, None)), gravity=9.81)
    orientation = state.orientation[1:]
    data = {
        "imu/gyr": gyroscope + BIAS + rng.normal(0.0, 1e-4 * np.sqrt(rate), gyroscope.shape),
        "imu/acc": force + rng.normal(0.0, 1e-3 * np.sqrt(rate), force.shape),
        "imu/mag": rotation.rotate_back(orientation, np.array([[0.0, 20.0, -45.0]])),
    }
    assert state.acceleration is not None
    return data, orientation, rotation.rotate_back(orientation, state.acceleration[1:])


@pytest.fixture(scope="module")
def hand() -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    return shaken("fast", 100.0)


def test_vigorous_motion(hand: tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]) -> None:
    data, orientation, acceleration = hand
    pose = KalmanFilter(BoundedMotion(), keep_covariance=False).run(data).pose
    late = slice(2000, None)
    up = rotation.up_in_body(orientation)
    assert np.degrees(metrics.rms(metrics.direction_error(pose["up"], up)[late])) < 0.6
    np.testing.assert_allclose(pose["gyroscope_bias"][-1][:2], BIAS[:2], atol=np.deg2rad(0.2))
    assert metrics.rms(metrics.vector_error(pose["external_acceleration"], acceleration)[late]) < 0.6
    assert metrics.rms(metrics.length(acceleration)[late]) > 3.0


def test_rate_does_not_matter() -> None:
    errors = []
    for rate in (50.0, 100.0, 400.0):
        data, orientation, _ = shaken("fast", rate, 40.0)
        pose = KalmanFilter(BoundedMotion(dt=1 / rate), keep_covariance=False).run(data).pose
        errors.append(np.degrees(metrics.rms(metrics.inclination_error(pose["relative_orientation"], orientation))))
    assert max(errors) < 0.8
    assert max(errors) < 1.5 * min(errors)


def test_corrections_come_at_their_interval() -> None:
    """Seconds between corrections, at several rates: the nearest multiple of the sampling interval."""
    for dt, interval in ((0.0035, 0.0175), (0.01, 0.02), (0.025, 0.025)):
        data = {"imu/gyr": np.zeros((200, 3)), "imu/acc": np.tile(GRAVITY + 0.01, (200, 1))}
        ticks = np.flatnonzero(KalmanFilter(BoundedMotion(dt=dt)).run(data).nis)
        np.testing.assert_allclose(np.diff(ticks) * dt, interval)


def test_clipped_samples_count_less() -> None:
    data = {"imu/gyr": np.zeros((300, 3)), "imu/acc": np.tile(GRAVITY, (300, 1))}
    data["imu/acc"][150:160] = [160.0, 0.0, 9.81]
    errors = []
    for limit in (156.0, 1e3):
        up = KalmanFilter(BoundedMotion(accelerometer_range=limit)).run(data).pose["up"]
        errors.append(float(metrics.direction_error(up, GRAVITY[None])[150:].max()))
    assert errors[0] < 0.2 * errors[1]


@pytest.mark.parametrize("kind", [BoundedMotion, ExternalAcceleration])
def test_clipped_rotation_is_made_up_for(kind: type[BoundedMotion] | type[ExternalAcceleration]) -> None:
    """Where the gyroscope was saturated the tilt is soon found again: the filter knows that it was turned further."""
    data = {"imu/gyr": np.zeros((600, 3)), "imu/acc": np.tile(GRAVITY, (600, 1))}
    data["imu/gyr"][150:160, 0] = 34.9
    turned = 0.01 * 38.0 * np.clip(np.arange(600) - 149, 0, 10)
    data["imu/acc"] = 9.81 * np.stack([0.0 * turned, np.sin(turned), np.cos(turned)], axis=-1)
    errors = []
    for limit in (34.8, 1e3):
        up = KalmanFilter(kind(gyroscope_range=limit)).run(data).pose["up"]
        errors.append(float(metrics.direction_error(up, data["imu/acc"])[180:].mean()))
    assert errors[0] < 0.4 * errors[1]


def test_a_long_drop_out_is_survived(hand: tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]) -> None:
    data, orientation, _ = hand
    force = data["imu/acc"].copy()
    force[3000:4000] = np.nan
    estimate = KalmanFilter(BoundedMotion()).run(data | {"imu/acc": force})
    np.testing.assert_array_equal(estimate.nis[3000:4000], 0.0)
    np.testing.assert_array_equal(estimate.pose["external_acceleration"][3010:4000], 0.0)
    error = np.degrees(metrics.inclination_error(estimate.pose["relative_orientation"], orientation))
    assert error[3000:].max() < 3.0
    spread = np.sqrt(np.trace(estimate.covariance[:, :2, :2], axis1=1, axis2=2))
    assert spread[3999] > 1.3 * spread[2999]
    assert spread[-1] < 1.3 * spread[2999]


def test_magnetometer_gives_the_heading(hand: tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]) -> None:
    data, orientation, _ = hand
    pose = KalmanFilter(BoundedMotion9(), keep_covariance=False).run(data).pose
    assert np.degrees(metrics.rms(metrics.total_error(pose["orientation"], orientation)[2000:])) < 1.0


# Inclination error (deg) over the movement phase, 286 Hz, and that of VQF 2.1 (six axes, causal, its own constants).
BROAD = {
    "02_undisturbed_slow_rotation_B": (0.402, 0.429),
    "06_undisturbed_fast_rotation_A": (0.811, 0.804),
    "08_undisturbed_fast_rotation_with_breaks_A": (1.546, 1.763),
    "10_undisturbed_slow_translation_A": (0.324, 0.299),
    "15_undisturbed_fast_translation_A": (0.481, 0.470),
    "21_undisturbed_fast_combined": (1.345, 1.716),
    "24_disturbed_tapping_A": (0.615, 0.607),
    "26_disturbed_phone_vibration_A": (0.569, 0.561),
    "28_disturbed_stationary_magnet_A": (1.002, 1.206),
    "32_disturbed_attached_magnet_1cm": (0.500, 0.560),
}


@pytest.mark.parametrize("trial", BROAD)
def test_broad(trial: str, recordings_folder: Path) -> None:
    file = scipy.io.loadmat(recordings_folder / "broad" / f"{trial}.mat", squeeze_me=True)
    data = {"imu/gyr": file["imu_gyr"], "imu/acc": file["imu_acc"]}
    mask, dt = file["movement"].astype(bool), 1.0 / float(file["sampling_rate"])
    own, other = BROAD[trial]
    pose = KalmanFilter(BoundedMotion(dt=dt), keep_covariance=False).run(data).pose
    error = metrics.inclination_error(pose["relative_orientation"], file["opt_quat"])
    assert np.degrees(metrics.rms(error, mask)) == pytest.approx(own, abs=0.02)
    assert own < 1.1 * other
