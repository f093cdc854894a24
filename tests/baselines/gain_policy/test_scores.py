"""Reference scores: what they are, and that the shipped ones are those that the package computes."""

import math

import numpy as np
import pytest

import poise
from poise.baselines.gain_policy.scores import RECORDED, REPLAY, SCORES, episodes_of, reference_scores
from poise.envs.hand.trajectories import HandTrajectories

HAND = "poise/HandMotionGain-v0"


def test_the_published_gains_score_zero_and_the_oracle_one():
    for identity, scores in SCORES.items():
        assert poise.normalized_score(identity, scores.neutral) == 0.0
        assert poise.normalized_score(identity, scores.oracle) == 1.0
        assert 0.0 < poise.normalized_score(identity, scores.constant) < 1.0
        assert poise.normalized_score(identity, scores.random) < 0.1


def test_they_are_measured_on_episodes_of_their_own():
    train, test = (episodes_of(HAND, split, 2) for split in (0, 1))
    assert not np.array_equal(train[0].measurements["imu/gyr"], test[0].measurements["imu/gyr"])
    scores = reference_scores(HAND, count=1, points=4)
    plain = poise.evaluate("external-acceleration", test[:1])
    wanted = plain[plain.metric == "inclination"].value.mean()
    assert scores.neutral == pytest.approx(wanted, abs=6e-4)
    assert scores.oracle <= scores.neutral


def test_recordings_are_scored_by_the_constants_of_all_others():
    recordings = HandTrajectories(duration=5.0).draw_many(2, 3)
    scores = reference_scores(REPLAY, points=4, recordings=recordings)
    assert scores.oracle <= min(scores.neutral, scores.constant)
    for data, known in RECORDED.items():
        assert poise.normalized_score(REPLAY, known.neutral, data) == 0.0
        # The best constants of a few other recordings may be worse than the published gains.
        assert poise.normalized_score(REPLAY, known.constant, data) < poise.normalized_score(REPLAY, known.oracle, data)
    with pytest.raises(ValueError, match="unknown data set 'broaad', did you mean 'broad'"):
        poise.normalized_score(REPLAY, 1.0, "broaad")
    with pytest.raises(ValueError, match="unknown data set ''"):
        poise.normalized_score(REPLAY, 1.0)


def test_wrong_arguments_are_explained():
    with pytest.raises(ValueError, match="unknown id"):
        poise.normalized_score("poise/HandMotion-v0", 1.0)
    with pytest.raises(ValueError, match="error must be 0 deg or more"):
        poise.normalized_score(HAND, math.nan)


@pytest.mark.slow
@pytest.mark.parametrize("identity", list(SCORES))
def test_the_shipped_scores_are_those_that_are_computed(identity):
    assert reference_scores(identity) == pytest.approx(SCORES[identity], rel=0.02)
