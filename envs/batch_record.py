"""Record many episodes in parallel processes; what is finished stays, and a second call goes on from there."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..filters.support.parallel import in_parallel
from ..filters.support.seeds import child_seeds
from .data.trajectory import Trajectory, load_trajectory


def episode_path(folder: Path, env_id: str, index: int) -> Path:
    """File of an episode: ``hand_motion_0003.h5`` for the fourth one of ``poise/HandMotion-v0``."""
    stem = re.sub(r"-v\d+$", "", env_id.split("/")[-1])
    return folder / f"{re.sub(r'(?<=[a-z])(?=[A-Z])', '_', stem).lower()}_{index:04d}.h5"


def record_episode(env_id: str, options: Mapping[str, Any], seed: int, path: Path) -> Path:
    """Play one episode and write it; the file appears whole or not at all."""
    import gymnasium

    import_environments()
    env = gymnasium.make(env_id, **options)
    try:
        from .record import record

        trajectory = record(env, seed=seed)
    finally:
        env.close()
    return trajectory.replace(metadata={**trajectory.metadata, "name": path.stem}).save(path)


def import_environments() -> None:
    """Register the environments, also in a worker process that did not import the package."""
    from . import register_environments

    register_environments()


def record_episodes(
    env_id: str,
    folder: str | Path,
    *,
    episodes: int,
    seed: int = 0,
    options: Mapping[str, Any] | None = None,
    processes: int = 1,
    report: Callable[[Path], None] | None = None,
) -> list[Path]:
    """Record episodes of one environment into a folder.

    Args:
        env_id: registered id.
        folder: where the files go; episodes that are there already, with the same seed and options, are kept.
        episodes: how many there shall be.
        seed: root seed; every episode has a child of its own, whatever the number of processes.
        options: arguments of the environment.
        processes: how many episodes are played at a time.
        report: called with the path of every finished episode, also with those that were there.

    Returns:
        The paths, in order.

    Raises:
        ValueError: a number is not positive, or a file in the folder is an episode of another environment, seed or
            with other options (nothing is overwritten).
    """
    for name, value in (("episodes", episodes), ("processes", processes)):
        if value < 1:
            raise ValueError(f"{name} must be at least 1, got {value}")
    folder, options = Path(folder), dict(options or {})
    folder.mkdir(parents=True, exist_ok=True)
    paths = [episode_path(folder, env_id, index) for index in range(episodes)]
    seeds = child_seeds(seed, episodes)
    missing = []
    for path, episode_seed in zip(paths, seeds, strict=True):
        if path.exists():
            check_same(load_trajectory(path), env_id, options, episode_seed, path)
            if report is not None:
                report(path)
        else:
            missing.append((env_id, options, episode_seed, path))
    for path in in_parallel(record_episode, missing, processes):
        if report is not None:
            report(path)
    return paths


def check_same(trajectory: Trajectory, env_id: str, options: Mapping[str, Any], seed: int, path: Path) -> None:
    """Refuse to mix episodes of different origin in one folder."""
    from .record import plain

    environment = trajectory.metadata.get("environment") or {}
    expected = {"environment": env_id, "seed": seed, **plain(options)}
    kwargs = environment.get("kwargs") or {}
    found = {"environment": environment.get("id"), "seed": trajectory.metadata.get("seed")}
    found |= {name: kwargs.get(name) for name in options}
    if found != expected:
        raise ValueError(f"{path} holds another episode ({found}) than is wanted ({expected}); choose another folder")
