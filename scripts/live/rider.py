"""A rider on a bicycle as bodies of meshes, and where the bodies are: in NumPy alone, from lengths and orientations.

The lengths are those with which filters are configured (:class:`.RiderGeometry`), so that any ride that has one can be
drawn, simulated or not. Positions of the bodies follow from their orientations along the linkage.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...envs.bicycle.frame.shapes import PAINT, RUBBER, Outline, bicycle_shapes
from ...filters.bicycle.force_inertial.kinematics import DOWN, UP_THE_TRUNK
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.bicycle.relative_sensor import relative_orientation
from ...filters.bicycle.whole_body.linkage import paper_axes
from ...filters.core import rotation
from .meshes import Colour, Mesh, ball, box, rod, tyre

SHIRT: Colour = (0.16, 0.40, 0.66)
TROUSERS: Colour = (0.21, 0.23, 0.29)
SKIN: Colour = (0.87, 0.68, 0.54)
SENSOR: Colour = (0.95, 0.55, 0.10)
DISK: Colour = (0.93, 0.86, 0.62)

SIGNS = {"left": 1.0, "right": -1.0}
ISB = paper_axes(np.eye(3)).T
"""Our axes (forward, left, up) to those of the ISB (forward, up, right)."""


class Placed(NamedTuple):
    """Where a body is over time.

    Attributes:
        position: ``(n, 3)`` m, world.
        orientation: ``(n, 4)`` body to world; NaN where it is unknown.
    """

    position: np.ndarray
    orientation: np.ndarray


Poses = dict[str, Placed]
"""Body → where it is."""
Values = Mapping[str, np.ndarray]
"""Quantity → ``(n, size)``."""


def rider_meshes(geometry: RiderGeometry) -> dict[str, list[Mesh]]:
    """Body → meshes in its frame; arms and legs hang along −z from their joints."""
    g = geometry
    meshes = _bicycle_meshes(g)
    shoulder, hip = np.array(g.shoulder), np.array(g.hip)
    neck = shoulder * (0.0, 0.0, 1.0)
    head = neck + np.array([0.03, 0.0, 0.23])
    meshes["pelvis"] = [
        rod(hip * (1.0, 0.75, 1.0), hip * (1.0, -0.75, 1.0), 0.085, TROUSERS),
        ball(np.array(g.trunk_pivot) - np.array([0.0, 0.0, 0.02]), 0.11, TROUSERS),
        *(ball(hip * (1.0, sign, 1.0), 0.085, TROUSERS) for sign in (1.0, -1.0)),
    ]
    meshes["trunk"] = [
        rod((0.0, 0.0, 0.0), 0.82 * neck, 0.105, SHIRT, 0.14),
        rod(shoulder * (1.0, 0.85, 1.0), shoulder * (1.0, -0.85, 1.0), 0.062, SHIRT),
        *(ball(shoulder * (1.0, sign, 1.0), 0.062, SHIRT) for sign in (1.0, -1.0)),
        rod(neck, head, 0.048, SKIN),
        ball(head, 0.10, SKIN, 11),
        box(g.trunk_imu, (0.02, 0.04, 0.06), SENSOR),
    ]
    ankle = np.array([0.0, 0.0, -g.shank])
    bend = math.pi - g.ankle_angle
    toe = ankle + g.ankle_to_pedal * np.array([math.sin(bend), 0.0, math.cos(bend)])
    for side in SIGNS:
        meshes[f"upper_arm_{side}"] = [
            rod((0.0, 0.0, 0.0), (0.0, 0.0, -g.upper_arm), 0.050, SHIRT, 0.038),
            ball((0.0, 0.0, -g.upper_arm), 0.038, SKIN),
        ]
        meshes[f"forearm_{side}"] = [
            rod((0.0, 0.0, 0.0), (0.0, 0.0, -g.forearm), 0.036, SKIN, 0.028),
            ball((0.0, 0.0, -g.forearm), 0.042, SKIN),
        ]
        meshes[f"thigh_{side}"] = [
            rod((0.0, 0.0, 0.0), (0.0, 0.0, -g.thigh), 0.080, TROUSERS, 0.055),
            ball((0.0, 0.0, -g.thigh), 0.057, TROUSERS),
        ]
        meshes[f"shank_{side}"] = [
            rod((0.0, 0.0, 0.0), ankle, 0.054, SKIN, 0.036),
            rod(ankle - 0.3 * (toe - ankle), ankle + 1.3 * (toe - ankle), 0.038, RUBBER, 0.030),
            ball(ankle, 0.042, RUBBER),
        ]
    return meshes


def _bicycle_meshes(g: RiderGeometry) -> dict[str, list[Mesh]]:
    """Frame, front assembly, wheels and crank, and the disk of the two-gyroscope paper's fixture."""
    places = (g.saddle, g.crank_axle, g.steer_axis, g.steer_origin, g.grip)
    seen = Outline(*places, g.wheelbase, (g.wheel_radius, g.wheel_radius), g.crank_length, g.pedal_offset)
    meshes = bicycle_shapes(seen, rod, box, tyre)
    frame, front = meshes.pop("rear_frame"), meshes.pop("front_assembly")
    frame.append(box(g.bicycle_imu, (0.05, 0.035, 0.03), SENSOR))
    flat = np.array([0.0, 0.0, 0.006])
    disk = [rod(-flat, flat, 0.2, DISK), rod((0.12, 0.0, 0.0), (0.12, 0.0, 0.014), 0.035, PAINT)]
    return {"bicycle": frame, "front": front, **meshes, "disk": disk}


