"""Roll from one gyroscope by balance: kinematics, Jacobians, rough ground, turns at unknown speed, rides."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.record import record
from poise.filters.bicycle.balanced_gyro import SPEED, BalancedGyro
from poise.filters.bicycle.odometry_aided import PITCH
from poise.filters.bicycle.platform_gyro import ROLL, PlatformGyro
from poise.filters.bicycle.two_gyro.kinematics import SIGNS
from poise.filters.core.consistency import nees
from poise.filters.core.kalman import KalmanFilter
from poise.filters.registry import make

DEG, DT = math.pi / 180.0, 0.01
FLAT = BalancedGyro(imu_tilt=0.0)


def ridden(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> dict[str, np.ndarray]:
    """Samples of a gyroscope in bicycle axes between the ticks of a motion, angles ``(T + 1,)`` in the paper's axes."""
    turned = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    return {"bicycle_imu/gyr": (turned[:-1].inv() * turned[1:]).as_rotvec() / DT * SIGNS}


def balanced(time: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """A roll that changes slowly, and the yaw of the turns in which it is balanced."""
    roll = 0.15 * np.sin(2.0 * math.pi * time / 8.0)
    return roll, DT * np.cumsum(9.81 * np.tan(roll) / speed)


def rms(values: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean(np.square(values)))))


def test_jacobians_are_central_differences() -> None:
    model, rng, step = BalancedGyro(dt=0.02), np.random.default_rng(0), 1e-6
    for _ in range(3):
        x, z = rng.uniform(-0.5, 0.5, 8), {"bicycle_imu/gyr": rng.normal(0.0, 0.5, 3)}
        _, F, Q = model.predict(x, z, z)
        _, H, R = model.residual(x, z)
        assert np.linalg.eigvalsh(Q).min() >= 0.0
        assert np.linalg.eigvalsh(R).min() > 0.0
        for column, unit in enumerate(step * np.eye(8)):
            moved = model.predict(x + unit, z, z)[0] - model.predict(x - unit, z, z)[0]
            np.testing.assert_allclose(F[:, column], moved / (2.0 * step), atol=1e-7)
            seen = model.residual(x - unit, z)[0] - model.residual(x + unit, z)[0]
            np.testing.assert_allclose(H[:, column], seen / (2.0 * step), atol=1e-7)


def test_roll_and_pitch_move_as_those_of_a_rigid_body() -> None:
    """Without corrections they are the Euler angles of SciPy's rotation, to the second order of the step."""
    time = DT * np.arange(301)
    roll, pitch = 0.15 * (1.0 - np.cos(2.0 * time)), 0.1 * (1.0 - np.cos(3.0 * time))
    data = ridden(roll, pitch, 0.5 * time)
    free = replace(FLAT, pitch_noise=1e6, balance_noise=1e6)
    estimate = KalmanFilter(free).run(data).pose
    # the first sample starts the filter
    np.testing.assert_allclose(estimate[ROLL.name][:, 0], roll[1:], atol=0.005)
    np.testing.assert_allclose(estimate[PITCH.name][:, 0], -pitch[1:], atol=0.005)


@pytest.mark.parametrize("speed", [2.0, 6.0])
def test_a_slalom_shows_roll_and_speed_whatever_the_bias(speed: float) -> None:
    time = DT * np.arange(6001)
    roll, yaw = balanced(time, speed)
    data = {"bicycle_imu/gyr": ridden(roll, 0.0 * roll, yaw)["bicycle_imu/gyr"] + np.array([0.02, -0.01, 0.01])}
    pose = KalmanFilter(FLAT).run(data).pose
    assert rms(pose[ROLL.name][3000:, 0] - roll[3001:]) < 0.3
    assert pose[SPEED.name][-1, 0] == pytest.approx(speed, rel=0.05)


def test_rough_ground_does_not_turn_the_roll_over() -> None:
    """Pitch rates of 25 °/s drive the filter of pitch rates to its side; here they are less than a degree of pitch."""
    rng, time = np.random.default_rng(1), DT * np.arange(6001)
    roll, yaw = balanced(time, 4.0)
    shaken = np.convolve(rng.normal(0.0, 1.0, len(time)), np.exp(-np.arange(60) / 8.0), "same")
    data = ridden(0.2 * roll, 0.25 * DEG * shaken, 0.2 * yaw)
    assert 15.0 < rms(data["bicycle_imu/gyr"][:, 1]) < 35.0
    models = (FLAT, PlatformGyro(imu_tilt=0.0))
    ours, theirs = (KalmanFilter(model).run(data).pose[ROLL.name][1000:, 0] for model in models)
    assert rms(ours - 0.2 * roll[1001:]) < 0.5
    assert rms(theirs - 0.2 * roll[1001:]) > 10.0


def test_a_ride_with_bumps_is_followed_and_its_covariance_is_that_of_the_errors() -> None:
    env = RiderBicycleEnv("bumps", 1, suite=["bicycle_imu/gyr"], fidelity="lumped", duration=25.0)
    ride = record(env, seed=3)
    estimate = make("balanced-gyro", dt=ride.dt, metadata=ride.metadata).run(ride.measurements)
    errors = estimate.pose[ROLL.name][500:] - ride.truth[ROLL.name][500:]
    assert rms(errors) < 0.8
    assert 0.02 < np.mean(nees(errors, estimate.covariance[500:, :1, :1])) < 3.0


def test_without_a_sample_nothing_is_believed() -> None:
    r, _, _ = FLAT.residual(np.full(8, 0.1), {"bicycle_imu/gyr": np.full(3, np.nan)})
    assert np.isnan(r).all()


def test_noises_and_constants_without_sense_are_refused() -> None:
    for name in ("balance_noise", "pitch_noise", "averaging"):
        with pytest.raises(ValueError, match=f"{name} must be positive"):
            BalancedGyro(**{name: 0.0})
