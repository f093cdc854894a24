"""A filter with a policy is an estimator like any other."""

from dataclasses import replace

import numpy as np
import pytest

import poise
from poise.baselines.gain_policy.adaptive import AdaptiveEstimator, shipped
from poise.baselines.gain_policy.constant_gains import best_constant_gains, constant_errors, policy_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.gain_tuning import ReplayGainEnv
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.estimator import Estimator, run_by_steps
from poise.filters.core.kalman import KalmanFilter

FILTERS = ("external-acceleration", "bounded-motion")
HELD_OUT = 987_654
"""Seed of the motions on which shipped policies are tested; training draws from others."""


@pytest.fixture(scope="module")
def measurements():
    trajectory = HandTrajectories(duration=6.0).draw_many(3, 1)[0]
    arrays = {name: trajectory.measurements[name].copy() for name in ("imu/gyr", "imu/acc")}
    arrays["imu/acc"][200:230] = np.nan
    arrays["imu/gyr"][::11] = np.nan
    arrays["imu/acc"][:3] = np.nan
    return arrays


def random_policy(tuned, seed=0):
    rng = np.random.default_rng(seed)
    weight = rng.normal(0.0, 1.0 / np.sqrt(tuned.observation_size), (tuned.actions, tuned.observation_size))
    return GainPolicy(tuned.name, tuned.ranges, tuned.features, ((weight, rng.normal(0.0, 0.3, tuned.actions)),))


def adaptive(name, seed=0):
    kalman = KalmanFilter(tunable_filter(name).model)
    return AdaptiveEstimator(kalman, random_policy(TunedFilter.of(kalman), seed))


def assert_equal(one, two, tolerance=0.0):
    for name in one.pose:
        np.testing.assert_allclose(one.pose[name], two.pose[name], atol=tolerance, rtol=tolerance)
    for a, b in zip(one[1:4], two[1:4], strict=True):
        np.testing.assert_allclose(a, b, atol=tolerance, rtol=tolerance)


