"""Tables of the comparison of riders, written from its numbers: those of a run, or those that ``--save`` kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

Numbers = Mapping[str, Any]
"""Paper, method and group, with their numbers; None for one that a method does not have."""


def error_cell(found: Numbers) -> str | None:
    """Mean RMS error, deg, with its 95 % interval over riders; None of what differs in its deviations alone."""
    return None if found["error"] is None else f"{found['error']:.2f} [{found['low']:.2f}, {found['high']:.2f}]"


def consistency_cell(found: Numbers) -> str | None:
    """Mean NEES of an angle, and share of errors inside the stated 90 %; None of a method without a covariance."""
    return None if found["nees"] is None else f"{found['nees']:.2f}, {100.0 * found['coverage']:.0f} %"


CELLS: dict[str, Callable[[Numbers], Any]] = {
    "error": error_cell,
    "mean": lambda found: found["error"],
    "consistency": consistency_cell,
    "bound": lambda found: found["over bound"],
}
"""Table → what stands in a cell: error with interval, error alone, consistency, error over its posterior bound."""


def by_group(numbers: Iterable[Numbers], paper: str, table: str) -> list[dict[str, Any]]:
    """One table of one paper: a row a method, a column a group; methods that lack a number are left out."""
    rows: dict[str, dict[str, Any]] = {}
    for found in numbers:
        if found["paper"] == paper:
            rows.setdefault(found["method"], {})[found["group"]] = CELLS[table](found)
    return [{"method": method, **cells} for method, cells in rows.items() if None not in cells.values()]
