"""Rides from the command line: recorded episodes, the table of rides, going on after an interruption."""

import json

import numpy as np
import pandas
import pytest

from poise.baselines.studies.rides.statistics import REPORTED, comparison, ride, trunk_lean
from poise.envs.bicycle.course.scenarios import list_scenarios
from poise.envs.data.trajectory import load_trajectory
from poise.filters.core import rotation
from poise.filters.support.rows import RESULT
from poise.scripts.main import main

RECORD = ["--options", "scenario=outdoor", "subject=2", "fidelity=full", "suite=whole-body", "duration=2.0"]


def record(folder, *words):
    return main(["record", "rider-bicycle", "--folder", str(folder), "--episodes", "2", "--seed", "5", *words, *RECORD])


def test_rides_recorded_in_two_processes_are_bitwise_those_of_one(tmp_path):
    assert [record(tmp_path / number, "--processes", number) for number in "12"] == [0, 0]
    paths = sorted((tmp_path / "1").glob("*.h5"))
    assert [path.name for path in paths] == ["rider_bicycle_0000.h5", "rider_bicycle_0001.h5"]
    for path in paths:
        one, other = load_trajectory(path), load_trajectory(tmp_path / "2" / path.name)
        assert len(one) == 201
        assert one.metadata["environment"]["kwargs"]["subject"] == 2
        for part in ("measurements", "truth"):
            left, right = getattr(one, part), getattr(other, part)
            assert left.keys() == right.keys()
            assert all(values.tobytes() == right[name].tobytes() for name, values in left.items())


def rides(folder, *words):
    short = ["--duration", "1", "--scenarios", "slow", "indoor_circle", "--subjects", "0", "4", "--processes", "1"]
    return main(["rides", "--runs", str(folder), *short, *words])


def test_rides_prints_tables_leaves_a_run_and_goes_on(tmp_path, capsys):
    assert rides(tmp_path) == 0
    output = capsys.readouterr().out
    assert "4 of 4 rides upright" in output
    assert "Beside the papers" in output
    assert "Saddle by scenario" in output
    (folder,) = (tmp_path / "rides").iterdir()
    table = pandas.read_csv(folder / "results.csv")
    assert tuple(table.columns) == RESULT
    assert set(table["trajectory"]) == {"slow-0", "slow-4", "indoor_circle-0", "indoor_circle-4"}
    assert "about 1 m/s" in (folder / "report.md").read_text(encoding="utf-8")

    assert (folder / "figures" / "signals.png").stat().st_size > 20_000
    kept, lost = (folder / "cache" / "rides" / f"000{index}.json" for index in (0, 1))
    stamp, text = kept.stat().st_mtime_ns, lost.read_text()
    lost.unlink()
    assert rides(tmp_path, "--resume", str(folder), "--json") == 0
    rows = [row for row in json.loads(capsys.readouterr().out)["rows"] if "speed m/s" in row]
    assert kept.stat().st_mtime_ns == stamp
    assert lost.read_text() == text
    assert [(row["scenario"], row["subject"]) for row in rows[:2]] == [("slow", 0), ("slow", 4)]
    assert len(list((tmp_path / "rides").iterdir())) == 1


def test_wrong_arguments_are_named(tmp_path, capsys):
    for words, said in (
        (["--scenarios", "moon"], "moon"),
        (["--subjects", "5"], "5"),
        (["--processes", "0"], "0"),
        (["--checks", "--pilots"], "name one of them"),
    ):
        assert main(["rides", "--runs", str(tmp_path), *words]) == 2
        assert said in capsys.readouterr().err


def test_a_full_ride_has_gaps_and_a_lumped_one_none():
    full, lumped = (ride("slow", 1, 0.3, fidelity, 2) for fidelity in ("full", "lumped"))
    assert 0.0 < full["gap_max"] < 1.0
    assert "gap_max" not in lumped
    assert full["upright"]
    assert full["duration"] == pytest.approx(0.3)
    assert full["speed_min"] <= full["speed_mean"] <= full["speed_max"]
    assert 200.0 < full["seat_force_mean"] < 900.0
    assert lumped["seat_force_mean"] == pytest.approx(full["seat_force_mean"], rel=0.1)


def test_lean_is_to_the_right_of_the_heading():
    heading = np.array([0.0, 1.0, -2.5])
    lean = np.radians([10.0, -20.0, 5.0])
    forward = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(0.4))
    turn = rotation.exp(np.stack([np.zeros(3), np.zeros(3), heading], axis=1))
    side = rotation.exp(np.stack([lean, np.zeros(3), np.zeros(3)], axis=1))
    truth = {
        "trunk/orientation": rotation.multiply(rotation.multiply(turn, side), forward),
        "bicycle/yaw": heading[:, None],
    }
    np.testing.assert_allclose(trunk_lean(truth), lean, atol=1e-12)


def test_what_the_papers_report_is_decided_by_the_rides():
    numbers = ride("slow", 1, 0.3, "lumped", 2)
    for line in REPORTED:
        assert line.scenario in list_scenarios()
        assert line.field in numbers
    assert comparison([]) == []
    for speed, holds in ((1.0, True), (2.0, False)):
        (claim, *_) = comparison([{**numbers, "scenario": "indoor_circle", "speed_mean": speed}])
        assert claim.holds is holds
        assert "about 1 m/s" in claim.statement
