"""Filters whose gains a network sets: zeros change nothing, stepping equals running, cards name everything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.learned.gains.gain_filter import GainFilter
from poise.baselines.learned.gains.gain_head import GainHead
from poise.baselines.learned.gains.gain_shares import described_filter, filter_of, with_gain_shares
from poise.baselines.learned.inputs.gain_features import GainFeatures
from poise.baselines.learned.networks.gru import GruNetwork
from poise.envs.hand.sensing import simulate_hand
from poise.filters.registry import make

FILTERS = {
    "external-acceleration": ("process", "measurement"),
    "mekf": ("process", "bias", "measurement"),
    "mekf with shares": ("process", "measurement", "attitude-gain", "bias-gain"),
}


def filter_named(name):
    return with_gain_shares("mekf") if name == "mekf with shares" else make(name)


def network(features, outputs, size=6, last=0.3):
    rng = np.random.default_rng(0)
    shapes = [(size, features), (size,), (3 * size, size), (3 * size,), (3 * size, size), (3 * size,)]
    return GruNetwork(
        *(0.3 * rng.standard_normal(shape) for shape in shapes),
        last * rng.standard_normal((outputs, size)),
        last * rng.standard_normal(outputs),
    )


def estimator(name, last=0.3):
    kalman, gains = filter_named(name), FILTERS[name]
    front_end, head = GainFeatures(kalman), GainHead(kalman, gains, (4.0,) * len(gains))
    return GainFilter(network(front_end.size, head.size, last=last), front_end, head)


def samples(length=260, batch=2):
    """Two gestures side by side, with gaps of either sensor."""
    rides = [simulate_hand(name, seed=seed, duration=8.0) for seed, name in enumerate(("slow", "fast"))][:batch]
    found = {name: np.stack([ride.measurements[name][300:][:length] for ride in rides], 1) for name in CHANNELS}
    found["imu/gyr"][30:34, 0] = np.nan
    found["imu/acc"][50:90, 0] = np.nan
    found["imu/gyr"][110:130, 0] = np.nan
    return found


CHANNELS = ("imu/gyr", "imu/acc")


@pytest.mark.parametrize("name", FILTERS)
def test_a_network_that_says_zeros_is_the_plain_filter_bit_by_bit(name):
    made, data = estimator(name, last=0.0), samples()
    found, expected = made.run(data), make(name.removesuffix(" with shares")).run(data)
    for key, values in expected.pose.items():
        np.testing.assert_array_equal(found.pose[key], values)
    np.testing.assert_array_equal(found.covariance, expected.covariance)
    other = estimator(name).run(data)
    assert np.nanmax(np.abs(other.pose["up"] - expected.pose["up"])) > 1e-4


@pytest.mark.parametrize("name", FILTERS)
def test_stepping_equals_running(name):
    made, data = estimator(name), samples()
    found = made.run(data)
    state = made.init({key: values[0] for key, values in data.items()})
    before = state.output.copy()
    for t in range(len(data["imu/gyr"])):
        state, estimate = made.step(state, {key: values[t] for key, values in data.items()})
        np.testing.assert_allclose(estimate.pose["up"], found.pose["up"][t], atol=1e-9)
        np.testing.assert_allclose(estimate.covariance, found.covariance[t], rtol=1e-7, atol=1e-12)
    np.testing.assert_array_equal(before, 0.0)
    single = made.run({key: values[:, 1] for key, values in data.items()})
    np.testing.assert_allclose(single.pose["up"], found.pose["up"][:, 1], atol=1e-12)


def test_gains_hold_from_the_sample_after_an_interval_and_keep_their_limits():
    made, data = estimator("mekf", last=5.0), samples()
    _, gains = made.run_with_gains(data)
    whole = made.front_end.features.interval_samples(made.dt)
    assert whole == 4
    for values in gains.values():
        np.testing.assert_array_equal(values[:whole], 0.0)
        changes = np.flatnonzero(np.diff(values[:, 1]))
        np.testing.assert_array_equal((changes + 1) % whole, 0)
        assert len(changes) > 10
        assert 3.0 < np.abs(values).max() <= 4.0


def test_in_and_after_a_gap_of_an_input_the_published_gains_hold():
    made, data = estimator("mekf", last=5.0), samples()
    _, gains = made.run_with_gains(data)
    for values in gains.values():
        np.testing.assert_array_equal(values[120:230, 0], 0.0)
        assert (values[[119, 230], 0] != 0.0).all()
        assert (values[4:, 1] != 0.0).all(), "a sequence without gaps is left to the network"
        assert (values[4:110, 0] != 0.0).all(), "single lost samples, or those of no input, change nothing"


def test_the_covariance_after_a_gap_is_that_of_the_plain_filter():
    """A tuning learned from small errors is ten times too certain of a large one: NEES 15 where the filter has 3."""
    ride, made = simulate_hand("mixed", seed=11, duration=30.0), GainFilter.load("mekf_noise")
    data = {name: ride.measurements[name].copy() for name in CHANNELS}
    for samples in data.values():
        samples[1000:1200] = np.nan
    found, plain = made.run(data), make("mekf").run(data)
    ratio = [np.trace(one.covariance[1220, :2, :2]) for one in (found, plain)]
    assert ratio[0] > 0.5 * ratio[1]


def test_weights_and_card_give_the_same_estimator_at_another_rate(tmp_path):
    kalman = replace(with_gain_shares("mekf"), model=replace(with_gain_shares("mekf").model, tilt_prior=0.1))
    front_end, gains = GainFeatures(kalman, make("bounded-motion"), 0.05), FILTERS["mekf with shares"]
    head = GainHead(kalman, gains, (4.0, 3.0, 2.0, 1.0), 0.1)
    made = GainFilter(network(front_end.size, 4), front_end, head)
    path = made.save(tmp_path / "mine", {"name": "mine"})
    again = GainFilter.load(path, dt=0.02)
    assert again.front_end.describe() == front_end.describe()
    assert again.head.describe() == head.describe()
    assert (again.dt, again.filter.model.tilt_prior) == (0.02, 0.1)
    data = samples()
    expected = GainFilter(GruNetwork.from_arrays(made.network.arrays()), front_end, head).with_dt(0.02).run(data)
    np.testing.assert_array_equal(again.run(data).pose["up"], expected.pose["up"])


def test_options_of_a_filter_are_described():
    kalman = make("two-gyro", model="sigma1", roll_prior=0.1)
    described = described_filter(kalman)
    assert described == {"name": "two-gyro", "shares": False, "parameters": {"model": "sigma1", "roll_prior": 0.1}}
    assert filter_of(described, 0.01).model == replace(kalman.model, dt=0.01)


def test_wrong_arguments_are_named():
    kalman = make("mekf")
    with pytest.raises(ValueError, match=r"gains must be among .* got \['speed'\]"):
        GainHead(kalman, ("speed",), (1.0,))
    with pytest.raises(ValueError, match="limits must be 1 positive numbers"):
        GainHead(kalman, ("process",), (0.0,))
    with pytest.raises(ValueError, match=r"at most 0\.04 s"):
        GainFeatures(kalman.with_dt(0.1))
    front_end, head = GainFeatures(kalman), GainHead(kalman, ("process",), (1.0,))
    with pytest.raises(ValueError, match="the network must take"):
        GainFilter(network(3, 1), front_end, head)
    with pytest.raises(ValueError, match="unknown filter with shares"):
        with_gain_shares("marins")
