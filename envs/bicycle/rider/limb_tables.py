"""Lookup tables of the rider control model: elbows and knees over steer and crank, weight of the legs on the pedals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ....filters.compile.cache import jit
from ....filters.core import rotation
from .leg_loads import leg_swing, weight_on_pedal
from .limbs import reach_to, three_turns
from .posture import CRANKS, KNEE_OUT, LIMBS, POINTS, Posture

WIDEST = 0.6
STEERS = np.linspace(-WIDEST, WIDEST, POINTS)
"""rad at which the arms' posture is tabulated; that of the legs is at :data:`.CRANKS`"""
SHOULDERS_FOLLOW = 0.45
"""part of the steering angle by which the trunk twists, so that the outer hand stays within reach"""
STRAIGHTEST = 0.985
"""largest extension of an arm, as a share of its straight length"""
BIT = 0.01
"""rad for slopes"""
Vector = tuple[float, float, float]


class LimbTables:
    """Abduction of each limb over steer (arms) or crank (legs), and the legs' weight on the pedals.

    Args:
        posture: the person on the bicycle.
        trunk: angles about y, x, z of the trunk around which the tables are linear, rad.
        swivel: ``(4,)`` of left arm, right arm, left leg, right leg, likewise.
        gravity: m/s².
    """

    def __init__(self, posture: Posture, trunk: Sequence[float], swivel: np.ndarray, gravity: float) -> None:
        self.posture, self.trunk, self.swivel = posture, tuple(trunk), swivel
        self.middle = np.array([*trunk, *swivel.tolist()])
        now = self.angles(CRANKS, STEERS)
        changed = [self.angles(CRANKS, STEERS, **{what: BIT}) for what in ("extra", "lean", "twist")]
        rows = []
        for limb in range(len(LIMBS)):
            slopes = [(there[limb][:, 1] - now[limb][:, 1]) / BIT for there in changed]
            rows.append(np.stack([now[limb][:, 1], *slopes], axis=1))
        # (point, limb, value and slopes)
        self.table = np.stack(rows, axis=1)
        # (point, weight on the pedal, what a swing without muscles does to the body, and the pedal's force in it)
        self.legs = np.column_stack([weight_on_pedal(posture, gravity), leg_swing(posture)])

    def angles(
        self,
        crank: float | np.ndarray,
        steer: float | np.ndarray = 0.0,
        extra: float = 0.0,
        lean: float = 0.0,
        twist: float = 0.0,
    ) -> list[np.ndarray]:
        """Joint angles ``(..., 4)`` of each limb by inverse kinematics.

        Args:
            crank: rad.
            steer: rad, left positive.
            extra: rad of swivel besides the middle one.
            lean: rad of the trunk, likewise.
            twist: rad of the trunk, likewise.
        """
        posture, (flexion, first_lean, first_twist) = self.posture, self.trunk
        turn = first_twist + twist + SHOULDERS_FOLLOW * np.asarray(steer, dtype=float)
        trunk = three_turns(np.full_like(turn, flexion), np.full_like(turn, first_lean + lean), turn)
        angles = []
        for name, turn in zip(LIMBS, (self.swivel + extra).tolist(), strict=True):
            side = name.split("_")[1]
            if name.startswith("arm"):
                target, out = posture.arm_target(side, steer, trunk), posture.elbow_out(side, trunk)
                # the outer arm is nearly straight in a tight turn
                target = target * np.minimum(1.0, STRAIGHTEST * posture.arm.reach / rotation.norm(target))
            else:
                target, out = posture.leg_target(side, crank), KNEE_OUT
            angles.append(reach_to(posture.limb(name), target, out, turn).angles)
        return angles


@jit
def abductions(table, middle, steer, crank, trunk, swivel, found):  # type: ignore[no-untyped-def]
    """Abduction of each limb for given positions of elbows and knees, rad.

    Args:
        table: :attr:`LimbTables.table`.
        middle: :attr:`LimbTables.middle`.
        steer: rad, left positive.
        crank: rad.
        trunk: ``(3,)`` wanted angles about y, x, z, rad.
        swivel: ``(4,)`` wanted swivel of each limb, rad.
        found: ``(4,)``, overwritten.
    """
    lean, twist = trunk[1] - middle[1], trunk[2] - middle[2] - SHOULDERS_FOLLOW * steer
    last = table.shape[0] - 1
    for limb in range(4):
        place = (steer + WIDEST) / (2.0 * WIDEST) * last
        if limb > 1:
            place = (crank % (2.0 * math.pi)) / (2.0 * math.pi) * last
        place = max(0.0, min(last - 1e-9, place))
        index = int(place)
        first, second, part = table[index, limb], table[index + 1, limb], place - index
        turn = swivel[limb] - middle[3 + limb]
        found[limb] = first[0] + part * (second[0] - first[0])
        for slope, change in ((1, turn), (2, lean), (3, twist)):
            found[limb] += (first[slope] + part * (second[slope] - first[slope])) * change


@jit
def legs_on_pedals(table, crank):  # type: ignore[no-untyped-def]
    """Forces (N, bicycle axes) of the left and the right leg's own weight on the pedals, and the legs' swing.

    The swing of legs without muscles, per (rad/s)² of the crank: a force upwards and a moment to the right, see
    :func:`.leg_swing`; forces of the left and the right pedal, likewise.

    Args:
        table: :attr:`LimbTables.legs`.
        crank: rad.
    """
    last = table.shape[0] - 1
    found = np.empty((2, 8))
    for side in range(2):
        place = ((crank + side * math.pi) % (2.0 * math.pi)) / (2.0 * math.pi) * last
        index = min(int(place), last - 1)
        for column in range(8):
            first, second = table[index, column], table[index + 1, column]
            found[side, column] = first + (place - index) * (second - first)
    left, right = found[0], found[1]
    weights = (left[0], left[1], left[2]), (right[0], -right[1], right[2])
    pedals = (left[5], left[6], left[7]), (right[5], -right[6], right[7])
    return weights, left[3] + right[3], left[4] - right[4], pedals