def rider_poses(geometry: RiderGeometry, values: Values) -> Poses:
    """Where the bodies are whose orientation is known.

    The values hold ``bicycle/orientation`` ``(n, 4)``, and of what else is known ``<body>/orientation``,
    ``bicycle/position``, ``bicycle/steer``, ``bicycle/crank``, ``wheel/angle``, ``pelvis/height``, ``pelvis/shift``,
    ``disk/position``.
    """
    g, bicycle = geometry, np.asarray(values["bicycle/orientation"], float)
    n = len(bicycle)
    position = np.asarray(values.get("bicycle/position", np.zeros((n, 3))), float)
    poses: Poses = {"bicycle": Placed(position, bicycle)}

    def angle(name: str) -> np.ndarray:
        return np.asarray(values.get(name, np.zeros((n, 1))), float)

    def hang(body: str, parent: str, at: np.ndarray, turn: np.ndarray) -> None:
        place, how = poses[parent]
        poses[body] = Placed(place + rotation.rotate(how, at), turn)

    def turned(parent: str, axis: tuple[float, float, float], by: np.ndarray) -> np.ndarray:
        return rotation.multiply(poses[parent].orientation, rotation.exp(by * np.array(axis)))

    origin = np.array(g.steer_origin)
    hang("front", "bicycle", origin, turned("bicycle", g.steer_axis, angle("bicycle/steer")))
    wheel = angle("wheel/angle")
    hang("rear_wheel", "bicycle", np.array([0.0, 0.0, g.wheel_radius]), turned("bicycle", (0.0, 1.0, 0.0), wheel))
    ahead = np.array([g.wheelbase, 0.0, g.wheel_radius]) - origin
    hang("front_wheel", "front", ahead, turned("front", (0.0, 1.0, 0.0), wheel))
    hang("crank", "bicycle", np.array(g.crank_axle), turned("bicycle", (0.0, 1.0, 0.0), angle("bicycle/crank")))
    up = angle("pelvis/height") * np.array([0.0, 0.0, 1.0])
    if "pelvis/shift" in values:
        up = up + np.asarray(values["pelvis/shift"], float) @ np.eye(3)[:2]
    if "disk/orientation" in values:
        at = values.get("disk/position", position + rotation.rotate(bicycle, np.array(g.trunk_pivot)))
        poses["disk"] = Placed(np.asarray(at, float), np.asarray(values["disk/orientation"], float))
    if "trunk/orientation" in values:
        hang("pelvis", "bicycle", up, bicycle)
        hang("trunk", "bicycle", np.array(g.trunk_pivot) + up, np.asarray(values["trunk/orientation"], float))
    for side, sign in SIGNS.items():
        flip = np.array([1.0, sign, 1.0])
        limbs = (
            ("upper_arm", "forearm", "trunk", np.array(g.shoulder) * flip, g.upper_arm),
            ("thigh", "shank", "bicycle", np.array(g.hip) * flip + up, g.thigh),
        )
        for upper, lower, parent, root, length in limbs:
            upper, lower = f"{upper}_{side}", f"{lower}_{side}"
            if parent in poses and f"{upper}/orientation" in values:
                hang(upper, parent, root, np.asarray(values[f"{upper}/orientation"], float))
                if f"{lower}/orientation" in values:
                    below = np.array([0.0, 0.0, -length])
                    hang(lower, upper, below, np.asarray(values[f"{lower}/orientation"], float))
    return poses


