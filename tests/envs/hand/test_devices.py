"""Devices with an array: readings against the array's formula and against differences, both drives, errors, planes."""

import json
import math
import warnings
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from poise.envs.hand.arm.arm import Arm
from poise.envs.hand.controller_gestures import Walk
from poise.envs.hand.devices import ARRAY_PRESETS, DEVICES, HandDevice, actual_array, array_preset, hand_device
from poise.envs.hand.environment import HandMotionEnv
from poise.envs.hand.sensing import HandVariation, simulate_hand
from poise.envs.record import record
from poise.envs.sensors.ideal import STANDARD_GRAVITY
from poise.envs.sensors.suite import imu_suite
from poise.filters.arrays.array import OCTA, PLANAR, AccelerometerArray, controller
from poise.filters.core import rotation

GESTURES = {"controller": "shaking", "octa": "fast", "octa-gyroscope": "shaking", "planar": "infinity"}


def ideal(device, gesture, **options):
    return simulate_hand(gesture, 3, "ideal", duration=6.0, device=device, **options)


def expected_readings(array, trajectory):
    """A z from the truth: the linear formula instead of carried sensors."""
    truth = trajectory.truth
    force = truth["acceleration"] + [0.0, 0.0, STANDARD_GRAVITY]
    force = rotation.rotate_back(truth["orientation"], force)
    alpha, rate = truth["angular_acceleration"], truth["angular_rate"]
    if array.dimension == 2:
        force, alpha, rate = force[:, :2], alpha[:, 2:], rate[:, 2:]
    return array.readings(force, alpha, rate)


@pytest.mark.parametrize("name", DEVICES)
def test_ideal_readings_are_those_of_the_array(name):
    device = DEVICES[name]
    trajectory = ideal(name, GESTURES[name])
    assert trajectory.measurements["array/acc"].shape[1] == device.array.size
    np.testing.assert_allclose(
        trajectory.measurements["array/acc"], expected_readings(device.array, trajectory), atol=1e-9
    )
    assert ("imu/gyr" in trajectory.measurements) == (device.gyroscope and not device.planar)
    assert ("imu/mag" in trajectory.measurements) == device.magnetometer
    if device.gyroscope and not device.planar:
        np.testing.assert_allclose(trajectory.measurements["imu/gyr"], trajectory.truth["angular_rate"], atol=1e-12)
    assert trajectory.metadata["device"]["array"] == device.array.describe()


def test_readings_are_the_path_of_each_sensor_differentiated():
    """The paths come from the true pose through SciPy; nothing of sensors.py or array.py enters."""
    trajectory = ideal("octa", "shaking", rate=1000.0)
    turns = Rotation.from_quat(trajectory.truth["orientation"][:, [1, 2, 3, 0]])
    for index in (1, 4, 10):
        path = trajectory.truth["position"] + turns.apply(np.array(OCTA.positions[index]))
        acceleration = CubicSpline(trajectory.time, path)(trajectory.time, 2) + np.array([0.0, 0.0, STANDARD_GRAVITY])
        reading = np.sum(turns.apply(np.array(OCTA.axes[index])) * acceleration, axis=1)
        error = (trajectory.measurements["array/acc"][:, index] - reading)[1200:-50]
        assert np.abs(error).max() < 5e-3 * np.abs(reading).max()


@pytest.mark.parametrize("name", ["octa-gyroscope", "planar"])
def test_both_drives_agree(name):
    recorded = []
    for drive in ("dynamic", "kinematic"):
        arm = Arm(anticipation=1.0, noise=0.0, table=None) if drive == "dynamic" else None
        with HandMotionEnv(GESTURES[name], drive, "ideal", duration=4.0, device=name, arm=arm) as env:
            recorded.append(record(env, seed=3))
    one, other = recorded
    for channel in one.measurements:
        difference = one.measurements[channel] - other.measurements[channel]
        # the engine is of first order: half a millisecond behind
        assert np.sqrt(np.nanmean(difference**2)) < 0.02 * np.nanstd(other.measurements[channel]), channel
    for quantity in ("angular_acceleration", "acceleration"):
        difference = one.truth[quantity] - other.truth[quantity]
        assert np.sqrt(np.mean(difference**2)) < 0.02 * np.std(other.truth[quantity]) + 1e-9, quantity
    simulated = simulate_hand(GESTURES[name], 3, "ideal", duration=4.0, device=name)
    for channel, values in simulated.measurements.items():
        np.testing.assert_allclose(other.measurements[channel], values, rtol=1e-5, atol=1e-4)


def test_planar_truth_is_that_of_the_plane():
    trajectory = ideal("planar", "infinity")
    truth, step = trajectory.truth, 0.01
    phi = np.unwrap(truth["planar/angle"][:, 0])
    assert phi[0] == pytest.approx(math.pi / 4)
    np.testing.assert_allclose(np.diff(phi, 2) / step**2, truth["planar/angular_acceleration"][1:-1, 0], atol=1.5)
    assert np.abs(truth["planar/angular_acceleration"]).max() > 30.0
    np.testing.assert_allclose(truth["planar/angular_rate"], trajectory.measurements["planar/gyr"], atol=1e-12)
    up = rotation.up_in_body(truth["orientation"])
    np.testing.assert_allclose(up[:, :2], np.stack([np.sin(phi), np.cos(phi)], axis=-1), atol=1e-12)
    force = trajectory.measurements["array/acc"][0].reshape(2, 2)
    np.testing.assert_allclose(force, np.full((2, 2), STANDARD_GRAVITY * math.sqrt(0.5)), atol=1e-9)
    np.testing.assert_array_equal(truth["planar/position"], truth["position"][:, [0, 2]])


