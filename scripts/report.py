"""A table of errors → terminal, Markdown report, figures, or JSON."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..filters.support.rows import markdown_table
from .experiment import Run
from .output import Output

if TYPE_CHECKING:
    import pandas

    from ..envs.data.trajectory import Trajectory

TITLES = {
    "inclination": "Inclination error, RMS over the evaluation mask, deg",
    "heading": "Heading error, RMS, deg",
    "total": "Total orientation error, RMS, deg",
}
"""Metric → title; other metrics get their name."""

MOST_COLUMNS = 8
"""Groups that a terminal shows one by one; the report has them all."""
MOST_DRAWN = 5
"""Estimators in a figure of errors over time."""


def kinds_of(labels: Any) -> dict[str, str]:
    """Label → kind, for labels that are names of estimators or begin with one (``name (variant)``).

    Smoothers, whatever they smooth, are of the kind ``offline``.
    """
    from ..baselines.registry import list_estimators
    from ..filters.core.offline import SUFFIX

    known = list_estimators(experimental=True)
    kinds = {label: known[name].kind for label in map(str, labels) if (name := label.split(" (")[0]) in known}
    return {label: "offline" if label.endswith(SUFFIX) else kind for label, kind in kinds.items()}


def parts(table: pandas.DataFrame) -> Iterator[tuple[str, str, pandas.DataFrame]]:
    """Title, metric and rows of each metric in deg; of each quantity apart where several have the metric.

    Estimators that give no angle (the angular rate alone) come after these, with the quantities that they give.
    Distances between estimators are not errors: see :func:`agreement_tables`.
    """
    import pandas

    angles = table[(table["unit"] == "deg") & ~table["metric"].str.contains(" to ")]
    valid = table[table["metric"] == "valid"]
    for metric in angles["metric"].unique():
        title = TITLES.get(metric, f"RMS {metric}, deg")
        of_metric = angles[angles["metric"] == metric]
        quantities = of_metric["quantity"].unique()
        for quantity in quantities:
            name = f"{quantity}: {title}" if len(quantities) > 1 else title
            part = of_metric[of_metric["quantity"] == quantity]
            yield name, metric, pandas.concat([part, valid[valid["quantity"] == quantity]])
    shown = angles["estimator"]
    others = table[~table["estimator"].isin(shown) & ~table["metric"].str.contains("^valid$| to |^nis$")]
    for (quantity, metric, unit), part in others.groupby(["quantity", "metric", "unit"], sort=False):
        yield f"{quantity}: RMS {metric}, {unit}", metric, part


def wide_tables(table: pandas.DataFrame, groups: Mapping[str, str] | None = None) -> dict[str, list[dict[str, Any]]]:
    """Title → rows (one per estimator; a column per group and the mean over trajectories), for every metric in deg."""
    from ..baselines.error_table import summary

    kinds = kinds_of(table["estimator"].unique())
    tables = {}
    for title, metric, part in parts(table):
        wide = summary(part, metric, groups)
        if len(wide.columns.drop(["valid"], errors="ignore")) == 2:  # of one group the mean repeats its column
            wide = wide.drop(columns="mean")
        tables[title] = [
            {"estimator": name, "kind": kinds.get(str(name), "–"), **{str(key): value for key, value in row.items()}}
            for name, row in wide.iterrows()
        ]
    return tables


def agreement_tables(table: pandas.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """Title → rows of recordings without truth: how far each estimator is from each other, and its consistency."""
    from ..baselines.error_table import agreement
    from ..baselines.scoring import family

    references = set(table.attrs.get("references", {}).values())
    tables = {}
    for metric in TITLES:
        wide = agreement(table, metric)
        if wide.empty:
            continue
        rows = []
        for name, row in wide.iterrows():
            related = any(family(str(name)) == family(one) and name != one for one in references)
            label = f"{name} (family of the reference)" if related else str(name)
            rows.append({"estimator": label, **{f"to {other}": value for other, value in row.items()}})
        listed = f"; reference {', '.join(sorted(references))}" if references else ""
        tables[f"Agreement, {metric}, RMS, deg (no truth: neither error nor ranking{listed})"] = rows
    if tables:
        nis = table[table["metric"] == "nis"].groupby("estimator", sort=False)["value"].mean()
        rows = [{"estimator": name, "NIS": value} for name, value in nis.items()]
        if rows:
            tables["Innovations: NIS a degree of freedom (1 if the noise is as assumed)"] = rows
    return tables


def numbered(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A matrix of many estimators with numbers as headings, so that it fits a terminal; each row names its number."""
    to = [name for name in rows[0] if name.startswith("to ")]
    if len(to) <= MOST_COLUMNS - 2:
        return rows
    number = {name.removeprefix("to "): str(index) for index, name in enumerate(to, start=1)}
    labels = [str(row["estimator"]) for row in rows]
    shown = [
        {"estimator": f"{number.get(label.split(' (family')[0], '–')} {label}"}
        | {number[name.removeprefix("to ")]: row[name] for name in to}
        for label, row in zip(labels, rows, strict=True)
    ]
    named = {label.split(" (family")[0] for label in labels}
    return shown + [{"estimator": f"{index} {name}"} for name, index in number.items() if name not in named]


