"""What a rider sits on, leans on and stops with."""

from __future__ import annotations

import math

import numpy as np
import pytest

from poise.envs.bicycle.course.path import Path
from poise.envs.bicycle.course.scenarios import scenario
from poise.envs.bicycle.frame.bicycle import Bicycle
from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE, RigidPart, combine
from poise.envs.bicycle.ride.contact_forces import LoadCells
from poise.envs.bicycle.ride.ride import Ride
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.rider.saddle import (
    BEHIND,
    DAMPING,
    FRONT,
    SIT_BONES,
    STIFFNESS,
    TISSUE_STIFFNESS,
    balanced_hand_load,
    press,
    resting_load,
    seat_contact,
)
from poise.envs.bicycle.rider.style import STYLES, RiderMotion
from poise.envs.physics.world import Physics
from poise.envs.sensors.ideal import STANDARD_GRAVITY

SEAT = seat_contact(400.0, 0.01)
STILL = (0.0, 0.0)


def test_a_saddle_gives_way_and_never_pulls():
    assert press(SEAT, *STILL, *STILL, *STILL)[2] == pytest.approx(400.0)
    assert press(SEAT, *STILL, *STILL, -0.005, 0.0)[2] == pytest.approx(400.0 + 0.005 * STIFFNESS)
    assert press(SEAT, *STILL, *STILL, 0.0, -0.1)[2] == pytest.approx(400.0 + 0.1 * DAMPING)
    assert press(SEAT, 0.1, 0.0, 0.1, 0.0, 0.011, 0.0) == (0.0, 0.0, 0.0)
    # 45 kg bounce at 5 Hz, a third of critical damping
    assert math.sqrt(STIFFNESS / 45.0) / (2.0 * math.pi) == pytest.approx(5.0, abs=0.1)
    assert DAMPING / (2.0 * math.sqrt(STIFFNESS * 45.0)) == pytest.approx(1.0 / 3.0, abs=0.01)


def test_a_pelvis_tips_on_springs_until_a_point_lets_go():
    # three springs: their stiffness about the centroid, and about the middle
    forwards, rightwards, force = press(SEAT, 1e-3, 0.0, 2e-3, 0.0, *STILL)
    xs = np.array([FRONT, -BEHIND, -BEHIND])
    along = TISSUE_STIFFNESS * ((xs - xs.mean()) ** 2).sum()
    assert forwards == pytest.approx(-0.01 * force - 1e-3 * along)
    assert rightwards == pytest.approx(-2e-3 * TISSUE_STIFFNESS * 2.0 * SIT_BONES**2)
    for tip in np.random.default_rng(0).normal(0.0, 0.1, (200, 3)):
        forwards, rightwards, force = press(SEAT, tip[0], 0.0, tip[1], 0.0, 0.05 * tip[2], 0.0)
        # tipping is resisted, whichever points still press, and no load cell below the triangle pulls
        cells = LoadCells().share(np.array([0.0, 0.0, force]), np.array([rightwards, forwards, 0.0]))
        assert cells.min() >= -1e-9
        assert rightwards * tip[1] <= 0.0
        assert -force * FRONT - 1e-9 <= forwards <= force * BEHIND + 1e-9
    assert press(SEAT, 0.5, 0.0, *STILL, *STILL)[0] == pytest.approx(-400.0 * FRONT)
    assert press(SEAT, *STILL, 0.5, 0.0, *STILL)[1] == pytest.approx(-400.0 * SIT_BONES, rel=0.05)


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
@pytest.mark.parametrize("subject", [0, 4])
def test_a_still_rider_rests_where_the_posture_has_the_pelvis(subject, fidelity):
    """Statics of the balance on the saddle against what the simulated rider's links say."""
    posture = sit(MOUNTAIN_BIKE, SUBJECTS[subject])
    motion = RiderMotion(STYLES["still"], np.random.default_rng(0))
    with Ride(posture, motion, Path(np.zeros(2)), lambda _: 2.0, fidelity=fidelity) as ride:
        places, forces = [], []
        for step in range(1500):
            ride.step()
            if step > 700:
                seat = [part for pair in ride.bicycle.body.joint_tuples(ride.rider.seat) for part in pair]
                places.append(seat[::2])
                forces.append(press(ride.rider.saddle, *seat)[2])
    assert np.abs(np.mean(places, axis=0)).max() < 4e-3
    load = resting_load(posture, balanced_hand_load(posture))
    assert np.mean(forces) == pytest.approx(load, rel=0.05)
    assert 0.4 < load / (SUBJECTS[subject].mass * STANDARD_GRAVITY) < 0.65


def test_light_riders_lean_less_on_their_hands():
    loads = [balanced_hand_load(sit(MOUNTAIN_BIKE, body)) for body in SUBJECTS]
    assert loads[3] == pytest.approx(STYLES["normal"].hand_load, rel=0.05)
    assert loads[4] < loads[2] < loads[1] < loads[0]


RIDER = RigidPart(70.0, (0.33, 0.0, 1.12), (6.0, 6.5, 1.5, 0.3))


@pytest.mark.parametrize("wanted", [1.5, 3.5])
def test_brakes_stop_without_a_skid_and_hold(wanted):
    bike = MOUNTAIN_BIKE.with_load(RIDER)
    mass = combine(bike.parts).mass
    spinning = sum(w.inertia_axle / w.radius**2 for w in (bike.rear_wheel, bike.front_wheel))
    with Physics() as physics:
        bicycle = Bicycle(physics, bike)
        bicycle.start(4.0)
        slips, speeds = [], []
        for _ in range(3500):
            bicycle.act(brake=wanted * mass)
            physics.step()
            state = bicycle.state()
            speeds.append(state.speed)
            slips.append(abs(state.wheel_rate * bike.rear_wheel.radius - state.speed))
            for tyre, force in zip(bicycle.tyres, bicycle.tyre_forces, strict=True):
                shear = math.hypot(force.force[0], force.force[1])
                # each wheel keeps from its friction limit, also while the load shifts
                assert force.load < 60.0 or shear < 0.95 * tyre.parameters.friction * force.load
        stop = int(np.argmax(np.array(speeds) < 1.0))
    slowed = (speeds[200] - speeds[stop]) / ((stop - 200) * physics.time_step)
    assert slowed == pytest.approx(wanted * mass / (mass + spinning), rel=0.12)
    assert max(slips[:stop]) < 0.3
    # the tyres spring back once, then it stands
    assert min(speeds) > -0.15
    assert abs(np.mean(speeds[-200:])) < 0.02
    assert abs(state.pitch) < 0.05


def test_varied_speeds_come_from_the_whole_range():
    for seed in range(5):
        speed = scenario("outdoor").draw(np.random.default_rng(seed), 122.0).speed
        found = [speed(time) for time in np.arange(0.0, 122.0, 0.5)]
        assert min(speed.levels) < 1.1
        assert max(speed.levels) > 5.9
        assert min(found) >= min(speed.levels) - 1e-9
        # half of each level's time it stays
        assert speed(0.0) == speed(0.45 * speed.hold)
