"""The human pilot: steers by what delayed and noisy senses and an internal model make of the bicycle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ...sensors.ideal import STANDARD_GRAVITY
from ..course.path import Path
from ..frame.bicycle import BicycleState
from ..frame.parameters import BicycleParameters
from ..rider.anthropometry import join
from ..rider.muscles import TRUNK_DAMPING, TRUNK_STIFFNESS
from ..rider.posture import Posture
from .control import ControlSettings, Pilot, PilotMemory
from .internal_model import (
    RIGID,
    STATES,
    InternalModel,
    TrunkModel,
    command_noise,
    delays,
    estimate,
    internal_model,
    rider_model,
    sensing_noise,
    steady_turn,
)
from .pilot import PilotParameters
from .regulator import PREVIEW_BINS, sampled

NOISES = 7
"""random numbers a control step: six senses and the muscles"""
ARMS_ON_BAR, ARMS_DAMPING = 0.45, 3.1
"""1, N·m·s/rad: part of the mass of a full rider's arms that moves with the grips, and what their joints damp; found in
the response of riders 0, 2 and 4 to a torque on the bar (0.43 to 0.64, 3.1 to 3.2)"""
BLOCK = 512
"""control steps whose noise is drawn at once"""


class HumanMemory(NamedTuple):
    """State of the human pilot besides that of its path and speed."""

    state: tuple[float, ...]
    inputs: tuple[float, ...]
    readings: tuple[float, ...]
    arms: tuple[float, float]
    step: int


class HumanNoise:
    """Standard normal numbers of each control step, from a counter: any step can be drawn again.

    Args:
        seed: child of the ride's root seed.
    """

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self._key, self._block = seed.generate_state(2, np.uint64), -1

    def at(self, count: int) -> np.ndarray:
        """Numbers ``(NOISES,)`` of one control step."""
        block, row = divmod(count, BLOCK)
        if block != self._block:
            generator = np.random.Generator(np.random.Philox(key=self._key, counter=[0, 0, 0, block]))
            self._numbers, self._block = generator.standard_normal((BLOCK, NOISES)), block
        return self._numbers[row]


def leaning_trunk(posture: Posture, full: bool, levelling: float) -> TrunkModel:
    """What of a rider leans: trunk, head and arms. The arms of a ``full`` rider turn with the bar."""
    trunk, arms = posture.trunk(), posture.limbs_at(0.0)
    whole = join([trunk, arms["arm_left"], arms["arm_right"]])
    bicycle = posture.bicycle
    grip = float(np.linalg.norm(np.cross(bicycle.steer_axis, np.array(bicycle.grip) - bicycle.steer_origin)))
    centre = posture.lumbar + rotation.rotate(posture.trunk_orientation(), whole.centre)
    return TrunkModel(
        whole.mass,
        float(whole.centre[2]),
        float(centre[2]),
        float(centre[0]),
        posture.flexion,
        float(whole.tensor[0, 0]),
        TRUNK_STIFFNESS,
        TRUNK_DAMPING,
        STANDARD_GRAVITY * trunk.mass * float(trunk.centre[2]),
        full * ARMS_ON_BAR * 2.0 * arms["arm_left"].mass * grip**2,
        full * ARMS_DAMPING,
        levelling,
    )


class HumanPilot(Pilot):
    """Human rider as the controller of steering; speed as :class:`.Pilot`.

    Args:
        bicycle: rider included, see :meth:`BicycleParameters.with_load`.
        human: senses, muscles and skill.
        noise: seed of the noise of senses and muscles.
        trunk: what of the rider leans; the rest is rigid.
        settings: weights.
        gravity: m/s².
        highest_speed: highest speed of the gain table, m/s.
    """

    def __init__(
        self,
        bicycle: BicycleParameters,
        human: PilotParameters,
        noise: np.random.SeedSequence,
        trunk: TrunkModel = RIGID,
        settings: ControlSettings | None = None,
        gravity: float = 9.81,
        highest_speed: float = 7.0,
    ) -> None:
        self.human, self._trunk, self._noise = human, trunk, HumanNoise(noise)
        super().__init__(bicycle, settings, gravity, highest_speed)
        s, step = self.settings, self.period
        self._costs = (s.roll, s.steer, s.roll_rate, s.steer_rate, *(human.care * c for c in (s.heading, s.offset)))
        self._costs += (human.care * s.offset_integral,)
        self._sigma = sensing_noise(human, step)
        self._muscle_sigma = command_noise(human, step)
        # the arms themselves: torque and its rate
        A, B = rider_model(bicycle, human, trunk, gravity, 1.0)
        arms, drive = sampled(A[6:8, 6:8], B[6:8, :1], step)
        self._arms, self._drive = arms.tolist(), drive[:, 0].tolist()

    def start(self, path: Path, speed: float = 0.0) -> None:
        """Begin a ride at the beginning of a path, at a speed (m/s), upright and with idle hands."""
        super().start(path, speed)
        self._slow, self._fast = delays(self.human, self.period)
        self._state, self._inputs = np.zeros(STATES), np.zeros((self._slow + 1, 3))
        self._readings = np.zeros((self._slow + 1, 6))
        self._torque, self._count = (0.0, 0.0), 0

    def update(self, state: BicycleState, speed: float, lean: float = 0.0) -> tuple[float, float]:
        """As :meth:`.Pilot.update`, steering as a human."""
        point, offset, heading = self._follow(state)
        noise = self._noise.at(self._count)
        self._count += 1
        readings, inputs = self._readings, self._inputs
        readings[:-1] = readings[1:]
        readings[-1] = (state.roll_rate, -state.steer, -state.steer_rate, state.roll, -heading, -offset)
        readings[-1] += self._sigma * noise[:6]
        expected = self._expected(state.speed)
        left, lean = self._turn(point.curvature, offset), lean + self._trunk.levelling * state.roll
        roll, trunk, torque = steady_turn(self.bicycle, self._trunk, self._gravity, state.speed, -left, lean)
        # beyond a metre or half a radian off the path, limit the correction
        offset, heading = max(-1.0, min(1.0, expected[5])), max(-0.5, min(0.5, expected[4]))
        self.offset_integral = max(-2.0, min(2.0, self.offset_integral + self.period * offset))
        errors = np.append(expected, self.offset_integral)
        errors[[0, 1, 6, 10]] -= (roll, -left, torque, trunk)
        errors[4], errors[5] = heading, offset
        ahead, limit = self.turns_ahead(state.speed)
        wanted = torque - float(self._gains(state.speed) @ np.concatenate([errors, ahead]))
        largest = self.human.largest_torque
        command = largest * math.tanh(wanted / largest)
        # the path turns the heading; so does what steering does beyond the linear model
        cos, wheelbase = math.cos(self.bicycle.steer_axis_tilt), self.bicycle.wheelbase
        angle = -cos * max(-1.2, min(1.2, expected[1]))
        curvature = point.curvature / max(0.5, 1.0 + point.curvature * offset)
        inputs[:-1] = inputs[1:]
        inputs[-1] = (command, state.speed * (curvature - (math.tan(angle) - angle) / wheelbase), lean)
        self._wish(min(speed, limit))
        arms = -self._move(command, float(noise[6])) - self.human.arm_damping * state.steer_rate
        self.command = (arms, self._driver(state))
        return self.command

    def _expected(self, speed: float) -> np.ndarray:
        """Filter and predict: the state ``(12,)`` that the rider expects at present."""
        low, high, part = self._between(speed)
        before, inputs, readings = self._state, self._inputs, self._readings
        first, present = estimate(self._model(low), before, inputs, readings)
        second, later = estimate(self._model(high), before, inputs, readings)
        self._state = (1.0 - part) * first + part * second
        return (1.0 - part) * present + part * later

    def _model(self, speed: float) -> InternalModel:
        return internal_model(self.bicycle, self.human, self._trunk, self._costs, self._gravity, speed, self.period)

    def _gains(self, speed: float) -> np.ndarray:
        low, high, part = self._between(speed)
        return (1.0 - part) * self._model(low).gains + part * self._model(high).gains

    def turns_ahead(self, speed: float) -> tuple[np.ndarray, float]:
        """As :meth:`.Pilot.turns_ahead`, with the changes of the arm torque after those of roll and steer."""
        changes, limit = super().turns_ahead(speed)
        stiffness = self.model.stiffness(max(speed, self._grid[0]))[1]
        roll, steer = changes[:PREVIEW_BINS], changes[PREVIEW_BINS:]
        return np.concatenate([changes, stiffness[0] * roll + stiffness[1] * steer]), limit

    def _move(self, command: float, noise: float) -> float:
        """Torque of the arms, N·m, right positive, one control step after a command."""
        unsteady = self._muscle_sigma * math.hypot(self.human.tremor, self.human.motor_noise * command) * noise
        (a, b), (c, d) = self._arms
        e, f = self._drive
        torque, rate = self._torque
        drive = command + unsteady
        self._torque = (a * torque + b * rate + e * drive, c * torque + d * rate + f * drive)
        return torque

    def save(self) -> PilotMemory:
        """State without the path."""
        human = HumanMemory(
            tuple(self._state.tolist()),
            tuple(self._inputs.ravel().tolist()),
            tuple(self._readings.ravel().tolist()),
            self._torque,
            self._count,
        )
        return replace(super().save(), human=human)

    def restore(self, memory: PilotMemory) -> None:
        """Undo :meth:`save`."""
        super().restore(memory)
        human = memory.human
        assert human is not None
        self._state = np.array(human.state)
        self._inputs = np.array(human.inputs).reshape(-1, 3)
        self._readings = np.array(human.readings).reshape(-1, 6)
        self._torque, self._count = human.arms, human.step
