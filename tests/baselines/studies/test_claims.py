"""Claims of reports: the numbers decide, and a number that is missing decides nothing."""

from __future__ import annotations

import math

from poise.baselines.studies.claims import Claim
from poise.baselines.studies.report import Report


def test_a_comparison_holds_or_not():
    claim = Claim.less("a is half of b", 1.0, 2.5, factor=0.5, names=("a", "b"))
    assert claim.holds is True
    assert claim.number == "a 1 against 0.5 × b 2.5 deg"
    assert Claim.less("a is half of b", 1.3, 2.5, factor=0.5).holds is False
    assert Claim.less("a is less", math.nan, 2.0).holds is None


def test_ranges_maxima_and_minima():
    assert Claim.within("consistent", 1.1, 0.8, 1.2).holds is True
    assert Claim.within("consistent", 1.3, 0.8, 1.2).number == "1.3 (0.8 … 1.2)"
    assert Claim.within("consistent", 1.3, 0.8, 1.2).holds is False
    errors = {"roll": 1.0, "pitch": 3.0, "yaw": math.nan}
    assert Claim.every("below 5°", errors, 5.0).holds is True
    assert Claim.every("below 2°", errors, 2.0).number == "largest: 3 deg (pitch), limit 2"
    assert Claim.every("below 2°", errors, 2.0).holds is False
    assert Claim.every("below 2°", {"yaw": math.nan}, 2.0).holds is None
    assert Claim.best("roll is best", "roll", errors).holds is True
    assert Claim.best("pitch is best", "pitch", errors).number == "pitch 3 against roll 1 deg"
    assert Claim.best("pitch is best", "pitch", errors).holds is False


def test_errors_are_compared_with_a_reference_by_name():
    errors, published = {"roll": 1.0, "pitch": 3.0, "yaw": 9.0}, {"roll": 2.0, "pitch": 2.0}
    found = Claim.shares("at or below the published ones", errors, published)
    assert found.holds is False
    assert found.number == "largest: 1.5 of it (pitch), limit 1"
    assert Claim.shares("within twice", errors, published, 2.0).holds is True


def test_a_ranking_is_that_of_the_numbers():
    errors = {"a": 1.0, "b": 2.0, "c": 3.0}
    assert Claim.ranked("a before b before c", ("a", "b", "c"), errors).holds is True
    found = Claim.ranked("b first", ("b", "a", "c"), errors)
    assert found.holds is False
    assert found.number == "a < b < c (b 2, a 1, c 3 deg)"


def test_a_report_prints_statement_number_and_verdict(tmp_path):
    report = Report(tmp_path)
    report.claims("What holds", [Claim("a statement", "1 against 2", True), Claim("another", "–", None)])
    assert report.entries[0].rows[0] == {"statement": "a statement", "number": "1 against 2", "holds": True}
    assert (tmp_path / "tables" / "what-holds.csv").read_text().splitlines()[2] == "another,–,"
