"""Compare all estimators on simulated hand motion and, if given, on recordings: tables, figures, a report."""

from __future__ import annotations

import json
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
    reference: str = "auto"
    """replacement of a missing truth (agreement, not error), see `poise evaluate --help`"""
    offline: bool = False
    """run the smoother of every estimator that has one as well"""
    trials: int = 5
    """trials of each test of the external-acceleration paper; 0 leaves them out"""
    rides: bool = True
    """whether to simulate rides of a bicycle too, and estimate the inclination of its and the rider's IMU"""
    save: Path | None = None
    """file for the errors of all recordings and simulations, from which `poise recommend` reads"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Simulate, load, estimate, compare."""
    import pandas

    from ..baselines.comparison.data_sets import (
        HAND_CHANNELS,
        contenders,
        groups_of,
        simulated,
        simulated_rides,
        with_other_clocks,
    )
    from ..baselines.evaluation import evaluate
    from ..baselines.recommendation import CORRECTED, ERRORS, dataset_errors, results_of
    from ..baselines.scoring import has_truth
    from ..baselines.studies.external_acceleration.simulation import compare_modes
    from ..filters.support.files import write_json
    from .experiment import start_run
    from .recordings.load import load_all, passed_over_text, plain_warnings
    from .report import draw_example, print_comparison, provenance
    from .tables import markdown_table

    with plain_warnings(), Output("benchmark", args) as out:
        recorded, passed_over = load_all(args.recordings) if args.recordings else ([], [])
        channels = {*HAND_CHANNELS, *(name for each in recorded for name in each.measurements)}
        chosen = contenders(args.estimators, channels)
        folder = start_run("benchmark", args, args.seed, args.runs)
        out.say(f"simulating {4 * args.episodes} episodes of poise/HandMotion-v0")
        data = {"simulation": simulated(args.seed, args.episodes, sensors=args.sensors)}
        if args.rides:
            out.say("simulating rides of poise/RiderBicycle-v0")
            data["rides"] = simulated_rides(args.seed)
        if recorded:
            data["recordings"] = recorded
        sections: dict[str, str] = {}
        tables, scored = [], {}
        for name, trajectories in data.items():
            table = evaluate(chosen, trajectories, reference=args.reference, offline=args.offline, progress=True)
            tables.append(table)
            scored[name] = [trajectory for trajectory in trajectories if has_truth(trajectory)], table
            folder.write_results(pandas.concat(tables))
            sections |= print_comparison(table, folder, out, groups=groups_of(trajectories), name=name)
            sections |= draw_example(table, trajectories, chosen, folder, name)
        results = [one for name in data for one in results_of(*scored[name])]
        corrected = with_other_clocks(recorded)
        if corrected:
            out.say(f"{len(corrected)} recordings again, the clock of the reference corrected")
            table = evaluate(
                *(chosen, corrected),
                reference_clock="corrected",
                offline=args.offline,
                check=False,
                progress=True,
            )
            results += results_of(corrected, table, CORRECTED)
        for metric in ERRORS:
            rows = [{"estimator": name, **errors} for name, errors in dataset_errors(results, metric).items()]
            if rows:
                names = list(dict.fromkeys(one["dataset"] for one in results))
                title = f"All data sets: {metric} error, RMS, mean over recordings, deg"
                sections[title] = markdown_table(rows, ["estimator", *names])
                out.table(rows, title, columns=["estimator", *names])
        if args.save is not None:
            source = json.loads((folder.folder / "versions.json").read_text(encoding="utf-8"))
            source = {key: source[key] for key in ("poise", "python", "packages")} | {"seed": args.seed}
            out.say(f"results: {write_json(args.save, {'source': source, 'recordings': results}, indent=None)}")
        if args.trials:
            out.say(f"the three tests of the external-acceleration paper, {args.trials} trials each")
            modes = compare_modes(range(args.trials))
            title = "external-acceleration, tests A to C of the paper, RMS in deg (levels in m/s²)"
            sections[title] = markdown_table(modes)
            out.table(modes, title)
        if passed_over:
            sections["Passed over"] = passed_over_text(passed_over, most=1000)
            out.say(f"passed over:\n{passed_over_text(passed_over)}")
        sections["Provenance"] = provenance(folder)
        out.report(folder.write_report("poise benchmark", sections))
    return 0


if __name__ == "__main__":
    run_command("benchmark")
