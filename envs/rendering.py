"""Pictures of a device and of the estimate of its attitude, drawn by PyBullet in a world of their own.

The world of the pictures is not the world of the physics: drawing cannot change an episode, and kinematic or recorded
motion is drawn like any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..filters.core import rotation
from ..filters.support.optional import extra
from .drawn import AXIS_COLOURS, DEVICE_SIZE, Box, device_boxes
from .physics.world import Physics
from .sensors.ideal import BodyState

with extra("sim"):
    import pybullet

IMAGE_SIZE = (480, 360)
"""Width and height of an image, pixels."""
TILE_COLOURS = ((0.80, 0.82, 0.84, 1.0), (0.62, 0.66, 0.70, 1.0))


def axes_boxes(length: float, thickness: float, pale: float = 0.0) -> list[Box]:
    """Three bars along the axes of a frame; ``pale`` mixes white into their colours."""
    boxes: list[Box] = []
    for axis, colour in enumerate(AXIS_COLOURS):
        half, centre = [thickness] * 3, [0.0] * 3
        half[axis], centre[axis] = 0.5 * length, 0.5 * length
        boxes.append((half, centre, tuple(c + pale * (1.0 - c) for c in colour)))
    return boxes


class DeviceScene:
    """A controller over a tiled ground with its axes, and pale thin axes for the estimate.

    Args:
        size: ``(3,)`` extent of the device, m.
        gui: open a window.
    """

    def __init__(self, size: Sequence[float] = DEVICE_SIZE, *, gui: bool = False) -> None:
        self._physics = Physics(gui=gui)
        if gui:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=self._physics.client)
        x = 0.5 * size[0]
        self._draw_ground()
        self._device = self._body([*device_boxes(size), *axes_boxes(2.2 * x, 0.004)])
        self._ghost = self._body(axes_boxes(2.8 * x, 0.0025, pale=0.55))
        self._target = np.zeros(3)

    def _body(self, boxes: Sequence[Box]) -> int:
        half, centres, colours = zip(*boxes, strict=True)
        visual = pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_BOX] * len(boxes),
            halfExtents=[list(extent) for extent in half],
            visualFramePositions=[list(centre) for centre in centres],
            rgbaColors=[[*colour[:3], 1.0] for colour in colours],
            physicsClientId=self._physics.client,
        )
        return self._physics.create_body(0.0, (0.0, 0.0, 0.0), visual=visual)

    def _draw_ground(self) -> None:
        places = [(i, j) for i in range(-3, 3) for j in range(-3, 3)]
        for parity, colour in enumerate(TILE_COLOURS):
            chosen = [place for place in places if sum(place) % 2 == parity]
            for begin in range(0, len(chosen), 16):
                # PyBullet takes at most 16 shapes a body
                self._body(
                    [
                        ((0.25, 0.25, 0.005), ((i + 0.5) * 0.5, (j + 0.5) * 0.5, -0.005), colour)
                        for i, j in chosen[begin : begin + 16]
                    ]
                )

    def draw(self, pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], estimate: np.ndarray) -> None:
        """Put the device and the estimate in place.

        Args:
            pose: ``orientation`` ``(4,)``, or ``up`` ``(3,)``, or the first orientation of a body.
            truth: ``position`` ``(3,)`` where known, m.
            estimate: ``(4,)`` orientation or ``(3,)`` inclination vector in sensor axes, of any length.
        """
        position = np.asarray(truth.get("position", np.full(3, np.nan)))
        self._target = position if np.isfinite(position).all() else np.array([0.0, 0.0, 0.5])
        names = ("orientation", "up", *(name for name in pose if name.endswith("/orientation")))
        # where no attitude is known, the device is drawn level
        known = next((pose[name] for name in names if name in pose), np.array([1.0, 0.0, 0.0, 0.0]))
        if len(known) == 4 and len(estimate) == 3 and np.any(estimate) and np.isfinite(estimate).all():
            # an inclination leaves the heading open: it is drawn with that of the device
            up, estimated = rotation.up_in_body(known), rotation.normalize(estimate)
            axis = rotation.cross(estimated, up)
            angle = np.arctan2(np.linalg.norm(axis), estimated @ up)
            estimate = rotation.multiply(known, rotation.exp(rotation.normalize(axis) * angle if axis.any() else axis))
        for body, shown in ((self._device, known), (self._ghost, estimate)):
            if np.isfinite(shown).all() and np.any(shown):
                self._place(body, rotation.normalize(shown) if len(shown) == 4 else rotation.level(shown))

    def _place(self, body: int, orientation: np.ndarray) -> None:
        zero = np.zeros(3)
        self._physics.set_state(body, BodyState(0.0, self._target, orientation, zero, zero))

    def image(self) -> np.ndarray:
        """The view of a camera beside and above the device, ``(height, width, 3)`` uint8."""
        eye = self._target + np.array([0.25, -0.5, 0.25])
        return take_picture(self._physics.client, eye, self._target, angle=50.0, reach=10.0)

    def close(self) -> None:
        """Close the world or the window."""
        self._physics.close()


def take_picture(client: int, eye: np.ndarray, target: np.ndarray, *, angle: float, reach: float) -> np.ndarray:
    """What a camera sees of a world, ``(height, width, 3)`` uint8, drawn without a screen.

    Args:
        client: number of the PyBullet world.
        eye: ``(3,)`` m, where the camera is.
        target: ``(3,)`` m, what it looks at.
        angle: vertical field of view, deg.
        reach: m, nothing beyond is drawn.
    """
    width, height = IMAGE_SIZE
    view = pybullet.computeViewMatrix(eye.tolist(), target.tolist(), [0.0, 0.0, 1.0], physicsClientId=client)
    lens = pybullet.computeProjectionMatrixFOV(angle, width / height, 0.05, reach, physicsClientId=client)
    pixels = pybullet.getCameraImage(
        width,
        height,
        view,
        lens,
        lightDirection=[1.0, -1.5, 3.0],
        shadow=1,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )[2]
    return np.reshape(np.asarray(pixels, dtype=np.uint8), (height, width, 4))[..., :3].copy()
