"""The true pose of rider and bicycle in one canonical set of quantities, and everything else that is known.

Orientations are body to world. Every body frame has x forward, y to the left and z up along the body (towards the
proximal joint of a limb). Joint angles follow the ISB axes (x forward, y up, z to the right): flexion, abduction and
axial rotation as Z-X-Y angles of trunk and hip, and Y-X-Y angles of the shoulder.
"""

from __future__ import annotations

import numpy as np

from ....filters.core import rotation
from ....filters.core.quantity import Quantity
from ...sensors.ideal import BodyState
from ..rider.posture import LIMBS, SIDES, segments_of
from .log import RideLog, limb_root

ISB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Our axes (forward, left, up) to those of the ISB (forward, up, right)."""
BODIES = (
    "bicycle",
    "trunk",
    "head",
    *(f"{part}_{side}" for part in ("upper_arm", "forearm", "thigh", "shank") for side in SIDES),
)
"""Bodies with an orientation."""
ANGLES = ("roll", "pitch", "yaw", "steer", "crank")
FULL_JOINTS = (
    "trunk_y",
    "trunk_x",
    "trunk_z",
    *(f"{limb}_{axis}" for limb in LIMBS for axis in ("y", "x", "z", "hinge")),
)
"""Order of ``joints/angles`` and ``joints/torques`` (of a lumped rider only the first three have torques)."""

QUANTITIES = {
    quantity.name: quantity
    for quantity in (
        *(Quantity(f"{body}/orientation", "rotation", 4, "1") for body in BODIES),
        *(Quantity(f"bicycle/{name}", "angle", 1, "rad") for name in ANGLES),
        Quantity("bicycle/speed", "vector", 1, "m/s"),
        Quantity("trunk/angles", "angle", 3, "rad"),
        *(Quantity(f"shoulder_{side}/angles", "angle", 3, "rad") for side in SIDES),
        *(Quantity(f"hip_{side}/angles", "angle", 3, "rad") for side in SIDES),
        *(Quantity(f"{joint}_{side}/flexion", "angle", 1, "rad") for joint in ("elbow", "knee") for side in SIDES),
    )
}
"""All quantities of ``info["pose"]`` by name."""

Quaternions = dict[str, np.ndarray]
"""Orientation → quaternion ``(4,)`` of one sample."""


def isb_matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix ``(..., 3, 3)`` in ISB axes."""
    return np.clip(ISB @ rotation.to_matrix(q) @ ISB.T, -1.0, 1.0)


def isb_zxy(q: np.ndarray) -> np.ndarray:
    """Flexion, bending (to the right positive) and axial rotation ``(..., 3)``: Z-X-Y angles in ISB axes.

    ``q`` ``(..., 4)`` turns the child into the parent, our axes.
    """
    return rotation.euler_zxy(isb_matrix(q))


def isb_yxy(q: np.ndarray) -> np.ndarray:
    """Plane of elevation, elevation (negative, in (−π, 0)) and axial rotation ``(..., 3)``: Y-X-Y angles in ISB axes.

    ``q`` ``(..., 4)`` turns the humerus into the trunk, our axes.
    """
    return rotation.euler_yxy(isb_matrix(q))


def segment_states(log: RideLog) -> dict[str, BodyState]:
    """Motion of every body in :data:`BODIES` but the head, which :class:`.HeadMotion` adds.

    A lumped rider's limbs have orientations only, no rates.
    """
    states = {"bicycle": log.frames["rear_frame"], "trunk": log.frames["trunk"]}
    for limb, held in log.limbs.items():
        for name, turn in zip(segments_of(limb), (held.upper, held.lower), strict=True):
            if name in log.frames:
                states[name] = log.frames[name]
            else:
                still = np.zeros((len(log.time), 3))
                orientation = rotation.multiply(limb_root(log.frames, limb), turn)
                states[name] = BodyState(log.time, still, orientation, still, still)
    return states


def _column(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, dtype=float)[:, None]


