"""Errors of all riders over time, and what is claimed of them."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.plots import new_figure, save_animation
from poise.baselines.studies.ride_figures import draw_angle, errors_over_time, spread_claims, spread_figure
from poise.baselines.studies.ride_study import SPACING


def rides(offset, growth=0.0):
    """Two rides of a minute with opposite errors around ``offset``, the first one longer."""
    time = SPACING * np.arange(round(60.0 / SPACING))
    size = 1.0 + growth * time / time[-1]
    return [
        {"over time": {"filter": {"φ": [*(offset + size), 9.0]}}},
        {"over time": {"filter": {"φ": list(offset - size)}}},
    ]


def test_mean_and_deviation_reach_to_the_shortest_ride():
    time, mean, deviation = errors_over_time(rides(0.5), "φ")
    assert len(time) == len(mean) == 240
    assert time[1] == SPACING
    np.testing.assert_allclose(mean, 0.5)
    np.testing.assert_allclose(deviation, np.sqrt(2.0))


@pytest.mark.parametrize(
    ("offset", "growth", "holds"), [(0.0, 0.0, [True, True]), (3.0, 0.0, [False, True]), (0.0, 9.0, [True, False])]
)
def test_errors_around_zero_that_do_not_grow(offset, growth, holds):
    assert [claim.holds for claim in spread_claims(rides(offset, growth), ["φ"], "Figure 8")] == holds


def test_rides_that_are_too_short_decide_nothing():
    short = [{"over time": {"filter": {"φ": [1.0] * 8}}}] * 2
    assert [claim.holds for claim in spread_claims(short, ["φ"], "Figure 8")] == [None, None]


def test_what_drifts_does_not_set_the_scale(tmp_path):
    time = np.linspace(0.0, 1.0, 11)
    figure, (ax,) = new_figure(3.0, 2.0)
    draw_angle(ax, time, 10.0 * time, {"integration": 1000.0 * time, "filter": 0.1 + 0.0 * time}, "φ")
    low, high = ax.get_ylim()
    assert -5.0 < low < 0.0 < 10.0 < high < 15.0
    assert [line.get_label() for line in ax.lines] == ["truth", "integration", "filter"]
    assert len(spread_figure(rides(0.0), ["φ"]).axes) == 1
    film = save_animation([figure, new_figure(3.0, 2.0)[0]], 0.1, tmp_path / "film.gif")
    assert film.read_bytes()[:6] == b"GIF89a"
