"""Tasks of a comparison: each makes its trajectories and runs all estimators; in parallel, resumable at any moment."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...envs.data.trajectory import Trajectory
from ...filters.compile.cache import cache_folder, unless_full
from ...filters.support.parallel import in_parallel
from ...filters.support.resume import is_kept, keep, kept
from ...filters.support.rows import RESULT
from ...filters.support.seeds import child_seeds
from ..evaluation import evaluate
from ..scoring import has_truth
from .data_sets import GESTURES, RIDES, contenders, groups_of, hand_episode, ride_imus
from .recommendation import results_of

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Task:
    """One piece of work of a comparison.

    Attributes:
        suite: to which table its results belong.
        name: distinct within the suite.
        make: function of a module that returns the trajectories.
        arguments: of ``make``.
        options: further ones, by name.
        settings: of :func:`poise.evaluate`.
        suffix: put behind the names of the data sets.
    """

    suite: str
    name: str
    make: Callable[..., list[Trajectory]]
    arguments: tuple[Any, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    suffix: str = ""

    @property
    def file(self) -> str:
        """Name of the file with its results."""
        return f"{re.sub(r'[^A-Za-z0-9.+-]+', '_', f'{self.suite} {self.name}')}.json"

    def trajectories(self) -> list[Trajectory]:
        """Simulated or loaded, the same at every call."""
        return self.make(*self.arguments, **self.options)


@dataclass(frozen=True)
class Results:
    """What the tasks of one suite found.

    Attributes:
        table: rows as of :func:`poise.evaluate`, with its ``attrs``; measures beyond RMS included.
        groups: trajectory → group.
        recordings: errors by recording with the statistics of its motion (:func:`.results_of`).
    """

    table: pandas.DataFrame
    groups: dict[str, str]
    recordings: list[dict[str, Any]]


def hand_tasks(seed: int, episodes: int, **options: Any) -> list[Task]:
    """Simulated motion of a hand-held device; every episode has a child of the seed."""
    seeds = iter(child_seeds(seed, episodes * len(GESTURES)))
    return [
        Task("simulation", f"{gesture}-{number}", hand_episode, (gesture, number, next(seeds)), options)
        for gesture in GESTURES
        for number in range(1, episodes + 1)
    ]


def imu_ride_tasks(seed: int, scenarios: Sequence[str] = RIDES) -> list[Task]:
    """Single IMUs on simulated rides; every ride has a subject of its own and a child of the seed."""
    seeds = child_seeds(seed, len(scenarios))
    return [
        Task("rides", scenario, ride_imus, (scenario, subject, child))
        for subject, (scenario, child) in enumerate(zip(scenarios, seeds, strict=True))
    ]


def given(trajectory: Trajectory) -> list[Trajectory]:
    """A trajectory that is there already."""
    return [trajectory]


def recording_tasks(trajectories: Sequence[Trajectory], suite: str = "recordings", **more: Any) -> list[Task]:
    """Recordings that are loaded already."""
    return [Task(suite, one.name, given, (one,), **more) for one in trajectories]


def run_tasks(
    tasks: Sequence[Task],
    folder: Path,
    names: Sequence[str],
    channels: Sequence[str],
    *,
    processes: int = 1,
    offline: bool = False,
    reference: str | None = None,
) -> dict[str, Results]:
    """Run what has no results in the folder yet, and put all together in the order of the tasks.

    Args:
        tasks: with distinct files.
        folder: of their results; one file a task, which appears whole or not at all.
        names: of estimators; empty for all that read no other channels than these.
        channels: see ``names``.
        processes: how many tasks run at a time.
        offline: also run the smoothers.
        reference: see :func:`poise.evaluate`.

    Returns:
        Suite → results. They do not depend on ``processes`` or on an interruption.

    Raises:
        ValueError: two tasks of one suite have one name; or in none of a suite anything could be run.
    """
    files = [task.file for task in tasks]
    twice = sorted({file for file in files if files.count(file) > 1})
    if twice:
        raise ValueError(f"two tasks share the file {twice[0]}: give their trajectories different names")
    folder.mkdir(parents=True, exist_ok=True)
    jobs = [
        (task, folder / task.file, tuple(names), tuple(channels), offline, reference)
        for task in tasks
        if not is_kept(folder / task.file, {})
    ]
    if processes > 1 and len(jobs) > 1:
        compile_ahead(names, channels, offline, processes)
    for _ in in_parallel(run_task, jobs, processes, label="compare", unit="task"):
        pass
    suites = dict.fromkeys(task.suite for task in tasks)
    return {suite: collected([folder / task.file for task in tasks if task.suite == suite]) for suite in suites}


def compile_ahead(names: Sequence[str], channels: Sequence[str], offline: bool, processes: int) -> None:
    """Divide the compiling of all estimators among processes, which each would begin with the same ones.

    A file in the cache says that it was done for this code: what is compiled already need not be run for it.
    """
    labels, folder = list(contenders(names, channels)), cache_folder()
    done, key = None if folder is None else folder / "ahead.json", {"labels": labels, "offline": offline}
    if done is None or is_kept(done, key):
        return
    shares = [(labels[first::processes], tuple(names), tuple(channels), offline) for first in range(processes)]
    for _ in in_parallel(compile_some, shares, processes):
        pass
    with unless_full(done.parent):
        keep(done, key, None)


def compile_some(labels: Sequence[str], names: Sequence[str], channels: Sequence[str], offline: bool) -> None:
    """Run some of the estimators on two seconds of motion."""
    (motion,) = hand_episode("mixed", 1, 0, duration=2.0)
    found = contenders(names, channels)
    with warnings.catch_warnings(), suppress(ValueError):
        warnings.simplefilter("ignore")
        evaluate({label: found[label] for label in labels}, motion, offline=offline)


def run_task(
    task: Task, path: Path, names: Sequence[str], channels: Sequence[str], offline: bool, reference: str | None
) -> Path:
    """Run all estimators on one task's trajectories and keep the results."""
    started = time.perf_counter()
    trajectories = task.trajectories()
    made = time.perf_counter()
    found: dict[str, Any] = {"groups": groups_of(trajectories)}
    settings = {"offline": offline, "reference": reference, "detailed": True, **task.settings}
    try:
        # kept with the results, and issued when these are collected, also after an interruption
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            table = evaluate(contenders(names, channels), trajectories, **settings)
        found["warnings"] = list(dict.fromkeys(str(one.message) for one in caught))
    except ValueError as reason:  # nothing could be run here; other tasks go on
        found |= {"rows": [], "attrs": {"refused": str(reason)}, "recordings": []}
    else:
        six_axes = {"imu/gyr", "imu/acc"}  # of which the statistics of a motion are
        known = [one for one in trajectories if has_truth(one) and six_axes <= set(one.measurements)]
        found |= {
            "rows": [[None if cell != cell else cell for cell in row] for row in table.itertuples(index=False)],
            "attrs": table.attrs,
            "recordings": results_of(known, table, task.suffix),
        }
    found["seconds"] = {"trajectories": made - started, "estimators": time.perf_counter() - made}
    return keep(path, {}, found, allow_nan=False)


def collected(files: Sequence[Path]) -> Results:
    """Results of the tasks of one suite.

    Raises:
        ValueError: nothing could be run in any of them.
    """
    from ..error_table import ErrorTable

    parts = [kept(file) for file in files]
    for text in dict.fromkeys(text for part in parts for text in part.get("warnings", [])):
        warnings.warn(text, stacklevel=3)
    rows = [[float("nan") if cell is None else cell for cell in row] for part in parts for row in part["rows"]]
    if not rows:
        raise ValueError("; ".join(dict.fromkeys(part["attrs"]["refused"] for part in parts)))
    table = ErrorTable(rows, columns=list(RESULT))
    attrs = [part["attrs"] for part in parts]
    table.attrs |= {
        "skipped": [tuple(item) for each in attrs for item in each.get("skipped", [])],
        "references": {name: value for each in attrs for name, value in each.get("references", {}).items()},
        "reference_clock": next((each["reference_clock"] for each in attrs if "reference_clock" in each), "recorded"),
    }
    groups = {name: group for part in parts for name, group in part["groups"].items()}
    return Results(table, groups, [one for part in parts for one in part["recordings"]])
