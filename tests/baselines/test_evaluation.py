"""The table of errors: names, metrics, stand-ins for the truth, what cannot be run."""

import numpy as np
import pytest

import poise
from poise.baselines.benchmark import HAND_CHANNELS, contenders
from poise.baselines.evaluation import COLUMNS, evaluate, summary
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core.metrics import DEGREES, direction_error, rms


@pytest.fixture(scope="module")
def trajectory():
    return simulate_hand("fast", seed=1, duration=6.0)


def value(table, estimator, metric, quantity="up"):
    chosen = table[(table.estimator == estimator) & (table.metric == metric) & (table.quantity == quantity)]
    assert len(chosen) == 1
    return chosen["value"].iloc[0]


def test_the_table_holds_the_errors_that_the_metrics_define(trajectory):
    table = evaluate(["mekf", "mekf-9", "tilt"], trajectory)
    assert tuple(table.columns) == COLUMNS
    up = poise.run("mekf", trajectory).pose["up"]
    expected = rms(direction_error(up, trajectory.truth["up"]), trajectory.mask) * DEGREES
    assert value(table, "mekf", "inclination") == pytest.approx(expected, rel=1e-12)
    assert value(table, "mekf-9", "total", "orientation") >= value(table, "mekf-9", "inclination") - 1e-9
    assert value(table, "mekf", "inclination") < value(table, "tilt", "inclination")
    assert set(table[table.quantity == "orientation"].estimator) == {"mekf-9"}
    assert not ((table.quantity == "orientation") & (table.metric == "inclination")).any()
    assert value(table, "mekf", "nis", "innovation") > 0.0
    assert table.attrs["skipped"] == []


def test_estimators_are_adjusted_to_the_rate_of_each_trajectory(trajectory):
    slow = trajectory.resampled(50.0).replace(metadata={**trajectory.metadata, "name": "slow"})
    table = evaluate({"named": "mekf", "made": poise.make_estimator("mekf", dt=0.5)}, [trajectory, slow])
    for name in (trajectory.name, "slow"):
        part = table[table.trajectory == name]
        assert value(part, "named", "inclination") == value(part, "made", "inclination")


def test_without_truth_a_reference_stands_in_and_is_named(trajectory):
    blind = trajectory.replace(truth={})
    table = evaluate({"mekf": "mekf", "mekf-9": "mekf-9", "twin": "mekf-9"}, blind, reference="mekf-9")
    assert value(table, "twin", "inclination to mekf-9") == pytest.approx(0.0, abs=1e-6)
    assert value(table, "mekf", "inclination to mekf-9") > 0.0
    assert set(table[table.estimator == "mekf-9"].metric) == {"nis"}
    assert not (table.metric == "inclination").any()
    assert set(evaluate("mekf", blind).metric) == {"nis"}


def test_missing_channels_and_packages_are_listed_not_fatal(trajectory, monkeypatch):
    six = trajectory.replace(measurements={k: v for k, v in trajectory.measurements.items() if k != "imu/mag"})
    table = evaluate(["mekf", "mekf-9"], six)
    assert table.attrs["skipped"] == [("mekf-9", six.name, "no channel imu/mag")]

    def missing(name, **parameters):
        raise ImportError("pip install vqf")

    monkeypatch.setattr("poise.baselines.evaluation.make_estimator", missing)
    assert evaluate("vqf", trajectory).attrs["skipped"] == [("vqf", trajectory.name, "pip install vqf")]


def test_bad_input_is_explained(trajectory):
    with pytest.raises(ValueError, match="did you mean 'mekf'"):
        evaluate("mekff", trajectory)
    with pytest.raises(ValueError, match="needs estimators and trajectories"):
        evaluate([], trajectory)
    with pytest.raises(ValueError, match="two trajectories are named"):
        evaluate("tilt", [trajectory, trajectory])
    with pytest.raises(ValueError, match=r"several estimators are named \['MEKF'\]"):
        evaluate([poise.make_estimator("mekf"), poise.make_estimator("mekf", dt=0.02)], trajectory)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        evaluate("tilt", "nowhere.mat")


def test_the_summary_averages_over_trajectories_not_groups(trajectory):
    parts = [
        trajectory[start:stop].replace(metadata={**trajectory.metadata, "name": f"part-{start}"})
        for start, stop in ((0, 200), (200, 400), (400, 600))
    ]
    table = evaluate(["tilt", "mekf"], parts)
    wide = summary(table, groups={"part-0": "a", "part-200": "b", "part-400": "b"})
    errors = table[(table.estimator == "tilt") & (table.metric == "inclination")]["value"].to_numpy()
    assert list(wide.index) == ["mekf", "tilt"]
    assert wide.loc["tilt", "mean"] == pytest.approx(errors.mean())
    assert wide.loc["tilt", "b"] == pytest.approx(errors[1:].mean())
    assert np.isfinite(wide.to_numpy()).all()


def test_the_benchmark_takes_what_the_data_suit():
    hand = contenders()
    assert {"mekf", "bounded-motion", "external-acceleration (mode 3)"} <= set(hand)
    listed = poise.list_estimators()
    assert all(set(listed[label.split(" (")[0]].channels) <= set(HAND_CHANNELS) for label in hand)
    six = contenders(channels=("imu/gyr", "imu/acc"))
    assert "mekf" in six
    assert "mekf-9" not in six
    assert set(contenders(["mekf-9"], channels=())) == {"mekf-9"}
