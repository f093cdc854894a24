"""Run of a command and its folder: ``runs/<command>/<time>-<seed>/``.

| file | holds |
|---|---|
| ``args.json`` | command, seed and every argument |
| ``versions.json`` | Python, platform, poise (with commit), packages |
| ``results.csv`` | one number per row: estimator, trajectory, quantity, metric, value, unit |
| ``report.md`` | report in Markdown |
| ``figures/`` | plots, drawn from ``results.csv`` |
"""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import platform
import shlex
import subprocess
import sys
import warnings
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..filters.support.files import write_json, write_text
from ..filters.support.parallel import processors
from ..filters.support.resume import refuse_changes
from ..filters.support.rows import RESULT, jsonable, records
from ..filters.support.version import ROOT, code_version, package_version

if TYPE_CHECKING:
    from ..envs.data.trajectory import Trajectory

SIMULATED = "simulated"
"""Set of trajectories that no file holds."""
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "filterpy",
    "gymnasium",
    "pybullet",
    "torch",
    "stable-baselines3",
    "vqf",
    "imufusion",
)
"""Packages whose versions can change a result."""


NO_RESULT = frozenset({"resume", "runs", "processes", "json", "export"})
"""Arguments of commands that no result depends on."""


@dataclasses.dataclass(frozen=True)
class Run:
    """One run of a command: its folder and the seed it started from."""

    folder: Path
    """``<root>/<command>/<time>-<seed>``."""
    command: str
    """Name of the command."""
    seed: int
    """Root seed."""

    @property
    def figures(self) -> Path:
        """Folder of the plots."""
        return self.folder / "figures"

    @property
    def versions(self) -> dict[str, Any]:
        """Python, platform, poise and packages that the run was made with."""
        return json.loads((self.folder / "versions.json").read_text(encoding="utf-8"))

    @property
    def results(self) -> Path:
        """Path of the table of results."""
        return self.folder / "results.csv"

    def write_results(self, rows: Iterable[Any]) -> Path:
        """Write all results so far; see :func:`write_results`."""
        return write_results(self.results, rows)

    @property
    def provenance(self) -> str:
        """What a report depends on, in Markdown: command, seed, versions."""
        state = self.versions
        packages = ", ".join(f"{name} {version}" for name, version in state["packages"].items() if version)
        return (
            f"- command: `poise {self.command}`, arguments in `args.json`, root seed {self.seed}\n"
            f"- poise {state['poise']['version']}, Python {state['python']}, {state['platform']}\n"
            f"- {packages}"
        )

    def write_report(self, title: str, sections: Mapping[str, str]) -> Path:
        """Write ``report.md``: a title, a heading and Markdown text a section, and what it depends on."""
        every = {**sections, "Provenance": self.provenance}
        parts = [f"# {title}", *(f"## {heading}\n\n{text.strip()}" for heading, text in every.items())]
        return write_text(self.folder / "report.md", "\n\n".join(parts) + "\n")


def start_run(command: str, args: Any, seed: int, root: str | Path = "runs") -> Run:
    """Make the folder of a new run, ``root/command/<time>-<seed>``, and write down its arguments and versions.

    Args:
        command: name of the command.
        args: its arguments, a dataclass instance or a mapping.
        seed: root seed.
        root: folder of all runs; made if missing.

    Returns:
        The run; its folder did not exist before, also when two runs start within a second.
    """
    now = datetime.now().astimezone()
    folder = new_folder(Path(root) / command, f"{now:%Y%m%d-%H%M%S}-{seed}")
    run = Run(folder, command, seed)
    run.figures.mkdir()
    write_json(folder / "args.json", jsonable({"command": command, "seed": seed, "args": args}))
    write_json(folder / "versions.json", {"started": now.isoformat(timespec="seconds"), **versions()})
    return run


def open_run(command: str, args: Any, may_differ: Collection[str] = ()) -> Run:
    """Start a run, and say on standard error how to resume it; or resume the one in the folder ``args.resume``.

    Args:
        command: name of the command.
        args: its arguments, a dataclass instance with ``seed``, ``runs`` and ``resume``.
        may_differ: arguments that a resumed run need not share with what is there, besides :data:`NO_RESULT`.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is a run of another command or of other arguments.
    """
    if args.resume is None:
        made = start_run(command, args, args.seed, args.runs)
        print(f"poise: an interrupted run continues with --resume {made.folder}", file=sys.stderr, flush=True)
        return made
    path = args.resume / "args.json"
    if not path.exists():
        raise FileNotFoundError(f"there is no run in {args.resume}")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        before = {**found["args"], "command": found["command"]}
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{path} does not say how the run was started: start a new one") from None
    now = {**jsonable(args), "command": command}
    refuse_changes(args.resume, before, now, [name for name in now if name not in {*NO_RESULT, *may_differ}])
    return Run(args.resume, command, args.seed)


