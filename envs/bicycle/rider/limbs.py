"""Limbs of two segments with a hinge between: posture from end points, and torques that make a force at the tip.

A limb hangs along −z in its zero posture: three joints at its root turn about y, then the new x, then the new z, and
the hinge (elbow or knee) about y. The tip lies anywhere in the x-z plane of the lower segment. Angles are ordered
(y, x, z, hinge).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from ....filters.core import rotation


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


@jit
def tip_torques(limb, angles, force, lift):  # type: ignore[no-untyped-def]
    """Torques of the four joints (N·m) that let the tip push on what it holds, and that lift the hinge: virtual work.

    Args:
        limb: length of the upper segment, x and z of the tip in axes of the lower one, m.
        angles: of the joints y, x, z and hinge, rad.
        force: of the tip, N, root axes.
        lift: force on the hinge, N, root axes.
    """
    (cy, cx, cz, ch), (sy, sx, sz, sh) = _cosines(angles), _sines(angles)
    # columns of the matrix after y, x and z; the third is that of the upper segment too
    first, second, third = (cy, 0.0, -sy), (sy * sx, cx, cy * sx), (sy * cx, -sx, cy * cx)
    ahead = _sum(cz, first, sz, second)
    across = _sum(-sz, first, cz, second)
    hinge = (-limb[0] * third[0], -limb[0] * third[1], -limb[0] * third[2])
    lower = _sum(ch * limb[1] + sh * limb[2], ahead, ch * limb[2] - sh * limb[1], third)
    # a joint's torque is its axis times the moment of the forces about it
    tip = (hinge[0] + lower[0], hinge[1] + lower[1], hinge[2] + lower[2])
    root = _sum(1.0, _cross(tip, force), 1.0, _cross(hinge, lift))
    return root[1], _dot(first, root), _dot(third, root), _dot(across, _cross(lower, force))


@jit
def _cosines(angles):  # type: ignore[no-untyped-def]
    return math.cos(angles[0]), math.cos(angles[1]), math.cos(angles[2]), math.cos(angles[3])


@jit
def _sines(angles):  # type: ignore[no-untyped-def]
    return math.sin(angles[0]), math.sin(angles[1]), math.sin(angles[2]), math.sin(angles[3])


@jit
def _sum(a, u, b, v):  # type: ignore[no-untyped-def]
    return a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2]


@jit
def _dot(u, v):  # type: ignore[no-untyped-def]
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@jit
def _cross(u, v):  # type: ignore[no-untyped-def]
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@jit
def into_pelvis(angles, force):  # type: ignore[no-untyped-def]
    """Force in bicycle axes to pelvis axes, or in pelvis axes to axes after two joints; angles about y, x (rad)."""
    cy, sy, cx, sx = math.cos(angles[0]), math.sin(angles[0]), math.cos(angles[1]), math.sin(angles[1])
    x, z = cy * force[0] - sy * force[2], sy * force[0] + cy * force[2]
    return x, cx * force[1] + sx * z, cx * z - sx * force[1]


@jit
def into_trunk(angles, force):  # type: ignore[no-untyped-def]
    """Force in pelvis axes to trunk axes; angles about y, x, z (rad)."""
    x, y, z = into_pelvis((angles[0], angles[1]), force)
    c, s = math.cos(angles[2]), math.sin(angles[2])
    return c * x + s * y, c * y - s * x, z
