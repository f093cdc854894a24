"""Coverage of a work: verdicts follow from entries and claims of a report."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from poise.baselines.studies import PAPERS, coverage
from poise.baselines.studies.claims import Claim
from poise.baselines.studies.coverage import Item, cover, page, read, verdict
from poise.baselines.studies.report import Report

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def report(tmp_path):
    report = Report(tmp_path)
    report.text("numbers", "Table I, indoors")
    report.claims(
        "What holds",
        [
            Claim("It does not drift", "0.1 deg", True),
            Claim("It beats zero", "2 against 1 deg", False),
            Claim("It is late in a short ride", "–", None),
            Claim("The camera is off", "by 1 deg", True),
        ],
    )
    return report


@pytest.mark.parametrize(
    ("item", "expected", "text"),
    [
        (Item("Figure 1", "a picture", because="it shows no result"), "cannot be answered", "it shows no result"),
        (Item("Table I", "errors", ("Table I",)), "reproduced", "drawn"),
        (Item("Table I", "drift", ("Table I",), (("What", "It does not drift"),)), "reproduced", "0.1 deg"),
        (Item("Table I", "skill", (), (("What", "It beats zero"),)), "differs", "does not hold"),
        (Item("Table I", "late", (), (("What", "It is late"),)), "undecided in this run", "–"),
        (Item("Table II", "more", ("Table II",)), "not in this run", ""),
        (Item("Table II", "more", (), (("What", "Nobody says so"),)), "not in this run", ""),
    ],
)
def test_a_verdict_follows_from_entries_and_claims(report, item, expected, text):
    row = verdict(item, report)
    assert row["verdict"] == expected
    assert text in row["what decides"]


def test_a_difference_has_its_number_and_the_causes_that_hold(report):
    causes = (("What", "The camera"), ("What", "It is late"))
    row = verdict(Item("Table I", "skill", ("Table I",), (("What", "It beats"),), (), causes), report)
    assert row["what decides"] == (
        "It beats zero: 2 against 1 deg – does not hold; because: The camera is off: by 1 deg"
    )
    bare = verdict(Item("Table I", "skill", (), (("What", "It beats"),), (), causes[1:]), report)
    assert bare["what decides"] == (
        "It beats zero: 2 against 1 deg – does not hold; no cause that was looked for holds"
    )
    assert row["shown in"] == "Table I, indoors; What"


def test_what_is_right_once_it_is_corrected_is_told_from_a_difference(report):
    published, mended = (("What", "It beats zero"),), (("What", "It does not drift"),)
    row = verdict(Item("(3)", "equation", (), published, mended), report)
    assert row["verdict"] == "reproduced as corrected"
    assert row["what decides"] == ("It beats zero: 2 against 1 deg – does not hold; It does not drift: 0.1 deg")
    assert verdict(Item("(3)", "equation", (), published, published), report)["verdict"] == "differs"
    assert verdict(Item("(3)", "equation", (), published, (("What", "Nobody"),)), report)["verdict"] == (
        "not in this run"
    )


def test_claims_of_several_tables_are_named_together():
    both = coverage.claims_in("What holds, indoor", "What holds, outdoor")
    item = Item("Table I", "drift", "Table I", both("It does not", "It beats"))
    assert item.shown == ("Table I",)
    assert item.decided == tuple(
        (f"What holds, {course}", start) for start in ("It does not", "It beats") for course in ("indoor", "outdoor")
    )


def test_an_item_that_nothing_answers_needs_a_reason():
    with pytest.raises(ValueError, match="Figure 3: an item that nothing shows or decides needs a reason"):
        Item("Figure 3", "curves")
    with pytest.raises(ValueError, match="claims in 'causes' say why it differs, not 'because' = 'it is short'"):
        Item("Figure 3", "curves", ("Figure 3",), because="it is short")


def test_the_page_has_every_row(report, tmp_path):
    items = (Item("Figure 1", "a | b", because="none"), Item("Table I", "errors", ("Table I",)))
    cover(report, items)
    rows = read(tmp_path)
    assert [row["item"] for row in rows] == ["Figure 1", "Table I"]
    text = page({"small": rows}, "- seed 0")
    assert "2 items: 1 reproduced, 1 cannot be answered" in text
    assert "| Figure 1 | a \\| b | cannot be answered | none |" in text
    assert text.endswith("- seed 0\n")


@pytest.mark.parametrize("paper", PAPERS)
def test_items_of_a_paper_are_told_apart(paper):
    module = importlib.import_module(PAPERS[paper].replace(".study", ".items"), "poise.baselines.studies")
    names = [(item.label, item.content) for item in module.ITEMS]
    assert len(names) == len(set(names)) > 10
    assert all(
        isinstance(start, str)
        for item in module.ITEMS
        for key in (*item.decided, *item.corrected, *item.causes)
        for start in key
    )


@pytest.mark.parametrize("paper", PAPERS)
def test_the_page_has_every_item(paper):
    text = (ROOT / "docs" / "coverage.md").read_text(encoding="utf-8")
    (section,) = [part for part in text.split("\n## ") if part.startswith(f"{paper}\n")]
    rows = [line.split(" | ")[:2] for line in section.splitlines() if line.startswith("| ")][2:]
    module = importlib.import_module(PAPERS[paper].replace(".study", ".items"), "poise.baselines.studies")
    assert [tuple(cell.strip("| ") for cell in row) for row in rows] == [
        (item.label, item.content.replace("|", "\\|")) for item in module.ITEMS
    ]
    assert coverage.ABSENT not in section
