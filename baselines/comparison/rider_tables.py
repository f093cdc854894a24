"""Tables of the comparison of riders, written from its numbers: those of a run, or those that ``--save`` kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

Numbers = Mapping[str, Any]
"""Paper, method and group, with their numbers; None for one that a method does not have."""


CELLS: dict[str, Callable[[Numbers], Any]] = {
    "error": lambda found: f"{found['error']:.2f} [{found['low']:.2f}, {found['high']:.2f}]",
    "mean": lambda found: found["error"],
    "consistency": lambda found: f"{found['nees']:.2f}, {100.0 * found['coverage']:.0f} %",
    "bound": lambda found: found["over bound"],
}
"""Table → what stands in a cell: mean RMS error (deg) with its 95 % interval over riders, the mean alone, mean NEES of
an angle and share of errors in the stated 90 %, mean error over its posterior bound."""
FIRST = {"error": "error", "mean": "error", "consistency": "nees", "bound": "over bound"}
"""Table → the number without which a method has no cell"""


def by_group(numbers: Iterable[Numbers], paper: str, table: str) -> list[dict[str, Any]]:
    """One table of one paper: a row a method, a column a group; methods that lack a number are left out."""
    rows: dict[str, dict[str, Any]] = {}
    for found in numbers:
        if found["paper"] == paper:
            cell = None if found[FIRST[table]] is None else CELLS[table](found)
            rows.setdefault(found["method"], {})[found["group"]] = cell
    return [{"method": method, **cells} for method, cells in rows.items() if None not in cells.values()]
