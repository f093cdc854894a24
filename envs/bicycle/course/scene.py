"""Rendering of rider, bicycle and fixture: the shapes of the physics, in a separate world."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ....filters.core import rotation
from ....filters.support.optional import extra
from ...physics.urdf import Tree, rod_shape
from ...physics.world import Physics
from ...rendering import AXIS_COLOURS, TILE_COLOURS, take_picture
from ...sensors.ideal import BodyState
from ..frame.bicycle import bicycle_tree
from ..frame.parameters import BicycleParameters
from ..rider.links import SEAT_JOINTS, SLIDES, TRUNK_JOINTS, add_full_rider, limb_joints
from ..rider.posture import LIMBS, Posture
from .terrain import FlatGround, Ground

with extra("sim"):
    import pybullet

DISK_RADIUS, DISK_COLOUR, POST_COLOUR = 0.2, (0.93, 0.86, 0.62), (0.55, 0.57, 0.6)
"""m; appearance of the disk of the two-gyroscope paper's fixture"""
TILE, TILES = 1.0, 8
"""m, and tiles on each side of the bicycle"""


class BicycleScene:
    """A bicycle over a ground of tiles that follows it.

    Args:
        tree: the bicycle and its attachments.
        ground: what it rolls on.
        gui: open a window.
    """

    def __init__(self, tree: Tree, ground: Ground, *, gui: bool = False) -> None:
        self._physics, self._ground = Physics(gui=gui), ground
        client = self._physics.client
        if gui:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=client)
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 0, physicsClientId=client)
        self._gui = gui
        self._bicycle = self._physics.load_urdf(tree.text())
        self._tiles = [self._tile(i, j) for i in range(-TILES, TILES) for j in range(-TILES, TILES)]
        self._target, self._heading = np.zeros(3), 0.0
        if gui:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 1, physicsClientId=client)

    def _tile(self, i: int, j: int) -> int:
        visual = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=[0.5 * TILE, 0.5 * TILE, 0.005],
            rgbaColor=TILE_COLOURS[(i + j) % 2],
            physicsClientId=self._physics.client,
        )
        return self._physics.create_body(0.0, (0.0, 0.0, 0.0), visual=visual)

    def draw(self, pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], estimate: np.ndarray) -> None:
        """Put bicycle and ground in place; the estimate is not shown."""
        zero, physics = np.zeros(3), self._physics
        position, orientation = np.asarray(truth["bicycle/position"]), np.asarray(pose["bicycle/orientation"])
        physics.set_state(self._bicycle, BodyState(0.0, position, orientation, zero, zero))
        self._heading = float(rotation.to_euler_zyx(orientation)[0])
        self._target = position + np.array([0.5 * math.cos(self._heading), 0.5 * math.sin(self._heading), 0.75])
        centre = np.floor(position[:2] / (2.0 * TILE)) * 2.0 * TILE
        places = [(i, j) for i in range(-TILES, TILES) for j in range(-TILES, TILES)]
        for tile, place in zip(self._tiles, places, strict=True):
            x, y = (centre + TILE * (np.array(place) + 0.5)).tolist()
            height, slope_x, slope_y = self._ground.height_and_slope(x, y)
            turn = np.array([1.0, 0.5 * slope_y, -0.5 * slope_x, 0.0])
            where = np.array([x, y, height - 0.005])
            physics.set_state(tile, BodyState(0.0, where, turn / np.linalg.norm(turn), zero, zero))
        if self._gui:
            pybullet.resetDebugVisualizerCamera(
                3.0, math.degrees(self._heading) - 30.0, -15.0, self._target.tolist(), physicsClientId=physics.client
            )

    def image(self) -> np.ndarray:
        """The view from the front right, ``(height, width, 3)`` uint8."""
        angle = self._heading - 1.0
        eye = self._target + np.array([2.6 * math.cos(angle), 2.6 * math.sin(angle), 0.55])
        return take_picture(self._physics.client, eye, self._target, angle=45.0, reach=30.0)

    def close(self) -> None:
        """Close the world or the window."""
        self._physics.close()


class RideScene(BicycleScene):
    """The rider on the bicycle.

    Args:
        posture: the person on the bicycle.
        ground: what they ride on.
        gui: open a window.
    """

    def __init__(self, posture: Posture, ground: Ground, *, gui: bool = False) -> None:
        tree = bicycle_tree(posture.bicycle)
        add_full_rider(tree, posture, slides=True)
        super().__init__(tree, ground, gui=gui)
        links = self._physics.links(self._bicycle)
        joints = [*SLIDES, *SEAT_JOINTS, *TRUNK_JOINTS, *(name for limb in LIMBS for name in limb_joints(limb))]
        self._joints = [links[name] for name in ("front_assembly", "crank", "rear_wheel", "front_wheel", *joints)]
        self._wheels = posture.bicycle.rear_wheel.radius / posture.bicycle.front_wheel.radius

    def draw(self, pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], estimate: np.ndarray) -> None:
        """Put rider, bicycle and ground in place; the estimate is not shown."""
        wheel = float(truth["wheel/angle"][0])
        angles = [float(pose["bicycle/steer"][0]), float(pose["bicycle/crank"][0]), wheel, wheel * self._wheels]
        rider = np.concatenate([truth[name] for name in ("pelvis/angles", "pelvis/height", "joints/angles")])
        rider = np.concatenate([truth.get("pelvis/shift", np.zeros(len(SLIDES))), rider])
        for link, angle in zip(self._joints, [*angles, *rider.tolist()], strict=True):
            pybullet.resetJointState(self._bicycle, link, angle, 0.0, physicsClientId=self._physics.client)
        super().draw(pose, truth, estimate)


class FixtureScene(BicycleScene):
    """A bicycle without a rider and the tilted disk above it.

    Args:
        bicycle: the bicycle.
        disk: point of the bicycle frame that carries the disk's centre, m.
        gui: open a window.
    """

    def __init__(self, bicycle: BicycleParameters, disk: Sequence[float], *, gui: bool = False) -> None:
        super().__init__(bicycle_tree(bicycle), FlatGround(), gui=gui)
        flat, axle = (0.0, 0.0, 0.006), (0.0, 0.0, 0.012)
        marked = [rod_shape((0.0, 0.0, -0.006), flat, DISK_RADIUS, DISK_COLOUR)]
        # markers of three colours make the disk's rotation visible
        for angle, colour in zip(np.radians([90.0, 210.0, 330.0]), AXIS_COLOURS, strict=True):
            place = 0.15 * np.array([math.cos(angle), math.sin(angle), 0.0])
            marked.append(rod_shape(place + flat, place + axle, 0.035, colour))
        tree = Tree("disk")
        tree.link("disk", 1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), marked)
        self._disk = self._physics.load_urdf(tree.text())
        post = Tree("post")
        post.link("post", 1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), [rod_shape(bicycle.saddle, disk, 0.02, POST_COLOUR)])
        self._post = self._physics.load_urdf(post.text())

    def draw(self, pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], estimate: np.ndarray) -> None:
        """Put bicycle, disk and ground in place; the estimate is not shown."""
        zero = np.zeros(3)
        for body, name, position in (
            (self._disk, "disk", truth["disk/position"]),
            (self._post, "bicycle", truth["bicycle/position"]),
        ):
            orientation = np.asarray(pose[f"{name}/orientation"])
            self._physics.set_state(body, BodyState(0.0, np.asarray(position), orientation, zero, zero))
        super().draw(pose, truth, estimate)
