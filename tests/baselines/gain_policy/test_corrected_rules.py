"""Policies that correct a rule by hand: without a correction they are the rule, and they never forget it."""

import dataclasses

import numpy as np
import pytest

import poise
from poise.baselines.gain_policy.adaptive import AdaptiveEstimator
from poise.baselines.gain_policy.compared.ablation import blinded, holding
from poise.baselines.gain_policy.config import TrainingConfig, config_of, shipped_config
from poise.baselines.gain_policy.motions import RiddenMotions
from poise.baselines.gain_policy.policy import GainPolicy, rule_skip
from poise.baselines.gain_policy.rules import ruled
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.gain_episode import filter_for
from poise.envs.gain_reward import GainReward
from poise.envs.recipes.rides import RideSource
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.ruled_features import ruled_features
from poise.filters.adaptation.rules import TurningRule
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.estimator import run_by_steps

PLATFORM = tunable_filter("platform-gyro")
PLAIN = TunedFilter.of(PLATFORM, ("measurement",))
TUNED = dataclasses.replace(PLAIN, features=ruled_features(PLATFORM, "turning", 0.1, PLAIN.ranges))
RULE = dataclasses.replace(GainPolicy.neutral(TUNED), skip=rule_skip(TUNED.features, 1))


@pytest.fixture(scope="module")
def ride():
    return poise.record(RiderBicycleEnv("pitch", 1, suite=["bicycle_imu/gyr"], fidelity="lumped", duration=8.0), seed=0)


def corrected(seed=1):
    """The rule with a random correction."""
    rng = np.random.default_rng(seed)
    weights = ((0.3 * rng.normal(size=(6, TUNED.observation_size)), rng.normal(size=6)),)
    return dataclasses.replace(RULE, layers=(*weights, (0.3 * rng.normal(size=(1, 6)), np.zeros(1))))


def test_without_a_correction_it_is_the_rule(ride):
    kalman = filter_for(PLATFORM, ride)
    wanted = ruled(kalman, "measurement", TurningRule())
    found = AdaptiveEstimator(kalman, RULE)
    for estimator in (found, AdaptiveEstimator(kalman, GainPolicy.mean_of([RULE] * 3))):
        _, _, actions = estimator.run_with_actions(None, ride.measurements)
        np.testing.assert_allclose(actions, wanted.run_with_actions(None, ride.measurements)[2], atol=1e-12)
    assert np.ptp(actions) > 0.2
    short = {name: values[:150] for name, values in ride.measurements.items()}
    np.testing.assert_array_equal(
        run_by_steps(found, short).pose["bicycle/roll"], found.run(short).pose["bicycle/roll"]
    )


def test_a_correction_is_added_within_the_range_and_files_bring_it_back(tmp_path):
    policy = corrected()
    x = np.random.default_rng(2).uniform(-1.0, 1.0, (50, TUNED.observation_size))
    rule = x[:, [TUNED.features.names.index("rule")]]
    plain = np.tanh(x @ policy.layers[0][0].T + policy.layers[0][1]) @ policy.layers[1][0].T
    np.testing.assert_allclose(policy(x), np.clip(plain + rule, -1.0, 1.0), atol=1e-12)
    again = GainPolicy.load(policy.save(tmp_path / "corrected"))
    assert again.features == policy.features
    np.testing.assert_allclose(again(x), policy(x), atol=1e-5)
    with pytest.raises(ValueError, match="skip must have the shape"):
        dataclasses.replace(policy, skip=np.zeros((1, 3)))
    other = dataclasses.replace(TUNED.features, rule=TurningRule(scale=1.0))
    with pytest.raises(ValueError, match="must correct a rule of"):
        dataclasses.replace(policy, features=other).save(tmp_path / "other")


def test_ablations_act_on_the_rule_too():
    policy, place = corrected(), np.array([TUNED.features.names.index("rule")])
    x = np.random.default_rng(3).uniform(-0.3, 0.3, (20, TUNED.observation_size))
    fixed = x.copy()
    fixed[:, place] = x[0, place]
    np.testing.assert_allclose(blinded(policy, place, x[0])(x), policy(fixed), atol=1e-12)
    np.testing.assert_allclose(holding(policy, 0, 0.25)(x), 0.25)


def test_a_training_begins_with_the_rule(ride):
    pytest.importorskip("torch")
    from poise.baselines.gain_policy.analytic import Costs, train_analytically

    policy = train_analytically(TUNED, [ride], np.zeros(1), epochs=1, learning_rate=1e-12, net_arch=(4,))
    x = np.random.default_rng(4).uniform(-0.5, 0.5, (20, TUNED.observation_size))
    np.testing.assert_allclose(policy(x), RULE(x), atol=1e-6)
    # with steps that are far too long what is held back still errs no more than by the rule
    costs = Costs(TUNED, GainReward("relative", error_scale=np.radians(5.0)))
    held_out = costs.episodes([ride], np.zeros(1))
    for seed in range(3):
        options = {"epochs": 1, "learning_rate": 1e3, "net_arch": (4,), "validation": [ride], "seed": seed}
        wild = train_analytically(TUNED, [ride], np.zeros(1), **options)
        assert costs.of_policy(held_out, wild) < costs.of_policy(held_out, RULE) + 1e-6


def test_the_exact_gradient_alone_corrects_a_rule():
    for name in ("two-gyro-level", "platform-gyro"):
        assert config_of("analytic", shipped_config(name)).rule == "turning"
        assert config_of("ppo", shipped_config(name)).rule is None
    assert config_of("analytic", shipped_config("external-acceleration")).rule is None
    with pytest.raises(ValueError, match="rule must be None for the agent ppo"):
        TrainingConfig(rule="turning")


def test_the_exact_gradient_alone_is_scored_by_several_quantities():
    wanted = ("bicycle/roll", "force-inertial/trunk_angles")
    assert config_of("analytic", shipped_config("force-inertial-consistent")).quantities == wanted
    assert config_of("ppo", shipped_config("force-inertial-consistent")).quantities == ()
    with pytest.raises(ValueError, match="quantities must be one at most for the agent ppo"):
        TrainingConfig(quantities=wanted)


def test_networks_share_rides_but_not_devices():
    changes = {"suite": ["bicycle_imu/gyr"], "fidelity": ["lumped"], "scenarios": ["straight"]}
    motions = RiddenMotions(RideSource(2, 2, 3.0, changes))
    first, other = motions.devices(5, 3, 0), motions.devices(5, 3, 1)
    for one, same in zip(first, motions.draw_many(5, 3), strict=True):
        np.testing.assert_array_equal(one.measurements["bicycle_imu/gyr"], same.measurements["bicycle_imu/gyr"])
    for one, same in zip(first, other, strict=True):
        assert one.name == same.name
        assert not np.array_equal(one.measurements["bicycle_imu/gyr"], same.measurements["bicycle_imu/gyr"])
