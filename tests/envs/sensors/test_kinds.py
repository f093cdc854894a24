"""A sensor kind of one's own, from outside the package: barometers on the hand-held device and on the bicycle."""

from __future__ import annotations

import dataclasses
import json

import gymnasium
import numpy as np
import pytest

import poise
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.sensors.single_imu import imu_of
from poise.envs.bicycle.sensors.sites import BICYCLE_IMU_SITE
from poise.envs.hand.devices import array_preset
from poise.envs.hand.sensing import simulate_hand
from poise.envs.sensors.ideal import BodyState, Mounting
from poise.envs.sensors.kinds import KINDS, SensorKind, register_sensor_kind, sensor_kind
from poise.envs.sensors.noise import NoiseModel
from poise.envs.sensors.presets import SensorPreset, sensor_preset
from poise.envs.sensors.sensor import Sensor
from poise.envs.sensors.suite import SensorSuite
from poise.filters.core.quantity import Channel


def pressure(height):
    """International standard atmosphere near the ground, hPa; height in m."""
    return 1013.25 * (1.0 - 2.25577e-5 * height) ** 5.25588


BAROMETER = SensorKind("barometer", 1, "hPa", "bar", lambda motion: pressure(motion.now.position[:, 2:]), 1200.0)


@pytest.fixture
def barometer():
    yield register_sensor_kind(BAROMETER)
    del KINDS["barometer"]


def test_a_registered_kind_and_a_preset_put_a_barometer_on_the_hand(barometer):
    mtw = sensor_preset("xsens-mtw-awinda")
    noise = NoiseModel(white_noise=0.002, resolution=0.01, full_scale=1200.0)
    preset = SensorPreset(
        "mtw-and-barometer", "of our own", mtw.gyroscope, mtw.accelerometer, others={"barometer": noise}
    )
    env = gymnasium.make("poise/HandMotion-v0", sensors=preset, gesture="slow", duration=4.0, lever_arm=(0.0, 0.0, 0.3))
    plain = gymnasium.make(
        "poise/HandMotion-v0",
        sensors=mtw,
        gesture="slow",
        duration=4.0,
        lever_arm=(0.0, 0.0, 0.3),
        magnetometer=False,
    )
    try:
        assert env.observation_space["imu/bar"].high == pytest.approx(1200.0)
        trajectory, without = poise.record(env, seed=3), poise.record(plain, seed=3)
    finally:
        env.close()
        plain.close()
    error = trajectory.measurements["imu/bar"][:, 0] - pressure(trajectory.truth["position"][:, 2])
    assert 0.01 < np.std(error) < 0.03
    assert trajectory.truth["imu/bar_bias"].shape == (len(trajectory), 1)
    described = trajectory.metadata["sensors"]["sensors"][-1]
    assert (described["kind"], described["unit"], described["channel"]) == ("barometer", "hPa", "imu/bar")
    # a further sensor changes nothing about the others
    np.testing.assert_array_equal(trajectory.measurements["imu/gyr"], without.measurements["imu/gyr"])


def test_an_unregistered_kind_puts_two_barometers_on_the_bicycle():
    exact = NoiseModel(full_scale=1200.0)
    low = Sensor(Channel("frame/bar", 1, "hPa"), BAROMETER, 25.0, exact, "bicycle", Mounting((0.0, 0.0, 0.5)))
    high = Sensor(Channel("back/bar", 1, "hPa"), BAROMETER, 100.0, exact, "trunk", Mounting((0.0, 0.0, 0.4)))
    options = {"fidelity": "lumped", "duration": 1.0, "scenario": "outdoor"}
    env = gymnasium.make("poise/RiderBicycle-v0", suite=["bicycle_imu/gyr", low, high, "wheel/speed"], **options)
    try:
        ride = poise.record(env, seed=1)
    finally:
        env.close()
    assert list(ride.measurements) == ["bicycle_imu/gyr", "wheel/speed", "frame/bar", "back/bar"]
    frame = np.isfinite(ride.measurements["frame/bar"][:, 0])
    np.testing.assert_array_equal(np.flatnonzero(frame), np.arange(0, len(ride), 4))
    # about 12 Pa a metre: the back is some 60 cm above the sensor on the frame
    rise = (ride.measurements["frame/bar"] - ride.measurements["back/bar"])[frame, 0] / 0.12
    assert np.all((rise > 0.4) & (rise < 1.2))
    json.dumps(ride.metadata["sensors"], allow_nan=False)
    assert "test_kinds.<lambda>" in ride.metadata["environment"]["kwargs"]["suite"][1]["kind"]["reading"]


