"""Output of a command: tables and sentences for people, or with ``--json`` one document for programs.

The document is the only text on standard output: ``{"command", "version", "seed", "rows": [{…}, …], …}``. Rows of
several tables name theirs in ``table``; numbers that are not finite are null. Progress messages go to standard error.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..filters.support.rows import cell, columns_of, is_numeric, jsonable, markdown_table, records
from ..filters.support.version import poise_version

PIPE_WIDTH = 120
"""Columns of a table that does not go to a terminal."""
LONGEST_NAME = 60
"""Characters up to which a text stays on one line of a printed table."""
SENTENCE = 20
"""Characters that a column of sentences needs at least"""


class Output:
    """Collects what a command finds; prints it at once, or as one document at the end of a ``with`` block.

    ``sections`` are those of a report: heading → Markdown, of every table and whatever a command adds.

    Args:
        command: name of the command.
        args: its arguments; ``json`` and ``seed`` count, if it has them.
    """

    def __init__(self, command: str, args: Any) -> None:
        self.as_json = bool(getattr(args, "json", False))
        self.sections: dict[str, str] = {}
        self.document: dict[str, Any] = {
            "command": command,
            "version": poise_version(),
            "seed": getattr(args, "seed", None),
            "rows": [],
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.as_json and kind is None:
            print(json.dumps(jsonable(self.document, lambda value: None), ensure_ascii=False, allow_nan=False))

    def table(self, rows: Iterable[Any], title: str, **options: Any) -> None:
        """Rows for both and the report; see :func:`print_table` for the options of the printed table."""
        found = records(rows)
        self.sections[title] = markdown_table(found)
        self.rows(found, title)
        self.show(found, title, **options)

    def rows(self, rows: Iterable[Any], table: str | None = None) -> None:
        """Rows of the document only, of the table of that name."""
        named = {} if table is None else {"table": table}
        self.document["rows"] += [{**named, **row} for row in records(rows)]

    def show(self, rows: Iterable[Any], title: str, columns: Sequence[str] | None = None, **options: Any) -> None:
        """A table for people only."""
        if not self.as_json:
            print_table(rows, title, columns, **options)
            sys.stdout.flush()

    def say(self, text: str) -> None:
        """A sentence for people, also with ``--json``: then on standard error."""
        print(text, file=sys.stderr if self.as_json else sys.stdout, flush=True)

    def report(self, path: Path) -> None:
        """Where the report of the run is; its folder is the document's ``run``."""
        self.add(run=str(path.parent))
        self.say(f"report: {path}")

    def add(self, **fields: Any) -> None:
        """Further fields of the document."""
        self.document.update(fields)


def print_table(
    rows: Iterable[Any],
    title: str | None = None,
    columns: Sequence[str] | None = None,
    digits: int = 3,
    width: int = PIPE_WIDTH,
    console: Console | None = None,
) -> None:
    """Print rows as a table, numbers to the right.

    Args:
        rows: see :func:`.records`.
        title: line above the table.
        columns: which fields in which order; by default all, in order of first appearance.
        digits: significant digits of floats.
        width: of the standard output, characters, if it is not a terminal.
        console: where; by default the standard output.
    """
    data = records(rows)
    console = console or Console(width=None if sys.stdout.isatty() else width)
    table = Table(title=title, title_justify="left")
    names = columns_of(data, columns)
    widths = {name: max((len(cell(record.get(name), digits)) for record in data), default=0) for name in names}
    # Names that do not break would take the place of numbers where there is too little; sentences need not have it all.
    whole = sum(width if width <= LONGEST_NAME else SENTENCE for width in widths.values())
    room = whole + 3 * len(names) + 1 <= console.width
    for name in names:
        # Long headings of numbers and sentences break into lines; names stay whole.
        if is_numeric(data, name):
            table.add_column(name, justify="right", overflow="fold")
        else:
            table.add_column(name, overflow="fold", no_wrap=room and widths[name] <= LONGEST_NAME)
    for record in data:
        # Text, so that a name in brackets is not markup.
        table.add_row(*(Text(cell(record.get(name), digits)) for name in names))
    console.print(table)
