"""Parts of a policy taken away: what is equal by definition is equal, and groups cover every observation."""

import numpy as np
import pytest

from poise.baselines.gain_policy.compared.ablation import (
    ablation,
    blinded,
    holding,
    mean_observation,
    observation_groups,
)
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter

TUNED = TunedFilter.of(tunable_filter("external-acceleration"), ("process", "measurement"))
RNG = np.random.default_rng(5)
WEIGHTS = RNG.normal(0.0, 0.02, (2, TUNED.observation_size)), np.array([0.1, -0.2])
POLICY = GainPolicy(TUNED.name, TUNED.ranges, TUNED.features, (WEIGHTS,))


def test_groups_cover_every_observation_twice_but_those_without_a_time_scale():
    groups = observation_groups(POLICY)
    counts = np.bincount(np.concatenate(list(groups.values())), minlength=TUNED.observation_size)
    assert {"innovation", "gyr", "acc", "external", "lean", "norm excess", "time scale 0.3 s"} <= set(groups)
    # the time since the start and the two actions before belong to no time scale
    assert (counts[:-3] == 2).all()
    assert (counts[-3:] == 1).all()


def test_what_is_taken_away_has_no_effect():
    places, mean = observation_groups(POLICY)["gyr"], RNG.uniform(-1.0, 1.0, TUNED.observation_size)
    one = RNG.uniform(-1.0, 1.0, TUNED.observation_size)
    other = one.copy()
    other[places] = RNG.uniform(-1.0, 1.0, len(places))
    blind = blinded(POLICY, places, mean)
    np.testing.assert_allclose(blind(one), blind(other), rtol=1e-12)
    same = one.copy()
    same[places] = mean[places]
    np.testing.assert_allclose(blind(one), POLICY(same), rtol=1e-12)
    held = holding(POLICY, 1, 0.4)
    assert held(one) == pytest.approx([POLICY(one)[0], 0.4])


def test_an_ablation_compares_with_the_whole_policy():
    motions = HandTrajectories(duration=3.0).draw_many(4, 2)
    rows = ablation(TUNED.kalman, POLICY, motions, np.zeros(2))
    assert rows[0]["without"] == "nothing"
    assert rows[0]["saved"] == "0 % (0 to 0)"
    assert [row["without"] for row in rows[-2:]] == ["gain: process", "gain: measurement"]
    assert mean_observation(TUNED.kalman, POLICY, motions).shape == (TUNED.observation_size,)