def test_intervals_give_means():
    fine = ideal("octa-gyroscope", "shaking", rate=1000.0)
    coarse = ideal("octa-gyroscope", "shaking", sampling="interval")
    mean = fine.measurements["array/acc"][1:].reshape(-1, 10, 12).mean(axis=1)
    error = coarse.measurements["array/acc"][1:] - mean
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.std(mean)


def test_noise_is_that_of_the_thesis():
    noisy = simulate_hand("shaking", 1, duration=40.0, device="controller")
    clean = simulate_hand("shaking", 1, "ideal", duration=40.0, device="controller")
    for channel, deviation in (("array/acc", 0.981), ("imu/gyr", 0.1), ("imu/mag", 0.5)):
        error = noisy.measurements[channel] - clean.measurements[channel]
        np.testing.assert_allclose(error.std(axis=0), deviation, rtol=0.05)
    planar = [simulate_hand("infinity", 1, sensors, duration=40.0, device="planar") for sensors in (None, "ideal")]
    for channel, deviation in (("array/acc", 0.3), ("planar/gyr", 0.6)):
        error = planar[0].measurements[channel] - planar[1].measurements[channel]
        np.testing.assert_allclose(error.std(axis=0), deviation, rtol=0.05)


def test_errors_of_the_geometry():
    preset = array_preset("array-calibrated")
    built = [actual_array(OCTA, preset, np.random.default_rng(seed)) for seed in range(200)]
    shifts = np.array([array.r - OCTA.r for array in built])
    assert shifts.std() == pytest.approx(1e-3, rel=0.03)
    angles = np.array([np.arccos(np.clip(np.sum(array.e * OCTA.e, axis=1), -1, 1)) for array in built])
    assert math.sqrt(np.mean(angles**2) / 2.0) == pytest.approx(math.radians(0.5), rel=0.03)
    assert actual_array(OCTA, array_preset("paper-array"), np.random.default_rng(0)) is OCTA
    flat = actual_array(PLANAR, preset, np.random.default_rng(0))
    assert flat != PLANAR
    assert flat.dimension == 2
    assert preset.scaled(2.0).axis_error == pytest.approx(2.0 * preset.axis_error)
    one, other = (
        simulate_hand(
            "shaking",
            seed,
            replace(preset, accelerometer=array_preset("ideal").accelerometer),
            duration=5.0,
            device="octa",
        )
        for seed in (0, 1)
    )
    for trajectory in (one, other):
        error = trajectory.measurements["array/acc"] - expected_readings(OCTA, trajectory)
        assert 0.02 < np.sqrt(np.mean(error**2)) < 1.0


@pytest.mark.parametrize("name", [*DEVICES, "mine"])
def test_checkers_have_nothing_to_say(name):
    mine = HandDevice(
        "mine",
        AccelerometerArray([[0.1, 0, 0], [-0.1, 0, 0]], [[0, 0, 1], [0, 0, 1]]),
        "bosch-bmi160",
        magnetometer=False,
    )
    env = gym.make("poise/HandMotion-v0", device=mine if name == "mine" else name, drive="kinematic")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
        check_env_sb3(env.unwrapped, warn=True)
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert info["truth"]["angular_acceleration"].shape == (3,)
    env.close()


def test_snapshots_continue_bitwise_with_the_array_as_built():
    with HandMotionEnv("shaking", "dynamic", "array-calibrated", duration=4.0, device="octa") as env:
        env.reset(seed=5)
        for _ in range(120):
            env.step(env.neutral_action)
        saved = env.snapshot()
        first = [env.step(env.neutral_action)[0]["array/acc"] for _ in range(60)]
        env.reset(seed=6)
        env.restore(saved)
        second = [env.step(env.neutral_action)[0]["array/acc"] for _ in range(60)]
    np.testing.assert_array_equal(first, second)


def test_a_users_array_from_a_file(tmp_path):
    path = tmp_path / "wand.json"
    path.write_text(json.dumps(controller(0.2).describe() | {"name": "wand"}))
    device = hand_device(str(path))
    assert (device.name, device.array.r[0, 1]) == ("wand", 0.2)
    assert simulate_hand("fast", 0, duration=1.0, device=str(path)).measurements["array/acc"].shape == (101, 6)
    assert hand_device("imu") is None


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="device must be imu, controller, octa"):
        HandMotionEnv(device="okta")
    with pytest.raises(ValueError, match="must stay in the vertical plane"):
        HandMotionEnv("slow", device="planar")
    with pytest.raises(ValueError, match="must stay in the vertical plane"):
        simulate_hand("mixed", 0, device="planar")
    with pytest.raises(ValueError, match="must be the identity"):
        HandMotionEnv(device="planar", mounting=rotation.exp(np.array([0.1, 0, 0])))
    with pytest.raises(ValueError, match="randomise must leave the mounting"):
        HandMotionEnv(device="planar", randomise=True)
    with pytest.raises(ValueError, match="not a whole suite"):
        HandMotionEnv(device="octa", sensors=imu_suite())
    with pytest.raises(ValueError, match="sensors must be one of"):
        HandMotionEnv(device="octa", sensors="nothing")
    with pytest.raises(ValueError, match="has none"):
        HandMotionEnv(device="octa", sensors="bosch-bmi160")
    with pytest.raises(ValueError, match="axis_error must not be negative"):
        replace(ARRAY_PRESETS[0], axis_error=-1.0)
    with HandMotionEnv(device="planar", drive="kinematic", randomise=HandVariation(0.02, 0.0, 0.1)) as env:
        env.reset(seed=0, options={"gesture": Walk(planar=True, duration=2.0)})
        with pytest.raises(ValueError, match="must stay in the vertical plane"):
            env.reset(options={"gesture": "slow"})
