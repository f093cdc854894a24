"""The thesis' device on the rate table, rates that point the wrong way, and the virtual controller's box."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from poise.baselines.studies.accelerometer_array import rate_table
from poise.baselines.studies.accelerometer_array.rate import over_time
from poise.baselines.studies.accelerometer_array.virtual import BOX, edges


def test_the_procedure_finds_the_published_scales():
    found = rate_table.measured(3, 0.5)
    for axis, (scale, offset, *_) in found["accelerometer"].items():
        assert scale == pytest.approx(rate_table.TABLE_4_1[axis][0], rel=2e-3)
        assert offset == pytest.approx(rate_table.TABLE_4_1[axis][1], abs=3.0)
    for axis, (scale, offset, correlation, *_) in found["gyroscope"].items():
        assert scale == pytest.approx(rate_table.TABLE_4_2[axis][0], rel=2e-3)
        assert offset == pytest.approx(rate_table.TABLE_4_2[axis][1], abs=0.05)
        assert correlation > 0.9999
    assert len(found["turns"]["kept"]) == len(found["turns"]["raw"])
    # a rate of ±325 °/s saturates and is left out
    assert not all(found["turns"]["kept"])
    assert rate_table.line_difference(found["lines"]["places"]) < 100.0


def test_lines_differ_by_their_offset_and_slope():
    assert rate_table.line_difference([[10.0, 5.0], [10.0, 2.0]]) == pytest.approx(3.0)
    assert rate_table.line_difference([[11.0, 0.0], [10.0, 0.0]], 180.0) == pytest.approx(np.pi)


def test_rates_that_point_the_wrong_way_are_counted():
    truth = np.tile([3.0, 0.0, 0.0], (10, 1))
    found = truth.copy()
    found[5:7] *= -1.0
    # errors of √1.6 rad/s before, and of 6 rad/s in two of five samples after
    found[:5] += [[np.sqrt(1.6), 0.0, 0.0]]
    numbers = over_time(found, truth)
    assert numbers["reversed"] == pytest.approx(0.2)
    assert numbers["growth"] == pytest.approx(3.0)


def test_one_line_draws_every_edge_of_the_box():
    points = edges()
    steps = {tuple(sorted((tuple(a), tuple(b)))) for a, b in itertools.pairwise(points)}
    assert len({step for step in steps if step[0] != step[1]}) == 12
    np.testing.assert_allclose(np.ptp(points, axis=0), BOX)
