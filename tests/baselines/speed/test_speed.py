"""What the speed command measures is what it says; how fast it is, is not tested."""

import json

import numpy as np
import pytest

from poise.baselines.speed import environments as speed_environments
from poise.baselines.speed import filters as speed_filters
from poise.baselines.speed import measure as speed_measure
from poise.baselines.speed import vectors as speed_vectors
from poise.filters.core.estimator import run
from poise.filters.core.kalman import KalmanFilter
from poise.filters.imu.external_acceleration import ExternalAcceleration
from poise.scripts.main import main


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    monkeypatch.setattr(speed_environments, "RIDE_LENGTH", 1.0)
    monkeypatch.setattr(speed_measure, "REPEATS", 1)
    monkeypatch.setattr(speed_filters, "BATCHES", (8,))
    samples = speed_filters.samples
    monkeypatch.setattr(speed_filters, "samples", lambda length, seed=0: samples(min(length, 300), seed))
    monkeypatch.setattr(speed_environments, "REPEATS", 1)
    monkeypatch.setattr(speed_environments, "STEPS", 20)


def test_the_yardstick_computes_the_same_filter():
    model = ExternalAcceleration(c_a=0.2)
    measurements = speed_filters.samples(300)
    ours = run(KalmanFilter(model), measurements).pose["up"]
    np.testing.assert_allclose(speed_filters.filterpy_run(model, measurements), ours, rtol=0, atol=1e-9)


def test_the_command_prints_rates_and_ratios(capsys):
    assert main(["speed", "--what", "filters", "environments", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    groups = {row["group"] for row in rows}
    without = ("whole sequence by name", "gain tuning on rides of 20 s, lumped")
    assert len(groups) == 6
    for group in groups:
        yardsticks = [row for row in rows if row["group"] == group and row["ratio"] == 1.0]
        assert len(yardsticks) == (0 if group in without else 1)
    assert all(row["rate"] > 0.0 for row in rows)
    riding = {(row["group"].split(", ")[1], row["what"]): row["rate"] for row in rows if "rider" in row["group"]}
    for fidelity in ("full", "lumped"):
        steps, factor = (riding[fidelity, f"RiderBicycle{what}"] for what in ("", ", real-time factor"))
        assert factor == pytest.approx(steps / speed_environments.RIDER_RATE)
    assert {"batch of 8, compiled", "whole sequence, compiled"} <= {row["what"] for row in rows}


def test_vector_environments_stand_beside_the_learner(capsys, monkeypatch):
    for name, value in (("ENVS", 2), ("STEPS", 2), ("LEARNED", 128), ("REPEATS", 1)):
        monkeypatch.setattr(speed_vectors, name, value)
    short = (("hand", "poise/HandMotionGain-v0", {"duration": 1.0}), ("replay", "poise/Replay-v0", {}))
    monkeypatch.setattr(speed_vectors, "CASES", short)
    assert main(["speed", "--what", "vectors", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["group"].split(",")[0] for row in rows] == ["hand", "hand", "replay", "replay"]
    for learner, ours in (rows[:2], rows[2:]):
        assert learner["ratio"] == 1.0
        assert ours["ratio"] == pytest.approx(ours["rate"] / learner["rate"])
