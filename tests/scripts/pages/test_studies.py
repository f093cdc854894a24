"""Tables of studies in pages are replaced by those of a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from poise.baselines.studies import PAPERS
from poise.baselines.studies.report import Report
from poise.scripts.pages.studies import BLOCK, update, updated

ROOT = Path(__file__).resolve().parents[3]
PAGE = """Before.

<!-- study: small: Errors, in deg -->
old
<!-- end of study -->

<!-- study: other: Errors -->
of another work
<!-- end of study -->

<!-- study: small: run -->
<!-- end of study -->
After.
"""


@pytest.fixture
def works(tmp_path):
    Report(tmp_path / "small").table("Errors, in deg", [{"angle": "φ", "ours": 1.234}, {"angle": "θ"}], "A note.")
    return {"small": tmp_path / "small"}


def test_blocks_of_finished_works_are_replaced_and_the_rest_stays(works, tmp_path):
    page, other = tmp_path / "page.md", tmp_path / "other.md"
    page.write_text(PAGE, encoding="utf-8")
    other.write_text("nothing to replace\n", encoding="utf-8")
    stamp = other.stat().st_mtime_ns
    update([page, other], works, "- `poise reproduce small`")
    text = page.read_text(encoding="utf-8")
    assert "-->\n| angle | ours |\n| --- | ---: |\n| φ | 1.23 |\n| θ | – |\n\nA note.\n<!-- end" in text
    assert "of another work" in text
    assert "run -->\n- `poise reproduce small`\n<!-- end of study -->\nAfter.\n" in text
    assert "old" not in text
    assert updated(text, works, "- `poise reproduce small`") == text
    assert other.stat().st_mtime_ns == stamp


def test_a_table_that_the_report_does_not_have_is_named_and_no_page_changes(works, tmp_path):
    good, bad = tmp_path / "a.md", tmp_path / "b.md"
    good.write_text(PAGE, encoding="utf-8")
    bad.write_text(PAGE.replace("Errors, in deg", "Error, in deg"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"error-in-deg.*errors-in-deg"):
        update([good, bad], works, "")
    assert good.read_text(encoding="utf-8") == PAGE


@pytest.mark.parametrize("page", ["two_gyro", "force_inertial", "whole_body", "array_rate"])
def test_blocks_of_the_pages_are_well_formed(page):
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    begins, ends = text.count("<!-- study: "), text.count("<!-- end of study -->")
    assert begins == ends == len(BLOCK.findall(text)) > 0


def test_tables_in_short_of_all_works_become_one(tmp_path):
    works = {name: tmp_path / name for name in PAPERS}
    for work in ("two-gyro", "whole-body"):
        report = Report(works[work])
        report.table("In short, indoor_circle, RMS in deg", [{"error of": "roll", "published": 0.72, "here": 0.94}])
        report.table("In short, outdoor, RMS in deg", [{"error of": "roll", "published": None, "here": 1.5}])
    page = "<!-- study: all: In short -->\nold\n<!-- end of study -->\n"
    text = updated(page, works, "")
    assert "| work | course | error of | published | here |" in text
    assert "| two-gyro | indoor | roll | 0.72 | 0.94 |" in text
    assert "| whole-body | outdoor | roll | – | 1.5 |" in text
    assert "old" not in text
    assert updated(page, {"two-gyro": works["two-gyro"]}, "") == page, "one work alone does not replace it"
    with pytest.raises(ValueError, match=r"begins with 'In long'"):
        updated(page.replace("short", "long"), works, "")
