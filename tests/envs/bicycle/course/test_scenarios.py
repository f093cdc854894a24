"""Scenarios: ridden upright by everybody, at their speeds, on their grounds."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.course.scenarios import list_scenarios, scenario
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.rider.posture import loop_closure_error
from poise.envs.record import record
from poise.envs.sensors.ideal import STANDARD_GRAVITY


def recorded(seed, **options):
    """An episode of a lumped rider, and the rider's posture."""
    env = RiderBicycleEnv(**{"fidelity": "lumped", **options})
    trajectory = record(env, seed=seed)
    posture = env.ride.rider.posture
    env.close()
    return trajectory, posture


@pytest.mark.parametrize("name", list_scenarios())
def test_scenarios_are_ridden_upright(name):
    duration = 15.0 if name in ("bumps", "pitch") else 7.0
    ride, _ = recorded(4, scenario=name, duration=duration, subject=3, suite=["bicycle_imu/acc"])
    assert len(ride) == 100 * duration + 1
    assert np.abs(ride.truth["bicycle/roll"]).max() < 0.6
    pitch = np.degrees(np.abs(ride.truth["bicycle/pitch"])).max()
    assert (pitch > 14.0) == (name == "pitch")
    if name == "bumps":
        force = np.nanmax(np.abs(ride.measurements["bicycle_imu/acc"]))
        assert force == pytest.approx(2.0 * STANDARD_GRAVITY)  # saturated


@pytest.mark.parametrize("seed", [100, 101, 103, 104])
def test_outdoor_rides_begin_at_a_speed_for_their_first_turn(seed):
    ride, _ = recorded(seed, scenario="outdoor", subject=seed % 5, duration=4.0, suite=["wheel/speed"])
    assert len(ride) == 401
    assert np.abs(ride.truth["bicycle/roll"]).max() < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("subject", range(5))
@pytest.mark.parametrize("name", list_scenarios())
def test_two_minutes_of_every_scenario_with_every_rider(name, subject):
    ride, posture = recorded(
        subject, scenario=name, duration=120.0, subject=subject, suite=["wheel/speed"], fidelity="full"
    )
    assert len(ride) == 12001
    assert loop_closure_error(ride.truth, posture).max() < 1e-3


def test_scenarios_compose():
    course = scenario("slalom+bumps").draw(np.random.default_rng(0), 20.0)
    heights = [course.ground.height_and_slope(*course.path.points[i, :2].tolist())[0] for i in range(0, 2400, 2)]
    assert max(heights) > 0.02
    assert np.abs(course.path.points[:, 3]).max() > 0.05
