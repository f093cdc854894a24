"""Coverage of a work: each of its tables, figures and statements with the verdict of a run.

A work lists its :class:`Item` s as data. An item names the entries of the report that show it and the claims that
decide it; the verdict is computed from them and is never written down.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...filters.support.rows import markdown_table
from .claims import Claim
from .report import Report

TITLE = "Coverage"
"""Title of the table in every report, and name of its file ``tables/coverage.csv``."""
REPRODUCED, CORRECTED, DIFFERS, IMPOSSIBLE = "reproduced", "reproduced as corrected", "differs", "cannot be answered"
UNDECIDED, ABSENT = "undecided in this run", "not in this run"
UNEXPLAINED = "no cause that was looked for holds"
"""Stands where none of an item's causes is confirmed."""
VERDICTS = (REPRODUCED, CORRECTED, DIFFERS, IMPOSSIBLE, UNDECIDED, ABSENT)
COLUMNS = ("item", "content", "verdict", "what decides", "shown in")
Decided = tuple[str, str]
"""Beginnings of the title of a table of claims and of a statement in it."""


def claims_in(*titles: str) -> Callable[..., tuple[Decided, ...]]:
    """Takes beginnings of statements, gives those claims of every table whose title begins with one of ``titles``."""
    return lambda *statements: tuple((title, each) for each in statements for title in titles)


INDOOR, OUTDOOR = claims_in("What holds, indoor"), claims_in("What holds, outdoor")
BOTH = claims_in("What holds, indoor", "What holds, outdoor")
"""Claims of the courses that every study of rides has."""


@dataclass(frozen=True)
class Item:
    """One table, figure or statement of a work."""

    label: str
    """such as ``Figure 15``; for a statement, where it is made"""
    content: str
    """what it shows or says"""
    shown: str | tuple[str, ...] = ()
    """beginning of the title of the report's entry that shows it, or of several"""
    decided: tuple[Decided, ...] = ()
    """claims that say what the item says; it is reproduced if all hold"""
    corrected: tuple[Decided, ...] = ()
    """claims that say it of the corrected equations; if all hold, a misprint is all that is between work and run"""
    causes: tuple[Decided, ...] = ()
    """claims that explain a difference; those that hold are printed where the item differs"""
    because: str = ""
    """why no run can answer it; where one can, claims say why: no sentence stays that no number changes"""

    def __post_init__(self) -> None:
        if isinstance(self.shown, str):
            object.__setattr__(self, "shown", (self.shown,))
        if not (self.shown or self.decided or self.because):
            raise ValueError(f"{self.label}: an item that nothing shows or decides needs a reason in 'because'")
        if self.because and (self.shown or self.decided):
            raise ValueError(f"{self.label}: claims in 'causes' say why it differs, not 'because' = {self.because!r}")


def verdict(item: Item, report: Report) -> dict[str, str]:
    """Row of the coverage table: :data:`COLUMNS` → text."""
    titles = [entry.title for entry in report.entries]
    shown = [next((title for title in titles if title.startswith(start)), None) for start in item.shown]
    found = [claim for key in item.decided for claim in claims_of(report, key)]
    missing = any(title is None for title in shown) or any(
        not claims_of(report, key) for key in (*item.decided, *item.corrected)
    )
    failed = [claim for claim in found if claim.holds is False]
    reasons: list[str] = []
    if not (item.shown or item.decided):
        result, reasons = IMPOSSIBLE, [item.because]
    elif missing and item.corrected:
        result = ABSENT
    elif failed:
        mended = [claim for key in item.corrected for claim in claims_of(report, key)]
        result = CORRECTED if mended and all(claim.holds for claim in mended) else DIFFERS
        failed += mended
        causes = [claim for key in item.causes for claim in claims_of(report, key) if claim.holds]
        reasons = [*map(said, failed), *(f"because: {said(claim)}" for claim in causes)]
        if result == DIFFERS and not causes:
            reasons.append(UNEXPLAINED)
    elif missing:
        result = ABSENT
    elif any(claim.holds is None for claim in found):
        result, reasons = UNDECIDED, [said(claim) for claim in found if claim.holds is None]
    else:
        result, reasons = REPRODUCED, [said(claim) for claim in found] or ["drawn; it states nothing"]
    where = dict.fromkeys([*(title for title in shown if title), *(title for title, _ in item.decided)])
    values = (item.label, item.content, result, "; ".join(reasons), "; ".join(where))
    return dict(zip(COLUMNS, values, strict=True))


def claims_of(report: Report, key: Decided) -> list[Claim]:
    """Claims of the report whose table and statement begin so."""
    title, statement = key
    return [
        claim
        for name, claims in report.claimed.items()
        if name.startswith(title)
        for claim in claims
        if claim.statement.startswith(statement)
    ]


def said(claim: Claim) -> str:
    """A claim in one line: statement and number, with what the run found if it does not hold."""
    return f"{claim.statement}: {claim.number}" + (" – does not hold" if claim.holds is False else "")


def cover(report: Report, items: Sequence[Item]) -> None:
    """Add the coverage table of a work at the end of its report."""
    rows = [verdict(item, report) for item in items]
    note = f"Of {len(rows)} tables, figures and statements: {counted(rows)}."
    report.table(TITLE, rows, note)


def counted(rows: Iterable[Mapping[str, str]]) -> str:
    """How many rows have each verdict, in words."""
    verdicts = [row["verdict"] for row in rows]
    return ", ".join(f"{verdicts.count(name)} {name}" for name in VERDICTS if name in verdicts)


def read(folder: Path) -> list[dict[str, str]]:
    """Rows of the coverage table in the run folder of a work."""
    with (folder / "tables" / f"{TITLE.lower()}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def page(
    works: Mapping[str, Sequence[Mapping[str, Any]]], provenance: str, failed: Mapping[str, str] | None = None
) -> str:
    """Markdown page of all works: how many items have each verdict, then a table for each work.

    Args:
        works: name of the work → rows of its table.
        provenance: Markdown.
        failed: name of a work that was not computed → its error.
    """
    failed = failed or {}
    every = [row for rows in works.values() for row in rows]
    parts = [
        "# Coverage of the five works",
        "Each table, figure and statement of the five works, with the verdict of a run.",
        "* *Reproduced*: the run shows it, and every claim that decides it holds.\n"
        "* *Reproduced as corrected*: not with the equations as published, but with their misprints corrected.\n"
        "* *Differs*: a claim does not hold. Its number follows, then the causes that the run confirms, with theirs.\n"
        "* *Cannot be answered*: a simulator has no counterpart.",
        f"{len(every)} items: {counted(every)}. The page is written by `poise reproduce all --page FILE`.",
    ]
    if failed:
        parts.append(f"**Not computed: {', '.join(failed)}.** What is counted above is without.")
    for work, rows in works.items():
        parts += [f"## {work}", f"{counted(rows)[:1].upper()}{counted(rows)[1:]}."]
        parts.append(markdown_table(rows, COLUMNS[:4]))
    for work, error in failed.items():
        parts += [f"## {work}", f"Not computed: `{error}`"]
    return "\n\n".join([*parts, "## Provenance", provenance]) + "\n"
