"""Several networks as one policy: the mean of their bounded actions, trained from seeds of their own, resumable."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.gain_policy.adaptive import AdaptiveEstimator
from poise.baselines.gain_policy.compared.ablation import blinded, holding
from poise.baselines.gain_policy.config import TrainingConfig, config_of
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter

TUNED = TunedFilter.of(tunable_filter("external-acceleration"))


def network(seed, units=(8, 4)):
    """A random network whose last layer often leaves [−1, 1]."""
    rng = np.random.default_rng(seed)
    sizes = [TUNED.observation_size, *units, TUNED.actions]
    layers = [(rng.normal(size=(b, a)), rng.normal(size=b)) for a, b in pairwise(sizes)]
    return GainPolicy(TUNED.name, TUNED.ranges, TUNED.features, tuple(layers))


def test_the_action_is_the_mean_of_bounded_actions(tmp_path):
    parts = [network(seed) for seed in range(3)]
    mean = GainPolicy.mean_of(parts)
    x = np.random.default_rng(9).uniform(-1.0, 1.0, (5, 2, TUNED.observation_size))
    each = np.stack([part(x) for part in parts])
    assert (np.abs(each) == 1.0).any()
    np.testing.assert_allclose(mean(x), each.mean(axis=0), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(mean(x[1, 0]), each[:, 1, 0].mean(axis=0), rtol=1e-12, atol=1e-12)
    again = GainPolicy.load(mean.save(tmp_path / "mean"))
    np.testing.assert_allclose(again(x), mean(x), atol=1e-5)
    assert [weight.shape[0] for weight, _ in again.layers] == [3, 3, 3]
    assert AdaptiveEstimator(TUNED.kalman, again).policy.layers[0][0].shape[0] == 3


def test_neutral_networks_are_the_filter_bit_by_bit():
    motion = HandTrajectories(gestures=("slow",), duration=4.0).draw_many(1, 1)[0]
    neutral = AdaptiveEstimator(
        TUNED.kalman.with_dt(motion.dt), GainPolicy.mean_of([GainPolicy.neutral(TUNED)] * 5)
    ).run(motion.measurements)
    for name, values in TUNED.kalman.with_dt(motion.dt).run(motion.measurements).pose.items():
        np.testing.assert_array_equal(neutral.pose[name], values)


def test_ablations_act_on_every_network():
    parts = [network(seed) for seed in range(2)]
    mean, places = GainPolicy.mean_of(parts), np.array([0, 4, 5])
    x = np.random.default_rng(3).uniform(-1.0, 1.0, (4, TUNED.observation_size))
    fixed = x.copy()
    fixed[:, places] = x[0, places]
    np.testing.assert_allclose(blinded(mean, places, x[0])(x), mean(fixed), atol=1e-12)
    held = holding(mean, 1, 0.25)(x)
    np.testing.assert_allclose(held[:, 1], 0.25)
    np.testing.assert_allclose(held[:, [0, 2]], mean(x)[:, [0, 2]], atol=1e-12)


def test_networks_that_do_not_go_together_are_refused():
    for others, said in (
        ([], "got 0 kinds"),
        ([network(0), network(1, (8, 5))], "got 2 kinds"),
        ([network(0), dataclasses.replace(network(1), smoothing=1.0)], "got 2 kinds"),
    ):
        with pytest.raises(ValueError, match=said):
            GainPolicy.mean_of(others)
    two, first = GainPolicy.mean_of([network(0), network(1)]), network(0).layers[0]
    with pytest.raises(ValueError, match="as many networks"):
        dataclasses.replace(two, layers=(first, *two.layers[1:]))


def test_a_training_of_several_networks_resumes_and_a_longer_list_keeps_the_first(tmp_path):
    pytest.importorskip("torch")
    from poise.baselines.gain_policy.networks import train_networks

    motions = HandTrajectories(duration=4.0)
    config = config_of(
        "analytic", TrainingConfig(motions=motions, trajectories=4, total_timesteps=2 * 3 * 40, net_arch=(4,))
    )

    def train(folder=None, stop_at=0, networks=2, **more):
        calls = []

        def report(progress):
            calls.append(progress["steps"])
            if len(calls) == stop_at:
                raise InterruptedError

        return train_networks(config, networks, start=np.zeros(3), folder=folder, report=report, **more), calls

    whole, steps = train()
    assert steps == sorted(steps)
    assert len(steps) == 4
    for number, stop in enumerate((1, 4)):
        with pytest.raises(InterruptedError):
            train(tmp_path, stop, resume=number > 0)
    resumed, _ = train(tmp_path, resume=True)
    for one, other in zip(resumed.layers, whole.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
    members = whole.card["networks"]
    assert len({member["seed"] for member in members}) == 2
    assert [member["costs"] for member in members] == [member["costs"] for member in resumed.card["networks"]]
    assert whole.bias_limit == min(member["bias_limit"] for member in members)
    assert (whole.layers[0][0][0] != whole.layers[0][0][1]).any()
    three, _ = train(networks=3)
    np.testing.assert_array_equal(three.layers[0][0][:2], whole.layers[0][0])


def test_networks_of_a_filter_that_estimates_its_bias_are_saved(tmp_path):
    pytest.importorskip("torch")
    from poise.baselines.gain_policy.networks import train_networks

    training = TrainingConfig(
        filter="bounded-motion",
        motions=HandTrajectories(duration=4.0),
        trajectories=2,
        total_timesteps=2 * 40,
        net_arch=(4,),
    )
    policy = train_networks(config_of("analytic", training), 2, start=np.zeros(3))
    assert policy.bias_limit == math.inf
    again = GainPolicy.load(policy.save(tmp_path / "policy.safetensors"))
    assert again.bias_limit == math.inf
    assert [member["bias_limit"] for member in again.card["networks"]] == [None, None]


@pytest.mark.parametrize(
    ("agent", "networks", "said"),
    [("analytic", 1, "networks must be at least 2, got 1"), ("recurrent-ppo", 3, "networks must be 1 for the agent")],
)
def test_wrong_numbers_of_networks_are_refused(agent, networks, said):
    pytest.importorskip("torch")
    from poise.baselines.gain_policy.networks import train_networks

    with pytest.raises(ValueError, match=said):
        train_networks(config_of(agent, TrainingConfig()), networks)
