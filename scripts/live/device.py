"""A hand-held device as meshes, its orientation by any estimate, and the virtual controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...envs.drawn import AXIS_COLOURS, DEVICE_SIZE, device_boxes
from ...filters.arrays.spatial.orientation import ArrayOrientation
from ...filters.arrays.spatial.virtual_controller import VIRTUAL_POSITION, advance
from ...filters.core import rotation
from .meshes import Mesh, box, rod

Values = Mapping[str, np.ndarray]


def device_meshes(size: Sequence[float] = DEVICE_SIZE) -> list[Mesh]:
    """The device of the rendered environments, of some size along the body axes (m), and its axes."""
    boxes = [box(centre, 2.0 * np.array(half), (r, g, b)) for half, centre, (r, g, b, *_) in device_boxes(size)]
    ends = 1.1 * size[0] * np.eye(3)
    return [*boxes, *(rod((0.0, 0.0, 0.0), end, 0.003, colour) for end, colour in zip(ends, AXIS_COLOURS, strict=True))]


@dataclass
class DeviceAttitude:
    """The orientation that an estimate means: one that leaves the heading open is drawn with that of the truth.

    A relative orientation has an unknown constant heading: it is set to that of the truth once, at the first sample at
    which both are known, so that drift is visible. An inclination alone has the heading of the truth at every sample.
    """

    _heading: np.ndarray | None = field(default=None, init=False)

    def orientation(self, estimate: Values, truth: np.ndarray | None) -> np.ndarray | None:
        """Sensor to world ``(n, 4)``, NaN where there is no estimate; None if it has no attitude.

        ``estimate`` holds quantities ``(n, size)``, ``truth`` is the orientation ``(n, 4)``.
        """
        if "orientation" in estimate:
            return np.asarray(estimate["orientation"], float)
        if "relative_orientation" in estimate:
            return self._aligned(np.asarray(estimate["relative_orientation"], float), truth)
        if "planar/angle" in estimate:
            return planar_orientation(np.asarray(estimate["planar/angle"], float)[:, 0], truth)
        return inclined(np.asarray(estimate["up"], float), truth) if "up" in estimate else None

    def _aligned(self, relative: np.ndarray, truth: np.ndarray | None) -> np.ndarray:
        if truth is None:
            return relative
        if self._heading is None:
            known = np.isfinite(relative).all(axis=1) & np.isfinite(truth).all(axis=1)
            if not known.any():
                return relative
            first = int(np.argmax(known))
            r = rotation.multiply(truth[first], rotation.conjugate(relative[first]))
            self._heading = rotation.normalize(r * (1.0, 0.0, 0.0, 1.0))
        return rotation.multiply(self._heading, relative)


def inclined(up: np.ndarray, truth: np.ndarray | None) -> np.ndarray:
    """An orientation ``(n, 4)`` with the inclination vector ``up`` ``(n, 3)`` that is nearest to the truth's."""
    with np.errstate(invalid="ignore", divide="ignore"):
        up = rotation.normalize(up)
        if truth is None:
            return rotation.level(up)
        known = rotation.up_in_body(truth)
        axis = rotation.cross(up, known)
        sine = rotation.norm(axis)
        angle = np.arctan2(sine, np.sum(up * known, axis=-1, keepdims=True))
        turn = np.where(sine > 0.0, axis * angle / np.where(sine > 0.0, sine, 1.0), 0.0 * axis)
        return rotation.multiply(truth, rotation.exp(turn))


def planar_orientation(angle: np.ndarray, truth: np.ndarray | None) -> np.ndarray:
    """An orientation ``(n, 4)`` by the angle ``(n,)`` from east to up, beside that of the truth."""
    north = np.array([0.0, -1.0, 0.0])
    if truth is None:
        return rotation.exp(angle[:, None] * north)
    x = rotation.rotate(truth, np.array([1.0, 0.0, 0.0]))
    known = np.arctan2(x[:, 2], x[:, 0])
    return rotation.multiply(rotation.exp((angle - known)[:, None] * north), truth)


@dataclass
class VirtualController:
    """Position of the virtual controller, by the estimate itself or by leaky integration of its acceleration."""

    velocity_damping: float = ArrayOrientation.velocity_damping
    """K_v, 1/s"""
    position_damping: float = ArrayOrientation.position_damping
    """K_b, 1/s"""
    _state: np.ndarray = field(default_factory=lambda: np.zeros(6), init=False)

    def position(self, estimate: Values, orientation: np.ndarray | None, dt: float) -> np.ndarray | None:
        """Displayed position ``(n, 3)``, m; None where the estimate has neither position nor acceleration.

        ``orientation`` is that of the device ``(n, 4)``, ``dt`` the sampling interval in s.
        """
        if VIRTUAL_POSITION.name in estimate:
            return np.asarray(estimate[VIRTUAL_POSITION.name], float)
        if "external_acceleration" not in estimate or orientation is None:
            return None
        accelerations = rotation.rotate(orientation, np.asarray(estimate["external_acceleration"], float))
        found = np.empty((len(accelerations), 3))
        for row, acceleration in enumerate(np.nan_to_num(accelerations)):
            self._state = advance(
                self._state,
                acceleration,
                np.float64(dt),
                velocity_damping=np.float64(self.velocity_damping),
                position_damping=np.float64(self.position_damping),
            )
            found[row] = self._state[3:]
        return found
