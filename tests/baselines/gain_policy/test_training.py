"""Training learns, is reproducible, and exports what it trained."""

import csv
import dataclasses
import json

import numpy as np
import pytest

from poise.baselines.gain_policy.config import TrainingConfig, shipped_config
from poise.baselines.gain_policy.constant_gains import constant_errors, policy_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.baselines.gain_policy.training import train_policy
from poise.envs.gain_episode import PRIVILEGED
from poise.envs.gain_tuning import ReplayGainEnv
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.kalman import KalmanFilter

SMALL = TrainingConfig(
    filter="bounded-motion",
    gains=("velocity",),
    total_timesteps=4096,
    n_envs=16,
    n_steps=64,
    batch_size=256,
    gain_search=0,
    warm_start=0,
    net_arch=(16,),
    learning_rate=3e-3,
    gamma=0.9,
    initial_std=0.3,
)


@pytest.fixture(scope="module")
def wrong():
    """A filter whose pseudo-measurement is believed far too little."""
    model = tunable_filter("bounded-motion").model
    return KalmanFilter(dataclasses.replace(model, velocity_bound=5.0 * model.velocity_bound), keep_covariance=False)


@pytest.fixture(scope="module")
def trajectories():
    return HandTrajectories(("slow", "fast"), duration=10.0, rates=(50.0,)).draw_many(0, 12)


def test_it_recovers_a_wrong_tuning(wrong, trajectories):
    policy = train_policy(dataclasses.replace(SMALL, total_timesteps=12_288), kalman=wrong, trajectories=trajectories)
    unseen = HandTrajectories(("slow", "fast"), duration=10.0, rates=(50.0,)).draw_many(1, 6)
    neutral = constant_errors(TunedFilter.of(wrong), unseen, np.zeros(3)).mean()
    assert policy_errors(wrong, policy, unseen).mean() < 0.7 * neutral


def test_equal_arguments_give_equal_policies_and_other_seeds_do_not(wrong, trajectories):
    config = dataclasses.replace(SMALL, total_timesteps=1024)
    one, two, three = (
        train_policy(dataclasses.replace(config, seed=seed), kalman=wrong, trajectories=trajectories)
        for seed in (0, 0, 1)
    )
    for (w1, b1), (w2, b2) in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(w1, w2)
        np.testing.assert_array_equal(b1, b2)
    assert not np.array_equal(one.layers[0][0], three.layers[0][0])


def test_the_exported_policy_is_the_trained_one(trajectories):
    from stable_baselines3.common.vec_env import VecNormalize

    from poise.baselines.gain_policy.actor_critic import make_model
    from poise.baselines.gain_policy.agents.learners import exported_policy
    from poise.baselines.gain_policy.vec_env import SB3VecEnv

    tuned = TunedFilter.of(tunable_filter("external-acceleration"))
    options = {"trajectory": trajectories, "privileged": True, "gains": tuple(one.gain for one in tuned.ranges)}
    env = VecNormalize(SB3VecEnv.make("poise/ReplayGain-v0", 16, **options), clip_obs=1e6)
    model = make_model(dataclasses.replace(SMALL, gains=None, net_arch=(32, 32)), env, np.array([0.5, -0.5, 0.1]))
    model.learn(2048)
    env.training = False
    observation = env.reset()
    policy = exported_policy(model, env, tuned, "ppo")
    for _ in range(30):
        action, _ = model.predict(observation, deterministic=True)
        np.testing.assert_allclose(policy(env.get_original_obs()[:, : tuned.observation_size]), action, atol=1e-5)
        observation, *_ = env.step(action)


def test_what_only_the_critic_knows_reaches_no_action(trajectories):
    import torch
    from stable_baselines3.common.vec_env import VecNormalize

    from poise.baselines.gain_policy.actor_critic import make_model
    from poise.baselines.gain_policy.vec_env import SB3VecEnv

    options = {"filter": "bounded-motion", "trajectory": trajectories, "privileged": True}
    env = VecNormalize(SB3VecEnv.make("poise/ReplayGain-v0", 4, **options))
    model = make_model(dataclasses.replace(SMALL, gains=None), env, np.zeros(3))
    observation = torch.as_tensor(env.reset())
    other = observation.clone()
    other[:, -PRIVILEGED:] += 1.0
    with torch.no_grad():
        one, two = (model.policy.get_distribution(x).distribution.mean for x in (observation, other))
        assert torch.equal(one, two)
        assert not torch.equal(model.policy.predict_values(observation), model.policy.predict_values(other))


def test_stable_baselines_trains_on_the_registered_environment(trajectories):
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv

    env = DummyVecEnv([lambda: ReplayGainEnv(trajectories, duration=2.0)] * 2)
    PPO("MlpPolicy", env, n_steps=32, batch_size=32, device="cpu").learn(64)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"total_timesteps": 0}, "total_timesteps"),
        ({"gamma": 1.0}, "gamma"),
        ({"initial_std": 0.0}, "initial_std"),
        ({"gain_search": -1}, "gain_search"),
        ({"error_scale": 0.0}, "error_scale"),
    ],
)
def test_wrong_configurations_are_explained(arguments, words):
    with pytest.raises(ValueError, match=words):
        TrainingConfig(**arguments)


def test_the_command_tunes_compares_and_exports(tmp_path, capsys):
    from poise.scripts.main import main

    recording = HandTrajectories(duration=5.0).draw_many(77, 1)[0].save(tmp_path / "one.h5")
    words = ["tune", "external-acceleration", "--steps", "2000", "--trajectories", "4", "--test-trajectories", "2"]
    words += ["--recordings", str(recording), "--runs", str(tmp_path / "runs"), "--export", str(tmp_path / "mine")]
    assert main(words) == 0
    folder = next((tmp_path / "runs" / "tune").iterdir())
    rows = list(csv.DictReader((folder / "results.csv").open()))
    assert {row["estimator"] for row in rows} == {"published", "constant", "policy", "oracle"}
    assert {row["trajectory"] for row in rows} >= {"hand-77-0"}
    card = json.loads((tmp_path / "mine.json").read_text())
    assert card["command"].startswith("poise tune external-acceleration --agent ppo")
    assert set(card["test_error_deg"]["policy"]) == {"simulated", "one.h5"}
    assert GainPolicy.load(tmp_path / "mine").filter == "external-acceleration"
    assert "published" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", ["external-acceleration", "bounded-motion"])
def test_minutes_of_training_beat_the_best_constant_gains(name):
    config = dataclasses.replace(shipped_config(name), total_timesteps=200_000, trajectories=96, warm_start=96)
    policy = train_policy(config)
    unseen = config.motions.draw_many(4321, 32)
    tuned = TunedFilter.of(tunable_filter(name))
    constant = constant_errors(tuned, unseen, np.array(policy.card["constant_action"]))
    learned = policy_errors(tuned.kalman, policy, unseen)
    # Of each motion's own error, as rewards are: a mean of errors is that of the one motion that no gains can follow.
    published = constant_errors(tuned, unseen, np.zeros(tuned.actions))
    assert ((constant - learned) / published).mean() > 0.0
