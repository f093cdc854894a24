"""Run environments and keep what happened as trajectories: one episode, or many in parallel processes."""

from __future__ import annotations

import dataclasses
import itertools
import re
import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..filters.support.parallel import in_parallel, progress_bar
from ..filters.support.seeds import child_seeds, root_seed
from ..filters.support.version import poise_version
from .base import Block, PoseEnv
from .data.trajectory import Trajectory, load_trajectory, trusted
from .registration import make_environment

Policy = Callable[[Any], Any]
"""Observation → action."""


def record(
    env: Any, *, seed: int | None = None, policy: Policy | None = None, steps: int | None = None, progress: bool = False
) -> Trajectory:
    """Play one episode and return it; sample 0 is the reset.

    Args:
        env: an environment of this package, in wrappers that leave its observations unchanged or in none; or a
            registered id, which is made and closed here.
        seed: of the episode; None draws one, which the metadata then name.
        policy: chooses the action from the observation; by default the ``neutral_action`` of the environment, or
            seeded samples of its action space if it has none.
        steps: stop after so many steps if the episode has not ended before; None plays to the end.
        progress: show a bar.

    Returns:
        The trajectory of at most ``steps + 1`` samples. Its truth is the pose and the truth of ``info``, its mask
        ``info["scored"]``.

    Raises:
        ValueError: ``steps`` is negative, or the environment does not follow the contract of this package.
    """
    if steps is not None and (not isinstance(steps, int) or isinstance(steps, bool) or steps < 0):
        raise ValueError(f"steps must be None or a whole number of at least 0, got {steps!r}")
    seed = root_seed(seed)
    with opened(env) as env, progress_bar(steps, "record", "step", show=progress) as bar:
        suite = getattr(env.unwrapped, "suite", None)
        if suite is None:
            raise ValueError(f"{env} has no sensor suite: only environments of this package can be recorded")
        choose = policy or default_policy(env, seed)
        # environments of this package give the measurement itself, others an observation to be undone
        measured = getattr(env.unwrapped, "measurement", None)
        observation, info = env.reset(seed=seed)
        if policy is None and steps is None and plays_alone(env):
            trajectory = joined(list(env.unwrapped.rest()), describe(env, seed))
            bar.update(len(trajectory) - 1)
            terminated = env.unwrapped.ending()[1]
            return trajectory.replace(
                metadata=trajectory.metadata | {"ended": "terminated" if terminated else "truncated"}
            )
        rows, infos, ended = [measured() if measured else suite.to_measurement(observation)], [info], "steps"
        for _ in itertools.count() if steps is None else range(steps):
            observation, _, terminated, truncated, info = env.step(choose(observation))
            rows.append(measured() if measured else suite.to_measurement(observation))
            infos.append(info)
            bar.update()
            if terminated or truncated:
                ended = "terminated" if terminated else "truncated"
                break
        return join(rows, infos, describe(env, seed) | {"ended": ended})


def record_once(env: Any, seed: int | None = None) -> Trajectory:
    """One episode (:func:`record`) of an environment that is closed afterwards."""
    with closing(env):
        return record(env, seed=seed)


def plays_alone(env: Any) -> bool:
    """Whether nobody looks at the single steps of an episode, so that it can be played a block at a time."""
    from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker

    while isinstance(env, OrderEnforcing | PassiveEnvChecker):
        env = env.env
    return isinstance(env, PoseEnv) and env.render_mode is None


def joined(blocks: list[Block], metadata: dict[str, Any]) -> Trajectory:
    """A trajectory from the blocks of an episode."""

    def stacked(part: str) -> dict[str, np.ndarray]:
        names = getattr(blocks[0], part)
        return {name: np.concatenate([getattr(block, part)[name] for block in blocks]) for name in names}

    return rated(
        Trajectory(
            time=np.concatenate([block.time for block in blocks]),
            measurements=stacked("measurements"),
            truth=stacked("pose") | stacked("truth"),
            mask=np.concatenate([block.scored for block in blocks]),
            metadata=metadata,
        )
    )


def rated(trajectory: Trajectory) -> Trajectory:
    """The same with the rate of its samples (Hz) in the metadata, where there are several."""
    if len(trajectory) < 2:
        return trajectory
    return trajectory.replace(metadata=trajectory.metadata | {"rate": 1.0 / trajectory.dt})


@contextmanager
def opened(env: Any) -> Iterator[Any]:
    """The environment itself, or the one made from an id and closed afterwards."""
    import gymnasium

    if isinstance(env, gymnasium.vector.VectorEnv):
        raise ValueError("a vector environment cannot be recorded; record its environments one by one")
    if not isinstance(env, str | gymnasium.Env):
        raise ValueError(f"env must be an environment or the id of one, got {env!r}")
    if not isinstance(env, str):
        yield env
        return
    with closing(make_environment(env)) as made:
        yield made


def default_policy(env: Any, seed: int) -> Policy:
    """The neutral action if the environment names one, else seeded samples."""
    neutral = getattr(env.unwrapped, "neutral_action", None)
    if neutral is not None:
        return lambda observation: neutral
    env.action_space.seed(seed)
    return lambda observation: env.action_space.sample()


