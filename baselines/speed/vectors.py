"""Speed of native vector environments beside the learner that they feed: PPO on an environment that does nothing."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from ...filters.support.optional import extra
from .measure import REPEATS, Speed

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

ENVS, STEPS = 256, 24
"""rows, and steps of all rows that are timed"""
LEARNED = 4096
"""steps that the learner takes at a time"""
CASES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("HandMotionGain, 64 motions", "poise/HandMotionGain-v0", {"motions": 64}),
    ("HandMotionGain, a new motion each", "poise/HandMotionGain-v0", {}),
    ("ReplayGain", "poise/ReplayGain-v0", {}),
    ("RiderBicycleGain, two-gyro, 2 rides", "poise/RiderBicycleGain-v0", {"filter": "two-gyro", "rides": 2}),
    ("Replay", "poise/Replay-v0", {"random_start": True, "duration": 10.0}),
)
"""What is timed: name, id and arguments."""


def vector_speeds() -> Iterator[Speed]:
    """Steps per CPU second of each native vector environment, and of the learner on the same spaces."""
    for what, identity, options in CASES:
        group = f"{what}, {ENVS} at a time"
        quiet: dict[str, Any] = {"infos": False, "staggered": True} if "Gain" in identity else {}
        env = gymnasium.make_vec(identity, ENVS, vectorization_mode="vector_entry_point", **options, **quiet)
        learner = learner_rate(env)
        yield Speed(group, "PPO of stable-baselines3 on the same spaces", learner, "steps/s", 1.0)
        rate = vector_rate(env)
        yield Speed(group, "native vector environment", rate, "steps/s", rate / learner)
        env.close()


def vector_rate(env: VectorEnv[Any, Any, Any]) -> float:
    """Median steps per CPU second; a share of the episodes begins anew in every step, as in a training."""
    rng, shape = np.random.default_rng(0), env.action_space.shape
    env.reset(seed=0)
    rates = []
    for _ in range(REPEATS + 1):
        spent = 0.0
        for _ in range(STEPS):
            actions = rng.uniform(-1.0, 1.0, shape).astype(np.float32)
            start = time.process_time()
            env.step(actions)
            spent += time.process_time() - start
        rates.append(ENVS * STEPS / spent)
    return sorted(rates[1:])[REPEATS // 2]


def learner_rate(env: VectorEnv[Any, Any, Any]) -> float:
    """Steps per CPU second of PPO with its usual settings on an environment of the same spaces that does nothing."""
    with extra("rl"):
        from stable_baselines3 import PPO
    kind = "MultiInputPolicy" if isinstance(env.single_observation_space, gymnasium.spaces.Dict) else "MlpPolicy"
    null = NullVectorEnv(env.num_envs, env.single_observation_space, env.single_action_space)
    from ..gain_policy.vec_env import SB3VecEnv

    model = PPO(kind, SB3VecEnv(null), n_steps=LEARNED // env.num_envs, seed=0, device="cpu")
    start = time.process_time()
    model.learn(LEARNED)
    return LEARNED / (time.process_time() - start)


class NullVectorEnv(gymnasium.vector.VectorEnv[Any, np.ndarray, np.ndarray]):
    """Returns the same observation at every step.

    Args:
        num_envs: number of rows.
        observation_space: of a row.
        action_space: of a row.
    """

    def __init__(
        self, num_envs: int, observation_space: gymnasium.Space[Any], action_space: gymnasium.Space[Any]
    ) -> None:
        from gymnasium.vector.utils import batch_space

        self.metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.SAME_STEP}
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = observation_space, action_space
        self.observation_space = batch_space(observation_space, num_envs)
        self.action_space = batch_space(action_space, num_envs)
        self.observation_space.seed(0)
        self._seen = self.observation_space.sample()

    def reset(self, **_: Any) -> tuple[Any, dict[str, Any]]:
        """The observation."""
        return self._seen, {}

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """The same observation, no reward, no end."""
        never = np.zeros(self.num_envs, bool)
        return self._seen, np.zeros(self.num_envs), never, never, {}
