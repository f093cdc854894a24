"""Errors of angles, rotations, counts and axes in different units."""

import numpy as np
import pytest

from poise.envs.sensors.noise import NoiseModel, NoiseProcess
from poise.envs.sensors.sensor import Sensor
from poise.envs.sensors.suite import SensorSuite
from poise.filters.core import rotation
from poise.filters.core.quantity import Channel

NOISY = NoiseModel(
    white_noise=0.02, bias_instability=0.05, turn_on_bias=0.1, resolution=0.03, dropout=0.1, full_scale=4.0
)


def process(form, size, seed=1, model=NOISY, units=()):
    return NoiseProcess(model, size, 50.0, np.random.default_rng(seed), form, units)


def readings(form, size, length=400):
    rng = np.random.default_rng(7)
    if form == "rotation":
        return rotation.positive(rotation.random(rng, (length,)))
    return rng.uniform(-3.0, 3.0, (length, size))


@pytest.mark.parametrize(("form", "size"), [("additive", 6), ("angle", 1), ("rotation", 4), ("counted", 1)])
def test_parts_equal_the_whole_and_restored_states_continue(form, size):
    units = (2.0,) * (3 if form == "rotation" else size)
    one, other = process(form, size, units=units), process(form, size, units=units)
    values = readings(form, size)
    whole, biases = one.sequence(values)
    first = other.sequence(values[:150])
    saved = other.save()
    rest = other.sequence(values[150:])
    np.testing.assert_allclose(np.concatenate([first[0], rest[0]]), whole, atol=1e-12)
    np.testing.assert_allclose(np.concatenate([first[1], rest[1]]), biases, atol=1e-12)
    np.testing.assert_array_equal(other.bias, rest[1][-1])
    assert 0.02 < np.isnan(whole[:, 0]).mean() < 0.2
    other.restore(saved)
    np.testing.assert_array_equal(other.sequence(values[150:])[0], rest[0])


def test_rotation_stays_a_unit_quaternion_with_the_stated_error():
    sigma, rate = 0.02, 50.0
    model = NoiseModel(white_noise=sigma / np.sqrt(rate), full_scale=1.0)
    truth = readings("rotation", 4, 20_000)
    measured, _ = process("rotation", 4, model=model).sequence(truth)
    np.testing.assert_allclose(np.linalg.norm(measured, axis=1), 1.0, atol=1e-12)
    assert np.all(measured[:, 0] >= 0.0)
    error = rotation.log(rotation.multiply(rotation.conjugate(truth), measured))
    np.testing.assert_allclose(error.std(axis=0), sigma, rtol=0.03)


def test_bias_of_a_rotation_is_its_mean_error():
    model = NoiseModel(turn_on_bias=0.1, full_scale=1.0)
    one, truth = process("rotation", 4, model=model), readings("rotation", 4, 5)
    measured, biases = one.sequence(truth)
    expected = rotation.positive(rotation.multiply(truth, rotation.exp(biases)))
    np.testing.assert_allclose(measured, expected, atol=1e-14)
    assert one.bias.shape == (3,)
    assert np.all(one.bias != 0.0)


def test_angles_wrap_and_sit_on_the_encoder_grid():
    grid = 2.0 * np.pi / 1024
    one = process("angle", 1, model=NoiseModel(resolution=grid, full_scale=np.pi))
    values = rotation.wrap(np.linspace(0.0, 20.0, 5000))[:, None]
    measured, _ = one.sequence(values)
    assert np.abs(measured).max() <= np.pi
    np.testing.assert_allclose(measured / grid, np.rint(measured / grid), atol=1e-9)
    assert np.abs(rotation.wrap(measured - values)).max() <= 0.5 * grid * (1.0 + 1e-9)
    # beyond π an offset comes back on the other side
    shifted, bias = process("angle", 1, model=NoiseModel(turn_on_bias=0.2, full_scale=np.pi)).sequence(values)
    np.testing.assert_allclose(rotation.wrap(shifted - values - bias), 0.0, atol=1e-9)


def test_counting_loses_nothing():
    grid = 0.2
    one = process("counted", 1, model=NoiseModel(resolution=grid, full_scale=20.0))
    values = np.full((1000, 1), 1.03)
    measured, _ = one.sequence(values)
    assert set(np.rint(measured[:, 0] / grid).astype(int)) == {5, 6}
    assert np.abs(np.cumsum(measured - values)).max() <= 0.5 * grid * (1.0 + 1e-9)


def test_units_scale_noise_range_and_bounds_of_each_axis():
    noise = NoiseModel(white_noise=0.1, turn_on_bias=1.0, full_scale=30.0)
    sensor = Sensor(Channel("seat/wrench", 2, "N, N·m"), "given", 100.0, noise, units=(1.0, 0.1))
    suite = SensorSuite([sensor], 100.0)
    box = suite.observation_space["seat/wrench"]
    np.testing.assert_allclose(box.high, [30.0, 3.0], rtol=1e-6)
    suite.reset(np.random.default_rng(0))
    measured, truth, _ = suite.simulate({}, {"seat/wrench": np.zeros((20_000, 2))})
    noise_only = measured["seat/wrench"] - truth["seat/wrench_bias"]
    np.testing.assert_allclose(noise_only.std(axis=0), [1.0, 0.1], rtol=0.03)
    largest = suite.simulate({}, {"seat/wrench": np.full((5, 2), 1e6)}).measurements
    np.testing.assert_allclose(largest["seat/wrench"], [[30.0, 3.0]] * 5)
    observed = suite.to_observation({"seat/wrench": np.array([1e6, -1e6])})
    assert box.contains(observed["seat/wrench"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"form": "product"}, "form must be"),
        ({"form": "rotation"}, "a rotation has 4 values"),
        ({"units": (1.0, 2.0)}, "units must be 1 positive"),
        ({"units": (0.0,)}, "units must be 1 positive"),
    ],
)
def test_bad_forms_and_units_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Sensor(Channel("steer/angle", 1, "rad"), "given", 100.0, NoiseModel(full_scale=1.0), **options)


def test_inertial_sensors_are_additive():
    with pytest.raises(ValueError, match="form must be 'additive'"):
        Sensor(Channel("imu/gyr", 3, "rad/s"), "gyroscope", 100.0, NoiseModel(full_scale=1.0), form="angle")
