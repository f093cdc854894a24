"""Measure estimators on recordings: BROAD trials, Movella/Xsens DOT exports, or trajectories of this package."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from .main import run_command
from .output import Output


@dataclass
class Args:
    """Arguments of ``poise evaluate``."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """files, or folders that are searched for recordings"""
    estimators: tuple[str, ...] = ("bounded-motion", "external-acceleration", "mekf", "mahony", "gru")
    """names of estimators; `poise evaluate --estimators all .` takes every one that is installed"""
    reference: str = "mekf-9"
    """estimator that stands in for the truth of recordings without one (agreement, not error)"""
    place: str | None = None
    """in recorded rides of a bicycle, the IMU to look at: bicycle_imu or trunk_imu"""
    calibration: Path | None = None
    """record of `poise calibrate` that turns raw readings of the recordings into SI units"""
    seed: int = 0
    """names the run folder; evaluation draws no random numbers"""
    runs: Path = Path("runs")
    """where the run folder goes"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Evaluate, print the table, and leave a run folder with a report."""
    from ..baselines.benchmark import groups_of
    from ..baselines.evaluation import evaluate
    from ..baselines.registry import list_estimators
    from ..envs.data.formats.load import load_recording, recording_files
    from .experiment import start_run
    from .report import draw_example, print_comparison, provenance

    paths = recording_files(args.recordings)
    if not paths:
        raise ValueError(f"no recording in {', '.join(map(str, args.recordings))}")
    trajectories = [load_recording(path, args.calibration) for path in paths]
    if args.place is not None:
        from ..envs.bicycle.sensors.single_imu import imu_of

        trajectories = [imu_of(trajectory, args.place) for trajectory in trajectories]
    names = tuple(list_estimators()) if args.estimators == ("all",) else args.estimators
    table = evaluate(list(names), trajectories, reference=args.reference, progress=True)
    folder = start_run("evaluate", args, args.seed, args.runs)
    folder.write_results(table)
    with Output("evaluate", args) as out:
        sections = print_comparison(table, folder, out, groups=groups_of(trajectories))
        sections |= draw_example(table, trajectories, {name: name for name in names}, folder, "recordings")
        sections["Provenance"] = provenance(folder)
        out.report(folder.write_report("poise evaluate", sections))
    return 0


if __name__ == "__main__":
    run_command("evaluate")