def true_pose(log: RideLog, states: dict[str, BodyState]) -> dict[str, np.ndarray]:
    """Quantity → ``(n, size)``."""
    pose = {f"{body}/orientation": states[body].orientation for body in BODIES}
    frame = states["bicycle"]
    yaw, pitch, roll = rotation.to_euler_zyx(frame.orientation)
    speed = frame.velocity[:, 0] * np.cos(yaw) + frame.velocity[:, 1] * np.sin(yaw)
    crank = rotation.wrap(log.crank)
    for name, values in zip(ANGLES, (roll, pitch, yaw, log.steer, crank), strict=True):
        pose[f"bicycle/{name}"] = _column(values)
    pose["bicycle/speed"] = _column(speed)
    trunk = rotation.multiply(rotation.conjugate(frame.orientation), states["trunk"].orientation)
    pose["trunk/angles"] = isb_zxy(trunk)
    for side in SIDES:
        arm, leg = log.limbs[f"arm_{side}"], log.limbs[f"leg_{side}"]
        pose[f"shoulder_{side}/angles"] = isb_yxy(arm.upper)
        pose[f"hip_{side}/angles"] = isb_zxy(leg.upper)
        pose[f"elbow_{side}/flexion"] = _column(-arm.angles[:, 3])
        pose[f"knee_{side}/flexion"] = _column(leg.angles[:, 3])
    return pose


def continuous_pose(pose: dict[str, np.ndarray], last: Quaternions) -> tuple[dict[str, np.ndarray], Quaternions]:
    """The same pose with quaternions that never change sign from one sample to the next.

    Args:
        pose: quantity → ``(n, size)``, n ≥ 1.
        last: quantity → quaternion ``(4,)`` of the sample before; empty at the first one, where w ≥ 0 is chosen.

    Returns:
        The pose, and its quaternions at the last sample.
    """
    found, now = dict(pose), {}
    for name, values in pose.items():
        if QUANTITIES[name].kind != "rotation":
            continue
        before = np.concatenate([last.get(name, np.eye(4)[0])[None], values[:-1]])
        signs = np.cumprod(np.where((before * values).sum(axis=1) < 0.0, -1.0, 1.0))
        found[name] = values * signs[:, None]
        now[name] = found[name][-1]
    return found, now


def other_truth(log: RideLog, head: BodyState) -> dict[str, np.ndarray]:
    """What is known besides the pose, name → ``(n, size)``; see the environment's table."""
    frame, contact = log.frames["rear_frame"], log.contact
    trunk = log.frames["trunk"]
    back = frame.orientation
    truth = {
        "bicycle/position": frame.position,
        "bicycle/velocity": frame.velocity,
        "bicycle/acceleration": frame.acceleration,
        "bicycle/angular_rate": rotation.rotate_back(back, frame.angular_velocity),
        "trunk/position": trunk.position,
        "trunk/acceleration": trunk.acceleration,
        "trunk/angular_rate": rotation.rotate_back(trunk.orientation, trunk.angular_velocity),
        "head/position": head.position,
        "head/angular_rate": rotation.rotate_back(head.orientation, head.angular_velocity),
        "pelvis/angles": log.pelvis[:, :2],
        "pelvis/height": log.pelvis[:, 2:3],
        "seat/force": rotation.rotate_back(back, contact.seat_force),
        "seat/moment": rotation.rotate_back(back, contact.seat_moment),
        "joints/angles": np.concatenate([log.trunk_joints, *(log.limbs[name].angles for name in LIMBS)], axis=1),
        "joints/torques": log.torques,
        "steer/rate": log.rates[:, :1],
        "crank/rate": log.rates[:, 1:2],
        "wheel/rate": log.rates[:, 2:],
        "wheel/angle": log.wheel[:, None],
    }
    if log.pelvis.shape[1] > 3:
        truth["pelvis/shift"] = log.pelvis[:, 3:]
    for name, forces in (("handlebar", contact.hands), ("pedal", contact.feet)):
        for index, side in enumerate(SIDES):
            truth[f"{name}/force_{side}"] = rotation.rotate_back(back, forces[:, index])
    return {name: np.asarray(values, dtype=float) for name, values in truth.items()}
