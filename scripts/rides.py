"""Ride every preset scenario with every preset rider; numbers of each ride beside what the papers report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..filters.support.parallel import progress_bar
from .experiment import COLUMNS, Run, open_run
from .main import run_command
from .output import Output

if TYPE_CHECKING:
    from ..baselines.studies.rides.statistics import RideStatistics

SHOWN = {
    "scenario": "scenario",
    "subject": "subject",
    "upright": "upright",
    "speed_mean": "speed m/s",
    "speed_max": "max m/s",
    "roll_sd": "roll sd deg",
    "roll_max": "max deg",
    "lean_mean": "lean mean deg",
    "lean_sd": "lean sd deg",
    "yaw_rate_mean": "yaw deg/s",
    "acceleration_max": "acc max m/s²",
    "seat_force_mean": "seat mean N",
    "seat_force_max": "seat max N",
    "handlebar_force_mean": "hand mean N",
    "handlebar_force_max": "hand max N",
    "gap_max": "gap max mm",
}
"""Field → column of the table."""
DRAWN = 20.0
"""s of a ride at most in the figure"""
UNITS = {
    "speed": "m/s",
    "roll": "deg",
    "pitch": "deg",
    "lean": "deg",
    "yaw_rate": "deg/s",
    "acceleration": "m/s²",
    "seat_force": "N",
    "handlebar_force": "N",
    "gap": "mm",
}
"""Quantity → unit."""


@dataclass
class Args:
    """Arguments of ``poise rides``."""

    duration: float = 16.0
    """of each ride, s; bumps and ramp come between 12 and 16 s"""
    fidelity: Literal["lumped", "full"] = "lumped"
    """lumped, or full with hands and feet in closed loops (about twice the time)"""
    scenarios: tuple[str, ...] = ()
    """names of scenarios (default: all)"""
    subjects: tuple[int, ...] = (0, 1, 2, 3, 4)
    """numbers of riders"""
    processes: int = 2
    """rides at a time"""
    seed: int = 0
    """root seed; every scenario and rider has a child of its own"""
    resume: Path | None = None
    """folder of a run that was interrupted; its finished rides are kept"""
    runs: Path = Path("runs")
    """where the run folder goes"""
    checks: bool = False
    """instead of the table of rides, check the physics and compare filters of one IMU on some rides (minutes)"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Ride, print both tables, draw one ride, and leave a run folder; 1 if anybody fell."""
    from ..baselines.studies.rides.reports import comparison
    from ..baselines.studies.rides.statistics import ride_all
    from ..envs.bicycle.course.scenarios import list_scenarios
    from ..envs.bicycle.course.scenarios import scenario as known
    from ..envs.bicycle.rider.anthropometry import SUBJECTS
    from .report import provenance
    from .tables import markdown_table

    if args.checks:
        return checked(args)
    scenarios = args.scenarios or tuple(list_scenarios())
    for name in scenarios:
        known(name)
    if not args.subjects or not all(0 <= subject < len(SUBJECTS) for subject in args.subjects):
        raise ValueError(f"subjects must be numbers from 0 to {len(SUBJECTS) - 1}, got {list(args.subjects)}")
    folder = open_run("rides", args, may_differ=("scenarios", "subjects"))
    seeds = ride_seeds(args.seed, len(SUBJECTS))
    rides: list[RideStatistics] = []
    total = len(scenarios) * len(args.subjects)
    with progress_bar(total, f"ride {args.duration:g} s, {args.fidelity}", "ride") as bar:
        for found in ride_all(
            folder.folder / "rides",
            scenarios,
            args.subjects,
            duration=args.duration,
            fidelity=args.fidelity,
            seeds=seeds,
            processes=args.processes,
        ):
            rides.append(found)
            folder.write_results(results(rides))
            bar.update()
    rides.sort(key=lambda each: (scenarios.index(each.scenario), each.subject))
    folder.write_results(results(rides))
    table = [{title: asdict(each)[field] for field, title in SHOWN.items()} for each in rides]
    if args.fidelity == "lumped":
        table = [{title: value for title, value in row.items() if title != SHOWN["gap_max"]} for row in table]
    papers = comparison(rides)
    titles = (f"{total} rides of {args.duration:g} s, {args.fidelity} rider", "Beside the papers, range over riders")
    upright = sum(each.upright for each in rides)
    with Output("rides", args) as out:
        out.rows(rides)
        out.show(table, titles[0], console=wide())
        out.show(papers, titles[1], console=wide())
        sections = {titles[0]: markdown_table(table), titles[1]: markdown_table(papers)}
        sections |= drawn(args, folder, scenarios, seeds)
        sections["Provenance"] = provenance(folder)
        out.say(f"{upright} of {total} rides upright")
        out.report(folder.write_report("poise rides", sections))
    return 0 if upright == total else 1


