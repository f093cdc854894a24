"""Gymnasium's vector environments for stable-baselines3, whose own interface is another one."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from ...filters.support.optional import extra

with extra("rl"):
    from stable_baselines3.common.vec_env import VecEnv


class SB3VecEnv(VecEnv):
    """A Gymnasium vector environment as a ``VecEnv`` of stable-baselines3.

    Infos are empty but where an episode ends: there they hold ``terminal_observation``, ``TimeLimit.truncated``, the
    last info of the episode, and, as of ``Monitor``, ``episode`` with return ``r``, length ``l`` and seconds ``t``.

    Args:
        env: in the mode ``SameStep`` of automatic resets, which is the one that stable-baselines3 knows.

    Raises:
        ValueError: another mode.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        mode = env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"env must be made with autoreset_mode='SameStep', got {mode}")
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.actions = np.zeros(env.action_space.shape or (env.num_envs,))
        self.returns, self.lengths = np.zeros(env.num_envs), np.zeros(env.num_envs, int)
        self._started = time.perf_counter()

    @classmethod
    def make(cls, identity: str, num_envs: int, **arguments: Any) -> SB3VecEnv:
        """The native vector environment of a registered id.

        Args:
            identity: such as ``poise/HandMotionGain-v0``.
            num_envs: episodes at a time.
            arguments: of the environment.
        """
        mode, same = "vector_entry_point", AutoresetMode.SAME_STEP.value
        return cls(gymnasium.make_vec(identity, num_envs, mode, autoreset_mode=same, **arguments))

    def reset(self) -> Any:
        """Begin all episodes, with the seeds of :meth:`seed` if they were given since the last reset."""
        seeded = any(seed is not None for seed in self._seeds)
        options = self._options[0] or None
        seeds: Any = self._seeds if seeded else None
        observation, _ = self.env.reset(seed=seeds, options=options)
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        self.returns[:], self.lengths[:] = 0.0, 0
        return observation

    def seed(self, seed: int | Sequence[int] | None = None) -> Sequence[int | None]:
        """Seed the next reset: the first episode's, the others count on; or one for each."""
        if isinstance(seed, Sequence):
            self._seeds = list(seed)
            return self._seeds
        return super().seed(seed)

    def step_async(self, actions: np.ndarray) -> None:
        """Remember the actions ``(envs, k)``."""
        self.actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Advance all episodes by one step; those that are over begin anew."""
        observation, rewards, terminated, truncated, found = self.env.step(self.actions)
        self.returns += rewards
        self.lengths += 1
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(over).tolist():
            infos[row] = {
                **info_of(found.get("final_info", {}), row),
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
                "terminal_observation": found["final_obs"][row],
                "episode": {
                    "r": float(self.returns[row]),
                    "l": int(self.lengths[row]),
                    "t": round(time.perf_counter() - self._started, 6),
                },
            }
        self.returns[over], self.lengths[over] = 0.0, 0
        return observation, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector environment, or of the single one that it stands for, once for each episode."""
        single = getattr(self.env.unwrapped, "single", None)
        owner = self.env if hasattr(self.env, attr_name) or single is None else single
        return [getattr(owner, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: episodes have no attributes of their own."""
        raise NotImplementedError("episodes that are computed together have no attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused: episodes have no methods of their own."""
        raise NotImplementedError("episodes that are computed together have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Never wrapped, but return and length of episodes are reported as ``Monitor`` does."""
        from stable_baselines3.common.monitor import Monitor

        return [wrapper_class is Monitor for _ in self._get_indices(indices)]


def info_of(infos: Mapping[str, Any], row: int) -> dict[str, Any]:
    """The info of one row, as the single environment gives it."""
    found: dict[str, Any] = {}
    for name, value in infos.items():
        if name.startswith("_") or not infos[f"_{name}"][row]:
            continue
        found[name] = info_of(value, row) if isinstance(value, Mapping) else value[row]
    return found
