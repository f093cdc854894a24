"""Lookup tables of the rider control model: elbows and knees over steer and crank, weight of the legs on the pedals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ....filters.core import rotation
from .limbs import forward, reach_to, three_turns
from .posture import KNEE_OUT, LIMBS, Posture

POINTS = 49
STEERS = np.linspace(-0.6, 0.6, POINTS)
"""rad at which the arms' posture is tabulated"""
CRANKS = np.linspace(0.0, 2.0 * math.pi, POINTS)
"""rad at which that of the legs is"""
SHOULDERS_FOLLOW = 0.45
"""part of the steering angle by which the trunk twists, so that the outer hand stays within reach"""
STRAIGHTEST = 0.985
"""largest extension of an arm, as a share of its straight length"""
BIT = 0.01
"""rad for slopes"""


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
        now = self.angles(CRANKS, STEERS)
        changed = [self.angles(CRANKS, STEERS, **{what: BIT}) for what in ("extra", "lean", "twist")]
        rows = []
        for limb in range(len(LIMBS)):
            slopes = [(there[limb][:, 1] - now[limb][:, 1]) / BIT for there in changed]
            rows.append(np.stack([now[limb][:, 1], *slopes], axis=1))
        # (point, limb, value and slopes)
        self._table = np.stack(rows, axis=1)
        self._weight = weight_on_pedal(posture, gravity)

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

    def abductions(self, steer: float, crank: float, trunk: Sequence[float], swivel: Sequence[float]) -> list[float]:
        """Abduction of each limb for given positions of elbows and knees, rad.

        Args:
            steer: rad, left positive.
            crank: rad.
            trunk: wanted angles about y, x, z.
            swivel: change of each limb's swivel, rad.
        """
        lean, twist = trunk[1] - self.trunk[1], trunk[2] - self.trunk[2] - SHOULDERS_FOLLOW * steer
        last = POINTS - 1
        arms = (steer - STEERS[0]) / (STEERS[-1] - STEERS[0]) * last
        legs = (crank % (2.0 * math.pi)) / (2.0 * math.pi) * last
        found = []
        for limb, turn in enumerate(swivel):
            place = max(0.0, min(last - 1e-9, arms if limb < 2 else legs))
            index = int(place)
            first, second = self._table[index, limb], self._table[index + 1, limb]
            angle, by_swivel, by_lean, by_twist = (first + (place - index) * (second - first)).tolist()
            found.append(angle + by_swivel * turn + by_lean * lean + by_twist * twist)
        return found

    def leg_weights(self, crank: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Forces (N, bicycle axes) of the left and the right leg's own weight on the pedals."""
        found = []
        for angle, side in ((crank, 1.0), (crank + math.pi, -1.0)):
            place = (angle % (2.0 * math.pi)) / (2.0 * math.pi) * (POINTS - 1)
            index = min(int(place), POINTS - 2)
            first, second = self._weight[index], self._weight[index + 1]
            x, y, z = (first + (place - index) * (second - first)).tolist()
            found.append((x, side * y, z))
        return found[0], found[1]


def weight_on_pedal(posture: Posture, gravity: float) -> np.ndarray:
    """Force ``(POINTS, 3)`` of the left leg's own weight on its pedal at the angles :data:`CRANKS`, N, bicycle axes.

    Hip and pedal carry the leg. Its hip is free to bend and to turn and its knee to bend, so that the virtual work of
    weight and pedal along these three joints vanishes: Jᵀ f = ∂V/∂q.
    """
    limb, segments = posture.leg, posture.segments()
    angles = reach_to(limb, posture.leg_target("left", CRANKS), KNEE_OUT).angles

    def tip_and_energy(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        leg, tip = forward(limb, q)
        height = 0.0
        for part, start, turn in (("thigh", np.zeros(3), leg.upper), ("shank", leg.hinge, leg.lower)):
            centre = start + rotation.rotate(turn, segments[part].centre)
            height = height + segments[part].mass * centre[..., 2]
        return tip, gravity * np.asarray(height)

    free, step = (0, 2, 3), 1e-5
    moved = [[tip_and_energy(angles + sign * step * np.eye(4)[joint]) for sign in (1.0, -1.0)] for joint in free]
    jacobian = np.stack([(more[0] - less[0]) / (2.0 * step) for more, less in moved], axis=1)
    slope = np.stack([(more[1] - less[1]) / (2.0 * step) for more, less in moved], axis=1)
    # the pedal's force on the leg is the opposite of the leg's on the pedal
    return -np.linalg.solve(jacobian, slope[..., None])[..., 0]
