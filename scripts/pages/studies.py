"""Tables of studies in pages: a block holds a table of a report, and a run replaces it.

A block begins with ``<!-- study: WORK: TITLE -->`` and ends with ``<!-- end of study -->``. The title is that of a
table in the report of the work, or ``run``: the command and the versions. ``all`` in the place of a work takes the
tables of all works whose title begins so, as one. Blocks of works that a run did not finish stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from ...baselines.studies import PAPERS
from ...baselines.studies.report import stem
from ...filters.support.files import write_text
from ...filters.support.names import look_up
from ...filters.support.rows import markdown_table

BLOCK = re.compile(r"(<!-- study: ([a-z-]+): (.+?) -->\n).*?(<!-- end of study -->)", re.DOTALL)
RUN = "run"
EVERY = "all"


def update(pages: Iterable[Path], works: Mapping[str, Path], made: str) -> None:
    """Replace the blocks of pages; pages that change are written whole.

    Args:
        pages: Markdown files.
        works: name of each finished work → folder of its report.
        made: Markdown that says with what the numbers were computed.

    Raises:
        ValueError: a block names a table that the report does not have; no page is written.
    """
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    for page, text in {page: updated(text, works, made) for page, text in texts.items()}.items():
        if text != texts[page]:
            write_text(page, text)


def updated(text: str, works: Mapping[str, Path], made: str) -> str:
    """The text of a page with the tables of these works."""

    def block(found: re.Match[str]) -> str:
        begin, work, title, end = found.groups()
        if work not in works and not (work == EVERY and set(works) >= set(PAPERS)):
            return found[0]
        if title == RUN:
            return f"{begin}{made.strip()}\n{end}"
        text = joined(works, title) if work == EVERY else table(works[work], title)
        return f"{begin}{text.strip()}\n{end}"

    return BLOCK.sub(block, text)


def table(folder: Path, title: str) -> str:
    """A table of a report, as Markdown, with its note.

    Raises:
        ValueError: the report has no such table.
    """
    files = {path.stem: path for path in (folder / "tables").glob("*.md")}
    return look_up("table", stem(title), files).read_text(encoding="utf-8")


def joined(works: Mapping[str, Path], title: str) -> str:
    """The tables of works whose titles begin with this one, as one table: work, course, and their own columns.

    Raises:
        ValueError: no report has such a table.
    """
    begin = stem(title) + "-"
    rows = []
    for work, folder in works.items():
        for path in sorted((folder / "tables").glob(f"{begin}*.csv")):
            course = re.split("[-_]", path.stem.removeprefix(begin))[0]
            rows += [{"work": work, "course": course, **row} for row in pd.read_csv(path).to_dict("records")]
    if not rows:
        raise ValueError(f"no report of {', '.join(works)} has a table that begins with {title!r}")
    return markdown_table(rows)
