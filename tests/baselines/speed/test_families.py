"""Speed of families of filters: the same filters in every form, filterpy among them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from poise.baselines.registry import list_estimators, make_estimator
from poise.baselines.speed import families as speed_families
from poise.baselines.speed import measure as speed_measure
from poise.baselines.speed.fixtures import plausible_measurements
from poise.filters.core.kalman import KalmanFilter
from poise.scripts.main import main

NAMES = [name for names in speed_families.FAMILIES.values() for name in names]
KALMAN = [name for name in NAMES if isinstance(make_estimator(name), KalmanFilter)]


@pytest.fixture
def _hurry(monkeypatch):
    monkeypatch.setattr(speed_measure, "REPEATS", 1)
    for name, value in (("BATCHES", (4,)), ("STEPS", 20), ("LONG", 50), ("ARRAYS", 3), ("SAMPLES", 20)):
        monkeypatch.setattr(speed_families, name, value)
    monkeypatch.setitem(speed_families.FAMILIES, "bicycle", ("platform-gyro",))
    monkeypatch.setitem(speed_families.FAMILIES, "arrays", ("planar-mean",))


@pytest.mark.parametrize("name", KALMAN)
def test_filterpy_computes_the_same_filter(name):
    estimator = make_estimator(name, compiled=False)
    data = speed_families.repeated(plausible_measurements(estimator, 1, 40), 60)
    theirs = speed_families.filterpy_run(estimator.model, data)
    memory = estimator.init({channel: array[0] for channel, array in data.items()})
    for t in range(60):
        memory, _ = estimator.step(memory, {channel: array[t] for channel, array in data.items()})
        np.testing.assert_allclose(memory.x, theirs[t], rtol=1e-7, atol=1e-7)


def test_samples_are_repeated_forth_and_back():
    data = {"a/b": np.arange(3.0)[:, None]}
    assert speed_families.repeated(data, 8)["a/b"][:, 0].tolist() == [0, 1, 2, 2, 1, 0, 0, 1]
    wide = speed_measure.widened(data, 5)["a/b"]
    assert wide.shape == (3, 5, 1)
    assert (wide == data["a/b"][:, None]).all()


@pytest.mark.usefixtures("_hurry")
def test_the_command_knows_the_families(capsys):
    assert main(["speed", "--what", "bicycle", "arrays", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    groups = {row["group"].split(" (")[0] for row in rows}
    assert groups == {"platform-gyro", "planar-mean"}
    for group in {row["group"] for row in rows}:
        assert next(row["ratio"] for row in rows if row["group"] == group) == 1.0
    assert {"batch of 4, compiled", "batch of 4, arrays", "step by step, compiled"} <= {row["what"] for row in rows}


def test_unknown_channels_are_named():
    class Odd:
        channels = (type("Channel", (), {"name": "nose/cold"}),)

    with pytest.raises(ValueError, match="nose/cold"):
        plausible_measurements(Odd(), 0)


@pytest.mark.usefixtures("_hurry")
def test_networks_are_compared_with_what_they_correct():
    rows = list(speed_families.learned_speeds())
    groups = {row.group: [row.what] for row in rows}
    for row in rows:
        groups[row.group].append(row.what)
    learned = [name for name, info in list_estimators().items() if info.kind == "learned"]
    assert len(groups) == 2 * len(learned)
    assert groups["two-gyro+network, whole sequence"][1:] == ["two-gyro", "two-gyro+network"]
    assert groups["gru, step by step"][1:] == ["bounded-motion", "gru"]
    assert all(row.rate > 0.0 for row in rows)
