"""Beyond the gyroscope biases of its training a policy leaves the published gains."""

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.gain_policy.adaptive import AdaptiveEstimator
from poise.baselines.gain_policy.known_bias import SETTLING, bias_limit, witness_of
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.estimator import run_by_steps

KALMAN = tunable_filter("external-acceleration")
TUNED = TunedFilter.of(KALMAN)
SLOW = (-0.9, 0.6, -0.6)


@pytest.fixture(scope="module")
def motions():
    return HandTrajectories(gestures=("slow",), sensors=("paper-hand",), duration=20.0).draw_many(5, 4)


def biased(trajectory, bias):
    """The same with a gyroscope bias of ``bias`` °/s."""
    gyr = trajectory.measurements["imu/gyr"] + np.radians(bias) * np.array([0.6, 0.0, 0.8])
    return replace(trajectory, measurements={**trajectory.measurements, "imu/gyr": gyr})


def followed(policy, measurements):
    return AdaptiveEstimator(KALMAN, policy).run_with_actions(None, measurements)


def test_the_limit_is_that_of_the_training(motions):
    small, large = (bias_limit(KALMAN, [biased(each, bias) for each in motions]) for bias in (0.0, 4.0))
    assert math.degrees(small) < 1.0 < 3.0 < math.degrees(large) < 6.0


def test_a_large_bias_ends_the_policy_and_a_small_one_does_not(motions):
    slow = GainPolicy.constant(TUNED, SLOW)
    limited = replace(slow, bias_limit=np.radians(2.0))
    good, bad = motions[0].measurements, biased(motions[0], 6.0).measurements
    _, _, actions = followed(limited, good)
    first = round(SETTLING / motions[0].dt)
    assert not actions[:first].any()
    assert (actions[first:] == SLOW).all()
    estimate, _, actions = followed(limited, bad)
    assert not actions.any()
    for name, published in KALMAN.run(bad).pose.items():
        np.testing.assert_array_equal(estimate.pose[name], published)
    early = replace(slow, bias_limit=np.radians(100.0))
    assert followed(early, bad)[2][first:].any()


def test_a_policy_is_trusted_later_as_if_it_had_been_from_the_start(motions):
    """Gains that change in the middle of a motion find a covariance that suits other ones: both filters run."""
    slow = GainPolicy.constant(TUNED, SLOW)
    estimate, state, _ = followed(replace(slow, bias_limit=np.radians(2.0)), motions[0].measurements)
    first = round(SETTLING / motions[0].dt)
    for name, values in AdaptiveEstimator(KALMAN, slow).run(motions[0].measurements).pose.items():
        np.testing.assert_array_equal(estimate.pose[name][first:], values[first:])
    for name, values in KALMAN.run(motions[0].measurements).pose.items():
        np.testing.assert_array_equal(estimate.pose[name][:first], values[:first])
    assert state.trusted.shape == ()
    assert state.trusted


def test_samples_one_by_one_give_the_same_bit_by_bit(motions):
    limited = replace(GainPolicy.constant(TUNED, SLOW), bias_limit=np.radians(2.0))
    bad = {name: values[:1700].copy() for name, values in biased(motions[0], 2.2).measurements.items()}
    bad["imu/acc"][200:230] = np.nan
    bad["imu/gyr"][::11] = np.nan
    estimator = AdaptiveEstimator(KALMAN, limited)
    whole, steps = estimator.run(bad), run_by_steps(estimator, bad)
    for name in whole.pose:
        np.testing.assert_array_equal(whole.pose[name], steps.pose[name])
    first, state = estimator.run_from(None, {name: values[:1437] for name, values in bad.items()})
    second, _ = estimator.run_from(state, {name: values[1437:] for name, values in bad.items()})
    np.testing.assert_array_equal(np.concatenate([first.pose["up"], second.pose["up"]]), whole.pose["up"])


def test_filters_that_estimate_a_bias_need_no_limit(motions):
    assert witness_of(tunable_filter("mekf")) is None
    assert witness_of(tunable_filter("two-gyro-level")) is None
    assert bias_limit(tunable_filter("mekf"), motions[:1]) == math.inf


def test_wrong_limits_are_refused():
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="bias_limit must be a positive rate"):
            replace(GainPolicy.constant(TUNED, SLOW), bias_limit=wrong)
    with pytest.raises(ValueError, match="trajectories must hold"):
        bias_limit(KALMAN, [])


def test_files_keep_the_limit(tmp_path):
    policy = GainPolicy.constant(TUNED, SLOW)
    for limit in (0.03, math.inf):
        path = replace(policy, bias_limit=limit).save(tmp_path / "one")
        assert GainPolicy.load(path).bias_limit == limit
