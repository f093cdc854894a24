"""Compare all estimators on simulated motion and, if given, on recordings: tables with intervals, figures, a report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..filters.support.files import write_json, write_text
from ..filters.support.optional import MissingExtraError
from ..filters.support.rows import RESULT, markdown_table
from .experiment import open_run
from .output import Output
from .report import draw_example, kinds_of, print_comparison
from .targets import check_file

if TYPE_CHECKING:
    import pandas

    from ..baselines.comparison.tasks import Results, Task
    from ..envs.data.trajectory import Trajectory
    from .experiment import Run

REGRESSIONS = "Errors that grew by more than 2 % against the baseline"
STEPS = 100
"""Samples of which each is timed as a step."""


@dataclass
class Args:
    """Arguments of ``poise benchmark``."""

    suite: Literal["all", "hand", "rider"] = "all"
    """hand: estimators of one IMU on simulated hand motion and on recordings; rider: the papers' filters of
    rider and bicycle, networks and simple references, on riders, scenarios and styles kept from training; all:
    both, and the inclination of an IMU on the bicycle and on the rider's trunk"""
    seed: int = 0
    """root seed of motions and sensor errors"""
    episodes: int = 3
    """simulated episodes of each gesture"""
    sensors: str = "xsens-mtw-awinda"
    """sensor preset of the simulation"""
    recordings: tuple[Path, ...] = ()
    """recordings, or folders of them, to compare on as well"""
    estimators: tuple[str, ...] = ()
    """names of estimators, or files of trained weights (default: all that are installed, except some slow loops); on
    riders a paper's filter stands for all that is compared with it"""
    reference: str = "auto"
    """replacement of a missing truth (agreement, not error), see `poise evaluate --help`"""
    offline: bool = False
    """run the smoother of every estimator that has one as well"""
    trials: int = 5
    """trials of each test of the external-acceleration paper; 0 leaves them out"""
    baseline: Path | None = None
    """results.csv of an earlier run: errors that grew by more than 2 % are listed, and the exit status is 1"""
    save: Path | None = None
    """file for the errors that `poise recommend` and `poise list` read; those that this run does not compute
    stay in it"""
    quick: bool = False
    """small version: one episode, trial or ride of each kind, without the references that learn"""
    sweep: bool = False
    """of the rider suite: vary noise scale, gaps, mounting, measured geometry and rate instead of printing the
    tables"""
    processes: int = 2
    """number of parallel processes"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    resume: Path | None = None
    """folder of an interrupted run; its results are kept"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Simulate, load, estimate, compare."""
    import pandas

    from ..baselines.comparison.recommendation import load_results
    from ..baselines.comparison.tasks import run_tasks
    from .comparison.riders import rider_settings, rider_sweeps, rider_tables
    from .recordings.load import load_all, plain_warnings, say_passed_over

    riders = None if args.suite == "hand" else rider_settings(args.estimators, args.seed, quick=args.quick)
    if args.suite == "rider" and (riders is None or args.recordings):
        wrong = f"--estimators {' '.join(args.estimators)}" if riders is None else "--recordings"
        raise ValueError(f"{wrong} has nothing for --suite rider, which compares the filters of the papers on riders")
    if args.sweep and args.suite != "rider":
        raise ValueError(f"--sweep belongs to --suite rider, not {args.suite}")
    if args.sweep and riders is not None and riders.estimators:
        raise ValueError(f"--sweep compares whole papers: name their filters, {', '.join(riders.papers)}")
    check_file("save", args.save, (*args.recordings, *(() if args.baseline is None else (args.baseline,))))
    before = None if args.baseline is None else load_baseline(args.baseline)
    if args.save is not None and args.save.exists():
        load_results(args.save)  # a damaged file is refused before the work
    with plain_warnings(), Output("benchmark", args) as out:
        recorded, passed_over = load_all(args.recordings) if args.recordings else ([], [])
        tasks, channels = tasks_of(args, recorded)
        folder = open_run("benchmark", args, may_differ=("baseline", "save"))
        if args.sweep:
            assert riders is not None
            rider_sweeps(riders, args, folder, out)
            out.report(folder.write_report("poise benchmark --suite rider --sweep", out.sections))
            return 0
        suites: dict[str, Results] = {}
        if tasks:
            suites = run_tasks(
                *(tasks, folder.folder / "tasks", args.estimators, channels),
                processes=args.processes,
                offline=args.offline,
                reference=args.reference,
            )
        ridden = None if riders is None else rider_tables(riders, args, folder, out)
        tables = [results.table.assign(suite=suite) for suite, results in suites.items()]
        if ridden is not None:
            tables.append(pandas.DataFrame(ridden.rows))
        table = pandas.concat(tables, ignore_index=True)
        folder.write_results(table)
        for suite, results in suites.items():
            show_suite(suite, results, [task for task in tasks if task.suite == suite], args, folder, out)
        show_data_sets(suites, out)
        if args.trials and tasks:
            show_paper(1 if args.quick else args.trials, out)
        if ridden is not None:
            suites |= ridden.suites
        if args.save is not None:
            recordings = [one for results in suites.values() for one in results.recordings]
            parts = {"recordings": recordings, "riders": [] if ridden is None else ridden.summary}
            out.say(f"results: {keep(args, folder, parts)}")
        grown = [] if before is None else show_regressions(table, before, out)
        say_passed_over(passed_over, out)
        more = {"Cost of an update": show_costs(args, channels, out)} if tasks else {}
        write_page(suites, more | ({REGRESSIONS: grown} if grown else {}), folder, out)
        out.report(folder.write_report("poise benchmark", out.sections))
    return 1 if grown else 0


