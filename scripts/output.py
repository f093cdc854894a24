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

from ..filters.support.rows import jsonable, records
from ..filters.support.version import poise_version
from .tables import print_table


class Output:
    """Collects what a command finds; prints it at once, or as one document at the end of a ``with`` block.

    Args:
        command: name of the command.
        args: its arguments; ``json`` and ``seed`` count, if it has them.
    """

    def __init__(self, command: str, args: Any) -> None:
        self.as_json = bool(getattr(args, "json", False))
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
        """Rows for both; see :func:`.tables.print_table` for the options of the printed table."""
        found = records(rows)
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
