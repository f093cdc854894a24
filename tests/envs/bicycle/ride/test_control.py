"""Paths, and balance of a bicycle with a rigid rider along them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.envs.bicycle.course.path import SPACING, Path, smooth_curvature, wandering_path
from poise.envs.bicycle.frame.bicycle import Bicycle
from poise.envs.bicycle.frame.parameters import BENCHMARK, MOUNTAIN_BIKE, RigidPart, combine
from poise.envs.bicycle.ride.control import ControlSettings, Pilot
from poise.envs.physics.world import Physics

RIDER = RigidPart(70.0, (0.33, 0.0, 1.12), (6.0, 6.5, 1.5, 0.3))
LOADED = replace(MOUNTAIN_BIKE, rear_frame=combine([MOUNTAIN_BIKE.rear_frame, RIDER]))
STRAIGHT = Path(np.zeros(2))


def ride(bike, path, speed, duration, roll_rate=0.0):
    """Roll, steer, speed, offset and steer torque at 250 Hz."""
    pilot = Pilot(bike.with_load())
    with Physics() as physics:
        bicycle = Bicycle(physics, bike)
        x, y, heading, _ = path.points[0].tolist()
        bicycle.start(speed, (x, y), heading, roll_rate=roll_rate)
        pilot.start(path, speed)
        rows = []
        for step in range(round(duration / physics.time_step)):
            if step % 4 == 0:
                state = bicycle.state()
                torque, drive = pilot.update(state.numbers, speed)
                rows.append((state.roll, state.steer, state.speed, pilot.offset, torque))
            bicycle.act(torque, drive * bike.rear_wheel.radius)
            physics.step()
    return np.array(rows).T


@pytest.mark.parametrize(
    ("bike", "speed"), [(BENCHMARK, 0.5), (BENCHMARK, 5.0), (LOADED, 0.5), (LOADED, 1.0), (LOADED, 3.0), (LOADED, 6.0)]
)
def test_balance_after_a_push(bike, speed):
    roll, _, ridden, offset, torque = ride(bike, STRAIGHT, speed, 9.0, roll_rate=0.02)
    late = slice(len(roll) * 2 // 3, None)
    assert np.abs(roll).max() < 0.15
    assert np.abs(roll[late]).max() < 2e-3
    assert np.abs(offset[late]).max() < 0.05
    assert ridden[late].mean() == pytest.approx(speed, abs=0.02)
    assert np.abs(torque).max() < 20.0


def test_indoor_circle_has_the_lean_of_a_steady_turn():
    radius, speed = 2.5, 1.0
    path = Path(smooth_curvature(lambda s: np.where(s > 3.0, 1.0 / radius, 0.0), 40.0))
    roll, steer, ridden, offset, _ = ride(LOADED, path, speed, 25.0)
    late = slice(len(roll) // 2, None)
    assert np.abs(offset[late]).max() < 0.05
    assert ridden[late].mean() == pytest.approx(speed, abs=0.02)
    parts = LOADED.parts
    mass = sum(part.mass for part in parts)
    height = sum(part.mass * part.centre[2] for part in parts) / mass
    spin = sum(wheel.inertia_axle / wheel.radius for wheel in (LOADED.rear_wheel, LOADED.front_wheel))
    # leaning to the left (negative) balances centrifugal force and the wheels' gyroscopic moment
    lean = -(1.0 + spin / (mass * height)) * speed**2 / radius / 9.81
    assert roll[late].mean() == pytest.approx(lean, rel=0.2)
    assert math.tan(steer[late].mean() * math.cos(LOADED.steer_axis_tilt)) == pytest.approx(1.05 / radius, rel=0.1)


def test_slalom_stays_on_the_path():
    path = Path(smooth_curvature(lambda s: np.sign(np.sin(0.1 * math.pi * (s - 5.0))) * (s > 5.0) / 6.0, 60.0))
    _, _, _, offset, _ = ride(LOADED, path, 3.0, 15.0)
    assert np.abs(offset).max() < 0.3


def test_the_pilot_slows_down_for_a_sharp_turn():
    path = Path(smooth_curvature(lambda s: np.where((s > 25.0) & (s < 31.0), 0.25, 0.0), 60.0))
    _, _, speed, offset, _ = ride(LOADED, path, 5.0, 12.0)
    assert speed.max() > 4.9
    assert speed.min() == pytest.approx(math.sqrt(2.0 / 0.25), abs=0.15)
    assert np.abs(offset).max() < 0.3


def test_speed_limits_leave_room_to_brake():
    """Slowing down at the comfortable rate from the limit anywhere reaches the turn at its own limit."""
    pilot = Pilot(LOADED)
    distances = np.linspace(0.0, 12.0, 41)
    limits = pilot.speed_limits(np.where(distances > 9.0, 0.25, 0.02), distances)
    turn, s = np.searchsorted(distances, 9.0, "right"), pilot.settings
    assert limits[turn] == pytest.approx(math.sqrt(s.lateral_acceleration / 0.25))
    for index in range(turn):
        slowed = limits[index] ** 2 - 2.0 * s.braking * (distances[turn] - distances[index])
        assert slowed == pytest.approx(limits[turn] ** 2)
    assert np.all(np.diff(limits[: turn + 1]) < 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
def test_two_minutes_outdoors(speed):
    """Turns of 4 m radius: who wants 6 m/s brakes to 2.8 m/s for them, 2 m/s² of lateral acceleration."""
    path = wandering_path(np.random.default_rng(7), 120.0 * speed)
    roll, _, ridden, offset, _ = ride(LOADED, path, speed, 120.0)
    assert len(roll) == 30000
    assert np.abs(roll).max() < 0.3
    assert np.abs(offset).max() < 0.5
    assert ridden.max() > 0.95 * speed


def test_path_of_constant_curvature_is_a_circle():
    path = Path(np.full(2001, 0.25), start=(1.0, 2.0, 0.3))
    centre = np.array([1.0 - 4.0 * math.sin(0.3), 2.0 + 4.0 * math.cos(0.3)])
    np.testing.assert_allclose(np.linalg.norm(path.points[:, :2] - centre, axis=1), 4.0, atol=1e-5)
    assert path.length == pytest.approx(2000 * SPACING)
    for distance in (-2.0, 0.0, 3.3, 50.0):
        point = path.at(distance)
        side = np.array([-math.sin(point.heading), math.cos(point.heading)])
        found, left = path.progress(distance + 0.2, *(np.array([point.x, point.y]) + 0.1 * side).tolist())
        assert found == pytest.approx(distance, abs=1e-2)
        assert left == pytest.approx(0.1, abs=1e-3)


def test_blended_curvature_turns_by_the_same_angle():
    blended = smooth_curvature(lambda s: np.where((s > 5.0) & (s < 10.0), 0.3, 0.0), 20.0)
    assert np.abs(np.diff(blended)).max() < 0.02
    assert blended.sum() * SPACING == pytest.approx(1.5, rel=0.01)


def test_wandering_path_stays_in_its_rectangle_and_repeats_by_seed():
    path = wandering_path(np.random.default_rng(5), 400.0)
    assert np.all(np.abs(path.points[:, :2]).max(axis=0) < (25.0, 20.0))
    assert np.abs(path.points[:, 3]).max() <= 0.25
    assert np.array_equal(path.points, wandering_path(np.random.default_rng(5), 400.0).points)


@pytest.mark.parametrize("seed", range(3))
def test_wide_turns_and_long_legs_stay_inside_too(seed):
    path = wandering_path(np.random.default_rng(seed), 400.0, widest_radius=12.0, shortest_leg=20.0)
    tight = wandering_path(np.random.default_rng(seed), 400.0)
    assert np.all(np.abs(path.points[:, :2]).max(axis=0) < (25.0, 20.0))
    assert np.abs(path.points[:, 3]).max() <= 0.25
    # what lets a rider be fast: more of it is nearly straight
    share, before = ((np.abs(each.points[:, 3]) < 2.0 / 36.0).mean() for each in (path, tight))
    assert share > 0.45
    assert share > before


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Path(np.zeros(1)), "curvature"),
        (lambda: smooth_curvature(np.zeros_like, 0.0), "length"),
        (lambda: wandering_path(np.random.default_rng(0), 10.0, (5.0, 50.0)), "room"),
        (lambda: wandering_path(np.random.default_rng(0), 10.0, widest_radius=3.0), "widest_radius"),
        (lambda: wandering_path(np.random.default_rng(0), 10.0, shortest_leg=60.0), "shortest_leg"),
        (lambda: ControlSettings(effort=0.0), "effort"),
        (lambda: ControlSettings(roll=-1.0), "roll"),
    ],
)
def test_impossible_arguments_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