def tasks_of(args: Args, recorded: list[Trajectory]) -> tuple[list[Task], list[str]]:
    """What is to be done, and the channels that estimators may read."""
    from ..baselines.comparison.data_sets import HAND_CHANNELS, RIDES, contenders, with_other_clocks
    from ..baselines.comparison.recommendation import CORRECTED
    from ..baselines.comparison.tasks import hand_tasks, imu_ride_tasks, recording_tasks
    from ..baselines.evaluation import AUTO
    from ..baselines.registry import make_estimator
    from ..baselines.scoring import ONBOARD
    from ..envs.sensors.presets import sensor_preset

    channels = list(dict.fromkeys([*HAND_CHANNELS, *(name for each in recorded for name in each.measurements)]))
    # unknown names are refused before anything is simulated
    contenders(args.estimators, channels)
    sensor_preset(args.sensors)
    if args.reference not in (AUTO, ONBOARD):
        make_estimator(args.reference)
    if args.suite == "rider":
        return [], channels
    tasks = hand_tasks(args.seed, 1 if args.quick else args.episodes, sensors=args.sensors)
    if args.suite == "all":
        tasks += imu_ride_tasks(args.seed, RIDES[:1] if args.quick else RIDES)
    tasks += recording_tasks(recorded)
    again = {"settings": {"reference_clock": "corrected", "check": False}, "suffix": CORRECTED}
    tasks += recording_tasks(with_other_clocks(recorded), "recordings, clock corrected", **again)
    return tasks, channels


def show_suite(suite: str, results: Results, tasks: list[Task], args: Args, folder: Run, out: Output) -> None:
    """Tables of a suite, its intervals and an example over time."""
    from ..baselines.comparison.data_sets import contenders
    from ..baselines.comparison.intervals import errors_of, intervals, is_measure

    table = results.table[~is_measure(results.table)]
    table.attrs |= results.table.attrs
    print_comparison(table, folder, out, groups=results.groups, name=suite)
    if (table["metric"] == "inclination").any():
        errors = errors_of(table, "inclination", "up")
        rows = intervals(errors) if len(errors) > 1 else []
        if rows:
            title = f"{suite}: inclination, mean with its 95 % interval over {len(errors)} trajectories, deg"
            out.table(rows, title, columns=["estimator", "mean", "low", "high", "difference", "better", "rank"])
    example = tasks[-1].trajectories()[-1:]
    chosen = contenders(args.estimators, list(example[0].measurements))
    draw_example(table, example, chosen, folder, suite, out)


def show_data_sets(suites: dict[str, Results], out: Output) -> None:
    """Mean errors of all data sets side by side."""
    from ..baselines.comparison.recommendation import ERRORS, dataset_errors

    results = [one for each in suites.values() for one in each.recordings]
    names = dict.fromkeys(one["dataset"] for one in results)
    for metric in ERRORS:
        rows = [{"estimator": name, **names, **each} for name, each in dataset_errors(results, metric).items()]
        if rows:
            out.table(rows, f"All data sets: {metric} error, RMS, mean over recordings, deg")


