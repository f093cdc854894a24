"""Table of errors: text form, means as a wide table, and agreement of estimators without a truth."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import pandas

from ..filters.support.rows import RESULT

WIDTH = 80
"""Width of a printed line in characters."""
MOST_ROWS = 60
COMPLETE = 0.98
"""Share of the best estimator's samples that an estimator must have estimates for, to be ranked with it."""


class ErrorTable(pandas.DataFrame):
    """A data frame of errors whose text shows metric and value of every row in 80 columns, whatever the names."""

    @property
    def _constructor(self) -> type[ErrorTable]:
        return ErrorTable

    def __repr__(self) -> str:
        if tuple(self.columns) != RESULT or not len(self):
            return str(pandas.DataFrame(self))
        shown = pandas.DataFrame(self).head(MOST_ROWS).reset_index(drop=True)
        texts = shown.astype({name: str for name in RESULT if name != "value"})
        texts["value"] = [f"{value:.4g}" for value in shown["value"]]
        # What identifies a row is shortened in its middle, the longest column first, until a line fits.
        widths = {name: max(len(name), int(texts[name].str.len().max())) for name in RESULT}
        while sum(widths.values()) + 2 * len(RESULT) > WIDTH:
            longest = max(("estimator", "trajectory", "quantity", "metric"), key=lambda name: widths[name])
            widths[longest] -= 1
        for name in RESULT[:4]:
            texts[name] = [shortened(text, widths[name]) for text in texts[name]]
        text = texts.to_string(index=False, line_width=None, justify="left")
        more = len(self) - len(shown)
        return text + (f"\n… {more} more rows of {len(self)}" if more else "")

    __str__ = __repr__

    def _repr_html_(self) -> str:
        return str(pandas.DataFrame(self)._repr_html_())


def shortened(text: str, width: int) -> str:
    """``text`` in at most ``width`` characters, without its middle."""
    if len(text) <= width:
        return text
    tail = (width - 1) // 2
    return f"{text[: width - 1 - tail]}…{text[len(text) - tail :]}"


def coverage(table: pandas.DataFrame, metric: str) -> pandas.Series:
    """Share of the evaluation mask with an estimate, for each estimator of a metric.

    Trajectories on which it could not be run count as zero, so that an easy half does not win.
    """
    chosen = table[table["metric"] == metric]
    quantities = chosen["quantity"].unique()
    valid = table[(table["metric"] == "valid") & table["quantity"].isin(quantities)]
    count = chosen["trajectory"].nunique()
    by_pair = valid.groupby(["estimator", "trajectory"])["value"].mean()
    # An error without a share (of older tables) counts as complete, if it is a number.
    of_pairs = chosen.groupby(["estimator", "trajectory"])["value"].mean()
    shares = by_pair.reindex(of_pairs.index).fillna(of_pairs.notna().astype(float))
    return shares.groupby("estimator").sum() / max(count, 1)


def summary(table: pandas.DataFrame, metric: str = "inclination", groups: Mapping[str, str] | None = None) -> Any:
    """Means over trajectories as a wide table: one row per estimator, one column per group, best estimators first.

    Estimators that have no estimate for some of the samples, or could not be run on some trajectories, come after
    those that have: their mean is over other, often easier, samples. The column ``valid`` then holds the share.

    Args:
        table: from :func:`poise.evaluate`, with one quantity that has this metric.
        metric: which metric.
        groups: trajectory → group; by default every trajectory is its own. The column ``mean`` is over trajectories.
    """
    table = pandas.DataFrame(table)
    chosen = table[table["metric"] == metric]
    labels = chosen["trajectory"].map(lambda name: (groups or {}).get(name, name))
    order = list(dict.fromkeys(labels))
    wide = chosen.assign(group=labels).groupby(["estimator", "group"], sort=False)["value"].mean().unstack()[order]
    wide.columns.name = "group"
    wide["mean"] = chosen.groupby("estimator")["value"].mean()
    shares = coverage(table, metric).reindex(wide.index)
    complete = shares >= COMPLETE * shares.max()
    if not complete.all():
        wide["valid"] = shares
    return wide.assign(late=~complete).sort_values(["late", "mean"]).drop(columns="late")


def agreement(table: pandas.DataFrame, metric: str = "inclination") -> Any:
    """Differences between estimators on recordings without truth: one row and one column per estimator, deg.

    The order is that of the table: no estimator is the truth, so there is no ranking. ``metric`` is ``inclination``,
    ``heading`` or ``total``.
    """
    table = pandas.DataFrame(table)
    to = table["metric"].str.extract(f"^{re.escape(metric)} to (.+)$", expand=False)
    chosen = table.assign(to=to)[to.notna()]
    if chosen.empty:
        return pandas.DataFrame()
    rows, columns = list(dict.fromkeys(chosen["estimator"])), list(dict.fromkeys(chosen["to"]))
    wide = chosen.groupby(["estimator", "to"])["value"].mean().unstack()
    known = [*(name for name in rows if name in columns), *(name for name in columns if name not in rows)]
    return wide.reindex(index=rows, columns=known)
