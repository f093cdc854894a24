"""Statistics of stable-baselines3's ``VecNormalize`` in safetensors with a card; its own files are pickles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ....filters.support.optional import extra
from ...weights_io import load_weights, save_weights

with extra("rl"):
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.vec_env import VecEnv, VecNormalize

KIND = "normalisation of observations"
"""Field ``kind`` of the card."""
SETTINGS = ("norm_obs", "norm_obs_keys", "norm_reward", "clip_obs", "clip_reward", "gamma", "epsilon")
"""Arguments of ``VecNormalize`` on the card."""
RETURNS = "returns"
"""Name of the statistics of rewards among those of observations."""


def save_normalisation(env: VecNormalize, path: str | Path) -> Path:
    """Write statistics and settings.

    Args:
        env: with observations that are arrays or dictionaries of arrays.
        path: file; ``.safetensors`` is appended where it is missing, and the card lies beside it.
    """
    arrays: dict[str, np.ndarray] = {}
    for name, each in statistics_of(env).items():
        arrays |= {f"{name}.mean": np.atleast_1d(each.mean), f"{name}.var": np.atleast_1d(each.var)}
        arrays[f"{name}.count"] = np.array([each.count], dtype=float)
    settings: dict[str, Any] = {name: getattr(env, name) for name in SETTINGS}
    return save_weights(path, arrays, {"kind": KIND, "settings": settings})


def load_normalisation(path: str | Path, venv: VecEnv) -> VecNormalize:
    """Wrap an environment in the normalisation of a file; it counts on unless ``training`` is set to False.

    Raises:
        FileNotFoundError: a part is missing.
        ValueError: the file is damaged, holds something else, or belongs to other observations.
    """
    arrays, card = load_weights(path)
    if card.get("kind") != KIND:
        raise ValueError(f"{path} is not a {KIND} but {card.get('kind')!r}")
    env = VecNormalize(venv, **card["settings"])
    known = statistics_of(env)
    sizes = {f"{name}.mean": np.atleast_1d(each.mean).shape for name, each in known.items()}
    found = {name: value.shape for name, value in arrays.items() if name.endswith(".mean")}
    if found != sizes:
        raise ValueError(f"{path} holds statistics {found}, the environment needs {sizes}")
    for name, each in known.items():
        each.mean, each.var = (arrays[f"{name}.{part}"].reshape(np.shape(each.mean)) for part in ("mean", "var"))
        each.count = float(arrays[f"{name}.count"][0])
    return env


def statistics_of(env: VecNormalize) -> dict[str, RunningMeanStd]:
    """Every running mean by name: of each key of a dictionary, or of the one array, and of returns."""
    found = {RETURNS: env.ret_rms}
    if not env.norm_obs:
        return found
    seen = env.obs_rms
    return found | (
        {f"observation {key}": seen[key] for key in seen} if isinstance(seen, dict) else {"observation": seen}
    )
