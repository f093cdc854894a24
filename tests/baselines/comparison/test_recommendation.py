"""Recommendations rest on the recordings that move alike, and on nothing else."""

import numpy as np
import pytest

from poise.baselines.comparison.data_sets import dataset_of, with_other_clocks
from poise.baselines.comparison.recommendation import (
    CORRECTED,
    MOUNTINGS,
    Motion,
    dataset_errors,
    load_results,
    merged,
    merged_rides,
    motion_of,
    recommend,
    replaced,
    results_of,
)
from poise.baselines.evaluation import evaluate
from poise.baselines.registry import list_estimators
from poise.envs.hand.sensing import simulate_hand


@pytest.fixture(scope="module")
def motions():
    return {gesture: simulate_hand(gesture, seed=8, duration=20.0) for gesture in ("slow", "severe")}


def results(slow, severe):
    """Two kinds of recordings, calm and violent, on which different estimators win."""
    calm = {"mekf": {"inclination": 0.2}, "tilt": {"inclination": 0.9}, "mekf-9": {"inclination": 0.3, "heading": 1.0}}
    wild = {"mekf": {"inclination": 4.0}, "tilt": {"inclination": 2.0}, "mekf-9": {"inclination": 5.0, "heading": 2.0}}
    sets = (("calm", slow, calm), ("wild", severe, wild))
    return {
        "recordings": [
            {"name": f"{name}-{number}", "dataset": name, "motion": vars(motion), "errors": errors}
            for name, motion, errors in sets
            for number in range(8)
        ]
    }


def test_the_nearest_recordings_decide(motions):
    slow, severe = motion_of(motions["slow"]), motion_of(motions["severe"])
    assert severe.turning > 1.5 * slow.turning
    assert severe.shaking > 3.0 * slow.shaking
    found = results(slow, severe)
    six = {name: values for name, values in motions["slow"].measurements.items() if name != "imu/mag"}
    calm = recommend(motions["slow"].replace(measurements=six), results=found)
    assert calm.sets == {"calm": 6}
    assert [row["estimator"] for row in calm.ranking] == ["mekf", "tilt"]
    assert calm.ranking[0]["inclination"] == pytest.approx(0.2)
    six = {name: values for name, values in motions["severe"].measurements.items() if name != "imu/mag"}
    wild = recommend(motions["severe"].replace(measurements=six), results=found)
    assert [row["estimator"] for row in wild.ranking] == ["tilt", "mekf"]
    assert wild.ranking[0]["reason"] == "the best on 6 of these 6"


def test_a_magnetometer_that_works_puts_headings_first(motions):
    found = results(motion_of(motions["slow"]), motion_of(motions["severe"]))
    nine = recommend(motions["slow"], results=found)
    assert nine.ranking[0]["estimator"] == "mekf-9"
    assert nine.ranking[0]["heading"] == pytest.approx(1.0)
    dead = motions["slow"].measurements | {"imu/mag": np.zeros((len(motions["slow"]), 3))}
    assert recommend(motions["slow"].replace(measurements=dead), results=found).ranking[0]["estimator"] == "mekf"


def test_nine_axes_are_compared_on_recordings_with_a_magnetometer(motions):
    found = results(motion_of(motions["slow"]), motion_of(motions["severe"]))
    for one in found["recordings"][:5]:
        one["errors"] = {name: errors for name, errors in one["errors"].items() if name != "mekf-9"}
    nine = recommend(motions["slow"], results=found)
    assert nine.sets == {"calm": 3, "wild": 3}
    assert {row["estimator"] for row in nine.ranking} == {"mekf-9", "mekf", "tilt"}
    six = {name: values for name, values in motions["slow"].measurements.items() if name != "imu/mag"}
    assert recommend(motions["slow"].replace(measurements=six), results=found).sets == {"calm": 6}


def test_conditions_are_told(motions):
    found = results(motion_of(motions["slow"]), motion_of(motions["severe"]))
    still = motions["slow"]
    rest = {
        "imu/gyr": np.tile([0.08, 0.0, 0.0], (len(still), 1)),
        "imu/acc": np.tile([0.0, 0.0, 9.81], (len(still), 1)),
    }
    notes = recommend(still.replace(measurements=rest), results=found).notes
    assert any("gyroscope bias 4.6 °/s" in note for note in notes)
    assert any("no benchmark recording moves like this one" in note for note in notes)
    slow = still.resampled(20.0)
    (between,) = (note for note in recommend(slow, results=found).notes if "20 Hz is slow" in note)
    assert f"it turns {motion_of(slow).turning / 20.0:.1f}° between two samples" in between


def test_bad_input_is_explained(motions, tmp_path):
    with pytest.raises(ValueError, match="mounting must be one of"):
        recommend(motions["slow"], mounting="boat")
    only = {"imu/mag": motions["slow"].measurements["imu/mag"]}
    with pytest.raises(ValueError, match="needs the channels imu/gyr and imu/acc"):
        recommend(motions["slow"].replace(measurements=only))
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(ValueError, match="holds no results"):
        load_results(tmp_path / "other.json")


