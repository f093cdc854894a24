"""Suites: rates, observations, truth, and that motions in parts and restored states agree."""

import itertools
import json

import numpy as np
import pytest

from poise.envs.sensors.ideal import BodyState, Mounting, interval_readings, magnetic_field, mounted
from poise.envs.sensors.noise import NoiseModel
from poise.envs.sensors.sensor import Sensor
from poise.envs.sensors.suite import SensorSuite, imu_suite
from poise.filters.core import rotation
from poise.filters.core.quantity import Channel

LENGTH = 120


def motion(length=LENGTH, rate=100.0):
    time = np.arange(length) / rate
    orientation = rotation.from_euler_zyx(np.sin(time), 0.5 * np.cos(2.0 * time), 0.3 * time)
    rng = np.random.default_rng(9)
    velocity, spin, acceleration, turning = np.cumsum(0.1 * rng.standard_normal((4, length, 3)), axis=1)
    return BodyState(time, np.zeros((length, 3)), orientation, velocity, spin, acceleration, turning)


def in_parts(suite, states, borders, readings=None):
    """Measurements and truth of a motion that is simulated in several parts."""
    parts = []
    for first, last in itertools.pairwise(borders):
        handed = None if readings is None else {name: values[first:last] for name, values in readings.items()}
        parts.append(suite.simulate(states.at(slice(first, last)), handed))
    return tuple({name: np.concatenate([part[i][name] for part in parts]) for name in parts[0][i]} for i in range(2))


def assert_same(one, other):
    assert list(one) == list(other)
    for name in one:
        np.testing.assert_allclose(one[name], other[name], rtol=1e-12, atol=1e-12)


def wheel_suite():
    encoder = Sensor(Channel("wheel/encoder", 1, "rad"), "given", 40.0, NoiseModel(resolution=0.1, full_scale=100.0))
    imu = imu_suite("xsens-mti-100", 50.0, (0.1, 0.0, 0.2), magnetometer=30.0, step_rate=100.0, site="trunk")
    return SensorSuite([*imu.sensors, encoder], 100.0)


@pytest.mark.parametrize("sampling", ["interval", "instant"])
@pytest.mark.parametrize("preset", ["ideal", "invensense-mpu-9250"])
def test_a_motion_in_parts_gives_the_numbers_of_the_whole(sampling, preset):
    options = {"lever_arm": (0.1, 0.2, 0.0), "mounting": (0.6, 0.8, 0.0, 0.0), "magnetometer": 30.0}
    one, other = (imu_suite(preset, sampling=sampling, **options) for _ in range(2))
    one.reset(np.random.default_rng(5))
    other.reset(np.random.default_rng(5))
    measured, truth, _ = one.simulate(motion())
    parts = in_parts(other, motion(), (0, 1, 2, 3, 50, LENGTH))
    assert_same(measured, parts[0])
    assert_same(truth, parts[1])


def test_several_bodies_rates_and_given_readings():
    states, angle = motion(), np.linspace(0.0, 9.0, LENGTH)[:, None]
    one, other = wheel_suite(), wheel_suite()
    one.reset(np.random.default_rng(6))
    other.reset(np.random.default_rng(6))
    measured, truth, _ = one.simulate({"body": states}, {"wheel/encoder": angle})
    parts = in_parts(other, states, range(LENGTH + 1), {"wheel/encoder": angle})
    assert_same(measured, parts[0])
    assert_same(truth, parts[1])
    assert set(truth) == {
        "trunk/gyroscope_bias",
        "trunk/accelerometer_bias",
        "trunk/magnetometer_bias",
        "wheel/encoder_bias",
    }
    rows = np.flatnonzero(np.isfinite(measured["wheel/encoder"][:, 0]))
    np.testing.assert_allclose(measured["wheel/encoder"][rows], angle[rows], atol=0.05 + 1e-12)
    np.testing.assert_array_equal(rows[:7], [0, 3, 5, 8, 10, 13, 15])
    assert len(rows) == 48


def test_a_slow_sensor_is_fresh_every_fourth_tick_and_covers_its_own_interval():
    states = motion()
    suite = imu_suite("ideal", 25.0, magnetometer=True, step_rate=100.0)
    suite.reset(np.random.default_rng(0))
    measured = suite.simulate(states).measurements
    fresh = np.isfinite(measured["imu/mag"][:, 0])
    np.testing.assert_array_equal(np.flatnonzero(fresh), np.arange(0, LENGTH, 4))
    rows = np.arange(4, LENGTH, 4)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(measured["imu/gyr"][:, 0])), rows)
    rate, force = interval_readings(states.at(rows - 4), states.at(rows))
    np.testing.assert_allclose(measured["imu/gyr"][rows], rate, atol=1e-12)
    np.testing.assert_allclose(measured["imu/acc"][rows], force, atol=1e-12)


