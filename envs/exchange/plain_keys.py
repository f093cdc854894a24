"""A wrapper that renames keys for formats in which ``/`` separates folders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

SEPARATOR = "."
"""What stands for ``/`` in a key."""


class PlainKeys(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Observations and infos with ``imu.gyr`` instead of ``imu/gyr``; nothing else changes.

    HDF5, and with it Minari, reads ``/`` in a key as a folder.

    Args:
        env: any environment; keys of its dictionaries may hold ``/`` but no dot.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.Wrapper.__init__(self, env)
        if isinstance(env.observation_space, spaces.Dict):
            self.observation_space = spaces.Dict(plain(env.observation_space.spaces))

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """As the environment does."""
        observation, info = self.env.reset(seed=seed, options=options)
        return plain(observation), plain(info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """As the environment does."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return plain(observation), reward, terminated, truncated, plain(info)


def plain(value: Any) -> Any:
    """The same with a dot for each ``/`` in the keys of a dictionary and of those inside it."""
    if not isinstance(value, Mapping):
        return value
    return {str(key).replace("/", SEPARATOR): plain(item) for key, item in value.items()}


def restored(value: Any) -> Any:
    """Undo :func:`plain`."""
    if not isinstance(value, Mapping):
        return value
    return {str(key).replace(SEPARATOR, "/"): restored(item) for key, item in value.items()}
