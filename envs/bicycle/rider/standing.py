"""Riding out of the saddle: posture of a rider who stands on the pedals, and the forces of feet and hands in it.

The saddle carries nothing. Feet and hands together hold the body where the rider wants it, turn the cranks and steer:
eight equations for the twelve components of four forces. Of all forces that do so, those are taken that differ least
from feet that share the weight and idle hands, in squares that count by :data:`READY` (static optimisation). In the
bicycle the body hangs on springs and dampers, as legs and arms hold it.

With each push the hips stay above the pushing foot and the trunk upright, while the bicycle is swung to the other side.
The constants are round figures of this project.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ..frame.parameters import join
from .leg_loads import weight_on_pedal
from .limb_tables import legs_on_pedals
from .muscles import HANDS as OF_HANDS
from .muscles import KEEPING_UP, PUSHES, SWUNG, TARGET, WEIGHTS
from .posture import ARM_REACH, CRANKS, SIDES, Posture, placed, rising_root
from .saddle import upper_body

FORWARD = 0.12
"""m by which the hips are ahead of where they sit, nearly above the cranks; of a person of the tables' stature"""
LEG_STRETCHED = 0.965
"""part of the straight leg at the farthest pedal: hips also move up, and to the side"""
SOFT, DAMPED = 2.0 * math.pi * 1.8, 0.7
"""rad/s, 1: natural frequency and damping ratio of the body on legs and arms"""
TIPPING = 800.0
"""N·m/rad: against the tip of the pelvis, critically damped"""
READY = np.array([0.1, 0.1, 1.0, 0.1, 0.1, 1.0, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3])
"""1: how readily feet and hands push along x, y, z, in squares"""
CROSS = np.stack([np.cross(axis, np.eye(3)).T for axis in np.eye(3)]).reshape(3, 9)
"""a vector times it is the matrix of its cross product, row by row"""
LARGEST_TURN = 0.45
"""1: mean torque on the crank at most, relative to the weight on a level crank: beyond, a foot would have to pull"""
LEANS = 0.75
"""1: part of a swing by which the bicycle leans; the body moves the other way by the rest"""
WALKING, RIDING = 1.0, 2.0
"""m/s: below the first riders sit, above the second they may stand"""


class Stance(NamedTuple):
    """Where a standing rider is, compared with a sitting one."""

    posture: Posture
    """the same person, hips and lumbar joint moved, trunk as upright as the arms reach"""
    ahead: float
    """m of the pelvis ahead"""
    above: float
    """m above"""


def stance(posture: Posture) -> Stance:
    """The person on the pedals: hips ahead of the saddle, as high as the legs reach, arms bent as in the saddle.

    Raises:
        ValueError: the bicycle is too small or too large for it.
    """
    ahead, body = FORWARD * posture.body.scale, posture.body

    def moved(above: float) -> Posture:
        by = np.array([ahead, 0.0, above])
        return replace(posture, hip=posture.hip + by, lumbar=posture.lumbar + by)

    def stretch(above: float) -> float:
        farthest = rotation.norm(moved(above).leg_target("left", CRANKS)).max()
        return float(farthest / posture.leg.reach - LEG_STRETCHED)

    message = f"{body.name} of {body.stature} m cannot stand on the pedals of {posture.bicycle.name!r}"
    above = rising_root(stretch, 0.0, 0.3, message)

    def bent(flexion: float) -> float:
        trunk = replace(moved(above), flexion=flexion).trunk_orientation()
        reach = rotation.norm(moved(above).arm_target("left", 0.0, trunk)).item()
        return ARM_REACH - float(reach) / posture.arm.reach

    upright = rising_root(bent, math.radians(-10.0), math.radians(75.0), message)
    return Stance(replace(moved(above), flexion=upright), ahead, above)