def test_a_benchmark_s_results_are_the_table_s_numbers(motions):
    named = [
        motion.replace(metadata={"name": name, "environment": {"id": "poise/HandMotion-v0"}})
        for name, motion in motions.items()
    ]
    table = evaluate(["mekf", "mekf-9", "tilt"], named)
    found = results_of(named, table) + results_of(named[:1], table, CORRECTED)
    assert [one["dataset"] for one in found] == ["simulated hand"] * 2 + [f"simulated hand{CORRECTED}"]
    chosen = table[(table.metric == "inclination") & (table.quantity == "up")]
    for estimator, errors in dataset_errors(found).items():
        assert errors["simulated hand"] == pytest.approx(chosen[chosen.estimator == estimator].value.mean(), abs=1e-4)
    assert set(dataset_errors(found, "heading")) == {"mekf-9"}
    # Those on the corrected clock are other numbers for the same motion: they are no neighbours.
    assert CORRECTED not in str(recommend(named[0], results={"recordings": found}).sets)


def test_an_estimator_that_missed_a_recording_has_no_mean_there():
    motion = {"rate": 100.0, "turning": 50.0, "shaking": 1.0, "lasting": 0.2}
    recordings = [
        {
            "name": "1",
            "dataset": "a",
            "motion": motion,
            "errors": {"x": {"inclination": 1.0}, "y": {"inclination": 2.0}},
        },
        {"name": "2", "dataset": "a", "motion": motion, "errors": {"y": {"inclination": 2.0}}},
        {
            "name": "3",
            "dataset": "b",
            "motion": motion,
            "errors": {"x": {"inclination": 1.0}, "y": {"inclination": 4.0}},
        },
    ]
    assert dataset_errors(recordings) == {"y": {"a": 2.0, "b": 4.0}, "x": {"b": 1.0}}


def test_errors_of_some_estimators_are_replaced():
    def row(name, **errors):
        return {"name": name, "dataset": "a", "errors": {key: {"inclination": value} for key, value in errors.items()}}

    kept, new = [row("1", x=1.0, y=2.0), row("2", x=3.0)], [row("1", y=5.0), row("3", y=7.0)]
    assert merged(kept, new) == [row("1", x=1.0, y=5.0), row("2", x=3.0)]
    assert kept[0] == row("1", x=1.0, y=2.0)


def test_data_sets_that_a_benchmark_does_not_have_stay():
    kept = [{"name": name, "dataset": each, "errors": {}} for name, each in (("1", "hands"), ("2", "rides"))]
    new = [{"name": "1", "dataset": "hands", "errors": {"x": {"inclination": 1.0}}}]
    assert replaced(kept, new) == [*new, kept[1]]


def test_a_benchmark_of_one_paper_leaves_the_others_as_they_are():
    def row(paper, method, error=1.0):
        return {"paper": paper, "method": method, "group": "unseen riders", "error": error}

    kept = [row(paper, method) for paper in ("two-gyro", "whole-body") for method in (paper, f"gru-{paper}", "ridge")]
    whole = [row("two-gyro", "two-gyro", 2.0)]
    assert merged_rides(kept, whole) == [*whole, *kept[3:]], "a published filter stands for all that was compared"
    alone = [row("two-gyro", "gru-two-gyro", 2.0), row("two-gyro", "new", 3.0)]
    assert merged_rides(kept, alone) == [kept[0], alone[0], kept[2], alone[1], *kept[3:]]


def test_a_distance_is_that_of_ratios():
    motion = Motion(100.0, 99.0, 0.95, 0.98)
    assert motion.distance(motion) == 0.0
    assert motion.distance(Motion(100.0, 199.0, 0.95, 0.98)) == pytest.approx(np.log(2.0))


def test_clocks_are_judged_by_data_set(motions):
    def recording(dataset, offset):
        metadata = {"name": f"{dataset} {offset}", "format": dataset, "reference_clock_offset": offset}
        return motions["slow"].replace(metadata=metadata)

    recordings = [recording("BROAD", 0.0023), recording("BROAD", 0.0024)]
    recordings += [recording("EuRoC", offset) for offset in (0.0, 0.0001, -0.004)]
    assert {dataset_of(one) for one in with_other_clocks(recordings)} == {"BROAD"}


def test_the_shipped_results_cover_benchmarks_and_estimators():
    found = load_results()
    sets = {one["dataset"] for one in found["recordings"]}
    assert {*MOUNTINGS, f"BROAD{CORRECTED}"} <= sets
    assert {"mekf", "bounded-motion", "vqf", "gru", "external-acceleration"} <= set(dataset_errors(found["recordings"]))
    known = {*list_estimators(experimental=True), "external-acceleration (mode 2)", "external-acceleration (mode 3)"}
    for one in found["recordings"]:
        assert {name.removesuffix(" (offline)") for name in one["errors"]} <= known


@pytest.mark.parametrize("samples", [1, 2, 50])
def test_a_short_recording_is_refused(motions, samples):
    with pytest.raises(ValueError, match=r"lasts .* s; motions are compared from 2 s on"):
        recommend(motions["slow"][:samples])
