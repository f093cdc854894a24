"""A foot on the ground at stops: holds a standing bicycle upright.

The legs of the rider stay on the pedals in the model. The foot is a force of the ground on the frame, upwards, at the
side to which the bicycle tips; it sets in when the rider is about to stop and lets go when the bicycle rolls again.
"""

from __future__ import annotations

import math

import numpy as np

from ..frame.bicycle import Bicycle, BicycleState

STOPPING, ROLLING = 0.3, 1.2
"""m/s: wanted speed below which a rider stops; speed of the bicycle above which no foot is needed"""
SET_IN = 0.4
"""s in which the foot takes the load"""
ASIDE = 0.28
"""m: foot beside the bicycle"""
STIFFNESS, DAMPING, LARGEST = 3000.0, 400.0, 900.0
"""N·m/rad, N·m·s/rad against rolling (about 1000 N·m/rad would just hold the weight); N at most"""
HOLD_STEER, HOLD_STEER_RATE = 12.0, 3.0
"""N·m/rad, N·m·s/rad: hands that keep the bar straight meanwhile"""


class Foot:
    """The foot of one rider; :attr:`engaged` is its state, from 0 (in the air) to 1."""

    engaged = 0.0

    def start(self, speed: float) -> None:
        """Begin a ride at a speed, m/s."""
        self.engaged = 1.0 if speed < STOPPING else 0.0

    def update(self, speed: float, wanted: float, period: float) -> None:
        """Set the foot down or lift it, during one control period (s); speeds of the bicycle in m/s."""
        stopping, held = wanted < STOPPING, self.engaged > 0.0
        down = speed < ROLLING and (stopping or held)
        change = period / SET_IN if down else -period / SET_IN
        self.engaged = max(0.0, min(1.0, self.engaged + change))

    def steer(self, torque: float, state: BicycleState) -> float:
        """Steer torque (N·m, left positive) of a rider whose weight is on the foot, in place of ``torque``."""
        if self.engaged == 0.0:
            return torque
        return (1.0 - self.engaged) * torque - self.engaged * (
            HOLD_STEER * state.steer + HOLD_STEER_RATE * state.steer_rate
        )

    def push(self, bicycle: Bicycle, state: BicycleState) -> None:
        """Let the foot act on the bicycle in the next step."""
        if self.engaged == 0.0:
            return
        moment = self.engaged * (STIFFNESS * state.roll + DAMPING * state.roll_rate)
        force = min(LARGEST, abs(moment) / ASIDE)
        side = -math.copysign(ASIDE, moment)
        drive = bicycle.parameters.drive
        ahead = 0.4 if drive is None else drive.axle[0]
        c, s = math.cos(state.yaw), math.sin(state.yaw)
        point = np.array([state.x + c * ahead - s * side, state.y + s * ahead + c * side, state.z])
        bicycle.body.push(-1, [0.0, 0.0, force], point.tolist())
