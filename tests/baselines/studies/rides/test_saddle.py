"""Statistics of the saddle's load cells, and riders who stay on their saddle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from poise.baselines.studies.rides.checks import ridden, saddle_checks
from poise.baselines.studies.rides.saddle import SITTING, saddle_rows, saddle_statistics
from poise.envs.bicycle.ride.contact_forces import LoadCells


def test_saddle_statistics_of_a_known_load() -> None:
    cells = LoadCells()
    place = np.array([[0.05, 0.02]] * 50 + [[-0.03, -0.04]] * 50)
    force, zero = np.full(100, 600.0), np.zeros(100)
    moment = np.stack([force * place[:, 1], -force * place[:, 0], zero], axis=1)
    found = saddle_statistics(cells.share(np.stack([zero, zero, force], axis=1), moment))
    assert found["along_5"] == pytest.approx(-30.0)
    assert found["along_95"] == pytest.approx(50.0)
    assert found["across_5"] == pytest.approx(-40.0)
    assert found["across_95"] == pytest.approx(20.0)
    assert found["pulls"] in (0.0, 50.0)
    lifted = saddle_statistics(np.array([[100.0, 100.0, 100.0], [100.0, -20.0, 100.0], [np.nan] * 3]))
    assert lifted["pulls"] == 50.0
    assert lifted["least"] == -20.0
    assert lifted["seated_pulls"] == 50.0
    assert lifted["lifted"] == 0.0
    thrown = saddle_statistics(np.array([[100.0, 100.0, 100.0], [10.0, -20.0, 15.0]]))
    assert (thrown["pulls"], thrown["seated_pulls"], thrown["lifted"]) == (50.0, 0.0, 50.0)
    assert (thrown["least"], thrown["seated_least"]) == (-20.0, 100.0)
    assert math.isnan(saddle_statistics(np.zeros((5, 3)))["along_5"])


def test_rows_are_the_worst_of_all_riders() -> None:
    one = saddle_statistics(np.array([[100.0, 100.0, 100.0]] * 2))
    other = saddle_statistics(np.array([[100.0, -20.0, 300.0]] * 2))
    slow, bumps = saddle_rows({"slow": [one, other], "bumps": [one]})
    assert (slow["seated, a cell below -5 N, %"], slow["least N"]) == (100.0, -20.0)
    assert (bumps["seated, a cell below -5 N, %"], bumps["least N"]) == (0.0, 100.0)
    assert slow["off the saddle, %"] == 0.0
    assert slow["CoP across mm"] == "-51 … 0"


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_nobody_pulls_at_the_saddle(fidelity) -> None:
    """Outdoors, with sprints; a saddle that pulled had a cell below -5 N for a quarter of this ride."""
    ride = ridden(3, scenario="outdoor", suite=["seat/load_cells"], duration=12.0, fidelity=fidelity)
    cells = ride.measurements["seat/load_cells"][1:]
    found = saddle_statistics(cells)
    # but for the friction of a pelvis that has left the saddle
    assert cells[cells.sum(axis=1) > SITTING].min() > -5.0
    assert found["pulls"] < 1.0
    assert max(abs(found["along_5"]), abs(found["along_95"])) < 130.0
    assert max(abs(found["across_5"]), abs(found["across_95"])) < 60.0


@pytest.mark.slow
def test_full_and_lumped_riders_sit_alike_in_every_scenario() -> None:
    assert [check.check for check in saddle_checks() if not check.holds] == []
