"""The rider suite of ``poise benchmark``: the papers' filters of riders beside networks, references and sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ...filters.support.rows import RESULT, markdown_table
from ..output import Output
from ..report import MOST_COLUMNS

if TYPE_CHECKING:
    from ...baselines.comparison.tasks import Results
    from ...baselines.studies.riders.suite import RiderSuite
    from ..experiment import Run

SUITE = "riders"
"""Name in ``results.csv``."""


class RiderPart(NamedTuple):
    """What the suite adds to a report.

    Attributes:
        rows: of ``results.csv``.
        suites: title → results, for the page.
        summary: paper, method and group with their numbers, as ``--save`` keeps them.
    """

    rows: list[dict[str, Any]]
    suites: dict[str, Results]
    summary: list[dict[str, Any]]


def rider_settings(estimators: Sequence[str], seed: int, *, quick: bool) -> RiderSuite | None:
    """Settings of the suite for the estimators that are named, all if none; None if none of them is of a paper.

    A paper's own filter stands for everything that is compared with it, any other estimator for itself.
    """
    from ...baselines.studies.riders.suite import PAPERS, RiderSuite, estimators_of

    wanted = tuple(paper for paper in PAPERS if not estimators or paper in estimators)
    alone = () if wanted else tuple(estimators)
    wanted = wanted or tuple(paper for paper in PAPERS if not set(alone).isdisjoint(estimators_of(paper)))
    if not wanted:
        return None
    made = RiderSuite(wanted, seed=seed, estimators=alone)
    made = replace(made, training=0) if alone else made
    return replace(made, rides=1, draws=1, training=0) if quick else made


def rider_tables(settings: RiderSuite, args: Any, folder: Run, out: Output) -> RiderPart:
    """Errors, each angle, bounds, consistency."""
    from ...baselines.comparison.rider_tables import by_group
    from ...baselines.comparison.tasks import Results
    from ...baselines.error_table import ErrorTable
    from ...baselines.studies.riders import suite, tables

    learning = f"; references learn from {settings.training} others" if settings.training else ""
    out.say(f"riders: {settings.rides} rides of each group{learning}; rides are simulated once and kept")
    rows = suite.compare(settings, folder.folder / "tasks", processes=args.processes, progress=True)
    numbers = tables.summary(rows)
    for paper in settings.papers:
        for title, table in (
            ("mean over angles, RMS in deg [95 % over riders]", by_group(numbers, paper, "error")),
            ("each angle, RMS in deg (unseen riders / other scenarios / aggressive riders)",
             tables.angle_table(rows, paper)),
            ("RMS error in multiples of the posterior bound, mean over angles", by_group(numbers, paper, "bound")),
            ("NEES of an angle, share of errors in the stated 90 %", by_group(numbers, paper, "consistency")),
        ):  # fmt: skip
            # twenty angles fit into the report, not into a terminal
            if len(table[0]) <= MOST_COLUMNS:
                out.table(table, f"{paper}: {title}")
            else:
                out.rows(table, f"{paper}: {title}")
                out.sections[f"{paper}: {title}"] = markdown_table(table)
    means = [mean for paper in settings.papers for mean in tables.ride_means(rows, paper)]
    groups = {trajectory: trajectory.split(":")[0] for _, trajectory, *_ in means}
    page = Results(ErrorTable(means, columns=list(RESULT)), groups, [])
    found = [{"suite": SUITE, **row} for row in tables.results(rows)]
    return RiderPart(found, {SUITE: page}, numbers)


def rider_sweeps(settings: RiderSuite, args: Any, folder: Run, out: Output) -> None:
    """Errors while one condition is varied, and a figure."""
    from ...baselines.studies.riders import sweeps

    found = sweeps.sweep_points(settings, processes=args.processes, progress=True)
    points = sorted((point for one in found for point in one), key=lambda point: point.ride)
    folder.write_results(sweeps.results(points))
    for paper in settings.papers:
        for name, sweep in sweeps.SWEEPS.items():
            title = f"{paper}: {sweep.label}; mean over angles and riders, RMS in deg"
            out.table(sweeps.sweep_table(points, paper, name), title)
        title = f"{paper}: each angle where geometry is told exactly; mean over riders, RMS in deg"
        out.table(sweeps.angle_rows(points, paper, "geometry", 0.0), title)
    out.say(f"figure: {sweeps.draw_sweeps(points, folder.figures / 'sweeps.png')}")
