"""Comparison of what may set gains: the factor on the errors of rides, and units of the results."""

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.gain_policy.motions import uneven_rides
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.bicycle.platform_gyro import ROLL
from poise.scripts.recordings.adapt import smaller_errors
from poise.scripts.tune import results


def test_a_factor_scales_the_errors_of_sensors_and_of_their_placement_and_nothing_else():
    source = uneven_rides()
    plain, smaller = (
        replace(source, changes=smaller_errors(source.changes, factor)).recipe().describe() for factor in (1.0, 0.1)
    )
    assert plain == source.recipe().describe()
    assert smaller.pop("placement_errors") == 0.1
    assert smaller["sensors"].pop("noise_scale") == [0.1, 0.1]
    del plain["placement_errors"], plain["sensors"]["noise_scale"]
    assert smaller == plain
    with pytest.raises(ValueError, match="errors must be a positive factor, got 0"):
        smaller_errors(source.changes, 0.0)


def test_errors_are_written_in_the_unit_that_stands_beside_them():
    sets = {"simulated": HandTrajectories(duration=1.0).draw_many(0, 1)}
    (row,) = results({"simulated": {"published": np.array([math.pi])}}, sets, ROLL)
    assert (row["value"], row["unit"], row["quantity"]) == (180.0, "deg", "bicycle/roll")