def test_the_state_before_makes_the_first_sample_complete():
    states = motion()
    suite = imu_suite("ideal", lever_arm=(0.2, 0.0, 0.1))
    suite.reset(np.random.default_rng(0))
    first = suite.simulate(states.at(slice(1, 2)), before=states.at(slice(0, 1))).measurements
    before, after = (mounted(states.at(index), Mounting((0.2, 0.0, 0.1))) for index in (0, 1))
    np.testing.assert_allclose(first["imu/gyr"][0], interval_readings(before, after)[0], atol=1e-12)
    np.testing.assert_allclose(first["imu/acc"][0], interval_readings(before, after)[1], atol=1e-12)


def test_instant_samples_use_the_physics_step_before_where_accelerations_are_unknown():
    states = motion()._replace(acceleration=None, angular_acceleration=None)
    suite = imu_suite("ideal", sampling="instant", lever_arm=(0.2, 0.0, 0.1))
    suite.reset(np.random.default_rng(0))
    now, before = states.at(slice(1, None)), states.at(slice(None, -1))
    measured = suite.simulate(now, before=before).measurements
    where = Mounting((0.2, 0.0, 0.1))
    expected = interval_readings(mounted(before, where), mounted(now, where))[1]
    np.testing.assert_allclose(measured["imu/acc"], expected, atol=1e-12)
    with pytest.raises(ValueError, match="instant readings need the acceleration"):
        suite.simulate(states)


def test_the_motion_of_a_placement_is_computed_once_and_handed_back():
    states = motion()
    suite = imu_suite("ideal", lever_arm=(0.2, 0.0, 0.1))
    suite.reset(np.random.default_rng(0))
    reference = ("body", Mounting(), "interval", 100.0, None)
    borders = ((1, 50), (50, LENGTH))
    parts = [
        suite.simulate(states.at(slice(a, b)), before=states.at(slice(a - 1, b - 1)), reference=reference)
        for a, b in borders
    ]
    assert set(parts[0].motions) == {reference, suite.sensors[0].placement}
    rate, force = interval_readings(states.at(slice(None, -1)), states.at(slice(1, None)), 0.0)
    found = [part.motions[reference] for part in parts]
    np.testing.assert_allclose(np.concatenate([part.angular_rate for part in found]), rate, atol=1e-12)
    np.testing.assert_allclose(np.concatenate([part.external_acceleration for part in found]), force, atol=1e-12)
    own = suite.sensors[0].placement
    read = np.concatenate([part.motions[own].specific_force for part in parts])
    np.testing.assert_array_equal(read, np.concatenate([part.measurements["imu/acc"] for part in parts]))


def test_observations_lie_in_their_space_and_hold_the_last_value():
    suite = imu_suite("paper-hand", step_rate=100.0, rate=25.0)
    suite.reset(np.random.default_rng(0))
    states, previous = motion(), None
    observations, measurements = [], []
    measured = suite.simulate(states).measurements
    for index in range(40):
        measurement = {name: values[index] for name, values in measured.items()}
        observation = suite.to_observation(measurement)
        assert suite.observation_space.contains(observation)
        np.testing.assert_array_equal(observation["new_sample"], [index > 0 and index % 4 == 0] * 2)
        if index < 4:
            assert not observation["imu/acc"].any()
        elif index % 4:
            np.testing.assert_array_equal(observation["imu/acc"], previous["imu/acc"])
        previous = observation
        observations.append(observation)
        measurements.append(measurement)
    batch = {name: np.stack([one[name] for one in observations])[:, None] for name in observations[0]}
    back = suite.to_measurement(batch)
    for name, values in back.items():
        assert values.shape == (40, 1, 3)
        np.testing.assert_allclose(values[:, 0], np.array([one[name] for one in measurements]), rtol=1e-6)


def test_values_beyond_the_bounds_are_clipped():
    suite = imu_suite("paper-hand")
    suite.reset(np.random.default_rng(0))
    wild = {"imu/gyr": np.full(3, 1e6), "imu/acc": np.array([1.0, np.nan, 1.0])}
    observation = suite.to_observation(wild)
    assert suite.observation_space.contains(observation)
    np.testing.assert_array_equal(observation["new_sample"], [1, 0])
    assert np.isfinite(suite.observation_space["imu/gyr"].high).all()


def test_a_saved_suite_goes_on_exactly():
    states, angle = motion(), np.ones((LENGTH, 1))
    suite, other = wheel_suite(), wheel_suite()
    suite.reset(np.random.default_rng(1))
    measured = suite.simulate(states.at(slice(0, 33)), {"wheel/encoder": angle[:33]}).measurements
    suite.to_observation({name: values[-1] for name, values in measured.items()})
    saved = suite.save()
    rest = states.at(slice(33, None))
    ahead = suite.simulate(rest, {"wheel/encoder": angle[33:]}).measurements
    other.restore(saved)
    again = other.simulate(rest, {"wheel/encoder": angle[33:]}).measurements
    for name in ahead:
        np.testing.assert_array_equal(ahead[name], again[name])
    suite.restore(saved)
    nothing = suite.to_observation({})
    np.testing.assert_array_equal(nothing["trunk/acc"], other.to_observation({})["trunk/acc"])


