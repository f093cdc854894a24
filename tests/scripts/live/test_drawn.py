"""Meshes, bodies of rider and device, curves: everything that is drawn, without a browser."""

from __future__ import annotations

import math
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import poise
from poise.envs.data.trajectory import Trajectory
from poise.filters.bicycle.force_inertial.kinematics import true_angles as force_inertial_angles
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.two_gyro.truth import true_angles as two_gyro_angles
from poise.filters.core import metrics, rotation
from poise.filters.core.quantity import GYROSCOPE_BIAS, UP
from poise.scripts.live.curves import curves_of
from poise.scripts.live.device import DeviceAttitude, VirtualController, device_meshes, inclined, planar_orientation
from poise.scripts.live.meshes import Mesh, ball, box, by_colour, is_hilly, road_mesh, rod, tyre
from poise.scripts.live.rider import estimated_values, forces_on, rider_meshes, rider_poses

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def ride() -> Trajectory:
    env = gymnasium.make("poise/RiderBicycle-v0", suite="all", duration=1.0)
    try:
        return poise.record(env, seed=1)
    finally:
        env.close()


def volume(mesh: Mesh) -> float:
    """Enclosed volume, m³; positive if all faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "expected", "within"),
    [
        (box((1.0, 2.0, 3.0), (0.2, 0.3, 0.4), RED), 0.024, 1e-12),
        (rod((0.0, 0.0, 0.0), (0.3, 0.4, 0.0), 0.1, RED), math.pi * 0.01 * 0.5, 0.04),
        (rod((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 0.2, RED, 0.1), math.pi * 0.07 / 3.0, 0.04),
        (ball((5.0, 0.0, 0.0), 0.1, RED), 4.0 / 3.0 * math.pi * 1e-3, 0.1),
        (tyre(0.3, 0.02, RED), 2.0 * math.pi**2 * 0.28 * 0.0004, 0.05),
    ],
)
def test_solids_have_their_volume_and_look_outwards(mesh, expected, within):
    assert volume(mesh) == pytest.approx(expected, rel=within)


def test_meshes_of_a_colour_are_joined():
    parts = [box((0, 0, 0), (1, 1, 1), RED), box((3, 0, 0), (1, 1, 1), BLUE), box((5, 0, 0), (2, 1, 1), RED)]
    joined = {mesh.colour: mesh for mesh in by_colour(parts)}
    assert volume(joined[RED]) == pytest.approx(3.0)
    assert volume(joined[BLUE]) == pytest.approx(1.0)


@pytest.mark.parametrize("meshes", [device_meshes(), *rider_meshes(RiderGeometry()).values()])
def test_all_bodies_look_outwards(meshes):
    assert all(volume(mesh) > 0.0 for mesh in meshes)


def test_bodies_of_a_ride_are_where_the_simulator_has_them(ride):
    geometry = RiderGeometry.of(ride.metadata)
    poses = rider_poses(geometry, ride.truth)

    def point(body: str, at: tuple[float, float, float]) -> np.ndarray:
        return poses[body].position + rotation.rotate(poses[body].orientation, np.array(at))

    # the pelvis tips by a degree on the saddle, which is not drawn
    np.testing.assert_allclose(poses["trunk"].position, ride.truth["trunk/position"], atol=0.008)
    forces = forces_on(geometry, ride.truth)
    for side in ("left", "right"):
        hand = point(f"forearm_{side}", (0.0, 0.0, -geometry.forearm))
        np.testing.assert_allclose(hand, forces[f"handlebar/force_{side}"][0], atol=0.01)
        bend = math.pi - geometry.ankle_angle
        sole = geometry.ankle_to_pedal * np.array([math.sin(bend), 0.0, math.cos(bend)])
        foot = point(f"shank_{side}", (sole[0], 0.0, sole[2] - geometry.shank))
        np.testing.assert_allclose(foot, forces[f"pedal/force_{side}"][0], atol=0.01)
    front = point("front_wheel", (0.0, 0.0, 0.0))
    np.testing.assert_allclose(front[:, 2], geometry.wheel_radius, atol=0.03)


def test_forces_carry_the_rider(ride):
    geometry = RiderGeometry.of(ride.metadata)
    total = sum(vector for _, vector in forces_on(geometry, ride.truth).values())
    weight = 9.81 * geometry.rider_mass
    assert -np.mean(total[:, 2]) == pytest.approx(weight, rel=0.1)  # type: ignore[index]


@pytest.mark.parametrize(
    ("derive", "bodies"),
    [
        (lambda truth: {n: v for n, v in truth.items() if n.endswith(("angles", "flexion")) and "joint" not in n}, 15),
        (two_gyro_angles, 7),
        (force_inertial_angles, 7),
    ],
)
def test_true_angles_give_the_true_bodies(ride, derive, bodies):
    geometry = RiderGeometry.of(ride.metadata)
    angles = {**derive(ride.truth), "bicycle/roll": ride.truth["bicycle/roll"]}
    found = rider_poses(geometry, estimated_values(angles, ride.truth))
    expected = rider_poses(geometry, ride.truth)
    assert len(found) == bodies
    for body, placed in found.items():
        np.testing.assert_allclose(placed.position, expected[body].position, atol=1e-9)
        assert metrics.total_error(placed.orientation, expected[body].orientation).max() < 1e-7


def test_a_ride_without_truth_stands_upright_and_steers():
    values = estimated_values({"bicycle/roll": np.full((2, 1), 0.1)}, {"bicycle/steer": np.full((2, 1), 0.3)})
    poses = rider_poses(RiderGeometry(), values)
    np.testing.assert_allclose(rotation.to_euler_zyx(poses["bicycle"].orientation)[2], 0.1)
    steered = metrics.total_error(poses["front"].orientation, poses["bicycle"].orientation)
    np.testing.assert_allclose(steered, 0.3, atol=1e-6)
    assert "trunk" not in poses


def turns(n: int, seed: int) -> np.ndarray:
    return np.asarray(rotation.random(np.random.default_rng(seed), (n,)))


def test_a_relative_orientation_is_aligned_once():
    truth = turns(20, 0)
    drift = rotation.exp(np.linspace(0.0, 0.5, 20)[:, None] * np.array([0.0, 0.0, 1.0]))
    heading = rotation.exp(np.array([0.0, 0.0, 2.0]))
    relative = rotation.multiply(drift, rotation.multiply(heading, truth))
    relative[:3] = np.nan
    attitude = DeviceAttitude()
    first = attitude.orientation({"relative_orientation": relative[:10]}, truth[:10])
    second = attitude.orientation({"relative_orientation": relative[10:]}, truth[10:])
    assert first is not None
    assert second is not None
    errors = metrics.total_error(np.concatenate([first, second]), truth)
    np.testing.assert_allclose(errors[3:], np.linspace(0.0, 0.5, 20)[3:] - 0.5 * 3 / 19, atol=1e-9)


def test_an_inclination_has_the_heading_of_the_truth():
    truth, other = turns(50, 1), turns(50, 2)
    up = rotation.up_in_body(other)
    found = inclined(3.0 * up, truth)
    np.testing.assert_allclose(rotation.up_in_body(found), up, atol=1e-9)
    np.testing.assert_allclose(metrics.total_error(found, truth), metrics.inclination_error(other, truth), atol=1e-7)
    np.testing.assert_allclose(rotation.up_in_body(inclined(up, None)), up, atol=1e-9)


def test_a_planar_angle_turns_in_its_plane():
    angle = np.array([-2.0, 0.3, 1.2])
    along = rotation.rotate(planar_orientation(angle, None), np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.arctan2(along[:, 2], along[:, 0]), angle)
    np.testing.assert_allclose(
        planar_orientation(angle + 0.1, planar_orientation(angle, None))[1],
        planar_orientation(np.array([0.4]), None)[0],
    )


def test_the_virtual_controller_leaks_as_the_thesis_says():
    # a constant error c of the acceleration leads to the offset c / (K_b K_v)
    level = np.tile([1.0, 0.0, 0.0, 0.0], (2000, 1))
    controller = VirtualController(velocity_damping=2.0, position_damping=4.0)
    estimate = {"external_acceleration": np.tile([0.0, 0.8, 0.0], (2000, 1))}
    halves = [
        controller.position({"external_acceleration": estimate["external_acceleration"][part]}, level[part], 0.01)
        for part in (slice(0, 700), slice(700, None))
    ]
    path = np.concatenate(halves)
    np.testing.assert_allclose(path[-1], [0.0, 0.1, 0.0], atol=1e-6)
    assert 0.0 < path[10, 1] < 0.01
    assert VirtualController().position({"up": level}, level, 0.01) is None
    own = {"virtual_position": np.ones((3, 3))}
    np.testing.assert_array_equal(VirtualController().position(own, None, 0.01), own["virtual_position"])


def test_curves_are_errors_in_degrees_and_angles():
    truth = {
        "orientation": rotation.exp(np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])),
        "gyroscope_bias": np.zeros((2, 3)),
    }
    estimate = {"up": np.tile([0.0, 0.0, 1.0], (2, 1)), "gyroscope_bias": np.tile([0.0, 0.3, 0.4], (2, 1))}
    curves = curves_of(truth, {"mine": estimate}, {"mine": (UP, GYROSCOPE_BIAS)})
    np.testing.assert_allclose(curves["error of inclination (deg)"]["mine"], [0.0, math.degrees(0.2)], atol=1e-9)
    np.testing.assert_allclose(curves["error of gyroscope_bias (rad/s)"]["mine"], [0.5, 0.5])
    np.testing.assert_allclose(curves["roll (deg)"]["truth"], [0.0, math.degrees(0.2)], atol=1e-9)
    assert list(curves["roll (deg)"]) == ["truth", "mine"]
    assert "yaw (deg)" not in curves


def test_what_is_drawn_needs_neither_viser_nor_pybullet():
    code = (
        "import sys; sys.modules.update(dict.fromkeys(['viser', 'plotly', 'pybullet', 'playwright']));"
        "import poise.scripts.live.shown, poise.scripts.live.player, poise.scripts.live.scene;"
        "from poise.scripts.main import main; sys.exit(main(['view', 'nowhere.csv']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2
    assert "pip install 'poise[view]'" in done.stderr


def test_a_road_has_the_heights_of_the_ride() -> None:
    """A hill of 1 m, met standing still at first; the mesh is a strip through the places with walls to its foot."""
    x = np.concatenate([np.zeros(20), np.linspace(0.0, 20.0, 401)])
    path = np.stack([x, np.zeros_like(x), 0.5 - 0.5 * np.cos(2.0 * np.pi * x / 20.0)], axis=1)
    assert is_hilly(path)
    assert not is_hilly(path * [1.0, 1.0, 0.01])
    vertices, faces = road_mesh(path)
    top = vertices[np.abs(vertices[:, 2]) > 1e-9]
    assert vertices[:, 2].min() == pytest.approx(0.0)
    np.testing.assert_allclose(np.abs(vertices[:, 1]), 0.6)
    np.testing.assert_allclose(top[:, 2], 0.5 - 0.5 * np.cos(2.0 * np.pi * top[:, 0] / 20.0), atol=1e-9)
    assert vertices[:, 0].min() == pytest.approx(-1.3)
    assert faces.max() == len(vertices) - 1
    standing, none = road_mesh(path[:20])
    assert len(standing) == len(none) == 0
