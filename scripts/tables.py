"""Rows of any kind → a table on the terminal (rich)."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..filters.support.rows import cell, columns_of, is_numeric, records

PIPE_WIDTH = 120
"""Columns of a table that does not go to a terminal."""

LONGEST_NAME = 60
"""Characters up to which a text stays on one line of a printed table."""


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
    names = columns_of(data, columns)
    table = Table(title=title, title_justify="left")
    for name in names:
        # Long headings of numbers and sentences break into lines; names stay whole.
        if is_numeric(data, name):
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
