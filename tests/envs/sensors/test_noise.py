"""The noise model against Allan deviations (allantools), statistics and the response of a filter."""

import math
from dataclasses import replace

import allantools
import numpy as np
import pytest

from poise.envs.sensors.assumptions import PEAK
from poise.envs.sensors.noise import NoiseModel, NoiseProcess
from poise.envs.sensors.presets import list_sensor_presets, sensor_preset

EVERYTHING = NoiseModel(
    white_noise=0.01,
    bias_random_walk=1e-3,
    bias_instability=0.1,
    turn_on_bias=0.1,
    scale_factor=0.01,
    misalignment=0.01,
    g_sensitivity=0.01,
    temperature_coefficient=0.02,
    warm_up=5.0,
    warm_up_time=2.0,
    full_scale=3.0,
    resolution=1e-3,
    dropout=0.1,
    burst_rate=0.5,
)


def process(model, width=3, rate=100.0, seed=0):
    return NoiseProcess(model, width, rate, np.random.default_rng(seed))


def allan_deviation(model, taus, length=20_000, width=16, rate=100.0):
    """Overlapping Allan deviation, averaged over independent axes."""
    data, _ = process(model, width, rate).sequence(np.zeros((length, width)))
    deviations = [allantools.oadev(axis, rate=rate, data_type="freq", taus=taus)[1] for axis in data.T]
    return np.sqrt(np.mean(np.square(deviations), axis=0))


def slope(taus, deviations):
    return np.polyfit(np.log(taus), np.log(deviations), 1)[0]


def test_white_noise_has_its_density_at_one_second_and_falls_with_the_root():
    taus = np.array([0.1, 0.3, 1.0, 3.0])
    deviations = allan_deviation(NoiseModel(white_noise=0.02), taus)
    assert deviations[2] == pytest.approx(0.02, rel=0.05)
    assert slope(taus, deviations) == pytest.approx(-0.5, abs=0.03)


def test_white_noise_density_does_not_depend_on_the_rate():
    for rate in (25.0, 400.0):
        model = NoiseModel(white_noise=0.02)
        assert allan_deviation(model, [1.0], length=8000, rate=rate)[0] == pytest.approx(0.02, rel=0.1)


def test_a_walking_bias_rises_with_the_root():
    taus = np.array([1.0, 3.0, 10.0])
    deviations = allan_deviation(NoiseModel(bias_random_walk=0.03), taus)
    np.testing.assert_allclose(deviations, 0.03 * np.sqrt(taus / 3.0), rtol=0.12)
    assert slope(taus, deviations) == pytest.approx(0.5, abs=0.08)


def test_a_wandering_bias_peaks_where_the_data_sheet_says():
    correlation = 2.0
    model = NoiseModel(bias_instability=0.5 / PEAK, bias_correlation_time=correlation)
    assert allan_deviation(model, [1.89 * correlation])[0] == pytest.approx(0.5, rel=0.06)
    values, _ = process(model, 64).sequence(np.zeros((4000, 64)))
    assert np.std(values) == pytest.approx(0.5 / PEAK, rel=0.05)


