"""Recordings inside and outside of simulated ranges, rank agreement, and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.studies.kit import Study
from poise.baselines.studies.realism.containment import containment_rows, ranges, simulated_summaries, summary, totals
from poise.baselines.studies.realism.ranks import agreement, kendall
from poise.baselines.studies.realism.roles import recorded
from poise.envs.hand.hand_held import HandHeld
from poise.envs.recipes.hand import HandRecipe
from poise.scripts.main import main

SHORT = HandRecipe("short", duration=30.0, carried_share=0.0, held=HandHeld(first_rest=(0.3, 2.0)))
WIDTHS = (25.0, 40.0)


def test_episodes_of_the_recipe_lie_inside_and_a_stronger_motion_outside(tmp_path: Path) -> None:
    study = Study(tmp_path, processes=1, progress=False)
    simulated = simulated_summaries(study, SHORT, 20, ["imu"], WIDTHS, rate=120.0)["imu"]
    assert [each.rate for each in simulated] == pytest.approx([120.0] * 20)
    own = [each._replace(statistics={25.0: each.statistics[25.0]}) for each in simulated]
    rows = containment_rows(own, simulated)
    inside, count = map(int, totals(rows)["inside"].split("/"))
    assert count - inside == 2 * len(rows)
    for row in rows:
        inside, count = map(int, row["inside"].split("/"))
        # two of twenty values lie beyond 5 and 95 %
        assert count - inside == 2, row
    fierce = HandHeld(acceleration=(40.0, 50.0), rate=(20.0, 30.0), largest_acceleration=50.0, largest_rate=30.0)
    violent = replace(SHORT, rates=(100.0, 100.0), held=fierce)
    outside = summary(violent.episode(1, 0), "imu", [25.0], "orientation")
    rows = {row["statistic"]: row for row in containment_rows([outside], simulated)}
    assert rows["gyr_rms"]["inside"] == "0/1"
    assert "above" in rows["gyr_rms"]["outside"]
    low, middle, high = ranges(simulated, 40.0)["acc_rms"]
    assert low < middle < high


def test_the_order_of_estimators_is_compared() -> None:
    assert kendall(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.9])) == 1.0
    assert kendall(np.array([1.0, 2.0, 3.0]), np.array([3.0, 2.0, 1.0])) == -1.0
    assert kendall(np.array([1.0, np.nan, 3.0]), np.array([1.0, 2.0, 3.0])) == 1.0
    generator = np.random.default_rng(0)
    simulated = np.array([1.0, 2.0, 4.0, 8.0]) * np.exp(0.1 * generator.standard_normal((30, 4)))
    tau, (low, high) = agreement(simulated, 2.0 * simulated[:5], seed=0)
    assert tau == 1.0
    assert low == high == 1.0
    noisy = np.exp(generator.standard_normal((5, 4)))
    low, high = agreement(simulated, noisy, seed=0)[1]
    assert high - low > 0.3


def test_recordings_are_given_with_their_role(tmp_path: Path) -> None:
    path = SHORT.episode(0, 0).save(tmp_path / "one.h5")
    (group,) = recorded([f"hand={tmp_path}"])
    assert group.paths == (path,)
    assert len(group.load()) == 1
    for text, message in (
        (str(path), "recordings must be role=path"),
        (f"foot={path}", "unknown role 'foot'"),
    ):
        with pytest.raises(ValueError, match=message):
            recorded([text])
    with pytest.raises(FileNotFoundError, match="no recording at"):
        recorded([f"hand={tmp_path / 'none'}"])


@pytest.mark.slow
def test_the_command_reports_motion_and_ranks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "recordings"
    for index in range(2):
        SHORT.episode(9, index).save(folder / f"trial{index}.h5")
    words = ["realism", "--recordings", f"hand={folder}", "--episodes", "4", "--parts", "motion", "ranks"]
    assert main([*words, "--processes", "1", "--runs", str(tmp_path / "runs"), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {"gyr_rms", "acc_above_10"} <= {row.get("statistic") for row in rows}
    assert any("τ" in row for row in rows)
    (figure,) = (tmp_path / "runs").rglob("spectra-hand-held-imu.png")
    assert figure.stat().st_size > 10_000


def test_unknown_parts_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["realism", "--parts", "motions"]) == 2
    assert "unknown part 'motions', did you mean 'motion'" in capsys.readouterr().err
