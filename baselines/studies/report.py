"""What a study reports: texts, tables, claims, figures and numbers, in the order in which they were found."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...filters.support.files import replacing, write_text
from ...filters.support.rows import RESULT, markdown_table
from ..plots import save, save_animation
from .claims import Claim

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RANGE = "mean, smallest … largest over riders and seeds"
OVER_MOTIONS = "mean, smallest … largest over the motions"
STD = "mean ± standard deviation over riders and seeds"


@dataclass(frozen=True)
class Entry:
    """One piece of a report."""

    title: str
    """heading; empty for a text without one"""
    text: str = ""
    """Markdown: the text, or the note under a table or figure"""
    rows: tuple[dict[str, Any], ...] = ()
    """of a table"""
    figure: Path | None = None
    """file of a picture"""


@dataclass
class Report:
    """Collects what a study finds; tables are also written as CSV, figures as PNG.

    Args:
        folder: the run's; ``tables/`` and ``figures/`` are made in it.
        publish: called with every entry when it is added.
    """

    folder: Path
    publish: Callable[[Entry], None] = lambda entry: None
    entries: list[Entry] = field(default_factory=list)
    results: list[dict[str, Any]] = field(default_factory=list)
    """rows of ``results.csv``"""
    claimed: dict[str, list[Claim]] = field(default_factory=dict)
    """title of a table of claims → its claims"""
    files: set[Path] = field(default_factory=set)
    """of tables and figures"""

    def text(self, markdown: str, title: str = "") -> None:
        """Add a paragraph or more."""
        self._add(Entry(title, markdown.strip()))

    def table(self, title: str, rows: Sequence[Mapping[str, Any]], note: str = "") -> None:
        """Add a table, and write it to ``tables/<title>.csv`` with all digits and, as it is read, to ``<title>.md``.

        Args:
            title: heading, of its own in this report.
            rows: column → value; texts, numbers, None.
            note: Markdown beneath.

        Raises:
            ValueError: no row, or a title that another entry has.
        """
        if not rows:
            raise ValueError(f"a table needs rows, {title!r} has none")
        path = self._new_file("tables", title, ".csv")
        columns = list(dict.fromkeys(name for row in rows for name in row))
        with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        entry = Entry(title, note.strip(), tuple(map(dict, rows)))
        write_text(path.with_suffix(".md"), "\n\n".join(filter(None, (markdown_table(rows), entry.text))) + "\n")
        self._add(entry)

    def figure(self, name: str, figure: Figure, title: str, note: str = "") -> Path:
        """Add a picture, written to ``figures/<name>.png``; returns the file.

        Raises:
            ValueError: a name or title that another entry has.
        """
        path = save(figure, self._new_file("figures", name, ".png"))
        self._add(Entry(title, note.strip(), figure=path))
        return path

    def animation(self, name: str, frames: Sequence[Figure], interval: float, title: str) -> Path:
        """Add a moving picture, written to ``figures/<name>.gif``; returns the file.

        Args:
            name: of the file.
            frames: pictures of equal size.
            interval: s from frame to frame.
            title: heading.

        Raises:
            ValueError: a name or title that another entry has.
        """
        path = save_animation(frames, interval, self._new_file("figures", name, ".gif"))
        self._add(Entry(title, figure=path))
        return path

    def numbers(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Add rows to ``results.csv``: estimator, trajectory, quantity, metric, value, unit."""
        self.results.extend(map(dict, rows))

    def compare(self, title: str, rows: Sequence[Mapping[str, Any]], note: str = "", *, interval: str = RANGE) -> None:
        """Add a table of published values beside ours.

        Args:
            title: heading.
            rows: each with ``quantity``, ``published`` (text or number; None where the paper has none), ``unit`` and
                ``values`` (one a ride; NaN are left out). Further keys are columns before the quantity (``filter``, …).
            note: Markdown beneath.
            interval: what stands behind our value: :data:`STD`, or the smallest and largest under another name.
        """
        shown = []
        for row in rows:
            others = {name: value for name, value in row.items() if name not in OWN}
            ours, extent = summarised(row["values"], interval)
            own = {"quantity": row["quantity"], "published": row["published"], "ours": ours}
            shown.append(others | own | {"interval": extent, "unit": row["unit"]})
        self.table(title, shown, f"Ours: {interval}. {note}".strip())

    def claims(self, title: str, claims: Sequence[Claim], note: str = "") -> None:
        """Add a table of statements, the numbers that decide each, and whether it holds.

        Args:
            title: heading, of its own in this report.
            claims: what is claimed; a report states no finding elsewhere.
            note: Markdown beneath.
        """
        rows = [{"statement": each.statement, "number": each.number, "holds": each.holds} for each in claims]
        self.table(title, rows, note)
        self.claimed[title] = list(claims)

    def _new_file(self, folder: str, name: str, suffix: str) -> Path:
        path = self.folder / folder / (stem(name) + suffix)
        if path in self.files:
            raise ValueError(f"the report has {path.name} already: choose another title than {name!r}")
        self.files.add(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _add(self, entry: Entry) -> None:
        self.entries.append(entry)
        self.publish(entry)


def stem(title: str) -> str:
    """Name of the file of an entry, without its suffix."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:80]


def result(*values: Any) -> dict[str, Any]:
    """A row of ``results.csv``, of :data:`.RESULT`: estimator, trajectory, quantity, metric, value, unit."""
    return dict(zip(RESULT, values, strict=True))


OWN = ("quantity", "published", "unit", "values")
"""Keys of a comparison that have a meaning."""


def summarised(values: Any, interval: str) -> tuple[float, str | None]:
    """Mean of values (NaN left out), and as text their smallest and largest, or for :data:`STD` their deviation."""
    found = np.asarray(values, dtype=float).ravel()
    found = found[np.isfinite(found)]
    if len(found) == 0:
        return float("nan"), None
    if interval == STD:
        return float(found.mean()), f"± {found.std(ddof=1):.3g}" if len(found) > 1 else None
    return float(found.mean()), f"{found.min():.3g} … {found.max():.3g}"