def test_a_device_with_an_array_and_an_imu_of_a_ride_keep_their_barometers(barometer):
    array = array_preset("array-calibrated")
    preset = dataclasses.replace(array, others={"barometer": NoiseModel(turn_on_bias=1.0, full_scale=1200.0)})
    flight = simulate_hand("slow", 1, preset, duration=2.0, device="octa")
    off = flight.measurements["imu/bar"] - flight.truth["imu/bar_bias"]
    np.testing.assert_allclose(off, pressure(flight.truth["position"][:, 2:]), atol=1e-9)
    where = Mounting(BICYCLE_IMU_SITE)
    own = Sensor(Channel("bicycle_imu/bar", 1, "hPa"), barometer, 100.0, preset.others["barometer"], "bicycle", where)
    env = RiderBicycleEnv(suite=["bicycle_imu/gyr", "bicycle_imu/acc", own], fidelity="lumped", duration=0.5)
    try:
        imu = imu_of(poise.record(env, seed=2))
    finally:
        env.close()
    assert list(imu.measurements) == ["imu/gyr", "imu/acc", "imu/bar"]
    assert {"gyroscope_bias", "accelerometer_bias", "imu/bar_bias"} < set(imu.truth)
    height = imu.measurements["imu/bar"] - imu.truth["imu/bar_bias"]
    np.testing.assert_allclose(height, pressure(imu.truth["position"][:, 2:]), atol=1e-9)


def test_a_kind_of_contact_forces_reads_what_the_environment_knows():
    both = SensorKind(
        "hand-load", 1, "N", "load", lambda ride: -ride.hands[:, :, 2].sum(axis=1, keepdims=True), on_body=False
    )
    load = Sensor(Channel("bar/load", 1, "N"), both, 50.0, NoiseModel(full_scale=2000.0), "bicycle")
    env = gymnasium.make("poise/RiderBicycle-v0", suite=["handlebar/force", load], sensors="ideal", duration=0.5)
    try:
        ride = poise.record(env, seed=1)
    finally:
        env.close()
    due = np.isfinite(ride.measurements["bar/load"][:, 0])
    force = ride.truth["handlebar/force_left"] + ride.truth["handlebar/force_right"]
    np.testing.assert_allclose(
        np.linalg.norm(force[due], axis=1), np.abs(ride.measurements["bar/load"][due, 0]), rtol=0.6
    )
    assert 0 < due.sum() < len(due)


def test_bad_kinds_are_named(barometer):
    assert register_sensor_kind(BAROMETER) is BAROMETER
    with pytest.raises(ValueError, match="there is another sensor kind 'barometer'"):
        register_sensor_kind(SensorKind("barometer", 2, "hPa", "bar", None))
    with pytest.raises(ValueError, match=r"kind must be a SensorKind or one of .*'barometer'.*, got 'thermometer'"):
        sensor_kind("thermometer")
    with pytest.raises(ValueError, match="a sample of a barometer has 1 values, but channel 'imu/bar' has 2"):
        Sensor(Channel("imu/bar", 2, "hPa"), "barometer", 1.0, NoiseModel(full_scale=1.0))
    for options, message in (
        ({"name": ""}, "must not be empty"),
        ({"size": 0}, "size of the sensor kind 'x' must be at least 1, got 0"),
        ({"full_scale": np.inf}, "full_scale of the sensor kind 'x' must be positive and finite, got inf"),
    ):
        with pytest.raises(ValueError, match=message):
            SensorKind(**{"name": "x", "size": 1, "unit": "1", "suffix": "x", "reading": None} | options)
    wrong = SensorKind("wrong", 1, "1", "x", lambda motion: motion.now.position)
    suite = SensorSuite([Sensor(Channel("a/x", 1, "1"), wrong, 1.0, NoiseModel(full_scale=1.0))], 1.0)
    suite.reset(np.random.default_rng(0))
    zero = np.zeros((2, 3))
    with pytest.raises(ValueError, match=r"readings of 'a/x' must have shape \(None, 1\), got \(2, 3\)"):
        suite.simulate(BodyState(np.arange(2.0), zero, np.tile([1.0, 0, 0, 0], (2, 1)), zero, zero))
