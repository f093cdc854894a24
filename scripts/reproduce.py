"""Reproduce the study of a paper: published tables and figures beside the results of this package.

Papers: two-gyro, force-inertial, whole-body, accelerometer-array, external-acceleration; `all` runs the five,
several at a time, and writes one page of coverage. --resume continues an interrupted study. If one of the five
fails, the others are finished, the exit status is 1, and --resume repeats the failed one.
"""

from __future__ import annotations

import dataclasses
import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from ..filters.support.files import write_json, write_text
from ..filters.support.parallel import in_parallel
from ..filters.support.resume import is_kept, keep
from ..filters.support.rows import markdown_table
from .experiment import Run, command_line, open_run
from .output import PIPE_WIDTH, Output
from .targets import check_file

if TYPE_CHECKING:
    from ..baselines.studies.kit import Study
    from ..baselines.studies.report import Entry, Report


KEPT = ("page", "pages")
"""Arguments of which no result depends."""
DONE = "done.json"
"""File in the folder of a work that is finished."""
EVERY = "all"
"""In the place of a paper: all of them."""


@dataclass
class Args:
    """Arguments of ``poise reproduce``."""

    paper: tyro.conf.Positional[str]
    """two-gyro, force-inertial, whole-body, accelerometer-array, external-acceleration, or all"""
    quick: bool = False
    """less than five minutes: two riders, one ride each of 20 s, unless given otherwise"""
    seed: int = 0
    """root seed; every ride has a separate child"""
    seeds: int | None = None
    """rides of each rider (default: 3, with --quick 1)"""
    subjects: tuple[int, ...] | None = None
    """numbers of riders (default: 0 1 2 3 4, with --quick 0 1)"""
    duration: float | None = None
    """of a ride, s (default: 60, with --quick 20)"""
    recordings: tuple[Path, ...] = ()
    """recorded data for studies that use them (default: the folder in POISE_DATA, if that is set)"""
    processes: int = 2
    """number of parallel processes"""
    resume: Path | None = None
    """folder of an interrupted run; its results are kept"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    page: Path | None = None
    """with `all`: file for the page of coverage, Markdown"""
    pages: tuple[Path, ...] = ()
    """pages in which the tables of studies are replaced by those of this run, such as docs/*.md"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Do the study, print results as they are computed, and write a run folder with a report."""
    from ..baselines.studies import find_paper
    from .pages.studies import update

    reproduce = None if args.paper == EVERY else find_paper(args.paper)
    if args.page is not None and args.paper != EVERY:
        raise ValueError(f"--page is the page of all papers: use it with {EVERY!r}, not with {args.paper!r}")
    check_file("page", args.page, args.recordings)
    args = filled(args)
    for path in args.pages:
        if not path.is_file():
            raise FileNotFoundError(f"no page at {path}: --pages takes Markdown files that are there")
    for path in args.recordings:
        if not path.exists():
            raise FileNotFoundError(f"no recording at {path}: there is no such file or folder")
    shared = ("quick", "seed", "subjects", "seeds", "duration", "processes", "recordings")
    settings = {name: getattr(args, name) for name in shared}
    if reproduce is None:
        return run_every(args, settings)
    with studying("reproduce", args, settings, f"poise reproduce {args.paper}", may_differ=KEPT) as (study, _, report):
        reproduce(study, report)
    update(args.pages, {args.paper: study.folder}, made_with(args, study.folder))
    return 0


def run_every(args: Args, settings: dict[str, Any]) -> int:
    """Do all studies, one in each process; those that are done are not done again when the run is resumed.

    Returns:
        0, or 1 if a study failed: the others are finished all the same.
    """
    from ..baselines.studies import PAPERS, coverage
    from ..baselines.studies.kit import Study
    from ..baselines.studies.shared_rides import record_rides
    from .pages.studies import update

    check(settings)
    folder = open_run("reproduce", args, may_differ=KEPT)
    rides = folder.folder.resolve() / "rides"
    left = [paper for paper in PAPERS if not is_done(paper, folder)]
    record_rides(Study(folder.folder.resolve(), **settings, rides=rides), left)
    failed: dict[str, str] = {}
    with Output("reproduce", args) as out:
        for paper, error in attempts(left, {**settings, "rides": rides}, folder):
            if error is not None:
                failed[paper] = error
                print(f"{paper} is not computed: {error}", file=sys.stderr)
            elif not out.as_json:
                out.say(f"{paper}: {coverage.counted(coverage.read(folder.folder / paper))}")
        works = {paper: coverage.read(folder.folder / paper) for paper in PAPERS if paper not in failed}
        for paper, rows in works.items():
            shown = [{name: row[name] for name in ("item", "content", "verdict")} for row in rows]
            out.table(shown, paper)
        made = made_with(args, folder.folder)
        page = coverage.page(works, made, failed)
        update(args.pages, {paper: folder.folder / paper for paper in works}, made)
        if args.page is not None:
            write_text(args.page, page)
        out.add(failed=failed)
        out.report(write_text(folder.folder / "report.md", page))
        if failed:
            out.say(f"not computed: {', '.join(failed)}; do that again with --resume {folder.folder}")
    return 1 if failed else 0


def attempts(papers: Sequence[str], settings: dict[str, Any], run: Run) -> Iterator[tuple[str, str | None]]:
    """Do the studies of papers, one in each process; paper and error (None: it is done), as soon as each ends."""
    jobs = [(paper, {**settings, "processes": 1, "progress": False}, run) for paper in papers]
    waiting = dict.fromkeys(papers)
    try:
        for paper, error in in_parallel(attempt, jobs, settings["processes"], label="works", unit="work"):
            del waiting[paper]
            yield paper, error
    except BrokenExecutor as broken:
        # a process was killed, and with it went the results of the others at work
        for paper in waiting:
            yield paper, None if is_done(paper, run) else in_a_line(broken)


def attempt(paper: str, settings: dict[str, Any], run: Run) -> tuple[str, str | None]:
    """:func:`one_study`, with its error in one line; all of it goes to ``error.txt`` in the folder of the work."""
    report = run.folder / paper / "error.txt"
    try:
        one_study(paper, settings, run)
    except Exception as error:
        write_text(report, traceback.format_exc())
        return paper, in_a_line(error)
    report.unlink(missing_ok=True)
    return paper, None


def in_a_line(error: BaseException) -> str:
    """Kind of an error and the first line of what it says."""
    return f"{type(error).__name__}: {error}".splitlines()[0]


def is_done(paper: str, run: Run) -> bool:
    """Whether the study of a paper was finished in this run, with this version of the code."""
    return is_kept(run.folder / paper / DONE, {"paper": paper})


SHOWN = ("quick", "seed", "subjects", "seeds", "duration")
"""arguments that a page names"""


def made_with(args: Any, folder: Path, command: str = "reproduce", shown: Sequence[str] = SHOWN) -> str:
    """Lines of a page that is kept: command with some arguments, version, commit and packages of a run, no machine."""
    state = Run(folder, command, args.seed).versions
    command = command_line(command, args, shown)
    commit = f", commit {state['poise']['commit'][:12]}" if "commit" in state["poise"] else ""
    changed = " with changes" if state["poise"].get("changed") else ""
    packages = ", ".join(f"{name} {version}" for name, version in state["packages"].items() if version)
    made = f"poise {state['poise']['version']}{commit}{changed}, Python {state['python']}"
    return f"- `{command}`\n- {made}\n- {packages}"


def one_study(paper: str, settings: dict[str, Any], run: Run) -> None:
    """Do the study of one paper in a folder of its own in the run's."""
    from ..baselines.studies import find_paper
    from ..baselines.studies.kit import Study
    from ..baselines.studies.report import Report

    folder = dataclasses.replace(run, folder=run.folder / paper)
    folder.figures.mkdir(parents=True, exist_ok=True)
    write_json(folder.folder / "versions.json", run.versions)
    report = Report(folder.folder)
    find_paper(paper)(Study(folder.folder.resolve(), **settings), report)
    folder.write_results(report.results)
    write(f"poise reproduce {paper}", folder, report)
    keep(folder.folder / DONE, {"paper": paper}, len(report.entries))


@contextmanager
def studying(
    command: str,
    args: Any,
    settings: dict[str, Any],
    title: str,
    width: int = PIPE_WIDTH,
    may_differ: Sequence[str] = (),
) -> Iterator[tuple[Study, Output, Report]]:
    """A study in a new or resumed run folder: entries of its report are printed and written as they are found.

    ``settings`` are fields of :class:`.Study`, ``width`` the columns of a table that does not go to a terminal;
    ``may_differ`` as in :func:`.open_run`.

    Raises:
        ValueError: a setting is out of its range, or what :func:`.open_run` refuses.
    """
    from ..baselines.studies.kit import Study
    from ..baselines.studies.report import Report

    check(settings)
    folder = open_run(command, args, may_differ)
    study = Study(folder.folder.resolve(), **settings)
    with Output(command, args) as out:

        def publish(entry: Entry) -> None:
            show(entry, out, width)
            write(title, folder, report)

        report = Report(folder.folder, publish)
        yield study, out, report
        folder.write_results(report.results)
        out.report(write(title, folder, report))


def check(settings: dict[str, Any]) -> None:
    """Refuse wrong settings of a study, before a folder is made.

    Raises:
        ValueError: names the setting.
    """
    from ..baselines.studies.kit import Study
    from ..envs.bicycle.rider.anthropometry import SUBJECTS

    if not all(0 <= subject < len(SUBJECTS) for subject in settings["subjects"]):
        raise ValueError(f"subjects must be numbers from 0 to {len(SUBJECTS) - 1}, got {list(settings['subjects'])}")
    Study(Path(), **settings)


def filled(args: Args) -> Args:
    """The arguments with what ``quick`` stands for where nothing was given."""
    few = args.quick
    data = os.environ.get("POISE_DATA")
    return dataclasses.replace(
        args,
        seeds=(1 if few else 3) if args.seeds is None else args.seeds,
        subjects=((0, 1) if few else (0, 1, 2, 3, 4)) if args.subjects is None else args.subjects,
        duration=(20.0 if few else 60.0) if args.duration is None else args.duration,
        recordings=(Path(data),) if data and not args.recordings else args.recordings,
    )


def show(entry: Entry, out: Output, width: int = PIPE_WIDTH) -> None:
    """Print one entry; the document gets its rows, and figures as they are named."""
    if entry.rows:
        out.table(entry.rows, entry.title, width=width)
        text = entry.text
    elif entry.figure is not None:
        text = f"figure: {entry.figure} ({entry.title})"
    else:
        text = "\n".join(part for part in (entry.title, entry.text) if part)
    if not out.as_json:
        out.say(f"{text}\n" if text else "")


def write(title: str, folder: Run, report: Report) -> Path:
    """Write ``report.md`` with all entries so far."""
    parts = [f"# {title}"]
    for entry in report.entries:
        if entry.title:
            parts.append(f"## {entry.title}")
        if entry.rows:
            parts.append(markdown_table(entry.rows))
        if entry.figure is not None:
            parts.append(f"![{entry.title}]({entry.figure.relative_to(folder.folder).as_posix()})")
        if entry.text:
            parts.append(entry.text)
    parts.append(f"## Provenance\n\n{folder.provenance}")
    return write_text(folder.folder / "report.md", "\n\n".join(parts) + "\n")
