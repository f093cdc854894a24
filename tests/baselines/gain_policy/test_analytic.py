"""Training by the exact gradient: equal to finite differences, and it finds gains that were mis-scaled."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("torch")

from poise.baselines.gain_policy.analytic import Costs, Episodes, train_analytically
from poise.baselines.gain_policy.config import TrainingConfig, config_of
from poise.baselines.gain_policy.constant_gains import constant_errors, policy_errors
from poise.baselines.gain_policy.training import train_policy
from poise.envs.gain_episode import GainEpisode
from poise.envs.gain_reward import GainReward
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter

KALMAN = tunable_filter("external-acceleration")
REWARD = GainReward("relative", error_scale=np.radians(5.0))


@pytest.fixture(scope="module")
def motions():
    return HandTrajectories(duration=6.0).draw_many(3, 6)


@pytest.mark.parametrize("quantity", [None, ("up", "external_acceleration")])
def test_the_gradient_is_that_of_finite_differences(motions, quantity):
    tuned = TunedFilter.of(KALMAN, ("process", "measurement"))
    costs = Costs(tuned, REWARD, quantity)
    start = np.zeros(2)
    part = Episodes.of(tuned, [GainEpisode.of(one, tuned, costs.quantities, REWARD, start) for one in motions[:2]])
    actions = np.random.default_rng(1).uniform(-0.6, 0.6, (60, 2, 2))
    actions[5, 1, 0] = 1.3
    cost, slope = costs.gradient(part, actions)
    assert cost.shape == (2,)
    assert slope[5, 1, 0] == 0.0
    for place in ((0, 0, 0), (10, 0, 1), (40, 1, 0), (5, 1, 1)):
        ahead, behind = actions.copy(), actions.copy()
        ahead[place] += 1e-4
        behind[place] -= 1e-4
        wanted = (costs.gradient(part, ahead)[0].mean() - costs.gradient(part, behind)[0].mean()) / 2e-4
        assert slope[place] == pytest.approx(wanted, rel=1e-3, abs=1e-9)


def test_short_episodes_count_as_if_they_were_alone(motions):
    tuned = TunedFilter.of(KALMAN, ("process", "measurement"))
    costs = Costs(tuned, REWARD)
    both = [motions[0], motions[1][:400]]
    episodes = [GainEpisode.of(one, tuned, costs.quantities, REWARD, np.zeros(2)) for one in both]
    actions = np.full((60, 2, 2), 0.3)
    together = costs.gradient(Episodes.of(tuned, episodes), actions)
    alone = costs.gradient(Episodes.of(tuned, episodes[1:]), actions[:40, 1:])
    assert together[0][1] == pytest.approx(alone[0][0], rel=1e-12)
    np.testing.assert_allclose(2.0 * together[1][:40, 1], alone[1][:, 0], rtol=1e-9, atol=1e-15)
    assert not together[1][40:, 1].any()


def test_it_finds_gains_that_were_wrong_and_repeats_bit_by_bit(motions):
    wrong = dataclasses.replace(KALMAN, model=dataclasses.replace(KALMAN.model, gyroscope_noise=1.0))
    tuned = TunedFilter.of(wrong, ("process", "measurement"))
    costs = []
    first, second = (
        train_analytically(
            tuned,
            motions[:4],
            np.zeros(2),
            epochs=6,
            learning_rate=2e-2,
            noise=0.2,
            report=lambda _, cost, unseen: costs.append(cost),
        )
        for _ in range(2)
    )
    for one, other in zip(first.layers, second.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
    assert costs[5] < 0.8 * costs[0]
    assert (
        policy_errors(wrong, first, motions[4:]).mean() < 0.8 * constant_errors(tuned, motions[4:], np.zeros(2)).mean()
    )


def test_stopped_after_a_pass_it_gives_the_same_policy(motions, tmp_path):
    steps = 3 * 60 * 5
    config = config_of("analytic", TrainingConfig(total_timesteps=steps, net_arch=(8,)))

    def train(folder, stop_at=0, resume=False, config=config):
        calls = []

        def report(_):
            calls.append(None)
            if len(calls) == stop_at:
                raise InterruptedError

        return train_policy(
            config, trajectories=motions, start=np.zeros(3), folder=folder, resume=resume, report=report
        )

    whole = train(None)
    for stop in (2, 3):
        with pytest.raises(InterruptedError):
            train(tmp_path, stop, resume=stop > 2)
    resumed = train(tmp_path, resume=True)
    for one, other in zip(resumed.layers, whole.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
    assert resumed.card["costs"] == whole.card["costs"]
    with pytest.raises(ValueError, match="total_timesteps"):
        train(tmp_path, resume=True, config=dataclasses.replace(config, total_timesteps=2 * steps))
