"""The comparison of riders' estimators: references, scores, tables and conditions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.comparison.rider_tables import by_group
from poise.baselines.learned.presets import PRESETS
from poise.baselines.learned.rides import UNSEEN
from poise.baselines.studies.averages import circular_mean
from poise.baselines.studies.riders import suite, sweeps, tables
from poise.baselines.studies.riders.errors import Errors, angle_names, errors_of, score
from poise.baselines.studies.riders.learnt import Ridge, moving_averages
from poise.envs import episodes
from poise.envs.recipes.rides import RideSource, ride
from poise.filters.core import rotation
from poise.filters.registry import make
from poise.scripts.comparison.riders import rider_settings

QUICK = {"pilots": ["ideal"], "scenarios": ["straight"], "fidelity": ["lumped"], "suite": ["two-gyro"]}
SHORT = RideSource(2, 1, 12.0, QUICK)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    kept = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(episodes, "user_cache", lambda name: kept / name)
        yield


def test_moving_averages_are_causal_means() -> None:
    features = np.arange(200.0)[:, None]
    found = moving_averages(features)
    assert found.shape == (200, 4)
    np.testing.assert_allclose(found[150], [150.0, 138.0, 88.0, 75.0])
    np.testing.assert_allclose(found[3], [3.0, 1.5, 1.5, 1.5])


def test_a_regression_finds_what_is_linear() -> None:
    generator = np.random.default_rng(0)
    inputs = generator.normal(3.0, [1.0, 100.0, 0.0], (4000, 3))
    targets = np.stack([2.0 * inputs[:, 0] - 0.01 * inputs[:, 1] + 1.0, np.full(4000, 0.5)], axis=1)
    ridge = Ridge.fit(inputs[:2000], targets[:2000], 1e-6)
    np.testing.assert_allclose(ridge.predict(inputs[2000:]), targets[2000:], atol=1e-6)
    with pytest.raises(ValueError, match="penalty must be positive, got 0"):
        Ridge.fit(inputs, targets, 0.0)


def test_scores_of_known_errors() -> None:
    values = np.radians(np.random.default_rng(1).normal(0.0, [1.0, 2.0], (100_000, 2)))
    found = score(Errors(values, np.radians(np.array([1.0, 2.0])) * np.ones_like(values)))
    np.testing.assert_allclose(found.angles, [1.0, 2.0], rtol=0.01)
    np.testing.assert_allclose([found.nees, found.coverage], [1.0, 0.9], rtol=0.02)
    overconfident = score(Errors(values, np.radians(0.5) * np.array([1.0, 2.0]) * np.ones_like(values)))
    np.testing.assert_allclose(overconfident.nees, 4.0, rtol=0.02)
    assert np.isnan(score(Errors(values)).nees)


def test_means_of_angles_wrap() -> None:
    angles = np.radians([[179.0, 10.0], [-179.0, 20.0]])
    np.testing.assert_allclose(np.abs(np.degrees(circular_mean(angles))), [180.0, 15.0], atol=1e-9)


def test_errors_and_deviations_of_a_filter() -> None:
    ridden = SHORT.recipe().sensed(ride(SHORT, 3, 0), np.random.SeedSequence(1))  # type: ignore[attr-defined]
    kalman = make("two-gyro", dt=ridden.dt, metadata=ridden.metadata, keep_covariance=True)
    scored = suite.scored_samples(ridden.replace(mask=ridden.time > 5.0))
    assert scored.sum() == 175
    estimate = kalman.run(ridden.measurements)
    found = errors_of(kalman, ridden, estimate, scored)
    roll = rotation.wrap(estimate.pose["bicycle/roll"] - ridden.truth["bicycle/roll"])[scored, 0]
    np.testing.assert_allclose(found.values[:, 0], roll)
    assert found.deviations is not None
    np.testing.assert_allclose(found.deviations[:, 0], np.sqrt(np.asarray(estimate.covariance)[scored, 0, 0]))
    names = angle_names(tuple(kalman.outputs))
    assert names == ["roll", "relative_angles 1", "relative_angles 2", "relative_angles 3"]
    many = suite.names_of("whole-body")
    assert len(set(many)) == len(many) == 20
    assert {"roll", "hip_left/angles 3", "knee_right/flexion"} <= set(many)


def test_conditions_change_what_they_say() -> None:
    recipe, ridden, seed = SHORT.recipe(), ride(SHORT, 3, 0), np.random.SeedSequence(5)
    usual = sweeps.usual(recipe, ridden, seed)
    lossy = sweeps.with_gaps(recipe, ridden, seed, 0.5)
    lost = ~np.isfinite(lossy.measurements["trunk_imu/gyr"]).all(axis=1)
    assert 0.3 < lost.mean() < 0.7
    np.testing.assert_array_equal(
        lossy.measurements["trunk_imu/gyr"][~lost], usual.measurements["trunk_imu/gyr"][~lost]
    )
    turned = sweeps.turned(recipe, ridden, seed, 10.0)
    lengths = [np.linalg.norm(each.measurements["trunk_imu/gyr"], axis=1) for each in (usual, turned)]
    np.testing.assert_allclose(lengths[0], lengths[1])
    assert np.nanmax(np.abs(turned.measurements["trunk_imu/gyr"] - usual.measurements["trunk_imu/gyr"])) > 1e-3
    slow = sweeps.at_rate(recipe, ridden, seed, 25.0)
    assert slow.dt == pytest.approx(0.04)
    np.testing.assert_allclose(
        slow.measurements["bicycle_imu/gyr"][5], usual.measurements["bicycle_imu/gyr"][17:21].mean(axis=0)
    )
    camera = [each.measurements["relative/orientation"] for each in (usual, slow)]
    seen = [np.isfinite(each[1:]).all(axis=1) for each in camera]
    assert seen[1].sum() == seen[0][: len(seen[1]) * 4].reshape(-1, 4).any(axis=1).sum()
    np.testing.assert_array_equal(slow.truth["bicycle/roll"][5], usual.truth["bicycle/roll"][20])


def test_tables_of_kept_numbers() -> None:
    numbers = [
        {"paper": "two-gyro", "method": method, "group": group, "error": 1.234, "low": 1.0, "high": 2.0}
        | {"over bound": 3.0, "nees": nees, "coverage": 0.9}
        for method, nees in (("two-gyro", 1.5), ("ridge", None))
        for group in UNSEEN
    ]
    assert by_group(numbers, "two-gyro", "error")[1] == {
        "method": "ridge",
        **dict.fromkeys(UNSEEN, "1.23 [1.00, 2.00]"),
    }
    assert by_group(numbers, "two-gyro", "mean")[0] == {"method": "two-gyro", **dict.fromkeys(UNSEEN, 1.234)}
    consistent = [{"method": "two-gyro", **dict.fromkeys(UNSEEN, "1.50, 90 %")}]
    assert by_group(numbers, "two-gyro", "consistency") == consistent, "a regression has no covariance"
    assert by_group(numbers, "whole-body", "bound") == []


def test_a_paper_is_compared_as_a_whole_or_some_estimators_alone() -> None:
    everything, paper = rider_settings((), 0, quick=False), rider_settings(("whole-body", "mekf"), 0, quick=False)
    assert everything == suite.RiderSuite()
    assert paper == suite.RiderSuite(("whole-body",))
    alone = rider_settings(("gru-two-gyro", "two-gyro-level+noise", "mekf"), 3, quick=False)
    assert alone is not None
    assert (alone.papers, alone.training, alone.seed) == (("two-gyro",), 0, 3)
    assert alone.alone("two-gyro") == ["two-gyro-level+noise", "gru-two-gyro"]
    assert rider_settings(("mekf",), 0, quick=False) is None


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="papers must be some of"):
        suite.RiderSuite(("mekf",))
    with pytest.raises(ValueError, match="rides must be at least 1, got 0"):
        suite.RiderSuite(rides=0)


@pytest.mark.slow
def test_the_comparison_of_one_paper(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = RideSource(2, 1, 12.0, {**QUICK, "styles": ["mild"]})
    monkeypatch.setitem(PRESETS, "two-gyro+network", replace(PRESETS["two-gyro+network"], rides=source))
    monkeypatch.setattr("poise.baselines.learned.rides.UNSEEN", {group: {} for group in UNSEEN})
    settings = suite.RiderSuite(("two-gyro",), rides=2, draws=1, training=2)
    monkeypatch.setattr(suite, "ROLL_ONLY", ("two-gyro-integration", "platform-gyro+turning"))
    rows = suite.compare(settings, tmp_path)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 2 * len(UNSEEN)
    files[1].unlink()
    before = files[0].stat().st_mtime_ns
    assert str(suite.compare(settings, tmp_path)) == str(rows), "an interrupted comparison ends with the same rows"
    assert files[0].stat().st_mtime_ns == before
    summary = json.loads(json.dumps(tables.summary(rows), allow_nan=False))
    found = {cells["method"]: cells for cells in by_group(summary, "two-gyro", "error")}
    assert {"two-gyro", "two-gyro+network", suite.MEAN, suite.RIDGE, suite.BIAS} <= set(found)
    assert all(float(cells["unseen riders"].split()[0]) > 0.0 for cells in found.values())
    oracle, published = (np.mean([row.mean for row in rows if row.method == name]) for name in (
        f"two-gyro, {suite.ORACLE}", "two-gyro"))  # fmt: skip
    assert oracle <= published
    consistent = {cells["method"] for cells in by_group(summary, "two-gyro", "consistency")}
    assert {"two-gyro", "two-gyro+network"} <= consistent
    assert len(tables.results(rows)) == len(rows) * 8
    ratios = {cells["method"]: cells["unseen riders"] for cells in by_group(summary, "two-gyro", "bound")}
    assert ratios["two-gyro"] > 1.0
    means = tables.ride_means(rows, "two-gyro")
    assert {row[3] for row in means} == {"angle", "angle over bound", "nees", "coverage of 90 %"}
    quick = suite.compare(replace(settings, training=0), tmp_path)
    assert {row.method for row in quick} < {row.method for row in rows}
    assert suite.MEAN not in {row.method for row in quick}
    alone = suite.compare(replace(settings, training=0, estimators=("gru-two-gyro",)), tmp_path)
    assert {row.method for row in alone} == {"gru-two-gyro", f"gru-two-gyro, {suite.CONSTANT}"}
    assert str(alone) == str(
        [row for row in rows if row.method.startswith("gru-two-gyro") and "bicycle" not in row.method]
    )


def test_constant_deviations_are_told_of_consistency_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    card = {"calibration": {"constant": [0.1, 0.2]}}
    monkeypatch.setattr(suite, "load_card", lambda name: card)
    assert suite.constant_deviations("two-gyro") is None
    assert suite.constant_deviations("two-gyro+network") == pytest.approx([0.1, 0.2])
    card["calibration"] = {}
    assert suite.constant_deviations("two-gyro+network") is None
    methods = ("two-gyro+network", f"two-gyro+network, {suite.CONSTANT}")
    rows = [
        suite.Row("two-gyro", method, group, 0, 0, (1.0, 2.0, 3.0, 4.0), nees, 0.9, 2.0)
        for method, nees in zip(methods, (1.0, 3.0), strict=True)
        for group in UNSEEN
    ]
    numbers = tables.summary(rows)
    assert [row["method"] for row in by_group(numbers, "two-gyro", "consistency")] == [*methods]
    for table in ("error", "mean", "bound"):
        assert [row["method"] for row in by_group(numbers, "two-gyro", table)] == [methods[0]]
    assert {row[0] for row in tables.ride_means(rows, "two-gyro")} == {methods[0]}
    assert [row["method"] for row in tables.angle_table(rows, "two-gyro")] == [methods[0]]


def test_each_angle_has_a_row_under_one_condition() -> None:
    points = [
        sweeps.Point("geometry", value, "two-gyro", "two-gyro", ride, (1.0 + ride, 2.0, 3.0, 4.0))
        for value in sweeps.SWEEPS["geometry"].values
        for ride in (0, 1)
    ]
    rows = sweeps.angle_rows(points, "two-gyro", "geometry", 0.0)
    assert [row["two-gyro"] for row in rows] == [1.5, 2.0, 3.0, 4.0]
    assert [row["angle"] for row in rows] == suite.names_of("two-gyro")
    assert sweeps.sweep_table(points, "two-gyro", "geometry")[0]["1"] == 2.62
