"""``poise align``: clocks, axes of segments, magnetometers."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from poise.envs.data.calibration.records import load_calibration
from poise.envs.data.trajectory import load_trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.scripts.main import main

from ...envs.data.alignment.test_clocks import other_device
from ...envs.data.alignment.test_segments import leaning


def test_clocks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reference = simulate_hand("mixed", seed=0, duration=90.0)
    files = [str(reference.save(tmp_path / "hand.h5")), str(other_device(3.217, 0.0).save(tmp_path / "other.h5"))]
    out, plot = tmp_path / "ride.h5", tmp_path / "clocks.png"
    assert main(["align", "clocks", *files, "--output", str(out), "--plot", str(plot), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["offset, s"] == pytest.approx(3.217, abs=2e-3)
    assert {name.split("/")[0] for name in load_trajectory(out).measurements} == {reference.name, "other"}
    assert plot.stat().st_size > 5_000
    assert main(["align", "clocks", files[0]]) == 2
    assert "two recordings at least" in capsys.readouterr().err


def test_segment(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = leaning().save(tmp_path / "lean.h5"), tmp_path / "aligned.h5"
    words = ["align", "segment", str(file), "--rest", "0", "4.5", "--movement", "5", "15", "--output", str(out)]
    assert main([*words, "--plot", str(tmp_path / "axes.png"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][0]["dominance"] > 0.95
    assert "mounting" in load_trajectory(out).metadata
    assert main(["align", "segment", str(file)]) == 2
    assert "--rest BEGIN END" in capsys.readouterr().err
    assert main([*words[:-1], "aligned.csv"]) == 2
    assert "must end in .h5" in capsys.readouterr().err


def test_magnetometer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = simulate_hand("severe", seed=2, duration=60.0).save(tmp_path / "tumble.h5")
    record, plot = tmp_path / "calibration.json", tmp_path / "field.png"
    assert main(["align", "magnetometer", str(file), "--record", str(record), "--plot", str(plot)]) == 0
    assert set(load_calibration(record).channels) == {"imu/mag"}
    assert plot.exists()
    assert main(["align", "magnetometer", str(file), str(file)]) == 2
    assert "takes one recording" in capsys.readouterr().err
