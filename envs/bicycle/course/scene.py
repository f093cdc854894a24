"""Pictures of rider and bicycle: the same shapes as in the physics, in a world of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ....filters.support.optional import extra
from ...physics.world import Physics
from ...rendering import TILE_COLOURS, take_picture
from ...sensors.ideal import BodyState
from ..frame.bicycle import bicycle_tree
from ..rider.links import TRUNK_JOINTS, add_full_rider, limb_joints
from ..rider.posture import LIMBS, Posture
from .terrain import Ground

with extra("sim"):
    import pybullet

TILE, TILES = 1.0, 8
"""m, and tiles on each side of the bicycle"""


class RideScene:
    """The rider on the bicycle over a ground of tiles that follows them.

    Args:
        posture: the person on the bicycle.
        ground: what they ride on.
        gui: open a window.
    """

    def __init__(self, posture: Posture, ground: Ground, *, gui: bool = False) -> None:
        self._physics, self._ground = Physics(gui=gui), ground
        client = self._physics.client
        if gui:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=client)
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 0, physicsClientId=client)
        self._gui = gui
        tree = bicycle_tree(posture.bicycle)
        add_full_rider(tree, posture)
        self._rider = self._physics.load_urdf(tree.text())
        links = self._physics.links(self._rider)
        self._riding = [links["front_assembly"], links["crank"], links["rear_wheel"], links["front_wheel"]]
        joints = [*TRUNK_JOINTS, *(name for limb in LIMBS for name in limb_joints(limb))]
        self._joints = [links[name] for name in joints]
        self._tiles = [self._tile(i, j) for i in range(-TILES, TILES) for j in range(-TILES, TILES)]
        self._wheels = posture.bicycle.rear_wheel.radius / posture.bicycle.front_wheel.radius
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
        """Put rider, bicycle and ground in place; the estimate is not shown."""
        zero, physics = np.zeros(3), self._physics
        position = np.asarray(truth["bicycle/position"])
        physics.set_state(self._rider, BodyState(0.0, position, np.asarray(pose["bicycle/orientation"]), zero, zero))
        wheel = float(truth["wheel/angle"][0])
        angles = [float(pose["bicycle/steer"][0]), float(pose["bicycle/crank"][0]), wheel, wheel * self._wheels]
        for link, angle in zip(
            [*self._riding, *self._joints], [*angles, *truth["joints/angles"].tolist()], strict=True
        ):
            pybullet.resetJointState(self._rider, link, angle, 0.0, physicsClientId=physics.client)
        self._heading = float(pose["bicycle/yaw"][0])
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