def test_an_added_sensor_leaves_the_others_alone():
    states = motion()
    plain, magnetic = imu_suite("xsens-mti-100"), imu_suite("xsens-mti-100", magnetometer=True)
    plain.reset(np.random.default_rng(3))
    magnetic.reset(np.random.default_rng(3))
    one, other = plain.simulate(states)[0], magnetic.simulate(states)[0]
    np.testing.assert_array_equal(one["imu/gyr"], other["imu/gyr"])
    plain.reset(np.random.default_rng(4))
    assert not np.array_equal(one["imu/gyr"], plain.simulate(states)[0]["imu/gyr"], equal_nan=True)


def test_the_bias_in_the_truth_is_the_one_in_the_measurement():
    states = motion()._replace(velocity=np.zeros((LENGTH, 3)))
    ideal = imu_suite("ideal")
    noise = NoiseModel(turn_on_bias=0.1, bias_random_walk=0.01, full_scale=50.0)
    suite = SensorSuite([Sensor(Channel("imu/gyr", 3, "rad/s"), "gyroscope", 100.0, noise)], 100.0)
    suite.reset(np.random.default_rng(0))
    ideal.reset(np.random.default_rng(0))
    measured, truth, _ = suite.simulate(states)
    exact = ideal.simulate(states).measurements
    np.testing.assert_allclose((measured["imu/gyr"] - truth["gyroscope_bias"])[1:], exact["imu/gyr"][1:], atol=1e-12)


def test_the_description_is_json_and_complete():
    suite = imu_suite("xsens-mtw-awinda", lever_arm=(0.1, 0.0, 0.0), magnetometer=True, field=magnetic_field(48.0))
    text = json.loads(json.dumps(suite.describe(), allow_nan=False))
    assert [sensor["channel"] for sensor in text["sensors"]] == ["imu/gyr", "imu/acc", "imu/mag"]
    assert text["sensors"][0]["device"] == "xsens-mtw-awinda"
    assert text["sensors"][0]["noise"]["white_noise"] == pytest.approx(np.deg2rad(0.01))
    assert text["sensors"][1]["lever_arm"] == [0.1, 0.0, 0.0]
    assert np.linalg.norm(text["field"]) == pytest.approx(48.0)


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"rate of 'imu/mag' must lie in \(0, 100\] Hz.*got 200 Hz"):
        imu_suite("ideal", magnetometer=200.0)
    with pytest.raises(ValueError, match="magnetometer must be False: the preset 'paper-hand' has none"):
        imu_suite("paper-hand", magnetometer=True)
    with pytest.raises(ValueError, match="sampling must be one of"):
        imu_suite(sampling="now")
    with pytest.raises(ValueError, match=r"must be positive and finite .*full_scale"):
        SensorSuite([Sensor(Channel("imu/gyr", 3, "rad/s"), "gyroscope", 100.0, NoiseModel())], 100.0)
    with pytest.raises(ValueError, match="a sample of a gyroscope has 3 values"):
        Sensor(Channel("imu/gyr", 2, "rad/s"), "gyroscope", 100.0, NoiseModel())
    with pytest.raises(ValueError, match="names of their own"):
        SensorSuite([*imu_suite().sensors, *imu_suite().sensors], 100.0)
    suite, states = imu_suite(), motion()
    with pytest.raises(RuntimeError, match="call reset"):
        suite.simulate(states)
    suite.reset(np.random.default_rng(0))
    with pytest.raises(ValueError, match="bodies must hold 'body', got"):
        suite.simulate({"frame": states})
    suite.simulate(states)
    with pytest.raises(ValueError, match="time of body 'body' must advance"):
        suite.simulate(states)
    with pytest.raises(ValueError, match="observation lacks"):
        suite.to_measurement({"imu/gyr": np.zeros(3)})
    wheel = wheel_suite()
    wheel.reset(np.random.default_rng(0))
    with pytest.raises(ValueError, match="surroundings must hold the reading 'wheel/encoder', got None"):
        wheel.simulate(states)
    wheel.reset(np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"readings of 'wheel/encoder' must have shape \(120, 1\), got \(120, 2\)"):
        wheel.simulate(states, {"wheel/encoder": np.zeros((LENGTH, 2))})


def test_a_half_turn_within_one_interval_is_read():
    still = np.zeros((2, 3))
    turned = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    suite = imu_suite("ideal", rate=1.0)
    suite.reset(np.random.default_rng(0))
    measured = suite.simulate(BodyState(np.array([0.0, 1.0]), still, turned, still, still)).measurements
    np.testing.assert_allclose(measured["imu/gyr"][1], [0.0, 0.0, np.pi], atol=1e-12)
