"""Compare all estimators on simulated hand motion and, if given, on recordings: tables, figures, a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .main import run_command
from .output import Output


@dataclass
class Args:
    """Arguments of ``poise benchmark``."""

    seed: int = 0
    """root seed of motions and sensor errors"""
    episodes: int = 3
    """simulated episodes of each gesture"""
    sensors: str = "xsens-mtw-awinda"
    """sensor preset of the simulation"""
    recordings: tuple[Path, ...] = ()
    """recordings, or folders of them, to compare on as well"""
    estimators: tuple[str, ...] = ()
    """names of estimators (default: all that are installed, except some slow loops)"""
    reference: str = "mekf-9"
    """estimator that stands in for the truth of recordings without one (agreement, not error)"""
    trials: int = 5
    """trials of each test of the external-acceleration paper; 0 leaves them out"""
    runs: Path = Path("runs")
    """where the run folder goes"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Simulate, load, estimate, compare."""
    import pandas

    from ..baselines.benchmark import HAND_CHANNELS, contenders, groups_of, simulated
    from ..baselines.evaluation import evaluate
    from ..baselines.studies.external_acceleration.simulation import compare_modes
    from ..envs.data.formats.load import load_recording, recording_files
    from .experiment import start_run
    from .report import draw_example, print_comparison, provenance
    from .tables import markdown_table

    recorded = [load_recording(path) for path in recording_files(args.recordings)]
    chosen = contenders(args.estimators, {*HAND_CHANNELS, *(name for each in recorded for name in each.measurements)})
    folder = start_run("benchmark", args, args.seed, args.runs)
    sections: dict[str, str] = {}
    tables = []
    with Output("benchmark", args) as out:
        out.say(f"simulating {4 * args.episodes} episodes of poise/HandMotion-v0 in PyBullet")
        data = {"simulation": simulated(args.seed, args.episodes, sensors=args.sensors)}
        if recorded:
            data["recordings"] = recorded
        for name, trajectories in data.items():
            table = evaluate(chosen, trajectories, reference=args.reference, progress=True)
            tables.append(table)
            folder.write_results(pandas.concat(tables))
            sections |= print_comparison(table, folder, out, groups=groups_of(trajectories), name=name)
            sections |= draw_example(table, trajectories, chosen, folder, name)
        if args.trials:
            out.say(f"the three tests of the external-acceleration paper, {args.trials} trials each")
            rows = compare_modes(range(args.trials))
            title = "external-acceleration, tests A to C of the paper, RMS in deg (levels in m/s²)"
            sections[title] = markdown_table(rows)
            out.table(rows, title)
        sections["Provenance"] = provenance(folder)
        out.report(folder.write_report("poise benchmark", sections))
    return 0


if __name__ == "__main__":
    run_command("benchmark")
