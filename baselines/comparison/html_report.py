"""A comparison as one HTML file that needs no network: tables to sort and filter, plots to hover and zoom."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ...filters.support.optional import extra
from ...filters.support.rows import jsonable
from ..plots import COLOURS
from .html_page import PAGE
from .intervals import details, errors_of, intervals, is_measure, win_matrix

if TYPE_CHECKING:
    import pandas

    from .tasks import Results

OTHER = "#8c8c8c"
"""Colour of what has no kind."""
ROW = 22
"""Height of an estimator in a plot, pixels."""
FOOT = {
    "mean": "RMS error over the evaluation mask, mean over trajectories",
    "95 %": "interval of the mean: bootstrap over trajectories",
    "difference": "mean of the paired differences to the best estimator on the same trajectories",
    "of it 95 %": "interval of the difference: an estimator whose interval holds 0 may be as good as the best",
    "better": "share of trajectories with a smaller error than the best estimator has (ties count half)",
    "rank": "mean rank over trajectories",
    "p95": "95th percentile of the absolute error",
    "largest": "largest absolute error of all trajectories",
    "settling": "time until the RMS of 1 s stays below three times that of the last half, s",
    "drift": "slope of the absolute error, a minute",
    "over bound": "RMS error in multiples of what the errors of the simulated sensors alone leave",
    "NEES": "normalised estimation error squared a degree of freedom, 1 if the covariance is consistent",
    "NEES 95 %": "where it lies for a consistent filter, if each trajectory is one draw",
    "NIS": "the same of innovations",
    "NIS 95 %": "where it lies for white innovations of the assumed size",
    "step, µs": "time of one update, sample by sample",
    "sequence, samples/s": "rate over a whole sequence",
}
"""Column → what it means; shown when the pointer rests on its heading."""


def html_report(
    title: str,
    suites: Mapping[str, Results],
    kinds: Mapping[str, str],
    provenance: Mapping[str, Any],
    tables: Mapping[str, Sequence[Mapping[str, Any]]] | None = None,
) -> str:
    """The page.

    Args:
        title: its heading.
        suites: suite → results.
        kinds: estimator → kind.
        provenance: what the results depend on: command, seed, versions.
        tables: further tables, title → rows, shown first.

    Raises:
        MissingExtraError: Plotly, whose script the page contains, is not installed.
    """
    with extra("view"):
        from plotly.offline import get_plotlyjs
    sections = [{"title": name, "tables": [table_of(rows)], "plots": []} for name, rows in (tables or {}).items()]
    for suite, results in suites.items():
        sections += sections_of(suite, results.table, kinds)
    data = {"sections": sections, "colours": {**COLOURS, "–": OTHER}, "foot": FOOT}
    about = "".join(
        f"<dt>{html.escape(str(name))}</dt><dd>{html.escape(str(value))}</dd>" for name, value in provenance.items()
    )
    # "</" would end the script that holds the data
    text = json.dumps(jsonable(data, lambda value: None), ensure_ascii=False, allow_nan=False).replace("</", "<\\/")
    parts = {"title": html.escape(title), "about": about, "data": text, "plotly": get_plotlyjs()}
    page = PAGE
    for name, part in parts.items():  # the script of Plotly last: it may contain anything
        page = page.replace(f"%%{name}%%", part)
    return page


def sections_of(suite: str, table: pandas.DataFrame, kinds: Mapping[str, str]) -> list[dict[str, Any]]:
    """One section for each quantity and metric of a suite that has a truth."""
    rms = table[~is_measure(table) & ~table["metric"].isin(["valid", "nis"]) & ~table["metric"].str.contains(" to ")]
    sections = []
    for (quantity, metric, unit), _ in rms.groupby(["quantity", "metric", "unit"], sort=False):
        errors = errors_of(table, metric, quantity)
        if errors.empty or not len(errors.columns):
            continue
        found = intervals(errors)
        more = {row["estimator"]: row for row in details(table, metric, quantity)}
        rows = [row | {"kind": kinds.get(row["estimator"], "–")} for row in found]
        shown = [shown_row(row, more.get(row["estimator"], {})) for row in rows]
        title = f"{suite}: {metric}" if quantity in ("up", "orientation") else f"{suite}: {quantity}, {metric}"
        sections.append(
            {
                "title": f"{title}, {unit}",
                "tables": [table_of(shown)],
                "plots": [interval_plot(rows, unit), trajectory_plot(errors, kinds, unit), win_plot(errors)],
            }
        )
    return sections


def shown_row(row: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """A row of the page: intervals as text, measures beyond RMS behind."""
    return {
        "estimator": row["estimator"],
        "kind": row["kind"],
        "mean": row["mean"],
        "95 %": interval(row["low"], row["high"]),
        "difference": row["difference"],
        "of it 95 %": interval(row["difference low"], row["difference high"]),
        "better": row["better"],
        "rank": row["rank"],
    } | {name: value for name, value in more.items() if name in FOOT}


def interval(low: float, high: float) -> str:
    """Both ends with three digits, as the numbers of the page."""
    return " – ".join(f"{end:#.3g}".rstrip(".") if abs(end) < 1e3 else f"{end:.0f}" for end in (low, high))


def table_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Rows as columns and cells; columns in which nothing is known are left out."""
    names = dict.fromkeys(name for row in rows for name in row)
    columns = [
        name for name in names if any(row.get(name, "–") not in ("–", None) and row[name] == row[name] for row in rows)
    ]
    return {"columns": columns, "rows": [[row.get(name) for name in columns] for row in rows]}


