"""Evaluate estimators on recordings: against the reference if there is one, else against each other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from ..experiment import start_run
from ..output import Output
from ..report import draw_example, print_comparison
from ..targets import check_folder


@dataclass
class Args:
    """Arguments of ``poise evaluate``."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """files, or folders that are searched for recordings"""
    estimators: tuple[str, ...] = ("bounded-motion", "external-acceleration", "mekf", "mahony", "gru")
    """names of estimators, files of weights of `poise train`, or `all` that are installed"""
    reference: str = "auto"
    """replacement of a missing truth (agreement, not error): an estimator, `onboard` for the
    orientation that the device computed, or `auto`: mekf-9, or bounded-motion where there is no magnetometer"""
    reference_clock: Literal["recorded", "corrected"] = "recorded"
    """truth as recorded, or corrected by the measured offset of its clock from that of the gyroscope"""
    offline: bool = False
    """also run the smoother of every estimator that has one"""
    site: str | None = None
    """in recordings of several sensors, the one to use, such as bicycle_imu or trunk_imu of a ride"""
    calibration: Path | None = None
    """record of `poise calibrate` that turns raw readings of the recordings into SI units"""
    seed: int = 0
    """names the run folder; evaluation draws no random numbers"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Evaluate, print the table, and leave a run folder with a report."""
    from ...baselines.comparison.data_sets import groups_of
    from ...baselines.evaluation import evaluate
    from ...baselines.registry import list_estimators
    from .load import load_all, plain_warnings, say_passed_over

    check_folder("runs", args.runs)
    names = tuple(list_estimators()) if args.estimators == ("all",) else args.estimators
    with plain_warnings():
        trajectories, passed_over = load_all(args.recordings, args.calibration, args.site)
        table = evaluate(
            list(names),
            trajectories,
            reference=args.reference,
            reference_clock=args.reference_clock,
            offline=args.offline,
            progress=True,
        )
    folder = start_run("evaluate", args, args.seed, args.runs)
    folder.write_results(table)
    with Output("evaluate", args) as out:
        print_comparison(table, folder, out, groups=groups_of(trajectories))
        draw_example(table, trajectories, {name: name for name in names}, folder, "recordings", out)
        say_passed_over(passed_over, out)
        out.report(folder.write_report("poise evaluate", out.sections))
    return 0
