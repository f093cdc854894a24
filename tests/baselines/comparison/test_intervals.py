"""Intervals, paired differences, ranks and regressions of a table of errors."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

from poise.baselines.comparison.intervals import details, errors_of, intervals, is_measure, regressions, win_matrix
from poise.filters.support.rows import RESULT


def table(errors: dict[str, list[float]], metric: str = "inclination") -> pandas.DataFrame:
    rows = [
        (name, f"ride-{number}", "up", kind, value if kind == metric else 1.0, "deg")
        for name, values in errors.items()
        for number, value in enumerate(values)
        for kind in (metric, "valid")
    ]
    return pandas.DataFrame(rows, columns=list(RESULT))


RNG = np.random.default_rng(0)
BASE = RNG.uniform(1.0, 3.0, 40)
ERRORS = table({"good": list(BASE), "alike": list(BASE[::-1] + 1e-3), "worse": list(BASE + 0.2)})


def test_paired_differences_see_what_means_alone_do_not() -> None:
    """``worse`` is always 0.2 above ``good``: intervals of the means overlap, that of the difference excludes zero."""
    rows = {row["estimator"]: row for row in intervals(errors_of(ERRORS, "inclination"))}
    good, worse = rows["good"], rows["worse"]
    assert good["high"] > worse["low"]
    assert worse["difference low"] == pytest.approx(0.2) == worse["difference high"]
    assert (worse["better"], good["better"]) == (0.0, 0.5)
    assert rows["alike"]["difference low"] < 0.0 < rows["alike"]["difference high"]
    assert rows["alike"]["mean"] == pytest.approx(BASE.mean() + 1e-3)


def test_interval_has_the_width_of_a_mean() -> None:
    """Of 40 draws of one distribution the 95 % interval is about ±1.96 standard errors."""
    (row, *_) = intervals(errors_of(ERRORS, "inclination"))
    half = 1.96 * BASE.std() / np.sqrt(len(BASE))
    assert row["high"] - row["low"] == pytest.approx(2 * half, rel=0.1)
    assert intervals(errors_of(ERRORS, "inclination"))[0] == row, "draws repeat"


def test_win_matrix_counts_trajectories() -> None:
    names, wins = win_matrix(errors_of(ERRORS, "inclination"))
    assert names[-1] == "worse"
    assert wins[names.index("good"), names.index("worse")] == 1.0
    assert wins[names.index("worse"), names.index("good")] == 0.0
    np.testing.assert_allclose(wins + wins.T, 1.0)


def test_an_estimator_that_ran_on_few_trajectories_is_not_ranked() -> None:
    both = pandas.concat([ERRORS, table({"half": list(BASE[:20] / 10.0)})])
    assert "half" not in errors_of(both, "inclination").columns


def test_regressions_name_what_grew() -> None:
    before, now = (one.assign(suite="simulation") for one in (ERRORS, ERRORS.copy()))
    assert regressions(now, before) == []
    grown = (now["estimator"] == "alike") & (now["metric"] == "inclination")
    now.loc[grown, "value"] *= 1.05
    (row,) = regressions(now, before)
    assert (row["estimator"], row["suite"], row["metric"]) == ("alike", "simulation", "inclination")
    assert row["growth, %"] == pytest.approx(5.0)
    now.loc[grown, "value"] *= 1.01 / 1.05
    assert regressions(now, before) == [], "less than 2 %"


def test_tables_without_anything_in_common() -> None:
    one = ERRORS.assign(suite="simulation")
    with pytest.raises(ValueError, match="no result in common"):
        regressions(one, one.assign(suite="rides"))


def test_details_are_means_and_the_largest() -> None:
    rows = [("one", f"ride-{n}", "up", "inclination largest", value, "deg") for n, value in enumerate((3.0, 7.0))]
    rows += [("one", f"ride-{n}", "up", "inclination", 1.0, "deg") for n in range(2)]
    rows += [("one", f"ride-{n}", "relative_orientation", "nees", value, "1") for n, value in enumerate((1.0, 3.0))]
    frame = pandas.DataFrame(rows, columns=list(RESULT))
    (row,) = details(frame, "inclination", "up")
    assert (row["RMS"], row["largest"], row["NEES"]) == (1.0, 7.0, 2.0)
    assert list(is_measure(frame)) == [True, True, False, False, True, True]


def test_details_state_where_a_consistent_filter_lies() -> None:
    values = {"inclination": 1.0, "nees": 1.2, "nees degrees": 2.0, "nis": 0.5, "nis lower": 0.9, "nis upper": 1.1}
    names = {"inclination": "up", "nees": "relative_orientation", "nees degrees": "relative_orientation"}
    rows = [
        ("one", f"ride-{n}", names.get(metric, "innovation"), metric, value, "1")
        for n in range(10)
        for metric, value in values.items()
    ]
    (row,) = details(pandas.DataFrame(rows, columns=list(RESULT)), "inclination", "up")
    # chi-square of 20 degrees of freedom: 9.591 and 34.170 (tables)
    assert (row["NEES 95 %"], row["NIS 95 %"]) == ("0.48 – 1.71", "0.90 – 1.10")
