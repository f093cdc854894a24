"""Statistics of saddle and steering, and the ranges in which they are believed."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from poise.baselines.studies.kit import Study
from poise.baselines.studies.realism.environments import gestures, medians, ride_statistics
from poise.baselines.studies.realism.ranges import BELIEVABLE, judged
from poise.baselines.studies.realism.simulators import ride_motion, sensors
from poise.baselines.studies.report import Report


def test_a_ride_in_numbers_that_agree_with_its_scenario() -> None:
    found = ride_statistics("straight", 1, 3, 10.0, "lumped")
    assert 2.3 < found["speed"] < 3.7
    assert found["upright"] == 1.0
    assert 0.5 < found["steer_rate"] < 60.0
    assert 1.0 < found["trunk_imu/gyr_rms"] < 100.0
    assert math.isnan(found["trunk_imu/acc_rms"])


def test_every_range_has_a_source_and_judges() -> None:
    for name, each in BELIEVABLE.items():
        # nothing but zero is asked of cells that pull
        assert each.low < each.high or each.low == each.high == 0.0, name
        assert len(each.source) > 20, name
    row = judged("least force of a load cell", {"here": -4.0, "there": -6.0})
    assert row["inside"] == "1/2"
    assert row["outside"] == "there (-6)"
    assert row["accepted"] == "≥ -5 N"


def test_medians_leave_out_what_is_unknown() -> None:
    found = medians([{"a": 1.0, "b": math.nan}, {"a": 3.0, "b": math.nan}, {"a": math.nan, "b": math.nan}])
    assert found["a"] == 2.0
    assert math.isnan(found["b"])


def test_gestures_have_the_strength_of_their_names(tmp_path: Path) -> None:
    study = Study(tmp_path, processes=1, progress=False)
    found = gestures(study, 1)
    assert found["slow"]["acc_rms"] < found["fast"]["acc_rms"] < found["severe"]["acc_rms"]
    assert "infinity" not in found


@pytest.mark.slow
def test_the_parts_about_rides_and_sensors_are_reported(tmp_path: Path) -> None:
    study, report = Study(tmp_path, subjects=(0,), processes=1, progress=False), Report(tmp_path)
    ride_motion(study, report, 2, [])
    sensors(report)
    tables = {entry.title: entry.rows for entry in report.entries}
    assert {row["scenario"] for row in tables["Saddle by scenario"]} >= {"outdoor", "slow"}
    assert len(tables["Allan deviation at 1000 s"]) >= 7
