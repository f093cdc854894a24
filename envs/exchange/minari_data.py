"""Data sets of Minari, the Farama Foundation's format for offline reinforcement learning."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from ...filters.support.optional import extra
from ...filters.support.parallel import progress_bar
from ...filters.support.seeds import child_seeds, root_seed
from ...filters.support.version import poise_version
from ..record import Policy, default_policy, describe, join, opened
from .plain_keys import PlainKeys, restored

if TYPE_CHECKING:
    from minari import MinariDataset
    from minari.data_collector import EpisodeBuffer

    from ..data.trajectory import Trajectory


def to_minari(
    env: Any,
    dataset_id: str,
    *,
    episodes: int = 1,
    seed: int | None = None,
    policy: Policy | None = None,
    algorithm: str | None = None,
    description: str | None = None,
    author: str | None = None,
    author_email: str | None = None,
    progress: bool = False,
) -> MinariDataset:
    """Play episodes and keep them as a data set of Minari, with the true pose in its infos.

    Observation keys have a dot where the environment's have ``/``: :class:`.PlainKeys`, which the stored specification
    names, so that ``dataset.recover_environment()`` makes an environment with the observations of the data set.

    Args:
        env: an environment of this package, or a registered id, which is made and closed here.
        dataset_id: Minari's name, ``[namespace/]name-v0``; a data set of that name must not exist.
        episodes: how many to play.
        seed: root seed; every episode has a child of its own. None draws one.
        policy: observation (keys with ``/``) → action; by default the neutral action.
        algorithm: name of what chose the actions; None for ``neutral`` without a policy.
        description: text kept with the data set.
        author: who made it.
        author_email: where to reach them.
        progress: show a bar.

    Returns:
        The data set, as ``minari.load_dataset(dataset_id)`` gives it.

    Raises:
        ValueError: ``episodes`` is not positive, the data set exists, or the environment cannot be rebuilt from its
            specification because an argument is not a plain value (give paths instead of trajectories).
        MissingExtraError: Minari is not installed.
    """
    with extra("exchange"):
        import minari
    if episodes < 1:
        raise ValueError(f"episodes must be at least 1, got {episodes}")
    if dataset_id in minari.list_local_datasets():
        raise ValueError(f"dataset_id {dataset_id!r} exists already; choose another name or version")
    root = root_seed(seed)
    with opened(env) as made:
        check_rebuilt(made)
        choose = policy or default_policy(made, root)
        wrapped = PlainKeys(made)
        bar = progress_bar(episodes, f"play {dataset_id}", "episode", show=progress)
        with bar, warnings.catch_warnings():

            def played() -> Iterator[EpisodeBuffer]:
                for episode_seed in child_seeds(root, episodes):
                    yield play(wrapped, choose, episode_seed)
                    bar.update()

            # an iterator, so that one episode at a time is in memory
            warnings.filterwarnings("ignore", message=".* is set to None", category=UserWarning, module="minari")
            return minari.create_dataset_from_buffers(
                dataset_id,
                played(),
                env=wrapped,
                algorithm_name=algorithm or ("neutral" if policy is None else "unnamed"),
                author=author,
                author_email=author_email,
                description=description or f"{made.spec.id}, {episodes} episodes from root seed {root}",
                requirements=[f"poise=={poise_version().split('+')[0]}"],
            )


def play(env: gymnasium.Env[Any, Any], choose: Policy, seed: int) -> EpisodeBuffer:
    """One episode; Minari's own collector would need jax."""
    from minari.data_collector import EpisodeBuffer

    observation, info = env.reset(seed=seed)
    observations: list[Any] = [observation]
    infos: list[Any] = [info]
    actions: list[Any] = []
    rewards: list[float] = []
    terminations: list[bool] = []
    truncations: list[bool] = []
    while not actions or not (terminations[-1] or truncations[-1]):
        actions.append(choose(restored(observation)))
        observation, reward, terminated, truncated, info = env.step(actions[-1])
        observations.append(observation)
        infos.append({key: value for key, value in info.items() if key not in LAST_STEP})
        rewards.append(float(reward))
        terminations.append(terminated)
        truncations.append(truncated)
    return EpisodeBuffer(
        seed=seed,
        observations=stacked(observations),
        actions=np.stack(actions),
        rewards=rewards,
        terminations=terminations,
        truncations=truncations,
        infos=stacked(infos),
    )


def stacked(rows: Sequence[Any]) -> Any:
    """Rows of equal dictionaries, also of nested ones, as one dictionary of arrays."""
    if isinstance(rows[0], dict):
        return {key: stacked([row[key] for row in rows]) for key in rows[0]}
    return np.stack([np.asarray(row) for row in rows])


LAST_STEP = frozenset({"episode"})
"""Entries of info that only the last step of an episode has."""


def check_rebuilt(env: gymnasium.Env[Any, Any]) -> None:
    """Refuse an environment whose specification would not make it again.

    Raises:
        ValueError: see :func:`to_minari`.
    """
    if env.spec is None:
        raise ValueError("env has no specification: make it with gymnasium.make and a registered id")
    for name, value in env.spec.kwargs.items():
        if not isinstance(value, str | int | float | bool | None | list | tuple | dict):
            raise ValueError(
                f"{env.spec.id} cannot be rebuilt from its specification: its argument {name} is a "
                f"{type(value).__name__}, not a plain value such as a name or a path"
            )


def from_minari(dataset: MinariDataset | str) -> list[Trajectory]:
    """The episodes of a data set of Minari as trajectories, which any estimator runs on.

    Args:
        dataset: made by :func:`to_minari` from an environment whose agent estimates a pose, or its name.

    Returns:
        One trajectory an episode. Measurements have the single precision of observations; time and truth are exact.

    Raises:
        ValueError: the data set holds no infos or no measurements (gain environments observe statistics).
        MissingExtraError: Minari is not installed.
    """
    with extra("exchange"):
        import minari
    if isinstance(dataset, str):
        dataset = minari.load_dataset(dataset)
    env = dataset.recover_environment()
    try:
        suite = getattr(env.unwrapped, "suite", None)
        if suite is None:
            raise ValueError(f"{env.spec.id if env.spec else env} observes no measurements, so it has no trajectories")
        kept = dataset.storage.get_episode_metadata(dataset.episode_indices)
        return [
            trajectory_of(episode, env, suite, about.get("seed"))
            for episode, about in zip(dataset.iterate_episodes(), kept, strict=True)
        ]
    finally:
        env.close()


def trajectory_of(episode: Any, env: gymnasium.Env[Any, Any], suite: Any, seed: int | None) -> Trajectory:
    """One episode of a data set."""
    if not episode.infos:
        raise ValueError(f"episode {episode.id} has no infos: the data set was collected without record_infos")
    seen = restored(episode.observations)
    infos = restored(episode.infos)
    measurements = suite.to_measurement(seen)
    count = len(next(iter(measurements.values())))
    ended = "terminated" if bool(episode.terminations[-1]) else "truncated"
    return join(
        [{name: values[row] for name, values in measurements.items()} for row in range(count)],
        [row_of(infos, row) for row in range(count)],
        describe(env, seed) | {"ended": ended},
    )


def row_of(infos: Any, row: int) -> Any:
    """The info of one time step."""
    if isinstance(infos, dict):
        return {key: row_of(value, row) for key, value in infos.items()}
    return np.asarray(infos[row])
