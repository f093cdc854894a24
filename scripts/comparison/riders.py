"""The rider suite of ``poise benchmark``: the papers' filters of riders beside networks, references and sweeps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..output import Output

if TYPE_CHECKING:
    from ...baselines.studies.riders.suite import RiderSuite
    from ..experiment import Run


def riders(args: Any) -> int:
    """Tables or sweeps of the rider suite."""
    from ...baselines.studies.riders.suite import PAPERS, RiderSuite
    from ..experiment import start_run
    from ..report import provenance

    wanted = tuple(paper for paper in PAPERS if not args.estimators or paper in args.estimators)
    settings = RiderSuite(wanted, seed=args.seed)
    if args.quick:
        settings = RiderSuite(wanted, rides=2, draws=1, training=6, seed=args.seed)
    with Output("benchmark", args) as out:
        folder = start_run("benchmark", args, args.seed, args.runs)
        sections = (rider_sweeps if args.sweep else rider_tables)(settings, args, folder, out)
        sections["Provenance"] = provenance(folder)
        out.report(folder.write_report("poise benchmark --suite rider", sections))
    return 0


def rider_tables(settings: RiderSuite, args: Any, folder: Run, out: Output) -> dict[str, str]:
    """Errors, each angle, consistency: printed, written, and as sections of the report."""
    from ...baselines.studies.riders import suite, tables
    from ...filters.support.rows import markdown_table

    out.say(f"references learn from {settings.training} rides; rides are simulated once and kept")
    learnt = suite.learnt_by(settings, quick=args.quick)
    found = suite.compare(settings, learnt, processes=args.processes, progress=True)
    rows = sorted((row for one in found for row in one), key=lambda row: (row.group, row.ride, row.draw))
    folder.write_results(tables.results(rows))
    sections = {}
    for paper in settings.papers:
        for title, table in (
            ("mean over angles, RMS in deg [95 % over riders]", tables.error_table(rows, paper)),
            ("each angle, RMS in deg (unseen riders / other scenarios / aggressive riders)",
             tables.angle_table(rows, paper)),
            ("NEES of an angle, share of errors in the stated 90 %", tables.consistency_table(rows, paper)),
        ):  # fmt: skip
            out.table(table, f"{paper}: {title}")
            sections[f"{paper}: {title}"] = markdown_table(table)
    return sections


def rider_sweeps(settings: RiderSuite, args: Any, folder: Run, out: Output) -> dict[str, str]:
    """Errors while one condition is varied, and a figure."""
    from ...baselines.studies.riders import sweeps
    from ...filters.support.rows import markdown_table

    found = sweeps.sweep_points(settings, processes=args.processes, progress=True)
    points = sorted((point for one in found for point in one), key=lambda point: point.ride)
    folder.write_results(sweeps.results(points))
    sections = {}
    for paper in settings.papers:
        for name, sweep in sweeps.SWEEPS.items():
            table = sweeps.sweep_table(points, paper, name)
            title = f"{paper}: {sweep.label}; mean over angles and riders, RMS in deg"
            out.table(table, title)
            sections[title] = markdown_table(table)
    out.say(f"figure: {sweeps.draw_sweeps(points, folder.figures / 'sweeps.png')}")
    return sections