def known_recordings(paths: Sequence[Path]) -> list[Trajectory]:
    """Recordings of files and folders that know an orientation or the inclination; others are named in warnings.

    Raises:
        ValueError: paths are given but hold none, or a file that was named itself cannot be read.
    """
    from .recordings.load import load_all, passed_over_text, plain_warnings

    if not paths:
        return []
    with plain_warnings():
        loaded, passed_over = load_all(paths)
        known = [trajectory for trajectory in loaded if "up" in trajectory.quantities]
        if not known:
            raise ValueError(f"recordings must know an orientation, none of {', '.join(map(str, paths))} does")
        for other in loaded:
            if "up" not in other.quantities:
                warnings.warn(f"{other.name} is passed over: it does not know its orientation", stacklevel=2)
        if passed_over:
            warnings.warn(f"passed over: {passed_over_text(passed_over)}", stacklevel=2)
    return known


def recorded_sets(paths: Sequence[Path]) -> dict[str, list[Trajectory]]:
    """Name of a folder or file → its recordings with a known orientation, on their uniform grids.

    Recordings of the same name in several folders are told apart by their folder.

    Raises:
        ValueError: see :func:`known_recordings`, two paths have the same name, or one that of simulated trajectories.
    """
    names = [path.resolve().name for path in paths]
    if len({*names, SIMULATED}) <= len(names):
        raise ValueError(f"recordings must be paths of different names, none {SIMULATED!r}, got {names}")
    loaded = (known_recordings((path,)) for path in paths)
    sets = {name: [each.on_grid() for each in some] for name, some in zip(names, loaded, strict=True)}
    met = Counter(each.name for some in sets.values() for each in some)

    def told_apart(group: str, one: Trajectory) -> Trajectory:
        return one if met[one.name] == 1 else one.replace(metadata={**one.metadata, "name": f"{group}/{one.name}"})

    return {group: [told_apart(group, each) for each in some] for group, some in sets.items()}


def command_line(command: str, args: Any, options: Sequence[str]) -> str:
    """The command that repeats the run.

    Args:
        command: its name.
        args: its arguments, a dataclass instance; a first field that is a text is the positional one.
        options: fields that the result depends on; those that are None or empty are left out.
    """
    first = getattr(args, dataclasses.fields(args)[0].name)
    words = ["poise", command, *([first] if isinstance(first, str) else [])]
    for name in options:
        value = getattr(args, name)
        if value is True:
            words.append(f"--{name.replace('_', '-')}")
        elif value is not False and value not in (None, ()):
            words += [f"--{name.replace('_', '-')}", *map(str, value if isinstance(value, tuple) else (value,))]
    return shlex.join(words)


def new_folder(parent: Path, name: str) -> Path:
    """Make and return ``parent/name``, with ``-2``, ``-3`` … appended if that is taken."""
    parent.mkdir(parents=True, exist_ok=True)
    attempt = 1
    while True:
        folder = parent / (name if attempt == 1 else f"{name}-{attempt}")
        try:
            folder.mkdir()
        except FileExistsError:
            attempt += 1
        else:
            return folder


def write_results(path: Path, rows: Iterable[Any]) -> Path:
    """Write rows of results as CSV, atomically.

    Args:
        path: file to (re)place.
        rows: mappings, named tuples, dataclass instances or a data frame, with exactly the fields :data:`.RESULT`, or
            all with ``suite`` besides, which then comes first.

    Raises:
        ValueError: a row has other fields.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    found = records(rows)
    columns = ("suite", *RESULT) if found and "suite" in found[0] else RESULT
    writer.writerow(columns)
    for record in found:
        if set(record) != set(columns):
            raise ValueError(f"a result has the fields {', '.join(columns)}, got {', '.join(map(str, record))}")
        writer.writerow([repr(float(record[name])) if name == "value" else record[name] for name in columns])
    return write_text(path, text.getvalue())


def versions(packages: Sequence[str] = PACKAGES) -> dict[str, Any]:
    """Return what a result depends on besides its arguments; imports none of the packages."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processors": processors(),
        "poise": {"version": package_version("poise"), "code": code_version(), **git_state(ROOT)},
        "packages": {name: package_version(name) for name in packages},
    }


def git_state(checkout: Path) -> dict[str, Any]:
    """Return commit and whether files differ from it; empty when ``checkout`` is not a git checkout."""
    # Without this test git would answer for a repository further up, that of somebody's project.
    if not (checkout / ".git").exists():
        return {}
    try:
        commit = _git(checkout, "rev-parse", "HEAD")
        changed = bool(_git(checkout, "status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.SubprocessError):
        return {}
    return {"commit": commit, "changed": changed}


def _git(checkout: Path, *words: str) -> str:
    return subprocess.run(
        ["git", "-C", str(checkout), *words], capture_output=True, text=True, check=True, timeout=10
    ).stdout.strip()
