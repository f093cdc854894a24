"""Numbers of the comparison: means with intervals over riders, consistency, each angle."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...learned.rides import UNSEEN
from ...statistics import mean_interval
from ..report import result
from .suite import CONSTANT, ROLL_ONLY, Row, names_of


def by_method(rows: Iterable[Row], paper: str) -> dict[str, dict[str, list[Row]]]:
    """Method → group → rows of one paper, methods in the order of the rows, groups in that of :data:`.UNSEEN`."""
    found: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        if row.paper == paper:
            found.setdefault(row.method, {group: [] for group in UNSEEN})[row.group].append(row)
    return found


def results(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """One number a row, as run folders keep them: each angle, and the mean over angles with its measures."""
    found = []
    for row in rows:
        ride = f"{row.group}:{row.ride}-{row.draw}"
        for name, angle in zip(names_of(row.paper), row.angles, strict=True):
            found.append(result(row.method, ride, f"{row.paper}/{name}", "angle", angle, "deg"))
        found += [result(row.method, ride, row.paper, *measure) for measure in measures(row)]
    return found


def measures(row: Row) -> list[tuple[str, float, str]]:
    """Metric, value and unit of what tables have of all angles together."""
    return [
        ("angle", row.mean, "deg"),
        ("angle over bound", row.over_bound, "1"),
        ("nees", row.nees, "1"),
        ("coverage of 90 %", row.coverage, "1"),
    ]


def ride_means(rows: Iterable[Row], paper: str) -> list[tuple[str, str, str, str, float, str]]:
    """Means over the draws of each ride, as rows of :func:`poise.evaluate`, of what estimates all angles of a paper."""
    found = []
    for method, groups in by_method(rows, paper).items():
        for group, own in groups.items() if method not in ROLL_ONLY and not method.endswith(CONSTANT) else ():
            for ride in sorted({row.ride for row in own}):
                draws = [measures(row) for row in own if row.ride == ride]
                for metric, _, unit in draws[0]:
                    value = float(np.mean([value for draw in draws for name, value, _ in draw if name == metric]))
                    found.append((method, f"{group}:{ride}", paper, metric, value, unit))
    return found


def riders(rows: Sequence[Row]) -> np.ndarray:
    """Mean error ``(rides,)`` of each ride over its draws, deg; every ride has a rider of its own."""
    rides = sorted({row.ride for row in rows})
    return np.array([np.mean([row.mean for row in rows if row.ride == ride]) for ride in rides])


def summary(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Numbers of each paper, method and group, for :mod:`poise.baselines.comparison.rider_tables`, as JSON has them.

    Columns: paper, method, group; ``error``, ``low`` and ``high``: mean of the RMS errors over angles, draws and
    riders, deg, and its 95 % interval over riders; ``over bound``; ``nees`` and ``coverage`` of the stated 90 %. What
    differs from another method in its deviations alone has the latter two only.
    """
    found = []
    for paper in dict.fromkeys(row.paper for row in rows):
        for method, groups in by_method(rows, paper).items():
            for group, own in groups.items():
                error = mean_interval(riders(own))
                numbers = {"error": error.value, "low": error.low, "high": error.high}
                for name, values in (
                    ("over bound", [row.over_bound for row in own]),
                    ("nees", [row.nees for row in own]),
                    ("coverage", [row.coverage for row in own]),
                ):
                    numbers[name] = float(np.mean(values))
                numbered = ("nees", "coverage") if method.endswith(CONSTANT) else tuple(numbers)
                known = {n: v if n in numbered and np.isfinite(v) else None for n, v in numbers.items()}
                label = f"{method} (roll alone)" if method in ROLL_ONLY else method
                found.append({"paper": paper, "method": label, "group": group, **known})
    return found


def angle_table(rows: Sequence[Row], paper: str) -> list[dict[str, str]]:
    """Method × angle: means over draws and riders in the three groups, deg, ``1.2 / 1.5 / 1.9``."""
    names = names_of(paper)
    table = []
    for method, groups in by_method((row for row in rows if not row.method.endswith(CONSTANT)), paper).items():
        errors = [np.array([row.angles for row in own]).mean(axis=0) for own in groups.values()]
        cells = {
            name: " / ".join(f"{each[index]:.2f}" for each in errors)
            for index, name in enumerate(names)
            if np.isfinite([each[index] for each in errors]).all()
        }
        table.append({"method": method, **{name: cells.get(name, "–") for name in names}})
    return table
