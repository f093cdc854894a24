"""Rows of any kind → a table: on the terminal (rich) or in Markdown."""

from __future__ import annotations

import dataclasses
import enum
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

PIPE_WIDTH = 120
"""Columns of a table that does not go to a terminal."""

LONGEST_NAME = 60
"""Characters up to which a text stays on one line of a printed table."""


def records(rows: Iterable[Any]) -> list[dict[str, Any]]:
    """Return rows as dictionaries.

    Args:
        rows: mappings, named tuples, dataclass instances, or one pandas data frame.
    """
    if hasattr(rows, "to_dict") and not isinstance(rows, Mapping):
        rows = rows.to_dict("records")
    return [_record(row) for row in rows]


def _record(row: Any) -> dict[str, Any]:
    if isinstance(row, Mapping):
        return dict(row)
    if hasattr(row, "_asdict"):
        return dict(row._asdict())
    if dataclasses.is_dataclass(row) and not isinstance(row, type):
        return {field.name: getattr(row, field.name) for field in dataclasses.fields(row)}
    raise TypeError(f"a row is a mapping, a named tuple or a dataclass instance, not {type(row).__name__}")


def jsonable(value: Any, infinite: Callable[[float], Any] = str) -> Any:
    """Return ``value`` in JSON's types: dataclasses by field, paths as text, arrays as lists.

    Args:
        value: anything.
        infinite: what stands for a number that is not finite; its text by default.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: jsonable(getattr(value, field.name), infinite) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): jsonable(item, infinite) for key, item in value.items()}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist(), infinite)
    if isinstance(value, set | frozenset):
        return sorted((jsonable(item, infinite) for item in value), key=str)
    if isinstance(value, list | tuple):
        return [jsonable(item, infinite) for item in value]
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else infinite(value)
    if isinstance(value, type) or callable(value):
        return f"{value.__module__}.{value.__qualname__}" if hasattr(value, "__qualname__") else repr(value)
    return str(value)


def cell(value: Any, digits: int = 3) -> str:
    """Return one entry as text: floats with ``digits`` significant digits, None and NaN as a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        number = float(value)
        if np.isnan(number):
            return "–"
        # Plain digits where they are readable: 12345 rather than 1.23e+04.
        return f"{number:.0f}" if 10**digits <= abs(number) < 1e9 else f"{number:.{digits}g}"
    return str(value)


def rich_table(
    rows: Iterable[Any], title: str | None = None, columns: Sequence[str] | None = None, digits: int = 3
) -> Table:
    """Return rows as a rich table, numbers to the right.

    Args:
        rows: see :func:`records`.
        title: line above the table.
        columns: which fields in which order; by default all, in order of first appearance.
        digits: significant digits of floats.
    """
    data = records(rows)
    names = _columns(data, columns)
    table = Table(title=title, title_justify="left")
    for name in names:
        # Long headings of numbers and sentences break into lines; names stay whole.
        if _numeric(data, name):
            table.add_column(name, justify="right", overflow="fold")
        else:
            longest = max((len(cell(record.get(name))) for record in data), default=0)
            table.add_column(name, no_wrap=longest <= LONGEST_NAME)
    for record in data:
        # Text, so that a name in brackets is not markup.
        table.add_row(*(Text(cell(record.get(name), digits)) for name in names))
    return table


def print_table(
    rows: Iterable[Any],
    title: str | None = None,
    columns: Sequence[str] | None = None,
    digits: int = 3,
    console: Console | None = None,
) -> None:
    """Print rows as a table; the arguments are those of :func:`rich_table`."""
    # A pipe or a file has no width of its own.
    console = console or (Console() if sys.stdout.isatty() else Console(width=PIPE_WIDTH))
    console.print(rich_table(rows, title, columns, digits))


def markdown_table(rows: Iterable[Any], columns: Sequence[str] | None = None, digits: int = 3) -> str:
    """Return rows as a Markdown table; the arguments are those of :func:`rich_table`."""
    data = records(rows)
    names = _columns(data, columns)
    lines = [names, ["---:" if _numeric(data, name) else "---" for name in names]]
    lines += [[cell(record.get(name), digits).replace("|", "\\|") for name in names] for record in data]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _columns(data: Sequence[Mapping[str, Any]], columns: Sequence[str] | None) -> list[str]:
    return list(columns if columns is not None else dict.fromkeys(name for record in data for name in record))


def _numeric(data: Sequence[Mapping[str, Any]], name: str) -> bool:
    present = [value for record in data if (value := record.get(name)) is not None]
    return bool(present) and all(
        isinstance(value, int | float | np.number) and not isinstance(value, bool) for value in present
    )
