"""How well hands stay on the handlebar and feet on the pedals, from the truth of a ride alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....filters.core import rotation
from .posture import LIMBS, Posture


def loop_gaps(truth: Mapping[str, np.ndarray], posture: Posture) -> np.ndarray:
    """Distance between each hand or foot and what it holds.

    The chain of the limb's orientations leads to the tip, steering and crank angle to the grip or the pedal.

    Args:
        truth: of a ride, quantity → ``(T, size)``.
        posture: the rider of that ride on that bicycle.

    Returns:
        ``(T, 4)`` m: left and right hand, left and right foot. A lumped rider has none (1e-15) unless an arm is too
        short for what the trunk does.
    """
    frame, trunk = truth["bicycle/orientation"], truth["trunk/orientation"]
    steer, crank = truth["bicycle/steer"][:, 0], truth["bicycle/crank"][:, 0]
    turn = rotation.multiply(rotation.conjugate(frame), trunk)
    # the pelvis with shoulders and hips bounces on the saddle
    bounce = rotation.rotate_back(frame, truth["trunk/position"] - truth["bicycle/position"]) - posture.lumbar
    gaps = []
    for name in LIMBS:
        kind, side = name.split("_")
        limb = posture.limb(name)
        if kind == "arm":
            root, parts = trunk, ("upper_arm", "forearm")
            target = posture.arm_target(side, steer, turn) - rotation.rotate_back(turn, bounce)
        else:
            root, parts, target = frame, ("thigh", "shank"), posture.leg_target(side, crank) - bounce
        upper, lower = (truth[f"{part}_{side}/orientation"] for part in parts)
        reached = rotation.rotate(upper, np.array([0.0, 0.0, -limb.upper]))
        reached = reached + rotation.rotate(lower, np.array([limb.tip[0], 0.0, limb.tip[1]]))
        gaps.append(np.linalg.norm(rotation.rotate_back(root, reached) - target, axis=1))
    return np.stack(gaps, axis=1)
