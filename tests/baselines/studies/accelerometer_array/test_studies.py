"""Chapters 2 and 3 of the thesis on arrays: short motions every day, the full study when slow."""

from __future__ import annotations

import json

import numpy as np
import pytest

from poise.baselines.studies.accelerometer_array import planar as planar_study
from poise.baselines.studies.accelerometer_array import planar_figures
from poise.baselines.studies.accelerometer_array import rate as angular_rate_study
from poise.baselines.studies.accelerometer_array.rate import (
    CALIBRATED,
    DEFAULT,
    ERRORS,
    METHODS,
    PUBLISHED,
    WITH_BIASES,
)


@pytest.fixture
def few_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those whose compiled forms other tests make too."""
    monkeypatch.setattr(angular_rate_study, "METHODS", {name: METHODS[name] for name in (DEFAULT, WITH_BIASES)})
    few = ("mean, wrapped difference", "extended filter")
    monkeypatch.setattr(planar_study, "METHODS", {name: planar_study.METHODS[name] for name in few})


def test_rows_and_tables_of_angular_rates(few_methods: None) -> None:
    rows = angular_rate_study.rate_errors(2, "white 0.1", 16.0)
    rows += angular_rate_study.rate_errors(2, CALIBRATED, 16.0)
    assert json.loads(json.dumps(rows)) == rows
    table = angular_rate_study.rate_table(rows)
    assert [row["method"] for row in table] == [DEFAULT, WITH_BIASES, "always zero"] * 2
    best = {row["errors"]: row["mean"] for row in table if row["method"] == WITH_BIASES}
    assert best["white 0.1"] < 0.2
    assert best[CALIBRATED] < 1.0
    assert all(row["least"] <= row["mean"] <= row["largest"] for row in table)
    for row in angular_rate_study.weight_table(rows):
        slow, *_, fast = [value for key, value in row.items() if key not in ("errors", "method")]
        assert slow > fast


def test_curves_of_angular_rates(few_methods: None) -> None:
    curves = angular_rate_study.rate_curves(1)
    assert {len(values) for values in curves.values()} == {1001}
    assert "true" in curves
    assert "weight" in curves


def test_rows_and_tables_of_planar_angles(few_methods: None) -> None:
    rows = planar_study.planar_errors(0, "infinity", 12.0)
    assert json.loads(json.dumps(rows)) == rows
    table = {row["method"]: row for row in planar_study.planar_table(rows)}
    assert table["extended filter"]["rms (°)"] < 6.0
    assert table["extended filter"]["within 10°"] > 0.9
    assert table["mean, wrapped difference"]["rms (°)"] < 8.0


def test_curves_of_planar_angles() -> None:
    curves = planar_figures.planar_curves(0, "infinity", 6.0)
    assert json.loads(json.dumps(curves)) == curves
    assert set(curves["errors"]) >= {*planar_figures.COMPARED, *planar_figures.MORE}
    found, angle = np.array(curves["estimates"]["extended filter"]), np.array(curves["angle"])
    np.testing.assert_allclose(found - angle, curves["errors"]["extended filter"], atol=1e-9)
    clean = planar_figures.clean_reading(0, "infinity", 6.0)
    assert np.std(np.array(clean) - curves["reading"]) == pytest.approx(0.3, rel=0.2)


def test_unscented_and_extended_filter_are_one_on_both_motions() -> None:
    for motion in planar_study.MOTIONS:
        assert planar_study.unscented_difference(0, motion, 4.0) < 1e-5


@pytest.mark.slow
def test_table_2_1() -> None:
    """Ranking on every seed; errors within those of the thesis; ranges of an independent simulation."""
    rows = [row for seed in range(6) for errors in ERRORS for row in angular_rate_study.rate_errors(seed, errors)]
    for seed in range(6):
        errors = {row["method"]: row["rms"] for row in rows if row["errors"] == CALIBRATED and row["seed"] == seed}
        assert max(errors[DEFAULT], errors[WITH_BIASES]) < min(errors["Parsa"], errors["polynomial roots"])
        assert errors[WITH_BIASES] <= max(PUBLISHED["weighted"])
        assert errors[DEFAULT] < 1.06
    holds = {claim.statement: claim.holds for claim in angular_rate_study.claims(rows)}
    assert holds["Table 2.1: the weighted method has the smallest error"]
    assert not holds["Figure 2.13: the weight grows with the angular rate"]
    means = {(row["errors"], row["method"]): row["mean"] for row in angular_rate_study.rate_table(rows)}
    for errors, largest in (("white 0.022", 0.020), ("white 0.1", 0.093), ("white 0.3", 0.29)):
        assert means[errors, "weighted, J at ω_TI"] <= 1.05 * largest
        assert means[errors, "weighted, J at ω_TI"] < 0.7 * means[errors, "weighted, as published"]
        assert means[errors, "weighted, J at ω_TI"] < 0.8 * means[errors, "weighted, corrected"]
        # what biases would cost where there are none
        assert means[errors, WITH_BIASES] < 1.35 * means[errors, "weighted, J at ω_TI"]
    assert means[CALIBRATED, WITH_BIASES] < 0.9 * means[CALIBRATED, "weighted, J at ω_TI"]
    assert means[CALIBRATED, "time integration"] > 10.0
    for row in angular_rate_study.weight_table(rows):
        if row["method"] == "weighted, J at ω_TI" and row["errors"] in ("white 0.022", "white 0.1"):
            weights = [value for key, value in row.items() if key not in ("errors", "method")]
            np.testing.assert_allclose(weights, [0.99, 0.97, 0.93, 0.88], atol=0.02)


@pytest.mark.slow
def test_planar_figures() -> None:
    """Means of ten seeds against those of an independent simulation."""
    rows = [
        row for motion in planar_study.MOTIONS for seed in range(10) for row in planar_study.planar_errors(seed, motion)
    ]
    found = {(row["motion"], row["method"]): row for row in planar_study.planar_table(rows)}

    def rms(motion: str, method: str) -> float:
        return found[motion, method]["rms (°)"]

    for motion, extended, mean in (("planar-walk", 6.0, 8.6), ("infinity", 4.8, 7.6)):
        assert rms(motion, "extended filter") <= extended
        assert rms(motion, "mean, wrapped difference") <= mean
        assert rms(motion, "unscented filter") == pytest.approx(rms(motion, "extended filter"), abs=1e-5)
        assert 15.0 < rms(motion, "time integration") < 40.0
        assert rms(motion, "tilt") > 40.0
        assert rms(motion, "mean, literal") > 50.0
        assert rms(motion, "linear filter, literal") > 50.0
    best = "complete pose, acceleration returns to zero"
    assert rms("infinity", best) <= 3.3
    assert found["infinity", best]["largest error (°)"] <= 9.0
    assert found["infinity", best]["within 10°"] > 0.99
    thesis = rms("infinity", "complete pose, thesis")
    assert thesis > rms("infinity", "extended filter")
    assert rms("infinity", "complete pose, thesis, published R") > 2.0 * thesis
    assert rms("infinity", "complete pose, thesis, published H") > 5.0 * thesis
    assert rms("planar-walk", "complete pose, thesis") > 80.0
    assert rms("planar-walk", best) < 15.0


@pytest.mark.slow
def test_correlated_acceleration_wants_an_inflated_variance() -> None:
    rows = [row for seed in range(5) for row in planar_study.inflation_errors(seed)]
    errors = {row["R"]: row["rms (°)"] for row in planar_study.planar_table(rows, "R")}
    for R, expected in ((10.0, 8.8), (30.0, 6.2), (100.0, 4.8), (300.0, 4.7), (1000.0, 5.7)):
        assert errors[R] == pytest.approx(expected, abs=0.4)
