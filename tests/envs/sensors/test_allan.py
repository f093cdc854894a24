"""Expected Allan deviations against those of simulated samples (allantools), and the drift of the named devices."""

from __future__ import annotations

import allantools
import numpy as np
import pytest

from poise.envs.sensors.allan import allan_deviation, allan_floors
from poise.envs.sensors.assumptions import CONSUMER, FILLED, INDUSTRIAL
from poise.envs.sensors.noise import NoiseModel, NoiseProcess
from poise.envs.sensors.presets import PRESETS, sensor_preset

DEVICES = [preset for preset in PRESETS if preset.is_device]


def simulated(model, times, rate, duration, axes=300):
    """Allan deviation of simulated samples at rest, over independent axes."""
    values, _ = NoiseProcess(model, axes, rate, np.random.default_rng(5)).sequence(
        np.zeros((round(duration * rate), axes)), np.zeros((round(duration * rate), 3))
    )
    found = [allantools.oadev(axis, rate=rate, data_type="freq", taus=times)[1] for axis in values.T]
    return np.sqrt(np.mean(np.square(found), axis=0))


@pytest.mark.parametrize(
    "part",
    [
        {"white_noise": 0.02},
        {"bias_instability": 0.1, "bias_correlation_time": 3.0},
        {"bias_random_walk": 0.01},
        {"white_noise": 0.01, "resolution": 0.06},
    ],
    ids=lambda part: next(iter(part)),
)
def test_every_part_has_the_expected_deviation(part):
    times = np.array([1.0, 4.0, 16.0])
    model = NoiseModel(**part)
    np.testing.assert_allclose(simulated(model, times, 10.0, 120.0), allan_deviation(model, times, 10.0), rtol=0.08)


def test_warming_counts_in_records_that_begin_cold():
    times = np.array([2.0, 8.0])
    model = NoiseModel(temperature_coefficient=0.1, warm_up=5.0, warm_up_time=10.0)
    np.testing.assert_allclose(
        simulated(model, times, 10.0, 60.0), allan_deviation(model, times, 10.0, duration=60.0), rtol=0.12
    )
    assert np.all(allan_deviation(model, times) == 0.0)


def test_presets_without_a_data_sheet_are_not_listed():
    names = [row["name"] for row in allan_floors()]
    assert names == [preset.name for preset in DEVICES]
    assert not {"ideal", "paper-hand"} & set(names)


def test_consumer_parts_drift_more_than_a_motion_tracker():
    floors = {str(row["name"]): row for row in allan_floors(1000.0)}
    tracker = floors["xsens-mti-100"]
    for name in ("bosch-bmi160", "invensense-mpu-9250", "st-lsm6dsox"):
        for kind in ("gyroscope", "accelerometer"):
            assert floors[name][kind] > 1.5 * tracker[kind]


@pytest.mark.slow
def test_simulated_devices_have_the_floors_of_the_list():
    for row in allan_floors(1000.0):
        model = sensor_preset(str(row["name"])).gyroscope
        warm = NoiseModel(**{**vars(model), "temperature_coefficient": 0.0, "bandwidth": np.inf, "resolution": 0.0})
        found = simulated(warm, [1000.0], 1.0, 10_000.0, axes=60)[0]
        assert found == pytest.approx(allan_deviation(warm, [1000.0], 1.0)[0], rel=0.12)


@pytest.mark.parametrize("preset", DEVICES, ids=lambda preset: preset.name)
def test_no_error_of_a_device_is_zero(preset):
    for kind, names in preset.assumed.items():
        noise, grade = preset.noise_of(kind), CONSUMER if "consumer" in preset.source else INDUSTRIAL
        expected = [name for name in FILLED if getattr(getattr(grade, kind), name)]
        assert all(getattr(noise, name) > 0.0 for name in expected)
        assert set(names) <= set(expected)
        for name in names:
            assert getattr(noise, name) == getattr(getattr(grade, kind), name)


def test_consumer_assumptions_are_never_better():
    for kind in ("gyroscope", "accelerometer", "magnetometer"):
        for name in FILLED:
            assert getattr(getattr(CONSUMER, kind), name) >= getattr(getattr(INDUSTRIAL, kind), name)


def test_bad_times_are_named():
    with pytest.raises(ValueError, match="times must be positive and finite"):
        allan_deviation(NoiseModel(), [0.0])
    with pytest.raises(ValueError, match="duration must be at least twice the averaging time of 10 s, got 15"):
        allan_deviation(NoiseModel(), [10.0], duration=15.0)
