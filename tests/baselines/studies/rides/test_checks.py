"""Checks of rides from the command line: every kind once, short, and what they must find."""

import json

import numpy as np
import pytest

from poise.baselines.studies.rides import checks as ride_checks
from poise.baselines.studies.rides import inclinations as ride_inclinations
from poise.baselines.studies.rides import study as ride_study
from poise.scripts.main import main


def test_eigenvalues_are_compared_mode_by_mode():
    (row, other) = ride_checks.eigenvalue_checks((5.0,))
    weave, castering, _ = row.found.split(", ")
    assert 0.0 < float(weave.split()[0]) < 1.0
    assert 0.0 < float(castering.split()[0]) < 5.0
    # a softer tyre moves the fastest mode more
    assert float(other.found.split(", ")[1].split()[0]) > float(castering.split()[0])


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_momentum_balances(fidelity):
    from poise.envs.bicycle.course.path import Path

    force, moment = ride_checks.momentum_residual(fidelity, Path(np.zeros(2)), 4.0, 600)
    assert 0.0 < force < (0.01 if fidelity == "full" else 0.001)
    assert 0.0 < moment < (0.01 if fidelity == "full" else 0.001)


def test_a_ride_too_short_to_be_looked_at_balances_nothing():
    from poise.envs.bicycle.course.path import Path

    with pytest.raises(ValueError, match="zero-size"):
        ride_checks.momentum_residual("lumped", Path(np.zeros(2)), 4.0, 0)


def test_inclinations_are_those_of_the_evaluation():
    rows = list(ride_inclinations.inclination_rows(("tilt",), (("slow", "bicycle_imu"),), duration=2.0))
    assert [row["scenario"] for row in rows] == ["slow"]
    assert 0.1 < float(rows[0]["tilt"]) < 5.0


def test_the_command_prints_both_tables(monkeypatch, tmp_path, capsys):
    one = ride_checks.Check("weight", "small", "small")
    monkeypatch.setattr(ride_study, "all_checks", lambda: iter([one]))
    monkeypatch.setattr(ride_study, "levels", dict)
    monkeypatch.setattr(ride_study, "vibration_checks", lambda levels: iter(()))
    monkeypatch.setattr(ride_study, "inclination_rows", lambda: iter([{"scenario": "slow", "tilt": "1.0"}]))
    assert main(["rides", "--checks", "--json", "--runs", str(tmp_path)]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [{name: row[name] for name in row if name != "table"} for row in rows] == [
        one._asdict(),
        {"scenario": "slow", "tilt": "1.0"},
    ]
    (folder,) = (tmp_path / "rides").iterdir()
    assert "Physical checks" in (folder / "report.md").read_text(encoding="utf-8")
