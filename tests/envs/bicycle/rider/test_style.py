"""Riders' habits on the bicycle: how far each style leans in a circle, and what saddle and hands then carry."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.rider.style import STYLES
from poise.envs.sensors.ideal import STANDARD_GRAVITY


@functools.cache
def steady_ride(style, scenario="indoor_circle", duration=11.0, after=6.0, subject=0, fidelity="lumped", seed=0):
    """Lean of the trunk to the bicycle (deg), load cells (N) and downward force of both hands (N), once in the turn."""
    env = RiderBicycleEnv(
        scenario, subject, style, ["seat/load_cells"], "ideal", duration=duration, fidelity=fidelity, rate=50.0
    )
    env.reset(seed=seed)
    leans, cells, hands, over = [], [], [], False
    while not over:
        observation, _, terminated, over, info = env.step(env.neutral_action)
        assert not terminated
        if info["time"] > after:
            leans.append(np.degrees(info["pose"]["trunk/angles"][1]))
            cells.append(observation["seat/load_cells"])
            hands.append([-info["truth"][f"handlebar/force_{side}"][2] for side in ("left", "right")])
    env.close()
    return np.array(leans), np.array(cells), np.array(hands)


def test_styles_lean_in_order_and_an_aggressive_rider_far():
    """The papers' riders lean up to about 20 degrees in a circle of 2.5 m."""
    leans = {style: np.abs(steady_ride(style)[0]) for style in ("mild", "normal", "aggressive")}
    for less, more in (("mild", "normal"), ("normal", "aggressive")):
        assert leans[less].mean() + 3.0 < leans[more].mean()
        assert leans[less].max() < leans[more].max()
    assert 15.0 < leans["aggressive"].max() < 35.0


@pytest.mark.parametrize(("style", "scenario"), [("normal", "indoor_circle"), ("mild", "straight")])
def test_a_steady_rider_presses_on_all_load_cells(style, scenario):
    _, cells, hands = steady_ride(style, scenario, fidelity="full")
    assert cells.mean(axis=0).min() > 50.0
    assert np.percentile(cells, 5.0, axis=0).min() > 0.0
    # the hands carry some, the saddle most
    weight = 68.0 * STANDARD_GRAVITY
    assert 0.1 * weight < hands.sum(axis=1).mean() < 0.3 * weight
    assert 0.5 * weight < cells.sum(axis=1).mean() < 0.8 * weight


def test_the_inner_hand_props_a_lean():
    """The hands share the load unequally in a turn, but none pulls, and together they carry about the same."""
    leans, _, hands = steady_ride("normal", fidelity="full")
    difference = (hands[:, 1] - hands[:, 0]) * np.sign(leans.mean())
    assert difference.mean() > 20.0
    assert hands.min() > 0.0
    _, _, straight = steady_ride("still", "straight", 3.0, 1.0, fidelity="full")
    assert straight.sum(axis=1).mean() == pytest.approx(hands.sum(axis=1).mean(), rel=0.12)
    assert straight.sum(axis=1).mean() > 2.0 * STYLES["still"].hand_load
