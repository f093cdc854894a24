"""Points of rider and bicycle in space from the angles of the whole-body paper, for figure 7."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.linkage import SIDES, RiderLinkage
from ....filters.core import rotation

HEAD = 0.28
"""m: centre of the head above the middle of the shoulders, about a seventh of a rider's height"""
RIM = np.linspace(0.0, 2.0 * np.pi, 33)
"""rad: angles of the points of a wheel"""


def skeleton(
    geometry: RiderGeometry, pose: Mapping[str, np.ndarray], steer: np.ndarray, crank: np.ndarray
) -> dict[str, np.ndarray]:
    """Lines of rider and bicycle in the frame R of the paper, which turns with the bicycle but does not roll.

    Args:
        geometry: lengths and places of the rider and the bicycle.
        pose: the paper's angles of one moment, each ``(size,)``.
        steer: ``(1,)`` steering angle, rad.
        crank: ``(1,)`` crank angle, rad.

    Returns:
        Name → ``(n, 3)`` points of a line, m: x forward, y left, z up.
    """
    link = RiderLinkage.for_rider(geometry)
    nothing = np.zeros(1)
    R_BT = rotation.euler_matrix("zxy", pose["trunk/angles"])
    pivot = link.point(link.trunk_pivot, "left", nothing)
    lines: dict[str, np.ndarray] = {}
    shoulders = {side: pivot + R_BT @ link.point(link.shoulder, side, nothing) for side in SIDES}
    neck = 0.5 * (shoulders["right"] + shoulders["left"])
    saddle = link.point(link.saddle, "left", nothing)
    lines["trunk"] = np.stack([saddle, pivot, neck, neck + HEAD * R_BT[:, 1]])
    lines["shoulders"] = np.stack([shoulders["right"], shoulders["left"]])
    for side in SIDES:
        R_BH = R_BT @ rotation.euler_matrix("yxy", pose[f"shoulder_{side}/angles"])
        elbow = shoulders[side] - link.upper_arm * R_BH[:, 1]
        lines[f"arm {side}"] = np.stack([shoulders[side], elbow, link.hand(side, steer)])
        R_BD = rotation.euler_matrix("zxy", pose[f"hip_{side}/angles"])
        hip = link.point(link.hip, side, nothing)
        lines[f"leg {side}"] = np.stack([hip, hip - link.thigh * R_BD[:, 1], link.pedal(side, crank)])
    lines |= bicycle(geometry, link, steer)
    roll = rotation.elementary_matrix(0, pose["bicycle/roll"][0])
    # from the paper's axes (forward, up, right) to ours (forward, left, up), rolled about the contact line
    return {name: _ours(points @ roll.T) for name, points in lines.items()}


def bicycle(geometry: RiderGeometry, link: RiderLinkage, steer: np.ndarray) -> dict[str, np.ndarray]:
    """Frame and wheels, paper's axes of the bicycle."""
    radius, origin = geometry.wheel_radius, np.zeros(1)
    rear, front = np.array([0.0, radius, 0.0]), np.array([geometry.wheelbase, radius, 0.0])
    saddle, axle, head = (
        link.point(place, "left", origin) for place in (geometry.saddle, geometry.crank_axle, geometry.steer_origin)
    )
    wheel = radius * np.stack([np.cos(RIM), np.sin(RIM), 0.0 * RIM], axis=-1)
    hands = [link.hand(side, steer) for side in SIDES]
    stem = 0.5 * (hands[0] + hands[1])
    return {
        "rear wheel": rear + wheel,
        "front wheel": front + wheel @ rotation.elementary_matrix(1, steer[0]).T,
        "frame": np.stack([rear, saddle, axle, rear, axle, head, saddle]),
        "fork": np.stack([front, head, stem]),
        "handlebar": np.stack(hands),
    }


def _ours(points: np.ndarray) -> np.ndarray:
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=-1)
