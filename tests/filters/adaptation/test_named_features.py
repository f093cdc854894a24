"""Features of filters of rides: each number by its name, right, and none of them idle."""

import numpy as np
import pytest

import poise
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.gain_episode import filter_for
from poise.filters.adaptation.features import InnovationFeatures
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.named_features import FLOOR, TYPICAL, VARIATION, NamedFeatures, features_of
from poise.filters.adaptation.tuned import TunedFilter

TWO_GYRO = tunable_filter("two-gyro")
PITCH_RATE = "bicycle_imu/gyr[1]"


@pytest.fixture(scope="module")
def ride():
    names = [channel.name for channel in TWO_GYRO.channels]
    return poise.record(RiderBicycleEnv(suite=names, fidelity="lumped", duration=3.0), seed=0)


def seen(ride, intervals, measurements=None):
    """Observations by name at the end of each interval, and the estimate."""
    tuned = TunedFilter.of(filter_for(TWO_GYRO, ride))
    samples = dict(ride.measurements if measurements is None else measurements)
    state = tuned.init({name: values[0] for name, values in samples.items()})
    found = []
    for start in range(0, 10 * intervals, 10):
        _, state = tuned.advance(state, {name: values[start : start + 10] for name, values in samples.items()})
        found.append(dict(zip(tuned.features.names, tuned.observe(state), strict=False)))
    return found, tuned.kalman.run({name: values[: 10 * intervals] for name, values in samples.items()})


def test_filters_of_one_sensor_have_invariant_features_and_others_named_ones():
    assert isinstance(features_of(tunable_filter("mekf"), 0.2), InnovationFeatures)
    assert features_of(tunable_filter("mekf"), 0.2).interval == 0.2
    named = features_of(TWO_GYRO)
    assert isinstance(named, NamedFeatures)
    assert len(named.names) == len(set(named.names)) == named.size(0)
    assert f"{PITCH_RATE} mean 0.3 s" in named.names


def test_they_are_the_statistics_that_they_say(ride):
    found, estimate = seen(ride, 20)
    rates = ride.measurements["bicycle_imu/gyr"][190:200, 1] / TYPICAL["rad/s"]
    assert found[-1][f"{PITCH_RATE} mean 0 s"] == pytest.approx(np.tanh(rates.mean()), abs=1e-6)
    spread = np.log10(max(rates.std() / VARIATION, FLOOR))
    assert found[-1][f"{PITCH_RATE} size 0 s"] == pytest.approx(np.tanh(spread), abs=1e-6)
    row = estimate.innovation[190:200, 0]
    row = row[row != 0.0]
    nis = 0.5 * np.log10(np.mean(row**2))
    assert found[-1]["innovation 0 size 0 s"] == pytest.approx(np.tanh(nis), abs=1e-6)
    # running mean over a time scale
    average = known = 0.0
    for part in ride.measurements["bicycle_imu/gyr"][:200, 1].reshape(20, 10):
        average += (1.0 - np.exp(-0.1)) * (np.nansum(part) / 10.0 - average)
        known += (1.0 - np.exp(-0.1)) * (np.isfinite(part).mean() - known)
    assert found[-1][f"{PITCH_RATE} mean 1 s"] == pytest.approx(np.tanh(average / known), abs=1e-6)


def test_no_feature_is_idle(ride):
    found, _ = seen(ride, 28)
    table = np.array([list(one.values()) for one in found])
    assert np.isfinite(table).all()
    assert (np.abs(table) <= 1.0).all()
    assert (np.ptp(table[5:], axis=0) > 1e-6).all()


def test_a_sensor_that_falls_silent_becomes_zero(ride):
    silent = {name: values.copy() for name, values in ride.measurements.items()}
    silent["relative/orientation"][100:] = np.nan
    found, _ = seen(ride, 20, silent)
    quiet = [
        name for name in found[-1] if name.startswith(("relative/orientation", "innovation")) and name.endswith(" 0 s")
    ]
    assert len(quiet) == 2 * (4 + TWO_GYRO.model.residual_size)
    assert not any(found[-1][name] for name in quiet)


def test_policies_with_them_are_saved_and_read(tmp_path):
    tuned = TunedFilter.of(TWO_GYRO)
    policy = GainPolicy.constant(tuned, [0.25, -0.5])
    again = GainPolicy.load(policy.save(tmp_path / "mine"))
    assert again.features == policy.features
    np.testing.assert_array_equal(again(np.zeros(tuned.observation_size)), [0.25, -0.5])
    with pytest.raises(ValueError, match="the filter has other ones"):
        tuned.features.init(tunable_filter("mekf"))
