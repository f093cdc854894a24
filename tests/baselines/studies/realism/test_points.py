"""The table of points: rows that can fail, targets with sources, and the quick measurements behind them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.studies.realism import points as table
from poise.baselines.studies.realism import probes
from poise.baselines.studies.realism.points import TARGETS, TITLE, body, orders, point, saddle
from poise.baselines.studies.realism.ranges import Covered
from poise.baselines.studies.realism.ranks import Ranked
from poise.baselines.studies.realism.roles import Recorded
from poise.baselines.studies.rides.saddle import saddle_statistics
from poise.scripts.main import main
from poise.scripts.pages.studies import update


def test_a_row_holds_where_all_values_do() -> None:
    row = point(1, "cells", "-475 N", {"here": -4.0, "there": 20.0}, "least force of a load cell")
    bad = point(1, "cells", "-475 N", {"here": -6.0, "there": 20.0}, "least force of a load cell")
    assert (row["now"], row["asked"], row["holds"]) == ("-4 … 20 N", "≥ -5 N", True)
    assert (bad["now"], bad["holds"]) == ("-6 … 20 N; outside: here (-6)", False)
    assert not point(1, "cells", "-475 N", [math.nan], "least force of a load cell")["holds"]


def test_what_people_do_must_be_covered() -> None:
    hands = Covered(9.0, 30.0, "Hz", "recordings of hands")
    assert hands.met([8.0, 12.0, 31.0])
    assert not hands.met([8.0, 12.0])
    assert not hands.met([10.0, 31.0])
    assert hands.text == "9 … 30 Hz among them"


def test_every_target_has_a_source() -> None:
    for name, each in TARGETS.items():
        assert each.low <= each.high, name
        assert len(each.source) > 10, name


def test_a_seated_rider_who_pulls_is_found_and_one_in_flight_is_not() -> None:
    quiet = saddle_statistics(np.array([[100.0, 100.0, 100.0]] * 3))
    pulled = saddle_statistics(np.array([[100.0, 100.0, 100.0], [100.0, 300.0, -20.0]]))
    thrown = saddle_statistics(np.array([[100.0, 100.0, 100.0], [10.0, 10.0, -20.0]]))
    for rides, holds in (([quiet, thrown], True), ([quiet, pulled], False)):
        share, least, *_ = saddle({"straight": rides, "bumps": [pulled]})
        assert (share["holds"], least["holds"]) == (holds, holds)
    assert share["now"] == "50 %; outside: straight (50)"


def test_bodies_are_compared_scenario_by_scenario() -> None:
    calm = {f"trunk_imu/{name}": 25.0 for name in ("gyr_rms", "force_above_2", "force_above_10", "force_sinusoids")}
    rows = list(body({"slow": calm | {"trunk_imu/gyr_f95": 5.0}, "fast": calm | {"trunk_imu/gyr_f95": 1.1}}))
    assert [row["holds"] for row in rows] == [True, False, False, False, False]


def test_the_order_of_estimators_is_a_row_for_every_group_that_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    taus = {"broad": 0.8, "mine": 0.2}

    def ranked(study: object, episodes: int, group: Recorded) -> Ranked | None:
        tau = taus.get(group.group)
        return None if tau is None else Ranked(["tilt", "vqf"], np.zeros((2, 2)), np.zeros((3, 2)), tau, 0.0, 1.0)

    monkeypatch.setattr(table, "ranked", ranked)
    groups = [Recorded(role, name, ()) for role, name in (("hand", "broad"), ("carried", "mine"), ("chest", "ride"))]
    rows = list(orders(None, 2, groups))  # type: ignore[arg-type]
    assert [(row["before"], row["now"], row["holds"]) for row in rows] == [("0.86", "0.8", True), ("–", "0.2", False)]
    assert "2 estimators on broad" in rows[0]["claim"]


def test_quick_measurements() -> None:
    assert probes.start_apart() == 0.0
    assert probes.gravity_residual() < 1e-9
    assert probes.misplaced() == pytest.approx(15.0 * math.sqrt(8.0 / math.pi), rel=0.1)
    assert probes.fixture_picture() > 20.0
    assert probes.default_drive() == "kinematic"
    least, most, lossy = probes.delays()
    assert least < 2.4 < 2.7 < most
    assert 0.05 < lossy < 0.3
    assert probes.field_spread("undisturbed")[1] < 1e-9 < 1.0 < probes.field_spread("attached-magnet")[0]
    found = probes.people()
    assert found["mass"][1] - found["mass"][0] > 50.0
    found = probes.courses()
    assert found["cadence"][0] < 60.0 < 90.0 < found["cadence"][1]
    assert found["coasting"][0] > 0.0


@pytest.mark.slow
def test_the_command_puts_the_table_on_a_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"<!-- study: realism: {TITLE} -->\nold\n<!-- end of study -->\n", encoding="utf-8")
    words = ["realism", "--parts", "points", "--rides", "2", "--episodes", "4", "--pages", str(page)]
    assert main([*words, "--runs", str(tmp_path / "runs")]) == 0
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    numbers = [int(line.split("|")[1]) for line in text.splitlines() if line.startswith("| ") and line[2].isdigit()]
    assert sorted(set(numbers)) == list(range(1, 16))
    update([page], {}, "")
    assert page.read_text(encoding="utf-8") == text