def isb_orientation(sequence: str, angles: np.ndarray) -> np.ndarray:
    """Child to parent ``(n, 4)`` in our axes, of angles ``(n, 3)`` about ISB axes."""
    return rotation.from_matrix(ISB.T @ rotation.euler_matrix(sequence, angles) @ ISB)


def hinge(angle: np.ndarray) -> np.ndarray:
    """A turn ``(n, 4)`` about the child's y axis by ``(n, 1)`` rad."""
    return rotation.exp(angle * np.array([0.0, 1.0, 0.0]))


def estimated_values(estimate: Values, known: Values) -> dict[str, np.ndarray]:
    """Orientations that an estimate's angles mean, and what is needed besides from ``known``.

    The heading and, where it is not estimated, the pitch of the bicycle are those of ``known``: of the truth, or of
    measurements of steering and crank. A body that is not estimated is left out.
    """
    n = len(next(iter(estimate.values())))
    truth = known.get("bicycle/orientation", np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)))
    yaw, pitch, roll = rotation.to_euler_zyx(np.asarray(truth, float))
    pitch = estimate["bicycle/pitch"][:, 0] if "bicycle/pitch" in estimate else pitch
    roll = estimate["bicycle/roll"][:, 0] if "bicycle/roll" in estimate else roll
    bicycle = rotation.from_euler_zyx(yaw, pitch, roll)
    kept = (
        "bicycle/position",
        "bicycle/steer",
        "bicycle/crank",
        "wheel/angle",
        "pelvis/height",
        "pelvis/shift",
        "disk/position",
    )
    found = {name: np.asarray(known[name], float) for name in kept if name in known}
    found["bicycle/orientation"] = bicycle
    carried = "disk" if "disk/orientation" in known else "trunk"
    if "trunk/angles" in estimate:
        found["trunk/orientation"] = rotation.multiply(bicycle, isb_orientation("zxy", estimate["trunk/angles"]))
    elif "two-gyro/relative_angles" in estimate:
        relative = relative_orientation(estimate["two-gyro/relative_angles"])
        found[f"{carried}/orientation"] = rotation.multiply(bicycle, relative)
    elif "force-inertial/trunk_angles" in estimate:
        seen = DOWN.T @ rotation.euler_matrix("xyx", estimate["force-inertial/trunk_angles"]) @ UP_THE_TRUNK
        level = rotation.from_euler_zyx(yaw, 0.0 * yaw, 0.0 * yaw)
        found["trunk/orientation"] = rotation.multiply(level, rotation.from_matrix(seen))
    for side in SIGNS:
        for joint, bend, parent, upper, lower, sequence, sign in (
            ("shoulder", "elbow", "trunk", "upper_arm", "forearm", "yxy", -1.0),
            ("hip", "knee", "bicycle", "thigh", "shank", "zxy", 1.0),
        ):
            angles, flexion = f"{joint}_{side}/angles", f"{bend}_{side}/flexion"
            root = found.get(f"{parent}/orientation")
            if angles in estimate and root is not None:
                turn = rotation.multiply(root, isb_orientation(sequence, estimate[angles]))
                found[f"{upper}_{side}/orientation"] = turn
                if flexion in estimate:
                    found[f"{lower}_{side}/orientation"] = rotation.multiply(turn, hinge(sign * estimate[flexion]))
    return found


def forces_on(geometry: RiderGeometry, values: Values) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Force → points ``(n, 3)`` where it acts (world, m) and vectors ``(n, 3)`` (world, N): saddle, hands, feet."""
    if "bicycle/orientation" not in values:
        return {}
    poses = rider_poses(geometry, values)
    bicycle = poses["bicycle"].orientation
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def act(name: str, body: str, at: np.ndarray) -> None:
        if name in values:
            place, how = poses[body]
            found[name] = place + rotation.rotate(how, at), rotation.rotate(bicycle, np.asarray(values[name], float))

    act("seat/force", "bicycle", np.array(geometry.saddle))
    for side, sign in SIGNS.items():
        grip = np.array(geometry.grip) * (1.0, sign, 1.0) - np.array(geometry.steer_origin)
        act(f"handlebar/force_{side}", "front", grip)
        pedal = np.array([sign * geometry.crank_length, sign * geometry.pedal_offset, 0.0])
        act(f"pedal/force_{side}", "crank", pedal)
    return found
