"""Limbs of two segments with a hinge between: posture from end points, and torques that make a force at the tip.

A limb hangs along −z in its zero posture: three joints at its root turn about y, then the new x, then the new z, and
the hinge (elbow or knee) about y. The tip lies anywhere in the x-z plane of the lower segment. Angles are ordered
(y, x, z, hinge).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ...physics.straight_line import straight_line


class Limb(NamedTuple):
    """Shape of a limb."""

    upper: float
    """m: length of the upper segment"""
    tip: tuple[float, float]
    """m: x and z of the tip, from the hinge, in axes of the lower segment"""
    bend: float
    """+1 if the hinge turns positively when it bends (knee), −1 (elbow)"""

    @property
    def reach(self) -> float:
        """Length of the straight limb, m."""
        return self.upper + float(np.hypot(*self.tip))


def half_turns(angle: np.ndarray, axis: int) -> np.ndarray:
    """Quaternion ``(..., 4)`` of a turn about coordinate axis 0, 1 or 2."""
    result = np.zeros((*np.shape(angle), 4))
    result[..., 0] = np.cos(0.5 * np.asarray(angle))
    result[..., 1 + axis] = np.sin(0.5 * np.asarray(angle))
    return result


def three_turns(y: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Quaternion ``(..., 4)`` of turns about y, then the new x, then the new z."""
    first = rotation.multiply(half_turns(y, 1), half_turns(x, 0))
    return rotation.multiply(first, half_turns(z, 2))


def three_angles(q: np.ndarray) -> np.ndarray:
    """Angles ``(..., 3)`` about y, x and z of a rotation, undoing :func:`three_turns`."""
    R = rotation.to_matrix(q)
    return np.stack(
        [
            np.arctan2(R[..., 0, 2], R[..., 2, 2]),
            np.arcsin(np.clip(-R[..., 1, 2], -1.0, 1.0)),
            np.arctan2(R[..., 1, 0], R[..., 1, 1]),
        ],
        axis=-1,
    )


class LimbPosture(NamedTuple):
    """Where the segments of a limb are, in the frame of its root."""

    upper: np.ndarray
    """(..., 4) orientation of the upper segment"""
    lower: np.ndarray
    """(..., 4) orientation of the lower segment"""
    angles: np.ndarray
    """(..., 4) joint angles y, x, z, hinge, rad"""
    hinge: np.ndarray
    """(..., 3) position of the elbow or knee, from the root, m"""


def reach_to(limb: Limb, target: np.ndarray, outward: np.ndarray, swivel: np.ndarray | float = 0.0) -> LimbPosture:
    """Posture of a limb whose tip is at ``target``.

    Args:
        limb: its shape.
        target: ``(..., 3)`` from the root, m.
        outward: ``(3,)`` or ``(..., 3)`` direction in which the elbow or knee stands out from the line root to tip.
        swivel: rad by which it is turned about that line, from the root's view clockwise.

    Raises:
        ValueError: a target out of reach.
    """
    target, outward = np.asarray(target, dtype=float), np.asarray(outward, dtype=float)
    a, b = limb.upper, float(np.hypot(*limb.tip))
    distance = rotation.norm(target)
    if not (np.all(distance < a + b) and np.all(distance > abs(a - b))):
        raise ValueError(
            f"a limb of {a:.3f} + {b:.3f} m cannot reach points {distance.min():.3f}…{distance.max():.3f} m away"
        )
    # axes of the line to the target; law of cosines for the angle at the root
    line = target / distance
    out = rotation.normalize(outward - line * np.sum(line * outward, axis=-1, keepdims=True))
    side = rotation.cross(line, out)
    swivel = np.asarray(swivel, dtype=float)[..., None]
    cosine = (a * a + distance**2 - b * b) / (2.0 * a * distance)
    sine = np.sqrt(1.0 - cosine**2)
    hinge = a * (cosine * line + sine * (np.cos(swivel) * out + np.sin(swivel) * side))
    # upper segment: z from the hinge to the root, y along the hinge's axis; then the hinge's angle
    z = -hinge / a
    y = limb.bend * rotation.normalize(rotation.cross(hinge, target - hinge))
    x = rotation.cross(y, z)
    upper = rotation.from_matrix(np.stack([x, y, z], axis=-1))
    reach = rotation.rotate_back(upper, target - hinge)
    angle = rotation.wrap(np.arctan2(reach[..., 0], reach[..., 2]) - np.arctan2(*limb.tip))
    angles = np.concatenate([three_angles(upper), angle[..., None]], axis=-1)
    return LimbPosture(upper, rotation.multiply(upper, half_turns(angle, 1)), angles, hinge)


def forward(limb: Limb, angles: np.ndarray) -> tuple[LimbPosture, np.ndarray]:
    """Posture and position of the tip ``(..., 3)`` in the frame of the root, from joint angles ``(..., 4)``."""
    upper = three_turns(angles[..., 0], angles[..., 1], angles[..., 2])
    lower = rotation.multiply(upper, half_turns(angles[..., 3], 1))
    hinge = rotation.rotate(upper, np.array([0.0, 0.0, -limb.upper]))
    tip = hinge + rotation.rotate(lower, np.array([limb.tip[0], 0.0, limb.tip[1]]))
    return LimbPosture(upper, lower, angles, hinge), tip


@lru_cache(maxsize=64)
def tip_torques(limb: Limb) -> Callable[..., list[list[float]]]:
    """Function of joint angles and two forces: lists ``(4,)``, ``(3,)``, ``(3,)`` (root axes) → ``[torques (4,)]``.

    The joint torques let the tip push with the first force on what it holds, and lift the hinge with the second, N·m
    (virtual work).
    """

    def compute(angles, force, lift):  # type: ignore[no-untyped-def]
        xp = rotation.namespace(angles)
        half = 0.5 * angles
        c, s, zero = xp.cos(half), xp.sin(half), 0.0 * half[..., 0]
        turn_y = xp.stack([c[..., 0], zero, s[..., 0], zero], axis=-1)
        turn_x = xp.stack([c[..., 1], s[..., 1], zero, zero], axis=-1)
        turn_z = xp.stack([c[..., 2], zero, zero, s[..., 2]], axis=-1)
        bend = xp.stack([c[..., 3], zero, s[..., 3], zero], axis=-1)
        # attitudes after each joint; hinge and tip in root axes
        second = rotation.multiply(turn_y, turn_x)
        upper = rotation.multiply(second, turn_z)
        hinge = rotation.rotate(upper, np.array([0.0, 0.0, -limb.upper]))
        lower = rotation.rotate(rotation.multiply(upper, bend), np.array([limb.tip[0], 0.0, limb.tip[1]]))
        # virtual work: a joint's torque is its axis times the moment of the forces about it
        root = rotation.cross(hinge + lower, force) + rotation.cross(hinge, lift)
        axis_x = rotation.rotate(turn_y, np.array([1.0, 0.0, 0.0]))
        axis_z = rotation.rotate(second, np.array([0.0, 0.0, 1.0]))
        axis_hinge = rotation.rotate(upper, np.array([0.0, 1.0, 0.0]))
        along_x = xp.sum(axis_x * root, axis=-1)
        along_z = xp.sum(axis_z * root, axis=-1)
        along_hinge = xp.sum(axis_hinge * rotation.cross(lower, force), axis=-1)
        return (xp.stack([root[..., 1], along_x, along_z, along_hinge], axis=-1),)

    return straight_line(compute, angles=4, force=3, lift=3)
