"""Uncertainty of a comparison: bootstrap intervals over trajectories, paired differences, ranks, regressions."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...filters.core.consistency import consistency
from ..error_table import COMPLETE, coverage
from ..measures import MEASURES, OF_ERROR
from ..statistics import mean_interval, probability_of_improvement

if TYPE_CHECKING:
    import pandas

DRAWS = 1000
"""Bootstrap draws of an interval."""
WORSE = 0.02
"""Relative growth of a mean error from which it counts as a regression."""
NEGLIGIBLE = 1e-3
"""deg (or the quantity's unit): smaller growth does not count."""


def is_measure(table: pandas.DataFrame) -> Any:
    """Which rows hold measures beyond the RMS error (:mod:`.measures`)."""
    return table["metric"].str.fullmatch(rf"(.+ )?({'|'.join(MEASURES)})")


def errors_of(table: pandas.DataFrame, metric: str, quantity: str | None = None) -> pandas.DataFrame:
    """Errors as a wide table: one row a trajectory, one column an estimator that ran on all of them.

    Args:
        table: rows of :func:`poise.evaluate`.
        metric: which.
        quantity: None where one quantity alone has the metric.
    """
    chosen = table[table["metric"] == metric]
    if quantity is not None:
        chosen = chosen[chosen["quantity"] == quantity]
    shares = coverage(table, metric)
    complete = shares.index[shares >= COMPLETE * shares.max()]
    wide = chosen.pivot_table(index="trajectory", columns="estimator", values="value", sort=False)
    return wide[[name for name in wide.columns if name in complete]].dropna(axis=1)


def intervals(errors: pandas.DataFrame) -> list[dict[str, Any]]:
    """Mean error of every estimator with its 95 % interval over trajectories, best first.

    ``difference`` is the mean of the paired differences to the best estimator on the same trajectories, and ``better``
    the share of trajectories on which the estimator has the smaller error (ties count half).

    Args:
        errors: from :func:`errors_of`.
    """
    order = list(errors.mean().sort_values().index)
    if not order:
        return []
    other = errors[order[0]].to_numpy()
    rows = []
    for name in order:
        own = errors[name].to_numpy()
        mean, paired = mean_interval(own, DRAWS), mean_interval(own - other, DRAWS)
        rows.append(
            {
                "estimator": name,
                "mean": mean.value,
                "low": mean.low,
                "high": mean.high,
                "difference": paired.value,
                "difference low": paired.low,
                "difference high": paired.high,
                "better": probability_of_improvement(-own[None], -other[None]),
                "rank": float(errors.rank(axis=1)[name].mean()),
            }
        )
    return rows


def win_matrix(errors: pandas.DataFrame) -> tuple[list[str], np.ndarray]:
    """Names, best first, and the share of trajectories on which each (row) has a smaller error than each (column)."""
    names = list(errors.mean().sort_values().index)
    values = errors[names].to_numpy()
    return names, (0.5 + 0.5 * np.sign(values[:, None, :] - values[:, :, None])).mean(axis=0)


def details(table: pandas.DataFrame, metric: str, quantity: str) -> list[dict[str, Any]]:
    """Means over trajectories of the measures beyond RMS (the largest of the largest), one row an estimator.

    ``NEES 95 %`` holds the mean NEES of a consistent filter if every trajectory counts as one draw of its error, which
    is correlated over time; ``NIS 95 %`` the mean bounds of white innovations.
    """
    rows = []
    for name in table["estimator"].unique():
        own = table[table["estimator"] == name]
        own = own[own["quantity"].isin([quantity, "relative_orientation", "innovation"])]
        of = partial(values_of, own)
        row: dict[str, Any] = {"estimator": name}
        for label, wanted in (("RMS", metric), *((each, f"{metric} {each}") for each in OF_ERROR)):
            row[label] = float(of(wanted).max() if label == "largest" else of(wanted).mean())
        row |= {"NEES": float(of("nees").mean()), "NEES 95 %": "–", "NIS": float(of("nis").mean()), "NIS 95 %": "–"}
        degrees = of("nees degrees").to_numpy()
        if len(degrees):
            bounds = consistency(degrees, degrees)
            row["NEES 95 %"] = f"{bounds.lower:.2f} – {bounds.upper:.2f}"
        if len(of("nis lower")):
            row["NIS 95 %"] = f"{of('nis lower').mean():.2f} – {of('nis upper').mean():.2f}"
        if row["RMS"] == row["RMS"]:
            rows.append(row)
    return sorted(rows, key=lambda row: row["RMS"])


def values_of(table: pandas.DataFrame, metric: str) -> pandas.Series:
    """Known values of a metric."""
    return table.loc[table["metric"] == metric, "value"].dropna()


def regressions(table: pandas.DataFrame, before: pandas.DataFrame) -> list[dict[str, Any]]:
    """Mean errors that grew against an earlier table, over the trajectories that both have.

    Args:
        table: rows of :func:`poise.evaluate`, with a column ``suite``.
        before: the same of an earlier run.

    Returns:
        One row for each suite, estimator, quantity and metric that grew by more than 2 %; the largest growth first.

    Raises:
        ValueError: the tables have no result in common.
    """
    keys = ["suite", "estimator", "trajectory", "quantity", "metric"]
    errors = [one[~is_measure(one) & ~one["metric"].isin(["valid", "nis"])] for one in (before, table)]
    both = (
        errors[0].merge(errors[1], on=keys, suffixes=(" before", " now")).dropna(subset=["value before", "value now"])
    )
    if both.empty:
        raise ValueError(
            "the baseline has no result in common with this run: suites, estimators or trajectories differ"
        )
    means = both.groupby(["suite", "estimator", "quantity", "metric"], sort=False)[["value before", "value now"]].mean()
    growth = means["value now"] / means["value before"] - 1.0
    grown = means[(growth > WORSE) & (means["value now"] - means["value before"] > NEGLIGIBLE)]
    rows = [
        {**dict(zip(means.index.names, key, strict=True)), "before": row.iloc[0], "now": row.iloc[1]}
        | {"growth, %": 100.0 * float(growth[key])}
        for key, row in grown.iterrows()
    ]
    return sorted(rows, key=lambda row: -row["growth, %"])
