"""A table of errors → terminal, Markdown report, figures, or JSON."""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .experiment import Run
from .output import Output
from .tables import markdown_table

if TYPE_CHECKING:
    import pandas

    from ..envs.data.trajectory import Trajectory

TITLES = {
    "inclination": "Inclination error, RMS over the scored ticks, deg",
    "heading": "Heading error, RMS, deg",
    "total": "Total orientation error, RMS, deg",
}
"""Metric → title; other metrics get their name."""

MOST_COLUMNS = 8
"""Groups that a terminal shows one by one; the report has them all."""


def kinds_of(labels: Any) -> dict[str, str]:
    """Label → kind, for labels that are names of estimators or begin with one (``name (variant)``)."""
    from ..baselines.registry import list_estimators

    known = list_estimators()
    return {label: known[name].kind for label in map(str, labels) if (name := label.split(" (")[0]) in known}


def parts(table: pandas.DataFrame) -> Iterator[tuple[str, str, pandas.DataFrame]]:
    """Title, metric and rows of each metric in deg; of each quantity apart where several have the metric.

    Estimators that give no angle (the angular rate alone) come after these, with the quantities that they give.
    """
    angles = table[table["unit"] == "deg"]
    for metric in angles["metric"].unique():
        title = TITLES.get(metric, f"RMS {metric}, deg")
        if " to " in metric:
            title += " (agreement, not error: these recordings have no truth)"
        of_metric = angles[angles["metric"] == metric]
        quantities = of_metric["quantity"].unique()
        for quantity in quantities:
            name = f"{quantity}: {title}" if len(quantities) > 1 else title
            yield name, metric, of_metric[of_metric["quantity"] == quantity]
    others = table[~table["estimator"].isin(angles["estimator"]) & (table["metric"] != "valid")]
    for (quantity, metric, unit), part in others.groupby(["quantity", "metric", "unit"], sort=False):
        yield f"{quantity}: RMS {metric}, {unit}", metric, part


def wide_tables(table: pandas.DataFrame, groups: Mapping[str, str] | None = None) -> dict[str, list[dict[str, Any]]]:
    """Title → rows (an estimator each, a column a group, then the mean over trajectories), for every metric in deg."""
    from ..baselines.evaluation import summary

    kinds = kinds_of(table["estimator"].unique())
    tables = {}
    for title, metric, part in parts(table):
        wide = summary(part, metric, groups)
        if len(wide.columns) == 2:  # of a single group the mean says it all again
            wide = wide.drop(columns="mean")
        tables[title] = [
            {"estimator": name, "kind": kinds.get(str(name), "–"), **{str(key): value for key, value in row.items()}}
            for name, row in wide.iterrows()
        ]
    return tables


def narrow(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row that fits a terminal: with many groups only their mean, median and largest."""
    numbers = [value for value in row.values() if isinstance(value, float)]
    if len(numbers) <= MOST_COLUMNS:
        return dict(row)
    *groups, mean = numbers
    texts = {name: value for name, value in row.items() if not isinstance(value, float)}
    finite = [value for value in groups if value == value]
    return {**texts, "mean": mean, "median": statistics.median(finite), "largest": max(finite)}


def skipped_text(table: pandas.DataFrame) -> str:
    """What could not be run and why, a line an estimator."""
    reasons: dict[str, set[str]] = {}
    for estimator, _, reason in table.attrs.get("skipped", []):
        reasons.setdefault(estimator, set()).add(reason)
    return "\n".join(f"- {name}: {'; '.join(sorted(why))}" for name, why in reasons.items())


def print_comparison(
    table: pandas.DataFrame, run: Run, out: Output, *, groups: Mapping[str, str] | None = None, name: str = ""
) -> dict[str, str]:
    """Print a comparison and draw its bars.

    Args:
        table: from :func:`poise.evaluate`.
        run: where the figures go.
        out: where tables and rows go.
        groups: trajectory → column of the wide tables.
        name: of the data (simulation, recordings), in titles and file names.

    Returns:
        Heading → Markdown, for the report.
    """
    from ..baselines.plots import rms_bars, save

    sections = {}
    out.rows(table, name or None)
    for title, rows in wide_tables(table, groups).items():
        heading = f"{name}: {title}" if name else title
        out.show([narrow(row) for row in rows], heading)
        sections[heading] = markdown_table(rows)
    found = list(parts(table))
    for _, metric, part in found:
        several = sum(metric == other for _, other, _ in found) > 1
        apart = several or part["unit"].iloc[0] != "deg"
        what = " ".join(word for word in (name, part["quantity"].iloc[0] if apart else "") if word)
        figure = rms_bars(part, kinds_of(part["estimator"].unique()), metric, what)
        words = f"{what} {metric}".strip().replace(" ", "-").replace("/", "-")
        path = save(figure, run.figures / f"{words}.png")
        sections[f"Figure: {words}"] = f"![{words}]({path.relative_to(run.folder)})"
    skipped = skipped_text(table)
    if skipped:
        sections[f"{name}: not run".lstrip(": ")] = skipped
        out.say(f"not run:\n{skipped}")
    return sections


def draw_example(
    table: pandas.DataFrame,
    trajectories: Sequence[Trajectory],
    contenders: Mapping[str, Any],
    run: Run,
    name: str,
    most: int = 5,
) -> dict[str, str]:
    """Draw the errors of the best estimator of each kind over time, on the last trajectory that has a truth.

    Returns:
        Heading → Markdown; empty if no trajectory has a truth, or no estimator an inclination.
    """
    from ..baselines.evaluation import fitted, has_truth, summary
    from ..baselines.plots import error_curves, save
    from ..filters.core.estimator import run as run_estimator

    known = [trajectory for trajectory in trajectories if has_truth(trajectory)]
    if not known:
        return {}
    trajectory = known[-1]
    kinds = kinds_of(contenders)
    best: dict[str, str] = {}
    for label in summary(table).index:
        best.setdefault(kinds.get(str(label), ""), str(label))
    if not best:
        return {}
    estimates = {
        label: run_estimator(fitted(contenders[label], trajectory), trajectory.measurements)
        for label in list(best.values())[:most]
    }
    figure = error_curves(trajectory, estimates, kinds, f"{name}: {trajectory.name}, best estimator of each kind")
    path = save(figure, run.figures / f"{name}-over-time.png")
    return {f"Figure: {name} over time": f"![{name} over time]({path.relative_to(run.folder)})"}


def provenance(run: Run) -> str:
    """What a report depends on: command, seed, versions."""
    state = json.loads((run.folder / "versions.json").read_text(encoding="utf-8"))
    packages = ", ".join(f"{name} {version}" for name, version in state["packages"].items() if version)
    lines = [
        f"- command: `poise {run.command}`, arguments in `args.json`, root seed {run.seed}",
        f"- poise {state['poise']['version']}, Python {state['python']}, {state['platform']}",
        f"- {packages}",
    ]
    return "\n".join(lines)