def keep(args: Args, folder: Run, parts: dict[str, list[dict[str, Any]]]) -> Path:
    """Write what this run has into the file of ``--save``, with its source, beside what is there now.

    A run of all estimators replaces the errors on all data sets that it has, one of named estimators theirs alone: on
    recordings those of each estimator, on rides those of each estimator, or of each paper whose filter is named.
    """
    from ..baselines.comparison.recommendation import load_results, merged, merged_rides, replaced

    assert args.save is not None
    kept = load_results(args.save) if args.save.exists() else {}
    new = {part: rows for part, rows in parts.items() if rows}
    named, earlier = list(new), dict(kept.get("source", {}))
    stay: dict[str, Any] = {}
    if args.estimators:
        if "recordings" in new and kept.get("recordings"):
            new["recordings"] = merged(kept["recordings"], new["recordings"])
        if "riders" in new and kept.get("riders"):
            new["riders"] = merged_rides(kept["riders"], new["riders"])
        beside = [part for part in new if kept.get(part)]
        named = [part for part in new if part not in beside] + (list(args.estimators) if beside else [])
    else:
        # sources of their own, of earlier runs of named estimators, are those of rows that are replaced
        had = {row[key] for row in new.get("riders", []) for key in ("paper", "method")}
        had |= {name for one in new.get("recordings", []) for name in one["errors"]}
        earlier = {name: source for name, source in earlier.items() if name not in had}
        if "recordings" in new:
            rows = replaced(kept.get("recordings", []), new["recordings"])
            others = {one["dataset"] for one in rows} - {one["dataset"] for one in new["recordings"]}
            stay = {one: earlier.get(one, earlier.get("recordings")) for one in sorted(others)}
            new["recordings"] = rows
    source = {key: folder.versions[key] for key in ("poise", "python", "packages")} | {"seed": args.seed}
    sources = {**earlier, **stay, **dict.fromkeys(named, source)}
    return write_json(args.save, {"recordings": [], **kept, **new, "source": sources}, indent=None)


def show_paper(trials: int, out: Output) -> None:
    """The tests of the external-acceleration paper."""
    from ..baselines.studies.external_acceleration.simulation import compare_modes

    out.say(f"the three tests of the external-acceleration paper, {trials} trials each")
    title = "external-acceleration, tests A to C of the paper, RMS in deg (levels in m/s²)"
    out.table(compare_modes(range(trials)), title)


def load_baseline(path: Path) -> pandas.DataFrame:
    """Results of an earlier run.

    Raises:
        ValueError: the file is none.
        FileNotFoundError: it is not there.
    """
    import pandas

    try:
        table = pandas.read_csv(path)
    except ValueError as reason:
        raise ValueError(f"--baseline {path} is not a table: {reason}") from None
    lacking = [name for name in ("suite", *RESULT) if name not in table.columns]
    if lacking:
        raise ValueError(f"--baseline {path} is not a results.csv of poise benchmark: it lacks {', '.join(lacking)}")
    return table


def show_regressions(table: pandas.DataFrame, before: pandas.DataFrame, out: Output) -> list[dict[str, Any]]:
    """What grew against the baseline."""
    from ..baselines.comparison.intervals import regressions

    grown = regressions(table, before)
    if grown:
        out.table(grown, REGRESSIONS)
    else:
        out.sections[REGRESSIONS] = "None."
        out.say("no error grew by more than 2 % against the baseline")
    return grown


def show_costs(args: Args, channels: list[str], out: Output) -> list[dict[str, Any]]:
    """Time of an update, step by step and over a sequence; no result, since results are the same on any machine."""
    from ..baselines.comparison.data_sets import contenders, hand_episode
    from ..baselines.run import fitted
    from ..baselines.speed.measure import measure
    from ..filters.core.estimator import run, run_by_steps

    (trajectory,) = hand_episode("mixed", 1, args.seed, sensors=args.sensors, duration=5.0)
    rows = []
    for label, contender in contenders(args.estimators, channels).items():
        estimator = fitted(contender, trajectory)
        if not {channel.name for channel in estimator.channels} <= set(trajectory.measurements):
            continue
        short = {name: values[:STEPS] for name, values in trajectory.measurements.items()}
        stepping = measure(partial(run_by_steps, estimator, short), STEPS)
        whole = measure(partial(run, estimator, trajectory.measurements), len(trajectory))
        rows.append({"estimator": label, "step, µs": 1e6 / stepping, "sequence, samples/s": whole})
    kinds = kinds_of(row["estimator"] for row in rows)
    rows = [{"estimator": row["estimator"], "kind": kinds.get(str(row["estimator"]), "–"), **row} for row in rows]
    out.sections["Cost of an update"] = markdown_table(rows)
    out.show(rows, "Cost of an update")
    return rows


def write_page(suites: dict[str, Results], tables: dict[str, list[dict[str, Any]]], folder: Run, out: Output) -> None:
    """The report for a browser, if Plotly is there."""
    from ..baselines.comparison.html_report import html_report

    state = folder.versions
    about = {"command": f"poise {folder.command}", "seed": folder.seed, "poise": state["poise"]["version"]}
    about |= {"commit": state["poise"].get("commit"), "Python": state["python"], **state["packages"]}
    labels = {name for results in suites.values() for name in results.table["estimator"]}
    try:
        page = html_report("poise benchmark", suites, kinds_of(sorted(labels)), about, tables)
    except MissingExtraError as reason:
        out.say(f"no page for a browser: {reason}")
        return
    out.say(f"page for a browser: {write_text(folder.folder / 'report.html', page)}")