@pytest.mark.parametrize("name", FILTERS)
def test_with_a_neutral_policy_it_is_the_filter_bit_by_bit(name, measurements):
    kalman = KalmanFilter(tunable_filter(name).model)
    neutral = AdaptiveEstimator(kalman, GainPolicy.neutral(TunedFilter.of(kalman)))
    plain, same = kalman.run(measurements), neutral.run(measurements)
    for output in plain.pose:
        np.testing.assert_array_equal(plain.pose[output], same.pose[output])
    for one, two in zip(plain[1:4], same[1:4], strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("name", FILTERS)
def test_steps_and_run_agree(name, measurements):
    estimator = adaptive(name)
    assert isinstance(estimator, Estimator)
    assert_equal(estimator.run(measurements), run_by_steps(estimator, measurements), 1e-12)
    actions = estimator.run_with_actions(None, measurements)[2]
    assert actions.shape == (601, 3)
    assert np.unique(actions, axis=0).shape[0] > 20


@pytest.mark.parametrize("name", FILTERS)
def test_it_goes_on_from_a_saved_state_anywhere(name, measurements):
    estimator = adaptive(name)
    whole = estimator.run(measurements)
    for cut in (1, 10, 123, 205):
        first, state = estimator.run_from(None, {key: array[:cut] for key, array in measurements.items()})
        kept = [np.array(array) for part in state[:2] for array in part] + [np.array(state.action)]
        second, _ = estimator.run_from(state, {key: array[cut:] for key, array in measurements.items()})
        for output, values in whole.pose.items():
            joined = np.concatenate([first.pose[output], second.pose[output]])
            np.testing.assert_allclose(joined, values, atol=1e-12, rtol=0.0)
        after = [np.array(array) for part in state[:2] for array in part] + [np.array(state.action)]
        for one, two in zip(kept, after, strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("name", FILTERS)
def test_a_batch_is_its_sequences(name, measurements):
    estimator = adaptive(name)
    turned = {key: array[:, [1, 2, 0]] for key, array in measurements.items()}
    pair = {key: np.stack([measurements[key], turned[key]], axis=1)[:, None] for key in measurements}
    together = estimator.run(pair)
    for index, single in enumerate((measurements, turned)):
        alone = estimator.run(single)
        for output, values in alone.pose.items():
            np.testing.assert_allclose(together.pose[output][:, 0, index], values, atol=1e-10)


@pytest.mark.parametrize("smoothing", [0.0, 0.7])
@pytest.mark.parametrize("name", FILTERS)
def test_environment_and_estimator_are_the_same_thing(name, smoothing):
    trajectory = HandTrajectories(duration=5.0).draw_many(8, 1)[0]
    estimator = adaptive(name)
    estimator = replace(estimator, policy=replace(estimator.policy, smoothing=smoothing))
    gains = [part.gain for part in estimator.policy.ranges]
    env = ReplayGainEnv(trajectory, name, gains=gains, smoothing=smoothing)
    observation, _ = env.reset(seed=0)
    said, over = [], False
    while not over:
        observation, _, _, over, info = env.step(estimator.policy(observation))
        said.append(info["estimate"]["up"])
    ticks = env.tuned.interval_samples * np.arange(1, len(said) + 1) - 1
    run = estimator.with_dt(trajectory.dt).run(trajectory.measurements)
    np.testing.assert_allclose(said, run.pose["up"][ticks], atol=1e-12)


def test_another_rate_keeps_the_seconds():
    estimator = adaptive("bounded-motion")
    assert (estimator.dt, estimator.tuned.interval_samples) == (0.01, 10)
    assert estimator.with_dt(1 / 286).tuned.interval_samples == 29
    assert estimator.with_dt(0.5).tuned.interval_samples == 1


def test_what_does_not_fit_is_refused():
    bounded = random_policy(TunedFilter.of(tunable_filter("bounded-motion")))
    with pytest.raises(ValueError, match="the policy sets the gains"):
        AdaptiveEstimator(tunable_filter("external-acceleration"), bounded)
    with pytest.raises(ValueError, match="unknown parameters"):
        shipped("external_acceleration_policy", nose=1.0)
    with pytest.raises(ValueError, match="lack the channels"):
        adaptive("bounded-motion").run({"imu/gyr": np.zeros((3, 3))})
    with pytest.raises(ValueError, match="at least one"):
        best_constant_gains(tunable_filter("bounded-motion"), [])


def test_the_search_for_constant_gains_finds_a_wrong_tuning():
    trajectories = HandTrajectories(duration=10.0, gestures=("slow", "fast")).draw_many(1, 4)
    model = tunable_filter("bounded-motion").model
    wrong = TunedFilter.of(KalmanFilter(replace(model, velocity_bound=5.0 * model.velocity_bound)), ("velocity",))
    found = best_constant_gains(wrong, trajectories, samples=8, refinements=15)
    assert found.score < 0.7 * found.neutral.mean()
    assert found.score == pytest.approx(np.mean(constant_errors(wrong, trajectories, found.action)))
    assert np.all(found.oracle <= found.scores + 1e-15)
    np.testing.assert_allclose(found.neutral, constant_errors(wrong, trajectories, np.zeros(1)))
    again = best_constant_gains(wrong, trajectories, samples=8, refinements=15)
    np.testing.assert_array_equal(found.tried, again.tried)


@pytest.mark.parametrize("name", FILTERS)
def test_a_constant_policy_has_the_errors_of_constant_gains(name):
    trajectories = HandTrajectories(duration=4.0, rates=(50.0, 100.0)).draw_many(2, 3)
    tuned = TunedFilter.of(tunable_filter(name))
    action = np.array([0.3, -0.2, 0.1])
    by_policy = policy_errors(tuned.kalman, GainPolicy.constant(tuned, action), trajectories)
    np.testing.assert_allclose(by_policy, constant_errors(tuned, trajectories, action), rtol=1e-10)


def test_the_shipped_policy_beats_the_published_tuning_and_the_best_constant_gains():
    """On motions of the kinds that it was trained on, so long that the first seconds, before it acts, hardly count."""
    from poise.baselines.gain_policy.config import KNOWN_MOTIONS, MixedMotions

    parts = tuple(replace(part, duration=100.0) for part in KNOWN_MOTIONS.parts)
    trajectories = MixedMotions(parts).draw_many(HELD_OUT, 8)
    estimator = poise.make_estimator("external-acceleration+policy")

    def typical(errors: np.ndarray) -> float:
        return float(np.exp(np.log(errors).mean()))

    policy = typical(policy_errors(estimator.filter, estimator.policy, trajectories))
    for action in (np.zeros(estimator.tuned.actions), np.array(estimator.policy.card["best_constant"])):
        assert policy < typical(constant_errors(estimator.tuned, trajectories, action))
