"""Rows of results, one per estimate, as tables of a report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..report import result

Row = dict[str, Any]


def grouped(
    rows: Iterable[Row], by: Mapping[str, str], columns: Mapping[str, tuple[str, Callable[[Sequence[float]], Any]]]
) -> list[Row]:
    """One line for each combination of keys, in order of first appearance; None where no row has a value.

    Args:
        rows: results.
        by: key of the rows → column that shows it.
        columns: column → key of the rows, and the mean, smallest … of its values.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in by), []).append(row)
    table = []
    for names, found in groups.items():
        line: Row = dict(zip(by.values(), names, strict=True))
        for column, (key, summary) in columns.items():
            values = [row[key] for row in found if row[key] is not None]
            line[column] = float(summary(values)) if values else None
        table.append(line)
    return table


def results_of(rows: Iterable[Row], key: str, trajectory: str, quantity: str, metric: str, unit: str) -> list[Row]:
    """Rows of ``results.csv``: ``row[key]`` of each method; ``trajectory`` is a format of the row's entries."""
    return [result(row["method"], trajectory.format(**row), quantity, metric, row[key], unit) for row in rows]


def values_of(rows: Iterable[Row], key: str, **chosen: Any) -> list[Any]:
    """``row[key]`` of the rows that have all the ``chosen`` entries."""
    return [row[key] for row in rows if all(row[name] == value for name, value in chosen.items())]


def mean_of(rows: Iterable[Row], key: str, **chosen: Any) -> float:
    """Mean of :func:`values_of`; NaN if there are none."""
    values = values_of(rows, key, **chosen)
    return float(np.mean(values)) if values else float("nan")
