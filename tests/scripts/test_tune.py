"""``poise tune``: what is simulated, agents and searches, reports, wrong input."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.gain_policy.config import shipped_config
from poise.envs.hand.trajectories import HandTrajectories
from poise.envs.recipes.hand import HandRecipe
from poise.envs.recipes.registry import recipe, save_recipe
from poise.scripts.main import main
from poise.scripts.tune import Args, Curve, training_config


def test_a_recipe_replaces_the_motions_of_the_shipped_policies(tmp_path: Path) -> None:
    assert training_config(Args()).motions == shipped_config("external-acceleration").motions
    chosen = training_config(Args(recipe="carried")).motions
    assert isinstance(chosen, HandRecipe)
    assert chosen.rates == (100.0, 100.0)
    assert chosen.carried_share == 1.0
    path = save_recipe(recipe("hand-held"), tmp_path / "mine.json")
    described = training_config(Args(recipe=str(path))).describe()
    assert described["motions"]["name"] == "hand-held"
    with pytest.raises(ValueError, match="recipe must be one of hand motions"):
        training_config(Args(recipe="rider"))


def test_agents_and_searches_leave_runs_that_a_report_compares(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = ["--runs", str(tmp_path)]
    short = save_recipe(replace(recipe("hand-held"), duration=3.0), tmp_path / "short.json")
    small = ["--steps", "700", "--trajectories", "3", "--test-trajectories", "2", "--recipe", str(short), *runs]
    assert main(["tune", "mekf", "--agent", "td3", *small]) == 0
    assert main(["tune", "mekf", "--agent", "optuna", "--trials", "4", *small]) == 0
    folders = sorted((tmp_path / "tune").iterdir())
    assert {"checkpoint.pt", "curve.csv", "policy.safetensors", "sets.json"} <= {
        each.name for each in folders[0].iterdir()
    }
    card = json.loads((folders[1] / "policy.json").read_text())
    assert card["agent"] == "optuna"
    capsys.readouterr()
    assert main(["tune", "--report", *map(str, folders), "--json", *runs]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["agent"] for row in rows} == {"td3", "optuna"}
    (report,) = (tmp_path / "tune-report").iterdir()
    assert "| td3 |" in (report / "report.md").read_text()
    assert (report / "figures" / "profiles-simulated.png").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mekff"], "did you mean 'mekf'"),
        (["vqf"], "filter must be a Kalman filter with gains, got 'vqf' (filters: external-acceleration, mekf, "),
        (["mekf+noise"], "filter must be a Kalman filter with gains, got 'mekf+noise'"),
        (
            ["mekf-9"],
            "lacks the channels ['imu/mag'] that mekf-9 reads; gains are tuned on motions of one sensor",
        ),
        (["two-gyro"], "'relative/orientation'] that two-gyro reads; gains are tuned on motions of one sensor"),
        (["mekf", "--test-trajectories", "0"], "test_trajectories must be at least 1"),
        (["mekf", "--quick", "--preset", "shipped"], "quick cannot be given with the preset shipped"),
        (["mekf", "--quick", "--steps", "0"], "poise: error: steps must be at least 1, got 0"),
        (["mekf", "--networks", "0"], "networks must be at least 1, got 0"),
        (["mekf", "--agent", "optuna", "--networks", "2"], "networks must be 1 for the agent optuna, got 2"),
        (["mekf", "--recipe", "nothing"], "recipe"),
        (["mekf", "--recordings", "missing"], "missing"),
        (["mekf", "--resume", "missing"], "there is no run in missing"),
        (["mekf", "--policy", "external_acceleration_policy"], "policy must set the gains"),
        (["mekf", "--policy", "missing"], "missing"),
        (["mekf", "--agent", "constant", "--policy", "missing"], "policy cannot be given with a search"),
        (["--report", "missing"], "is not a finished run of poise tune"),
    ],
)
def test_wrong_input_is_one_line(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["tune", *words]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda one: {"measurements": {"imu/gyr": one.measurements["imu/gyr"]}}, "lacks the channels ['imu/acc']"),
        (
            lambda one: {"measurements": {name: np.nan * values for name, values in one.measurements.items()}},
            "all are NaN",
        ),
        (lambda one: {"truth": {"up": np.nan * one.truth_of("up")}}, "no scored sample"),
        (lambda one: {"mask": np.zeros(len(one), bool)}, "no scored sample"),
    ],
)
def test_recordings_that_cannot_be_scored_are_refused(
    spoil: Any, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    one = HandTrajectories(duration=1.0).draw_many(0, 1)[0]
    one.replace(**spoil(one)).save(tmp_path / "one.h5")
    assert main(["tune", "mekf", "--recordings", "one.h5"]) == 2
    assert said in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["one.h5"]


def test_a_curve_continues_where_a_checkpoint_was(tmp_path: Path) -> None:
    curve = Curve(tmp_path / "curve.csv", resumed=False)
    for steps in (10, 20, 30):
        curve.add(steps, 0.1 * steps)
    curve.write()
    resumed = Curve(tmp_path / "curve.csv", resumed=True)
    resumed.add(20, 7.0)
    assert resumed.rows == [(10.0, 1.0), (20, 7.0)]
