"""Ideal readings of force sensors, encoders and camera, against statics and geometry; and on a simulated rider."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.sensors.readings import RideQuantities, centre_of_pressure
from poise.envs.bicycle.sensors.sites import SPREAD_VIEWPOINTS, sensor_sites
from poise.envs.bicycle.sensors.suites import CHANNELS
from poise.envs.sensors.ideal import BodyState
from poise.filters.core import rotation

POSTURE = sit(MOUNTAIN_BIKE, SUBJECTS[3])
SITES = sensor_sites(POSTURE)
WEIGHT = 600.0


def body(orientation=(1.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0)):
    return BodyState(0.0, np.array(position), np.array(orientation), np.zeros(3), np.zeros(3))


def read(names, sites=SITES, **quantities):
    quantities.setdefault("bodies", {"bicycle": body(), "trunk": body()})
    ride = RideQuantities(sites=sites, **quantities)
    return {name: CHANNELS[name].kind.reading(ride) for name in names}


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.05, 0.02), (-0.03, -0.04)])
def test_cells_of_a_static_rider_carry_the_weight_and_tell_its_place(place):
    x, y = place
    force = np.array([0.0, 0.0, -WEIGHT])
    moment = np.cross([x, y, 0.0], force)
    cells = read(["seat/load_cells"], seat_force=force, seat_moment=moment)["seat/load_cells"]
    assert cells.sum() == pytest.approx(WEIGHT)
    np.testing.assert_allclose(centre_of_pressure(cells, SITES), place, atol=1e-12)
    # the formula as the paper prints it
    assert cells[0] / cells.sum() * 0.20 - 0.043 == pytest.approx(x, abs=1e-12)
    assert (cells[1] - cells[2]) / (2.0 * cells.sum()) * 0.12 == pytest.approx(y, abs=1e-12)


def test_seat_wrench_turns_and_moves_to_the_sensor():
    force, moment = np.array([30.0, -20.0, -WEIGHT]), np.array([5.0, -8.0, 2.0])
    frame = rotation.from_euler_zyx(*map(np.array, (0.7, 0.05, -0.2)))
    wrench = read(
        ["seat/wrench"],
        bodies={"bicycle": body(frame)},
        seat_force=rotation.rotate(frame, force),
        seat_moment=rotation.rotate(frame, moment),
    )["seat/wrench"]
    g = math.radians(20.0)
    # columns: the sensor's axes, pitched nose up by γ, in bicycle axes
    axes = np.array([[math.cos(g), 0.0, -math.sin(g)], [0.0, 1.0, 0.0], [math.sin(g), 0.0, math.cos(g)]])
    np.testing.assert_allclose(wrench[:3], axes.T @ force, atol=1e-10)
    saddle_from_sensor = 0.13 * axes[:, 2]
    np.testing.assert_allclose(wrench[3:], axes.T @ (moment + np.cross(saddle_from_sensor, force)), atol=1e-10)


def test_vertical_weight_on_a_vertical_post_would_only_press():
    """A force along the post through the saddle point makes no moment at the sensor."""
    g = math.radians(20.0)
    along = WEIGHT * np.array([math.sin(g), 0.0, -math.cos(g)])
    wrench = read(["seat/wrench"], seat_force=along, seat_moment=np.zeros(3))["seat/wrench"]
    np.testing.assert_allclose(wrench, [0.0, 0.0, -WEIGHT, 0.0, 0.0, 0.0], atol=1e-10)


def test_handlebar_forces_are_left_then_right_in_bicycle_axes():
    yaw = rotation.from_euler_zyx(*map(np.array, (math.pi / 2.0, 0.0, 0.0)))
    hands = np.array([[0.0, 10.0, -40.0], [-5.0, 0.0, -60.0]])
    force = read(["handlebar/force"], bodies={"bicycle": body(yaw)}, hands=hands)["handlebar/force"]
    np.testing.assert_allclose(force, [10.0, 0.0, -40.0, 0.0, 5.0, -60.0], atol=1e-12)


def test_encoders():
    found = read(["wheel/speed", "steer/angle", "crank/angle"], wheel_rate=9.0, steer=-0.2, crank=15.0)
    assert found["wheel/speed"] == pytest.approx([9.0 * 0.335])
    assert found["steer/angle"] == pytest.approx([-0.2])
    assert found["crank/angle"] == pytest.approx([15.0 - 4.0 * math.pi])
    sunk = replace(SITES, wheel_radius=0.33)
    assert read(["wheel/speed"], sunk, wheel_rate=1.0)["wheel/speed"] == pytest.approx([0.33])


def test_relative_orientation_is_trunk_to_bicycle():
    frame, lean = (rotation.random(np.random.default_rng(seed)) for seed in (1, 2))
    bodies = {"bicycle": body(frame), "trunk": body(rotation.multiply(frame, lean))}
    found = read(["relative/orientation"], bodies=bodies)["relative/orientation"]
    np.testing.assert_allclose(found, rotation.positive(lean), atol=1e-12)


def trunk_at(frame, place, turn):
    position = place + rotation.rotate(frame, POSTURE.lumbar)
    orientation = rotation.multiply(frame, rotation.multiply(POSTURE.trunk_orientation(), rotation.exp(np.array(turn))))
    return {"bicycle": body(frame, place), "trunk": body(orientation, position)}


def test_distances_do_not_depend_on_where_the_bicycle_is():
    here = read(["relative/distances"], bodies=trunk_at(np.array([1.0, 0, 0, 0]), np.zeros(3), (0.1, 0.2, 0.0)))
    frame = rotation.from_euler_zyx(*map(np.array, (2.0, 0.1, -0.3)))
    there = read(["relative/distances"], bodies=trunk_at(frame, np.array([30.0, -9.0, 0.2]), (0.1, 0.2, 0.0)))
    np.testing.assert_allclose(there["relative/distances"], here["relative/distances"], atol=1e-12)
    assert np.all((here["relative/distances"] > 0.3) & (here["relative/distances"] < 1.5))


@pytest.mark.parametrize(("viewpoints", "rank"), [(None, 2), (SPREAD_VIEWPOINTS, 3)], ids=["camera", "spread"])
def test_one_camera_is_blind_to_turns_about_its_line_of_sight_to_the_joint(viewpoints, rank):
    sites = SITES if viewpoints is None else sensor_sites(POSTURE, viewpoints=viewpoints)

    def distances(turn):
        bodies = trunk_at(np.array([1.0, 0, 0, 0]), np.zeros(3), turn)
        return read(["relative/distances"], sites, bodies=bodies)["relative/distances"]

    step = 1e-5
    jacobian = np.array([(distances(step * axis) - distances(-step * axis)) / (2.0 * step) for axis in np.eye(3)]).T
    values = np.linalg.svd(jacobian)[1]
    assert np.sum(values > 0.02 * values[0]) == rank


def test_many_ticks_are_read_at_once():
    length, rng = 7, np.random.default_rng(0)
    turn, place = rotation.random(rng, (2, length)), rng.standard_normal((2, length, 3))
    still = np.zeros((length, 3))
    bodies = {
        name: BodyState(np.arange(length) / 100.0, place[i], turn[i], still, still)
        for i, name in enumerate(("bicycle", "trunk"))
    }
    whole = RideQuantities(
        bodies,
        SITES,
        *rng.standard_normal((3, length)),
        *rng.standard_normal((2, length, 3)),
        rng.standard_normal((length, 2, 3)),
    )
    kinds = {name: channel.kind for name, channel in CHANNELS.items() if not channel.kind.on_body}
    assert len(kinds) == 8
    found = {name: kind.reading(whole) for name, kind in kinds.items()}
    fields = ("wheel_rate", "steer", "crank", "seat_force", "seat_moment", "hands")
    for tick in range(length):
        now = {name: state.at(tick) for name, state in bodies.items()}
        one = RideQuantities(now, SITES, **{name: getattr(whole, name)[tick] for name in fields})
        for name, kind in kinds.items():
            np.testing.assert_allclose(kind.reading(one), found[name][tick], atol=1e-12)


def test_what_is_missing_is_named():
    with pytest.raises(ValueError, match="steer is needed"):
        read(["steer/angle"], crank=0.0)
    with pytest.raises(ValueError, match="bodies must hold 'trunk'"):
        read(["relative/orientation"], bodies={"bicycle": body()})