def narrow(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row that fits a terminal: with many groups only their mean, median and largest."""
    numbers = {name: value for name, value in row.items() if isinstance(value, float)}
    groups = [value for name, value in numbers.items() if name not in ("mean", "valid")]
    if len(numbers) <= MOST_COLUMNS or "mean" not in numbers:
        return dict(row)
    texts = {name: value for name, value in row.items() if not isinstance(value, float)}
    finite = [value for value in groups if value == value]
    middle = {"mean": numbers["mean"], "median": statistics.median(finite), "largest": max(finite)} if finite else {}
    return {**texts, **middle, **({"valid": numbers["valid"]} if "valid" in numbers else {})}


def skipped_text(table: pandas.DataFrame) -> str:
    """What could not be run and why, a line an estimator and reason."""
    where: dict[tuple[str, str], list[str]] = {}
    for estimator, trajectory, reason in table.attrs.get("skipped", []):
        where.setdefault((estimator, reason), []).append(trajectory)
    return "\n".join(
        f"- {name}: {reason} ({names[0] if len(names) == 1 else f'{len(names)} recordings'})"
        for (name, reason), names in where.items()
    )


def print_comparison(
    table: pandas.DataFrame, run: Run, out: Output, *, groups: Mapping[str, str] | None = None, name: str = ""
) -> None:
    """Print a comparison of :func:`poise.evaluate`, draw its bars, and add both to the report.

    ``groups`` tells the column of each trajectory in the wide tables; ``name`` that of the data in titles and files.
    """
    from ..baselines.plots import rms_bars, save

    out.rows(table, name or None)
    begin = f"{name}: " if name else ""
    wide, apart = wide_tables(table, groups), agreement_tables(table)
    for title, rows in (wide | apart).items():
        out.show(numbered(rows) if title in apart else [narrow(row) for row in rows], begin + title)
        out.sections[begin + title] = markdown_table(rows)
    if table.attrs.get("reference_clock") and table["metric"].isin(list(TITLES)).any():
        clock = {"recorded": "as recorded", "corrected": "corrected by the measured offset"}[
            table.attrs["reference_clock"]
        ]
        out.sections[f"{begin}clock of the reference"] = f"{clock[0].upper()}{clock[1:]}."
        out.say(f"clock of the reference: {clock}")
    found = list(parts(table))
    for _, metric, part in found:
        several = sum(metric == other for _, other, _ in found) > 1
        named = several or part["unit"].iloc[0] != "deg"
        what = " ".join(word for word in (name, part["quantity"].iloc[0] if named else "") if word)
        figure = rms_bars(part, kinds_of(part["estimator"].unique()), metric, what)
        words = f"{what} {metric}".strip().replace(" ", "-").replace("/", "-")
        path = save(figure, run.figures / f"{words}.png")
        out.sections[f"Figure: {words}"] = f"![{words}]({path.relative_to(run.folder)})"
    skipped = skipped_text(table)
    if skipped:
        out.sections[f"{begin}not run"] = skipped
        out.say(f"not run:\n{skipped}")


def draw_example(
    table: pandas.DataFrame,
    trajectories: Sequence[Trajectory],
    contenders: Mapping[str, Any],
    run: Run,
    name: str,
    out: Output,
) -> None:
    """Draw the errors of the best estimator of each kind over time, on the last trajectory that has a truth.

    Nothing is drawn if no trajectory has a truth, or no estimator an inclination.
    """
    from ..baselines.error_table import summary
    from ..baselines.plots import error_curves, save
    from ..baselines.run import run as run_estimator
    from ..baselines.scoring import has_truth

    scored = set(table.loc[table["metric"] == "inclination", "trajectory"])
    known = [trajectory for trajectory in trajectories if has_truth(trajectory) and trajectory.name in scored]
    if not known:
        return
    trajectory = known[-1]
    table = table[table["trajectory"] == trajectory.name]
    kinds = kinds_of(contenders)
    best: dict[str, str] = {}
    for label in summary(table).index.intersection(list(contenders), sort=False):
        best.setdefault(kinds.get(str(label), ""), str(label))
    if not best:
        return
    estimates = {label: run_estimator(contenders[label], trajectory) for label in list(best.values())[:MOST_DRAWN]}
    figure = error_curves(trajectory, estimates, kinds, f"{name}: {trajectory.name}, best estimator of each kind")
    path = save(figure, run.figures / f"{name}-over-time.png")
    out.sections[f"Figure: {name} over time"] = f"![{name} over time]({path.relative_to(run.folder)})"
