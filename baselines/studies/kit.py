"""What a study computes with: rides and other results that are computed once a run folder and version, in parallel."""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.bicycle.several_suites import record_suite_files
from ...envs.data.trajectory import Trajectory, load_trajectory
from ...envs.record import plain, record_episode
from ...filters.support.files import write_text
from ...filters.support.parallel import in_parallel
from ...filters.support.resume import is_kept, keep, kept
from ...filters.support.seeds import named_seed
from ...filters.support.version import code_version

RIDER = "poise/RiderBicycle-v0"
OF_SENSORS = ("suite", "sensors", "rate")
"""Arguments of the environment that leave the ride as it is."""
RideJob = tuple[str, dict[str, Any], int, Path]
"""Environment, its arguments, seed and file of a ride, as :func:`.record_episode` takes them."""


@dataclass(frozen=True)
class Study:
    """How much is ridden and computed for one paper, and where it is kept.

    Rides are ``subjects`` x ``seeds``; what is finished stays in ``folder``, so that an interrupted study is resumed.
    Rides and results belong to the code that computed them: another version computes them again, with a notice.
    """

    folder: Path
    """the run's; rides go to ``rides/``, other results to ``cache/``"""
    quick: bool = False
    """fewer and shorter: a study should take less than five minutes on two processors"""
    seed: int = 0
    """root seed"""
    subjects: tuple[int, ...] = (0, 1, 2, 3, 4)
    """numbers of riders"""
    seeds: int = 3
    """rides of each rider"""
    duration: float = 60.0
    """s of a ride"""
    processes: int = 2
    """how much is computed at a time"""
    recordings: tuple[Path, ...] = ()
    """recorded data (files or folders) to look at as well"""
    progress: bool = True
    """show bars on the standard error"""
    rides: Path | None = None
    """where rides go that several studies share; None for ``rides/`` in the folder"""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
        if not self.subjects or any(subject < 0 for subject in self.subjects):
            raise ValueError(f"subjects must be numbers of riders, 0 or more, got {list(self.subjects)}")
        for name in ("seeds", "processes"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 1.0 <= self.duration < float("inf"):
            raise ValueError(f"duration must be at least 1 s and finite, got {self.duration}")

    def seed_of(self, *names: str | int) -> int:
        """A seed below 2³² that depends on the root seed and on the names only."""
        return named_seed(self.seed, *names)

    def ride_jobs(
        self,
        scenario: str,
        suite: str | Sequence[str],
        *,
        sensors: str = "paper",
        rate: float | None = None,
        fidelity: str = "full",
        duration: float | None = None,
        style: str | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> list[RideJob]:
        """What records the rides of every subject and seed in ``poise/RiderBicycle-v0``.

        The motion of a ride depends on the root seed, scenario, subject and index alone: other sensors see the same
        ride (if duration, fidelity and style are the same).

        Args:
            scenario: name, such as ``outdoor`` or ``slalom+bumps``.
            suite: of sensors, or a list of channels.
            sensors: ``paper``, ``ideal`` or a device.
            rate: Hz; None for that of the suite.
            fidelity: ``full`` or ``lumped``.
            duration: s; None for that of the study.
            style: of the rider; None for that of the scenario.
            options: further arguments of the environment.

        Returns:
            One for each ride, named ``<scenario>-<subject>-<index>``, subjects first.
        """
        settings = {
            "scenario": scenario,
            "suite": suite if isinstance(suite, str) else list(suite),
            "sensors": sensors,
            "rate": rate,
            "fidelity": fidelity,
            "duration": self.duration if duration is None else float(duration),
            "style": style,
            **(options or {}),
        }
        wanted = [
            (f"{scenario}-{subject}-{index}", self.seed_of(scenario, subject, index), {**settings, "subject": subject})
            for subject in self.subjects
            for index in range(self.seeds)
        ]
        suite_name = suite if isinstance(suite, str) else "channels"
        return self._jobs(RIDER, f"{scenario}-{suite_name}-{sensors}", settings, wanted)

    def ride_files(self, scenario: str, suite: str | Sequence[str], **settings: Any) -> list[Path]:
        """Rides of :meth:`ride_jobs`, which has the same arguments, recorded once.

        Returns:
            Their files, for :func:`load_ride`: :meth:`map` should get them rather than long trajectories. A ride that
            ended in a fall is as long as the rider was up, and its ``metadata["ended"]`` is ``terminated``.
        """
        return self._recorded(scenario, self.ride_jobs(scenario, suite, **settings))

    def episodes(
        self, env_id: str, count: int, *, name: str, options: Mapping[str, Any] | None = None
    ) -> list[Trajectory]:
        """Episodes of any environment, recorded once.

        Args:
            env_id: such as ``poise/BicycleFixture-v0``.
            count: how many.
            name: of this kind of episode: seeds depend on the root seed, it and the index alone.
            options: arguments of the environment.

        Returns:
            Trajectories named ``<name>-<index>``.
        """
        settings = dict(options or {})
        wanted = [(f"{name}-{index}", self.seed_of(env_id, name, index), settings) for index in range(count)]
        return [load_ride(path) for path in self._recorded(name, self._jobs(env_id, name, settings, wanted))]

    def _jobs(
        self, env_id: str, label: str, settings: Mapping[str, Any], wanted: list[tuple[str, int, dict[str, Any]]]
    ) -> list[RideJob]:
        origin = [env_id, plain(settings), code_version("filters", "envs")]
        folder = (self.rides or self.folder / "rides") / f"{slug(label)}-{digest(origin)}"
        return [(env_id, options, seed, folder / f"{slug(name)}.h5") for name, seed, options in wanted]

    def _recorded(self, label: str, jobs: list[RideJob]) -> list[Path]:
        self._compute(record_episode, [job for job in jobs if not job[-1].exists()], label, "ride")
        return [job[-1] for job in jobs]

    def record_together(self, jobs: Iterable[RideJob]) -> None:
        """Record rides of ``poise/RiderBicycle-v0`` that are not there yet, each once for all suites that want it.

        A ride that cannot be recorded is left out: the study that needs it tries again, and its error counts.
        """
        together: dict[str, list[RideJob]] = {}
        for job in jobs:
            _, options, seed, path = job
            if not path.exists():
                motion = {name: value for name, value in options.items() if name not in OF_SENSORS}
                together.setdefault(digest([plain(motion), seed]), []).append(job)
        self._compute(record_or_leave, [(each,) for each in together.values()], "rides", "ride")

    def cached(self, key: str, function: Callable[..., Any], *args: Any) -> Any:
        """``function(*args)``, computed once a run folder and version of the code.

        Args:
            key: name of the result, of its own in this study.
            function: a function of a module, gives what JSON knows (arrays become lists).
            args: what it takes; if they change (as pickled), the result is computed again.

        Raises:
            TypeError: the result is not one of JSON's types.
        """
        return self.map(key, function, [args], bar=False)[0]

    def map(self, key: str, function: Callable[..., Any], jobs: Iterable[tuple[Any, ...]], *, bar: bool = True) -> list:
        """``[function(*job) for job in jobs]``, several at a time, each computed once a run folder and version.

        Args:
            key: name of the results, of its own in this study; also the bar's label.
            function: of a module (processes must find it), gives what JSON knows (arrays become lists).
            jobs: arguments of each call.
            bar: show a bar.

        Raises:
            TypeError: a result is not one of JSON's types.
        """
        import joblib

        folder = self.folder / "cache" / slug(key)
        name = f"{function.__module__}:{function.__qualname__}"
        tasks = [
            (folder / f"{index:04d}.json", {"function": name, "arguments": joblib.hash(job)}, function, job)
            for index, job in enumerate(jobs)
        ]
        missing = [task for task in tasks if not is_kept(*task[:2])]
        self._compute(compute, missing, key if bar else "", "job")
        return [kept(task[0]) for task in tasks]

    def _compute(self, function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], label: str, unit: str) -> None:
        """Call a function that leaves files, several at a time; warn if another version has worked in the folder."""
        path, now = self.folder / "code.txt", code_version()
        before = path.read_text(encoding="utf-8").strip() if path.exists() else None
        if before not in (None, now):
            text = f"{self.folder} holds results of poise {before}; this is poise {now}: they are computed again"
            print(text, file=sys.stderr)
        if before != now:
            write_text(path, f"{now}\n")
        label = label if self.progress else ""
        for _ in in_parallel(function, jobs, self.processes, label=label, unit=unit):
            pass


def record_or_leave(jobs: Sequence[RideJob]) -> None:
    """Record one ride for all jobs, or none of them if it fails."""
    _, options, seeds, paths = zip(*jobs, strict=True)
    try:
        record_suite_files(options, seeds[0], paths)
    except Exception as error:
        print(f"{paths[0].stem} is recorded later: {type(error).__name__}: {error}", file=sys.stderr)


def compute(path: Path, key: dict[str, Any], function: Callable[..., Any], job: tuple[Any, ...]) -> None:
    """Call and keep the result in a file."""
    keep(path, key, function(*job), default=as_list)


def as_list(value: Any) -> Any:
    """What JSON does not know by itself: arrays and numbers of NumPy, dataclasses."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    raise TypeError(f"a result must be made of numbers, texts, lists and mappings, got {type(value).__name__}")


def load_ride(path: Path) -> Trajectory:
    """A recorded ride, with subject, index and group in its metadata."""
    ride = load_trajectory(path)
    kwargs = (ride.metadata.get("environment") or {}).get("kwargs") or {}
    known = {"index": int(path.stem.rsplit("-", 1)[1]), "group": kwargs.get("scenario", path.stem.rsplit("-", 1)[0])}
    if "subject" in kwargs:
        known["subject"] = kwargs["subject"]
    return ride.replace(metadata={**ride.metadata, **known})


def slug(text: str) -> str:
    """A text as the name of a file."""
    return re.sub(r"[^A-Za-z0-9.+_-]+", "_", text)


def digest(value: Any) -> str:
    """Eight hexadecimal digits of a SHA-256, to name settings."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:8]