def test_constant_errors_have_their_deviations():
    model = NoiseModel(turn_on_bias=0.2, scale_factor=0.03, misalignment=0.01)
    biases, diagonals, others = [], [], []
    for seed in range(400):
        one = process(model, seed=seed)
        measured, _ = one.sequence(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        bias, response = measured[0], measured[1:] - measured[0]
        np.testing.assert_allclose(bias, one.bias)
        biases.append(bias)
        diagonals.append(np.diag(response) - 1.0)
        others.append(response[~np.eye(3, dtype=bool)])
    for sample, deviation in ((biases, 0.2), (diagonals, 0.03), (others, 0.01)):
        assert np.std(sample) == pytest.approx(deviation, rel=0.08)


def test_the_bias_warms_up_exponentially():
    model = NoiseModel(temperature_coefficient=0.04, warm_up=5.0, warm_up_time=1.0)
    measured, biases = process(model, width=2000).sequence(np.zeros((500, 2000)))
    assert np.std(measured[-1]) == pytest.approx(0.2, rel=0.05)
    np.testing.assert_allclose(measured[100] / measured[-1], (1.0 - math.exp(-1.0)) / (1.0 - math.exp(-4.99)))
    np.testing.assert_array_equal(measured, biases)
    np.testing.assert_array_equal(measured[0], 0.0)


def test_specific_force_leaks_into_a_g_sensitive_gyroscope():
    model = NoiseModel(g_sensitivity=0.01)
    force = np.array([[0.0, 0.0, 9.8]])
    leaks = [process(model, seed=seed).sequence(np.zeros((1, 3)), force)[0] for seed in range(300)]
    assert np.std(leaks) == pytest.approx(0.098, rel=0.1)
    with pytest.raises(ValueError, match="specific_force is needed"):
        process(model).sequence(np.zeros((1, 3)))


def test_readings_saturate_and_come_in_steps():
    one = process(NoiseModel(full_scale=2.0, resolution=0.3), width=1)
    values = np.linspace(-3.0, 3.0, 601)[:, None]
    measured, _ = one.sequence(values)
    inside = np.abs(values) < 1.9
    assert np.max(np.abs(measured)) == 2.0
    assert np.max(np.abs((measured - values)[inside])) <= 0.15 + 1e-12
    np.testing.assert_allclose(measured[inside] / 0.3, np.rint(measured[inside] / 0.3), atol=1e-12)


@pytest.mark.parametrize(("frequency", "gain"), [(1.0, 1.0), (20.0, math.sqrt(0.5))])
def test_the_low_pass_halves_the_power_at_its_cut_off(frequency, gain):
    time = np.arange(4000) / 200.0
    phase = 2.0 * np.pi * frequency * time
    measured, _ = process(NoiseModel(bandwidth=20.0), 1, 200.0).sequence(np.sin(phase)[:, None])
    basis = np.stack([np.sin(phase), np.cos(phase)], axis=-1)[1000:]
    amplitude = np.linalg.norm(np.linalg.lstsq(basis, measured[1000:, 0])[0])
    assert amplitude == pytest.approx(gain, rel=1e-4)


def test_the_low_pass_starts_settled_and_keeps_slow_noise():
    measured, _ = process(NoiseModel(bandwidth=10.0), 1).sequence(np.full((5, 1), 7.0))
    np.testing.assert_allclose(measured, 7.0, rtol=1e-12)
    model = NoiseModel(white_noise=0.02, bandwidth=10.0)
    assert allan_deviation(model, [1.0])[0] == pytest.approx(0.02, rel=0.08)


def test_samples_are_lost_alone_and_in_bursts():
    measured, _ = process(NoiseModel(dropout=0.1), 1).sequence(np.zeros((40_000, 1)))
    assert np.mean(np.isnan(measured)) == pytest.approx(0.1, abs=0.01)
    measured, _ = process(NoiseModel(burst_rate=0.5, burst_duration=0.2), 1).sequence(np.zeros((200_000, 1)))
    lost = np.isnan(measured[:, 0])
    begins = np.sum(lost[1:] & ~lost[:-1])
    assert np.sum(lost) / begins == pytest.approx(20.0, rel=0.1)
    assert begins / 2000.0 == pytest.approx(0.5 / 1.1, rel=0.1)


@pytest.mark.parametrize("bandwidth", [math.inf, 20.0])
def test_a_motion_in_parts_gives_the_numbers_of_the_whole(bandwidth):
    model = replace(EVERYTHING, bandwidth=bandwidth)
    values, forces = np.random.default_rng(1).standard_normal((2, 700, 3))
    whole, biases = process(model).sequence(values, forces)
    other = process(model)
    parts = [other.sequence(values[a:b], forces[a:b]) for a, b in ((0, 0), (0, 1), (1, 10), (10, 600), (600, 700))]
    np.testing.assert_allclose(np.concatenate([part[0] for part in parts]), whole, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(np.concatenate([part[1] for part in parts]), biases, rtol=0.0, atol=1e-15)


def test_seeds_decide_and_saved_states_go_on_exactly():
    values = np.ones((300, 3))
    one, same, other = process(EVERYTHING), process(EVERYTHING), process(EVERYTHING, seed=1)
    first = one.sequence(values, values)[0]
    np.testing.assert_array_equal(first, same.sequence(values, values)[0])
    assert not np.array_equal(first, other.sequence(values, values)[0], equal_nan=True)
    one.sequence(values[:10], values[:10])
    state = one.save()
    ahead = one.sequence(values, values)[0]
    other.restore(state)
    np.testing.assert_array_equal(ahead, other.sequence(values, values)[0])
    one.restore(state)
    np.testing.assert_array_equal(ahead, one.sequence(values, values)[0])


def test_noise_scales_share_one_realisation():
    model = NoiseModel(white_noise=0.01, bias_instability=0.1, bias_random_walk=0.01, turn_on_bias=0.3)
    zeros = np.zeros((50, 3))
    full = process(model.scaled(1.0)).sequence(zeros)[0]
    assert model.scaled(1.0) == model
    np.testing.assert_allclose(process(model.scaled(0.5)).sequence(zeros)[0], 0.5 * full, rtol=1e-12)
    np.testing.assert_array_equal(process(EVERYTHING.scaled(0.0)).sequence(zeros + 1.0)[0], 1.0)
    assert EVERYTHING.scaled(0.0).full_scale == EVERYTHING.full_scale
    assert EVERYTHING.scaled(20.0).dropout == 1.0


def test_bad_numbers_are_named():
    with pytest.raises(ValueError, match=r"dropout must be in \[0, 1\] and finite, got 1.5"):
        NoiseModel(dropout=1.5)
    with pytest.raises(ValueError, match="white_noise must be not negative and finite, got -1"):
        NoiseModel(white_noise=-1.0)
    with pytest.raises(ValueError, match="turn_on_bias must be not negative and finite, got nan"):
        NoiseModel(turn_on_bias=math.nan)
    with pytest.raises(ValueError, match="full_scale must be positive, got 0"):
        NoiseModel(full_scale=0.0)
    with pytest.raises(ValueError, match=r"noise_scale must lie in \[0, inf\), got -1"):
        NoiseModel().scaled(-1.0)
    with pytest.raises(ValueError, match="rate must be positive"):
        process(NoiseModel(), rate=0.0)
    with pytest.raises(ValueError, match="size must be at least 1"):
        process(NoiseModel(), width=0)


@pytest.mark.parametrize("name", list_sensor_presets())
def test_presets_name_their_source_and_have_finite_ranges(name):
    preset = sensor_preset(name)
    assert len(preset.source) > 20
    for model in (preset.gyroscope, preset.accelerometer, preset.magnetometer):
        if model is not None:
            assert model.full_scale < math.inf
            assert name == "ideal" or model.white_noise > 0.0 or model.resolution > 0.0
            assert model.scaled(0.0).white_noise == 0.0


def test_preset_units():
    deg, gravity = math.pi / 180.0, 9.80665
    mpu = sensor_preset("invensense-mpu-9250")
    assert mpu.gyroscope.turn_on_bias == pytest.approx(5.0 * deg)
    assert mpu.accelerometer.white_noise == pytest.approx(300e-6 * gravity)
    paper = sensor_preset("paper-hand")
    measured, _ = NoiseProcess(paper.gyroscope, 1, 100.0, np.random.default_rng(0)).sequence(np.zeros((10_000, 1)))
    assert np.std(measured) == pytest.approx(0.01, rel=0.05)
    with pytest.raises(ValueError, match=r"unknown sensor preset 'nothing' \(sensor presets: ideal, .*st-lsm6dsox"):
        sensor_preset("nothing")