def join(rows: list[Mapping[str, Any]], infos: list[Mapping[str, Any]], metadata: dict[str, Any]) -> Trajectory:
    """Stack measurements and infos of single time steps to a trajectory."""
    names = {key: set(infos[0].get(key, {})) for key in ("pose", "truth")}
    for step, info in enumerate(infos):
        for key in ("time", "pose", "truth"):
            if key not in info:
                raise ValueError(f"info lacks {key!r} at step {step}; it holds {sorted(info)}")
        for key, expected in names.items():
            if set(info[key]) != expected:
                raise ValueError(f"info[{key!r}] changed from {sorted(expected)} to {sorted(info[key])} at step {step}")
    truth = {
        name: np.stack([np.atleast_1d(np.asarray(info[key][name], dtype=float)) for info in infos])
        for key in ("pose", "truth")
        for name in infos[0][key]
    }
    trajectory = Trajectory(
        time=np.array([float(info["time"]) for info in infos]),
        measurements={name: np.stack([np.asarray(row[name], dtype=float) for row in rows]) for name in rows[0]},
        truth=truth,
        mask=np.array([bool(info.get("scored", True)) for info in infos]),
        metadata=metadata,
    )
    return trusted(rated(trajectory))


def describe(env: Any, seed: int | None) -> dict[str, Any]:
    """What is needed to play the same episode again; a seed of None is an unknown one."""
    spec = env.spec
    identity = type(env.unwrapped).__name__ if spec is None else spec.id
    suite = env.unwrapped.suite
    geometry = getattr(env.unwrapped, "geometry", None)
    extra = {} if geometry is None else {"geometry": geometry.describe()}
    return {
        "name": f"{identity}-{seed}",
        "environment": {"id": identity, "kwargs": plain({} if spec is None else spec.kwargs)},
        "sensors": plain(suite.describe()) if hasattr(suite, "describe") else None,
        "seed": seed,
        "version": poise_version(),
        "source": "simulation",
        **extra,
    }


def plain(value: Any) -> Any:
    """``value`` in JSON's types; any other value becomes its ``repr``."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {item.name: plain(getattr(value, item.name)) for item in dataclasses.fields(value)}
        return {"type": type(value).__name__, **fields}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if callable(value) and hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}"
    return value if isinstance(value, str | int | float | bool | None) else repr(value)


def episode_path(folder: Path, env_id: str, index: int) -> Path:
    """File of an episode: ``hand_motion_0003.h5`` for the fourth one of ``poise/HandMotion-v0``."""
    stem = re.sub(r"-v\d+$", "", env_id.split("/")[-1])
    return folder / f"{re.sub(r'(?<=[a-z])(?=[A-Z])', '_', stem).lower()}_{index:04d}.h5"


def record_episode(env_id: str, options: Mapping[str, Any], seed: int, path: Path) -> Path:
    """Play one episode and write it; the file appears whole or not at all."""
    return named(record_once(make_environment(env_id, **options), seed), path).save(path)


def named(trajectory: Trajectory, path: Path) -> Trajectory:
    """The same with the name of its file."""
    return trajectory.replace(metadata={**trajectory.metadata, "name": path.stem})


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
    """Record episodes of one environment into a folder; what is finished stays, and a second call continues there.

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
            Also an option that the environment does not take.
    """
    for name, value in (("episodes", episodes), ("processes", processes)):
        if value < 1:
            raise ValueError(f"{name} must be at least 1, got {value}")
    folder, options = Path(folder), dict(options or {})
    folder.mkdir(parents=True, exist_ok=True)
    paths = [episode_path(folder, env_id, index) for index in range(episodes)]
    seeds = child_seeds(seed, episodes)
    jobs = [(env_id, options, episode_seed, path) for path, episode_seed in zip(paths, seeds, strict=True)]
    return resumed(record_episode, check_same, jobs, processes, report)


def resumed(
    write: Callable[..., Path],
    check: Callable[..., None],
    jobs: Sequence[tuple[Any, ...]],
    processes: int = 1,
    report: Callable[[Path], None] | None = None,
) -> list[Path]:
    """Write the files of all jobs that are not there yet.

    Args:
        write: writes the file of a job, which appears whole or not at all, and returns its path.
        check: raises ValueError if the file of a job that is there holds something else.
        jobs: arguments of both; the last one is the path.
        processes: how many files are written at a time.
        report: called with the path of every finished file, also with those that were there.

    Returns:
        The paths, in the order of the jobs.
    """
    missing = []
    for job in jobs:
        if not job[-1].exists():
            missing.append(job)
            continue
        check(*job)
        if report is not None:
            report(job[-1])
    for path in in_parallel(write, missing, processes):
        if report is not None:
            report(path)
    return [job[-1] for job in jobs]


def check_same(env_id: str, options: Mapping[str, Any], seed: int, path: Path) -> None:
    """Refuse to mix episodes of different origin in one folder.

    Raises:
        ValueError: the file holds another episode.
    """
    metadata = load_trajectory(path).metadata
    environment = metadata.get("environment") or {}
    found = {"environment": environment.get("id"), "options": environment.get("kwargs"), "seed": metadata.get("seed")}
    refuse_others(path, found, {"environment": env_id, "options": plain(options), "seed": seed})


def refuse_others(path: Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Refuse a file that holds something else than is wanted.

    Raises:
        ValueError: an entry differs; the message names it, and both values, shortened.
    """
    for name, value in wanted.items():
        if found.get(name) != value:
            values = f"{reprlib.repr(found.get(name))}, wanted is {reprlib.repr(value)}"
            another = "other options" if name == "options" else f"another {name}"
            raise ValueError(f"{path} holds an episode of {another}: {values}; choose another folder")
