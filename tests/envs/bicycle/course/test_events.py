"""Gusts, coasting, cadences, stops and starts."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.course.events import Events, SideForce, coasting_phases, gusts, usual_cadence
from poise.envs.bicycle.course.path import Path
from poise.envs.bicycle.course.scenarios import SpeedProfile, scenario
from poise.envs.bicycle.frame.bicycles import BICYCLES
from poise.envs.bicycle.ride.ride import Ride
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.rider.style import STYLES, RiderMotion


def ride(speed, events=None, pilot="skilled"):
    posture = sit(BICYCLES["mountain-bike"], SUBJECTS[0])
    motion = RiderMotion(STYLES["still"], np.random.default_rng(0))
    return Ride(posture, motion, Path(np.zeros(2)), speed, fidelity="lumped", pilot=pilot, events=events)


def test_side_force_is_linear_between_samples_and_ends():
    force = SideForce(np.array([0.0, 10.0, 20.0]))
    assert force(0.01) == pytest.approx(5.0)
    assert force(0.03) == pytest.approx(15.0)
    assert force(-0.1) == force(0.1) == 0.0
    with pytest.raises(ValueError, match="finite"):
        SideForce(np.array([0.0, np.nan]))


def test_gusts_begin_with_nothing_and_repeat_by_seed():
    first, second = (gusts(np.random.default_rng(4), 5.0, 60.0).values for _ in range(2))
    assert np.array_equal(first, second)
    assert first[0] == 0.0
    assert 3.0 < first.std() < 30.0
    assert np.abs(first).max() < 120.0


def test_phases_and_cadences_stay_in_their_ranges():
    rng = np.random.default_rng(0)
    for begin, end in coasting_phases(rng, 300.0):
        assert 3.0 <= end - begin <= 7.0
    cadences = [usual_cadence(rng) * 30.0 / np.pi for _ in range(200)]
    assert 50.0 <= min(cadences) < 55.0
    assert 95.0 < max(cadences) <= 100.0


def test_a_push_from_the_left_leads_to_the_right():
    """The force is to the right (negative); the same ride without it stays where it was."""
    ends = []
    for strength in (0.0, -60.0):
        values = np.zeros(80)
        values[50:70] = strength
        with ride(lambda _: 3.0, Events(side=SideForce(values)), "ideal") as on:
            for _ in range(725):
                on.step()
            ends.append(on.bicycle.state().roll)
    assert ends[1] - ends[0] > 0.002


def test_legs_rest_while_coasting_and_pedal_afterwards():
    rates = []
    with ride(lambda _: 4.0, Events(coasting=((2.0, 5.0),))) as on:
        for step in range(4500):
            on.step()
            if step in (900, 2300, 4499):
                rates.append((on.bicycle.state().crank_rate, on.bicycle.state().speed))
    assert rates[0][0] > 3.0
    assert abs(rates[1][0]) < 0.5
    assert rates[1][1] < rates[0][1]
    assert rates[2][0] > 3.0


def test_the_cadence_is_the_riders():
    for cadence in (5.5, 9.5):
        with ride(lambda _: 4.5, Events(cadence=cadence)) as on:
            for _ in range(1500):
                on.step()
            assert cadence / 1.3 < on.bicycle.state().crank_rate < cadence * 1.3


def test_a_ride_starts_from_rest_and_stops_again_upright():
    profile = SpeedProfile(np.array([0.0, 3.0, 0.0]), 5.0, dwell=0.3)
    speeds = []
    with ride(profile) as on:
        for step in range(8000):
            on.step()
            if step % 500 == 0:
                speeds.append(on.bicycle.state().speed)
            assert abs(on.state.roll) < 0.3
        assert on.foot.engaged == 1.0
    assert abs(speeds[1]) < 0.1
    assert max(speeds) > 2.0
    assert abs(speeds[-1]) < 0.15


@pytest.mark.parametrize("name", ["stop-and-go", "commute", "gusts"])
def test_scenarios_have_their_events(name):
    course = scenario(name).draw(np.random.default_rng(1), 40.0)
    assert course.events.cadence is not None
    assert (course.events.side is not None) == (name == "gusts")
    assert bool(course.events.coasting) == (name == "commute")
    assert (course.speed(0.0) == 0.0) == (name == "stop-and-go")