def colour_of(kind: str) -> str:
    """Colour of the marks of a kind."""
    return COLOURS.get(kind, OTHER)


def log_axis(unit: str) -> dict[str, Any]:
    """A logarithmic axis of errors whose ticks show the errors themselves."""
    ticks = [digit * 10.0**power for power in range(-4, 5) for digit in (1, 2, 5)]
    return {"type": "log", "title": {"text": f"RMS error, {unit}"}, "tickvals": ticks}


def interval_plot(rows: Sequence[Mapping[str, Any]], unit: str) -> dict[str, Any]:
    """Mean errors with their intervals, the best at the top."""
    worst_first = list(reversed(rows))
    trace = {
        "type": "scatter",
        "mode": "markers",
        "x": [row["mean"] for row in worst_first],
        "y": [row["estimator"] for row in worst_first],
        "error_x": {
            "type": "data",
            "symmetric": False,
            "color": OTHER,
            "array": [row["high"] - row["mean"] for row in worst_first],
            "arrayminus": [row["mean"] - row["low"] for row in worst_first],
        },
        "marker": {"size": 9, "color": [colour_of(row["kind"]) for row in worst_first]},
        "hovertemplate": "%{y}: %{x:.3f}<extra></extra>",
    }
    axis = log_axis(unit)
    layout = {"title": f"mean and 95 % interval, {unit}", "xaxis": axis, "height": 120 + ROW * len(rows)}
    return {"data": [trace], "layout": layout, "row": ROW}


def trajectory_plot(errors: pandas.DataFrame, kinds: Mapping[str, str], unit: str) -> dict[str, Any]:
    """Errors of every trajectory, one line an estimator; the best five are shown at first."""
    order = list(errors.mean().sort_values().index)
    traces = [
        {
            "type": "scatter",
            "mode": "lines+markers",
            "name": name,
            "x": list(errors.index),
            "y": [float(value) for value in errors[name]],
            "visible": True if number < 5 else "legendonly",
            "line": {"color": colour_of(kinds.get(name, "–")), "width": 1, "dash": DASHES[number % len(DASHES)]},
        }
        for number, name in enumerate(order)
    ]
    axis = log_axis(unit)
    layout = {"title": f"error of every trajectory, {unit}", "yaxis": axis, "height": 420}
    return {"data": traces, "layout": layout, "row": 0}


DASHES = ("solid", "dash", "dot", "dashdot", "longdash")


def win_plot(errors: pandas.DataFrame) -> dict[str, Any]:
    """Share of trajectories on which each estimator (row) beats each (column)."""
    names, wins = win_matrix(errors)
    trace = {
        "type": "heatmap",
        "x": names,
        "y": names,
        "z": wins.tolist(),
        "zmin": 0.0,
        "zmax": 1.0,
        "colorscale": [[0.0, "#b2182b"], [0.5, "#f7f7f7"], [1.0, "#2166ac"]],
        "hovertemplate": "%{y} beats %{x} on %{z:.0%}<extra></extra>",
    }
    size = 180 + ROW * len(names)
    layout = {
        "title": "share of trajectories on which the row has the smaller error",
        "yaxis": {"autorange": "reversed"},
        "height": size,
    }
    return {"data": [trace], "layout": layout, "row": ROW}
