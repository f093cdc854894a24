"""stable-baselines3 sees the native vector environments as it sees its own."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from poise.baselines.gain_policy.vec_env import SB3VecEnv

GAIN = "poise/HandMotionGain-v0"
OPTIONS = {"duration": 1.0, "gesture": ("slow", "fast")}


@pytest.mark.parametrize(
    ("identity", "options"),
    [(GAIN, OPTIONS), ("poise/Replay-v0", {"duration": 0.1, "random_start": True})],
)
def test_it_equals_the_environments_of_stable_baselines(identity, options):
    ours = SB3VecEnv.make(identity, 3, **options)
    theirs = DummyVecEnv([lambda: gym.make(identity, **options)] * 3)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    ours.seed(5)
    theirs.seed(5)
    first, second = ours.reset(), theirs.reset()
    rng, ends = np.random.default_rng(0), 0
    for _ in range(25):
        np.testing.assert_equal(first, second)
        actions = rng.uniform(-1.0, 1.0, (3, *ours.action_space.shape)).astype(np.float32)
        (first, earned, over, infos), (second, rewards, done, found) = ours.step(actions), theirs.step(actions)
        np.testing.assert_allclose(earned, rewards, atol=1e-6)
        np.testing.assert_array_equal(over, done)
        for row in np.flatnonzero(over):
            ends += 1
            np.testing.assert_equal(infos[row]["terminal_observation"], found[row]["terminal_observation"])
            assert infos[row]["TimeLimit.truncated"]
            assert infos[row]["time"] == found[row]["time"]
    assert ends >= 6
    ours.close()
    theirs.close()


def test_returns_and_lengths_are_those_of_the_episodes():
    env = SB3VecEnv.make(GAIN, 2, infos=False, **OPTIONS)
    env.reset()
    rewards = []
    for _ in range(10):
        _, reward, over, infos = env.step(np.zeros((2, 1)))
        rewards.append(reward)
    assert over.all()
    assert infos[1]["episode"]["l"] == 10
    assert infos[1]["episode"]["r"] == pytest.approx(np.sum(rewards, axis=0)[1], rel=1e-5)
    with pytest.raises(NotImplementedError, match="no attributes of their own"):
        env.set_attr("tuned", None)
    assert env.get_attr("neutral_action")[1].shape == (1,)


def test_ppo_trains_on_it():
    env = VecNormalize(SB3VecEnv.make(GAIN, 4, motions=2, **OPTIONS))
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, device="cpu", seed=0).learn(128)
    assert model.num_timesteps == 128
    assert len(model.ep_info_buffer) >= 8


def test_another_mode_of_resets_is_refused():
    with pytest.raises(ValueError, match="autoreset_mode='SameStep'"):
        SB3VecEnv(gym.make_vec("poise/Replay-v0", 2))
