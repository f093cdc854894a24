"""Optuna finds the constant gains that are known to be right, repeats itself, and begins with the published ones."""

import dataclasses

import numpy as np
import pytest

from poise.baselines.gain_policy.agents.optuna_search import optuna_constant_gains
from poise.baselines.gain_policy.constant_gains import best_constant_gains
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.kalman import KalmanFilter


@pytest.fixture(scope="module")
def trajectories():
    return HandTrajectories(("slow", "fast"), duration=5.0, rates=(50.0,)).draw_many(0, 4)


@pytest.fixture(scope="module")
def wrong():
    model = tunable_filter("bounded-motion").model
    kalman = KalmanFilter(dataclasses.replace(model, velocity_bound=5.0 * model.velocity_bound), keep_covariance=False)
    return TunedFilter.of(kalman, ("velocity",))


def test_it_finds_what_the_other_search_finds(wrong, trajectories):
    found = optuna_constant_gains(wrong, trajectories, trials=25)
    other = best_constant_gains(wrong, trajectories, samples=16, refinements=20)
    np.testing.assert_array_equal(found.tried[0], [0.0])
    np.testing.assert_allclose(found.neutral, other.neutral)
    assert found.score < 0.8 * found.neutral.mean()
    assert found.score == pytest.approx(other.score, rel=0.03)


def test_equal_seeds_repeat(wrong, trajectories):
    one, two, three = (optuna_constant_gains(wrong, trajectories, trials=5, seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.tried, two.tried)
    assert not np.array_equal(one.tried, three.tried)


def test_nothing_to_search_on_is_explained(wrong, trajectories):
    with pytest.raises(ValueError, match="got 0 and 100"):
        optuna_constant_gains(wrong, [])
    with pytest.raises(ValueError, match="got 4 and 0"):
        optuna_constant_gains(wrong, trajectories, trials=0)