class StandingForces:
    """Forces of feet and hands of one standing rider.

    Args:
        seated: the person in the saddle.
        stands: of the same person.
        swing: amplitude of the bicycle's swing, rad.
        gravity: m/s².
        full: whether the legs are bodies of their own.
    """

    def __init__(self, seated: Posture, stands: Stance, swing: float, gravity: float, full: bool) -> None:
        self._seated, self._stands, self._swing, self._gravity, self._full = seated, stands, swing, gravity, full
        posture, saddle = stands.posture, np.array(seated.bicycle.saddle)
        upper, legs = (
            upper_body(posture),
            [mass for name, mass in posture.limbs_at(0.0).items() if name.startswith("leg")],
        )
        body = seated.body.mass
        # hips carry what the pedals do not carry of the legs
        on_pedals = -2.0 * float(weight_on_pedal(posture, gravity)[:-1, 2].mean()) / gravity
        whole = join(upper if full else [*upper, *legs])
        self.carried = body - on_pedals if full else body
        centre = whole.centre - saddle
        if full:
            hips = posture.hip * (1.0, 0.0, 1.0) - saddle
            centre = (whole.mass * centre + (self.carried - whole.mass) * hips) / self.carried
        self._centre = centre - (stands.ahead, 0.0, stands.above)
        trunk = placed(posture.trunk(), np.zeros(3), posture.trunk_orientation())
        self._trunk_effect = trunk.mass * float(trunk.centre[2])
        # what tips: the pelvis, to which rigid legs belong
        tipping = join([posture.pelvis()] if full else [posture.pelvis(), *legs])
        above = float(posture.lumbar[2] - posture.hip[2]) + float(seated.hip[2] - saddle[2])
        down = float(tipping.centre[2] - posture.hip[2]) + float(seated.hip[2] - saddle[2])
        carried = tipping.mass * down**2 + posture.trunk().mass * above**2
        about = tipping.tensor + carried * np.eye(3)
        self._tip_damping = 2.0 * np.sqrt(TIPPING * np.diag(about)[[0, 1]])
        self.flexed = posture.flexion - seated.flexion
        self._hip_height = float(posture.hip[2])
        drive = seated.bicycle.drive
        assert drive is not None
        self._axle, self._crank = np.array(drive.axle), drive.crank_length

    def level(self, rise: float, speed: float) -> float:
        """How far the rider has got up at a speed (m/s), of one who wants to have got up by ``rise``."""
        return rise * min(1.0, max(0.0, (speed - WALKING) / (RIDING - WALKING)))

    def hold(
        self, level: float, ridden: tuple[float, ...], torque: float, legs: np.ndarray, pelvis: np.ndarray,
        memory: np.ndarray,
    ) -> None:  # fmt: skip
        """Replace the forces of a seated rider in the memory of :mod:`.muscles`, as far as this one has got up.

        Args:
            level: 0 in the saddle to 1 on the pedals.
            ridden: steer, crank (rad), rates of crank and wheel (rad/s), ratio of the gear (0 while the legs rest).
            torque: mean torque wanted at the crank, N·m.
            legs: of :func:`.legs_on_pedals`.
            pelvis: ``(2, 5)`` rad of forward tip and of tip to the right, m of rise, way ahead and to the left; rates.
            memory: overwritten.
        """
        steer, crank, crank_rate, wheel_rate, ratio = ridden
        bicycle, posture = self._seated.bicycle, self._seated
        saddle, weight = np.array(bicycle.saddle), self.carried * self._gravity
        c, s = math.cos(crank), math.sin(crank)
        # first off the saddle, then ahead of it
        up, forth = min(1.0, 2.0 * level), max(0.0, 2.0 * level - 1.0)
        # the trunk stays upright above a bicycle that leans away from the pushing foot
        swing = forth * self._swing
        memory[TARGET][:2] += level * self.flexed, -swing * c
        side = swing * self._hip_height * np.array([c, -s * crank_rate, -c * crank_rate**2])
        memory[SWUNG] = LEANS * swing * c, -LEANS * swing * s * crank_rate
        wanted = np.array([[forth * self._stands.ahead, side[0], up * self._stands.above], [0.0, side[1], 0.0]])
        now = pelvis[:, [3, 4, 2]]
        pull = SOFT**2 * (wanted[0] - now[0]) + 2.0 * DAMPED * SOFT * (wanted[1] - now[1])
        force = self.carried * (pull + np.array([0.0, side[2], self._gravity]))
        centre = self._centre + now[0]
        centre[1] -= self._trunk_effect * memory[TARGET][1] / self.carried
        moment = (centre @ CROSS).reshape(3, 3) @ force
        moment[:2] -= TIPPING * pelvis[0, [1, 0]] + self._tip_damping * pelvis[1, [1, 0]]
        places = [posture.pedal(name, crank) for name in SIDES] + [posture.grip(name, steer) for name in SIDES]
        equations = np.zeros((8, 12))
        for index, arms in enumerate(((np.array(places) - saddle) @ CROSS).reshape(4, 3, 3)):
            equations[:3, 3 * index : 3 * index + 3] = -np.eye(3)
            equations[3:6, 3 * index : 3 * index + 3] = -arms
        for index in range(2):
            x, _, z = places[index] - self._axle
            equations[6, 3 * index : 3 * index + 3] = z, 0.0, -x
            arms = (places[2 + index] - bicycle.steer_origin) @ CROSS
            equations[7, 6 + 3 * index : 9 + 3 * index] = bicycle.steer_axis @ arms.reshape(3, 3)
        turn = min(torque, LARGEST_TURN * weight * self._crank) * 2.0 * c**2
        turn -= float(equations[6, :6] @ memory[WEIGHTS])
        if ratio > 0.0:
            turn += max(-15.0, min(15.0, KEEPING_UP * (wheel_rate / ratio - crank_rate)))
        asked = np.array([*force, *moment, turn, equations[7, 6:] @ memory[OF_HANDS]])
        like = np.zeros(12)
        like[[2, 5]] = -0.5 * weight
        ready = READY[:, None] * equations.T
        found = like + ready @ np.linalg.solve(equations @ ready, asked - equations @ like)
        if self._full:
            found[:6] += crank_rate**2 * np.array(legs_on_pedals(legs, crank)[3]).ravel()
        memory[PUSHES] += level * (found[:6] - memory[PUSHES])
        memory[OF_HANDS] += level * (found[6:] - memory[OF_HANDS])