def checked(args: Args) -> int:
    """Print physical checks and the errors of filters of one IMU, and leave a report."""
    from ..baselines.studies.rides.checks import all_checks
    from ..baselines.studies.rides.inclinations import inclination_rows
    from .experiment import start_run
    from .report import provenance
    from .tables import markdown_table, records

    folder = start_run("rides", args, args.seed, args.runs)
    with Output("rides", args) as out:
        sections = {}
        for title, found in (
            ("Physical checks", all_checks()),
            ("RMS errors of inclination, deg, of filters of one IMU", inclination_rows()),
        ):
            out.say(f"computing: {title}")
            rows = records(found)
            out.table(rows, title, console=wide())
            sections[title] = markdown_table(rows)
        sections["Provenance"] = provenance(folder)
        out.report(folder.write_report("poise rides --checks", sections))
    return 0


def drawn(args: Args, folder: Run, scenarios: Sequence[str], seeds: Mapping[tuple[str, int], int]) -> dict[str, str]:
    """Heading → Markdown: the beginning of one of the rides with the papers' sensors."""
    from ..baselines.plots import save
    from ..baselines.studies.rides.plots import example_ride, ride_signals

    scenario, subject = "outdoor" if "outdoor" in scenarios else scenarios[0], args.subjects[0]
    seconds = min(args.duration, DRAWN)
    ride = example_ride(scenario, subject, seeds[scenario, subject], seconds, args.fidelity)
    title = f"{scenario}, subject {subject}: {seconds:g} s"
    save(ride_signals(ride, title), folder.figures / "signals.png")
    return {f"Figure: {title}": "![signals](figures/signals.png)"}


def ride_seeds(seed: int, riders: int) -> dict[tuple[str, int], int]:
    """Seed of every scenario and rider, whichever of them ride."""
    from ..envs.bicycle.course.scenarios import list_scenarios
    from ..filters.support.seeds import child_seeds

    pairs = list(product(list_scenarios(), range(riders)))
    return dict(zip(pairs, child_seeds(seed, len(pairs)), strict=True))


def results(rides: Sequence[RideStatistics]) -> list[dict[str, Any]]:
    """Rows of ``results.csv``; what is true of a ride has the estimator ``truth``."""
    rows = []
    for ride in rides:
        name = f"{ride.scenario}-{ride.subject}"
        rows.append(dict(zip(COLUMNS, ("truth", name, "ride", "upright", float(ride.upright), "1"), strict=True)))
        for quantity, unit in UNITS.items():
            for metric in ("mean", "sd", "min", "max"):
                value = getattr(ride, f"{quantity}_{metric}", None)
                if value is not None:
                    rows.append(dict(zip(COLUMNS, ("truth", name, quantity, metric, value, unit), strict=True)))
    return rows


def wide() -> Any:
    """A console with room for all columns where the output is no terminal."""
    import sys

    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=190)


if __name__ == "__main__":
    run_command("rides")
