"""Constant gains, policies and oracles of filters of rides: each ride is filtered by who rode it."""

import dataclasses

import numpy as np
import pytest

import poise
from poise.baselines.gain_policy.constant_gains import best_constant_gains, constant_errors, policy_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.baselines.gain_policy.stack import TrajectoryStack
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.gain_episode import filter_for
from poise.filters.adaptation.gains import gain_sizes, tunable_filter
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.bicycle.two_gyro.filter import TwoGyro
from poise.filters.core.metrics import rms

TWO_GYRO = tunable_filter("two-gyro")
QUANTITY = "two-gyro/relative_angles"


@pytest.fixture(scope="module")
def rides():
    options = {"fidelity": "lumped", "duration": 1.0, "suite": [channel.name for channel in TWO_GYRO.channels]}
    return [poise.record(RiderBicycleEnv(subject=subject, **options), seed=subject) for subject in (0, 3)]


def test_a_papers_angles_are_scored_with_the_filter_told_who_rides(rides):
    tuned = TunedFilter.of(TWO_GYRO)
    neutral = constant_errors(tuned, rides, np.zeros(tuned.actions), QUANTITY)
    for ride, found in zip(rides, neutral, strict=True):
        kalman = poise.make_estimator("two-gyro", dt=ride.dt, metadata=ride.metadata)
        wrong = kalman.run(ride.measurements).pose[QUANTITY] - kalman.model.truth(ride.truth)[QUANTITY]
        sizes = np.linalg.norm((wrong + np.pi) % (2.0 * np.pi) - np.pi, axis=-1)[ride.mask]
        assert found == pytest.approx(np.sqrt(np.nanmean(sizes**2)), rel=1e-9)
    assert filter_for(tuned.kalman, rides[0]).model != filter_for(tuned.kalman, rides[1]).model
    policy = GainPolicy.neutral(tuned)
    np.testing.assert_allclose(policy_errors(tuned.kalman, policy, rides, QUANTITY), neutral, rtol=1e-9)


def test_the_search_and_the_stacks_of_the_oracle_take_them_too(rides):
    tuned = TunedFilter.of(TWO_GYRO, ("process",))
    found = best_constant_gains(tuned, rides, quantity=QUANTITY, samples=2, refinements=0)
    assert found.score <= found.neutral.mean()
    stacks = TrajectoryStack.by_rate(tuned, rides, QUANTITY)
    assert [len(stack.trajectories) for stack in stacks] == [1, 1]
    errors = [float(rms(stack.errors(np.zeros(1)), stack.mask)[0]) for stack in stacks]
    np.testing.assert_allclose(errors, found.neutral, rtol=0.02)


def test_belief_in_a_level_road_is_a_gain_of_the_constraint(rides):
    level = dataclasses.replace(TWO_GYRO, model=TwoGyro(model="sigma1", constraint=True))
    tuned = TunedFilter.of(level)
    assert "constraint" not in TWO_GYRO.gains
    assert tuned.actions == len(TWO_GYRO.gains) + 1
    action = np.array([float(part.gain == "constraint") for part in tuned.ranges])
    assert gain_sizes(level.model, tuned.gains(action))["constraint"] == pytest.approx(np.radians(100.0))
    # hardly believed, the constraint is as good as absent
    plain = dataclasses.replace(level, model=TwoGyro(model="sigma1"))
    without = constant_errors(TunedFilter.of(plain), rides, np.zeros(2), QUANTITY)
    believed = constant_errors(tuned, rides, np.zeros(3), QUANTITY)
    doubted = constant_errors(tuned, rides, action, QUANTITY)
    assert (np.abs(doubted - without) < np.abs(believed - without)).all()
