"""Policies of recordings that they were not trained on."""

import numpy as np
import pytest

from poise.baselines.gain_policy.compared import left_out
from poise.baselines.gain_policy.compared.left_out import left_out_policy_errors, parts_of
from poise.baselines.gain_policy.constant_gains import constant_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter

TUNED = TunedFilter.of(tunable_filter("external-acceleration"), ("process", "measurement"))


def test_a_trajectory_is_never_trained_on_by_the_policy_that_it_is_scored_with(monkeypatch):
    motions, trained = HandTrajectories(duration=2.0).draw_many(4, 3), []

    def train(tuned, trajectories, start, **others):
        trained.append(({one.name for one in trajectories}, tuple(start)))
        return GainPolicy.constant(tuned, start)

    monkeypatch.setattr(left_out, "train_analytically", train)
    actions = np.array([[0.0, 0.0], [-0.5, 0.5], [0.5, -0.5]])
    errors = left_out_policy_errors(TUNED, motions, actions, 3)
    names = [one.name for one in motions]
    assert [used for used, _ in trained] == [set(names) - {name} for name in names]
    tried = np.stack([constant_errors(TUNED, motions, action) for action in actions])
    for index, (_, start) in enumerate(trained):
        best = np.delete(tried, index, axis=1).mean(axis=1).argmin()
        np.testing.assert_array_equal(start, actions[best])
        assert errors[index] == pytest.approx(tried[best, index], rel=1e-9)
    with pytest.raises(ValueError, match=r"folds must be between 2 and the number of trajectories \(3\), got 4"):
        left_out_policy_errors(TUNED, motions, actions, 4)


def test_parts_hold_every_sample_once():
    (motion,) = HandTrajectories(duration=2.5).draw_many(4, 1)
    parts = parts_of(motion, 1.0)
    assert [len(part) for part in parts] == [100, len(motion) - 100]
    np.testing.assert_array_equal(np.concatenate([part.time for part in parts]), motion.time)
    assert len(parts_of(motion, 10.0)) == 1
