"""What the papers mount: suites, places, rates, grades; inertial sensors against closed forms."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.sensors.readings import RideQuantities
from poise.envs.bicycle.sensors.sites import BICYCLE_IMU_SITE, BICYCLE_IMU_TILT, fixture_sites, sensor_sites
from poise.envs.bicycle.sensors.suites import CHANNELS, list_bicycle_suites, rider_bicycle_suite
from poise.envs.sensors.ideal import STANDARD_GRAVITY, BodyState
from poise.filters.core import rotation

POSTURE = sit(MOUNTAIN_BIKE, SUBJECTS[3])
SITES = sensor_sites(POSTURE)
BODIES = ("bicycle", "trunk", "upper_arm_left", "upper_arm_right", "thigh_left", "thigh_right")


def circle(length=200, rate=100.0, speed=2.0, radius=2.5, roll=-0.15):
    """Everything rigidly on one frame whose origin rides a circle to the left with constant roll."""
    time = np.arange(length) / rate
    turn = speed / radius
    yaw = turn * time
    heading = np.stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw], axis=1)
    inward = np.stack([-np.sin(yaw), np.cos(yaw), 0.0 * yaw], axis=1)
    orientation = rotation.from_euler_zyx(yaw, 0.0 * yaw, np.full(length, roll))
    turning = np.tile([0.0, 0.0, turn], (length, 1))
    state = BodyState(
        time, -radius * inward, orientation, speed * heading, turning, speed * turn * inward, np.zeros((length, 3))
    )
    return dict.fromkeys(BODIES, state)


def ride_on(bodies):
    length = len(bodies["bicycle"].time)
    weight = np.tile([0.0, 0.0, -500.0], (length, 1))
    rate, hands = np.full(length, 6.0), np.zeros((length, 2, 3))
    steer, crank = np.zeros(length), 5.0 * np.arange(length) / 100.0
    return RideQuantities(bodies, SITES, rate, steer, crank, weight, 0.0 * weight, hands)


def measure(suite, bodies, seed=0):
    suite.reset(np.random.default_rng(seed))
    return suite.simulate(bodies, ride_on(bodies))[:2]


def test_suites_carry_the_papers_channels_and_rates():
    assert list_bicycle_suites() == ["two-gyro", "two-gyro-fixture", "force-inertial", "whole-body", "all"]
    made = {name: rider_bicycle_suite(name, sites=SITES) for name in list_bicycle_suites()}
    assert [suite.rate for suite in made.values()] == [100.0, 100.0, 50.0, 100.0, 100.0]
    names = {name: [channel.name for channel in suite.channels] for name, suite in made.items()}
    assert names["two-gyro"] == ["bicycle_imu/gyr", "trunk_imu/gyr", "relative/orientation"]
    assert {"seat/wrench", "handlebar/force", "wheel/speed"} < set(names["force-inertial"])
    assert {"upper_arm_left/gyr", "thigh_right/gyr", "crank/angle", "steer/angle"} < set(names["whole-body"])
    for paper in ("two-gyro", "force-inertial", "whole-body"):
        assert set(names[paper]) <= set(names["all"])


@pytest.mark.parametrize("sensors", ["paper", "ideal", "xsens-mtw-awinda"])
@pytest.mark.parametrize("name", ["two-gyro", "two-gyro-fixture", "force-inertial", "whole-body", "all"])
def test_every_suite_is_described_and_bounded(name, sensors):
    suite = rider_bicycle_suite(name, sites=SITES, sensors=sensors, magnetometer=True)
    json.dumps(suite.describe(), allow_nan=False)
    json.dumps(SITES.describe(), allow_nan=False)
    for channel in suite.channels:
        box = suite.observation_space[channel.name]
        assert np.all(np.isfinite(box.high))
        assert box.shape == (CHANNELS[channel.name].size,)


def test_devices_say_where_their_numbers_come_from():
    for name, entry in CHANNELS.items():
        if entry.device is not None:
            assert len(entry.device.source) > 40, name


def test_imu_at_rest_reads_gravity_along_its_tilted_axes():
    suite = rider_bicycle_suite("force-inertial", "ideal", sites=SITES)
    still = BodyState(
        np.arange(5) / 50.0, np.zeros((5, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (5, 1)), *([np.zeros((5, 3))] * 4)
    )
    measured, _ = measure(suite, dict.fromkeys(BODIES, still))
    s, c = math.sin(BICYCLE_IMU_TILT), math.cos(BICYCLE_IMU_TILT)
    np.testing.assert_allclose(measured["bicycle_imu/acc"][1:], [STANDARD_GRAVITY * np.array([s, 0.0, c])] * 4)
    np.testing.assert_allclose(measured["trunk_imu/acc"][1:], [[0.0, 0.0, STANDARD_GRAVITY]] * 4)
    np.testing.assert_allclose(measured["bicycle_imu/gyr"][1:], 0.0)


@pytest.mark.parametrize("sampling", ["instant", "interval"])
def test_imu_on_a_steady_circle_feels_v_squared_over_r(sampling):
    speed, radius, roll = 2.0, 2.5, -0.15
    bodies = circle(speed=speed, radius=radius, roll=roll)
    suite = rider_bicycle_suite(["bicycle_imu/acc", "bicycle_imu/gyr"], "ideal", sites=SITES, sampling=sampling)
    measured, _ = measure(suite, bodies)
    turn, (ahead, _, height) = speed / radius, BICYCLE_IMU_SITE
    # the papers' force-inertial (6) in steady motion, corrected, for y to the left: roll < 0 leans to the left, inwards
    lateral = speed * turn - height * math.sin(-roll) * turn**2
    level = np.array([-ahead * turn**2, lateral, STANDARD_GRAVITY])
    axes = rotation.multiply(
        rotation.from_euler_zyx(*map(np.array, (0.0, 0.0, roll))), np.array(SITES.bicycle_imu.rotation)
    )
    tolerance = 1e-9 if sampling == "instant" else 1e-4
    np.testing.assert_allclose(measured["bicycle_imu/acc"][5], rotation.rotate_back(axes, level), atol=tolerance)
    rate = rotation.rotate_back(axes, np.array([0.0, 0.0, turn]))
    np.testing.assert_allclose(measured["bicycle_imu/gyr"][5], rate, atol=1e-9)


def test_camera_runs_at_its_own_rate():
    bodies = circle(length=1000)
    measured, _ = measure(rider_bicycle_suite("all", sites=SITES), bodies)
    fresh = ~np.isnan(measured["relative/orientation"][:, 0])
    assert fresh[:100].sum() == 16
    assert fresh.sum() == 160
    assert np.all(np.isfinite(measured["wheel/speed"]))
    assert np.isnan(measured["bicycle_imu/gyr"][0]).all()
    for options, expected in (({"relative_rate": 25.0}, 250), ({"sensors": "ideal"}, 1000), ({"rate": 10.0}, 1000)):
        measured, _ = measure(rider_bicycle_suite("two-gyro", sites=SITES, **options), bodies)
        assert np.isfinite(measured["relative/orientation"][:, 0]).sum() == expected


def test_observations_flag_what_is_fresh():
    suite, bodies = rider_bicycle_suite("two-gyro", sites=SITES), circle(length=10)
    suite.reset(np.random.default_rng(0))
    flags = []
    measured = suite.simulate(bodies, ride_on(bodies)).measurements
    for step in range(10):
        observation = suite.to_observation({name: values[step] for name, values in measured.items()})
        assert suite.observation_space.contains(observation)
        flags.append(observation["new_sample"].tolist())
    assert flags[:3] == [[0, 0, 1], [1, 1, 0], [1, 1, 0]]
    assert flags[7] == [1, 1, 1]


def test_same_seed_same_numbers():
    bodies = circle(length=60)
    suites = [rider_bicycle_suite("all", sites=SITES, magnetometer=True) for _ in range(3)]
    one, _ = measure(suites[0], bodies, 3)
    again, _ = measure(suites[1], bodies, 3)
    other, _ = measure(suites[2], bodies, 4)
    for name, values in one.items():
        np.testing.assert_array_equal(values, again[name])
        if name not in ("wheel/speed", "crank/angle"):
            assert not np.array_equal(values, other[name], equal_nan=True), name


def test_truth_names_every_bias():
    _, truth = measure(rider_bicycle_suite("all", sites=SITES), circle(length=10))
    assert {
        "bicycle_imu/gyroscope_bias",
        "trunk_imu/accelerometer_bias",
        "thigh_left/gyroscope_bias",
        "seat/wrench_bias",
        "relative/orientation_bias",
        "steer/angle_bias",
    } < set(truth)
    assert truth["relative/orientation_bias"].shape == (10, 3)
    assert truth["seat/wrench_bias"].shape == (10, 6)


def test_noise_scales_share_the_errors_of_the_same_realisation():
    bodies = circle(length=300)
    results = {
        scale: measure(rider_bicycle_suite("all", sites=SITES, noise_scale=scale, relative_rate=100.0), bodies, 1)[0]
        for scale in (0.0, 0.01, 0.5, 1.0)
    }
    ideal, _ = measure(rider_bicycle_suite("all", "ideal", sites=SITES), bodies, 1)
    for name in ideal:
        np.testing.assert_allclose(results[0.0][name], ideal[name], atol=1e-12)
        errors = [np.nanstd(results[scale][name] - ideal[name]) for scale in (0.0, 0.01, 0.5, 1.0)]
        if name != "crank/angle":
            assert errors == sorted(errors), name
        assert errors[3] > 0.0, name
    error = {
        scale: rotation.log(
            rotation.multiply(rotation.conjugate(ideal["relative/orientation"]), results[scale]["relative/orientation"])
        )
        for scale in (0.5, 1.0)
    }
    np.testing.assert_allclose(2.0 * error[0.5], error[1.0], atol=1e-9)


def test_camera_noise_and_alignment_are_those_stated():
    length = 60_000
    still = BodyState(
        np.arange(length) / 100.0,
        np.zeros((length, 3)),
        np.tile([1.0, 0, 0, 0], (length, 1)),
        *([np.zeros((length, 3))] * 2),
    )
    suite = rider_bicycle_suite(["relative/orientation"], sites=SITES)
    drifts, turn_ons = [], []
    for seed in range(6):
        measured, truth = measure(suite, dict.fromkeys(BODIES, still), seed)
        seen = np.isfinite(measured["relative/orientation"][:, 0])
        error = rotation.log(measured["relative/orientation"][seen])
        bias = truth["relative/orientation_bias"]
        np.testing.assert_allclose(np.linalg.norm(measured["relative/orientation"][seen], axis=1), 1.0, atol=1e-12)
        # rotations nearly add at these sizes
        np.testing.assert_allclose((error - bias[seen]).std(axis=0), math.radians(1.0), rtol=0.05)
        # slow: a frame changes it by far less than it is; bounded: it wanders about its mean
        assert np.abs(np.diff(bias[seen], axis=0)).max() < math.radians(0.3)
        assert np.abs(bias).max() < math.radians(8.0)
        drifts.append(bias.std(axis=0))
        turn_ons.append(bias.mean(axis=0))
    assert math.radians(0.7) < np.mean(drifts) < math.radians(1.2)
    assert math.radians(0.4) < np.std(turn_ons) < math.radians(1.8)


def test_wheel_encoder_counts():
    bodies = circle(length=2000)
    suite = rider_bicycle_suite(["wheel/speed"], sites=SITES)
    measured, _ = measure(suite, bodies)
    speeds, step = measured["wheel/speed"][:, 0], 2.0 * math.pi / 1024 * SITES.wheel_radius * 100.0
    counts = np.rint(speeds / step)
    np.testing.assert_allclose(speeds, counts * step, atol=1e-9)
    assert set(np.diff(np.unique(counts))) == {1.0}
    assert speeds.mean() == pytest.approx(6.0 * SITES.wheel_radius, rel=0.02)


def test_saturating_accelerometer_and_chosen_devices():
    suite = rider_bicycle_suite("force-inertial", sites=SITES)
    assert suite.observation_space["bicycle_imu/acc"].high[0] == pytest.approx(2.0 * STANDARD_GRAVITY)
    other = rider_bicycle_suite("force-inertial", "bosch-bmi160", sites=SITES)
    assert [sensor.device for sensor in other.sensors][:5] == ["bosch-bmi160"] * 4 + ["JR3 six-axis sensor"]


def test_places_are_those_of_the_papers():
    post = np.array(SITES.seat_sensor.lever_arm) - np.array(SITES.saddle)
    assert np.linalg.norm(post) == pytest.approx(0.13)
    # the post leans backwards: the sensor sits ahead of the saddle point, and its z axis points up to it
    assert post[0] > 0.0
    up = rotation.rotate(np.array(SITES.seat_sensor.rotation), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(up, -post / 0.13, atol=1e-12)
    assert SITES.load_cells.x == pytest.approx((0.157, -0.043, -0.043))
    nose = rotation.rotate(np.array(SITES.bicycle_imu.rotation), np.array([1.0, 0.0, 0.0]))
    assert math.asin(nose[2]) == pytest.approx(BICYCLE_IMU_TILT)
    assert SITES.trunk_imu.lever_arm == POSTURE.trunk_imu


def test_fixture_has_a_disk_instead_of_a_rider():
    sites = fixture_sites(SITES, (0.3, 0.0, 1.0))
    suite = rider_bicycle_suite("two-gyro-fixture", sites=sites)
    assert [sensor.body for sensor in suite.sensors] == ["bicycle", "disk", "disk"]
    assert np.linalg.norm(sites.markers, axis=1) == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "three-gyro"}, "suite must be one of"),
        ({"name": ["wheel/sound"]}, "channels must be different ones"),
        ({"name": ["wheel/speed", "wheel/speed"]}, "channels must be different ones"),
        ({"name": []}, "channels must be different ones"),
        ({"sensors": "cheap"}, "sensors must be 'paper' or one of"),
        ({"sensors": "adis16470", "magnetometer": True}, "a device with a magnetometer"),
        ({"rate": 0.0}, "rate must lie in"),
        ({"rate": 1e6}, "rate must lie in"),
        ({"rate": math.nan}, "rate must lie in"),
        ({"relative_rate": 200.0}, "relative_rate must lie in"),
        ({"relative_rate": 0.0}, "relative_rate must lie in"),
        ({"noise_scale": -1.0}, "noise_scale must lie in"),
        ({"sampling": "block"}, "sampling must be one of"),
    ],
)
def test_bad_input_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        rider_bicycle_suite(**{"name": "all", "sites": SITES, **options})


def test_impossible_places_are_refused():
    with pytest.raises(ValueError, match="wheel_radius must be positive"):
        replace(SITES, wheel_radius=-0.1)
    with pytest.raises(ValueError, match="viewpoints must be three points"):
        sensor_sites(POSTURE, viewpoints=[(0.0, 0.0, 1.0)])
