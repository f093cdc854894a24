"""The human pilot: steers by what delayed and noisy senses and an internal model make of the bicycle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ....filters.core.quantity import GRAVITY, STANDARD_GRAVITY
from ..course.path import Path
from ..frame.bicycle import SPEED
from ..frame.parameters import BicycleParameters, join
from ..rider.muscles import TRUNK_DAMPING, TRUNK_STIFFNESS
from ..rider.posture import Posture
from .control import ControlSettings, Pilot, PilotMemory
from .human_steering import STATES, Human, steer_humanly
from .internal_model import (
    RIGID,
    TrunkModel,
    command_noise,
    delays,
    internal_model,
    lean_matrices,
    rider_model,
    sensing_noise,
    steering_reaction,
)
from .pilot import PilotParameters
from .regulator import sampled

NOISES = 7
"""random numbers a control step: six senses and the muscles"""
ARMS_INERTIA, ARMS_DAMPING = 0.21, 0.83
"""kg·m², N·m·s/rad: what a full rider's arms and their joints add to the steering; means of riders 0, 2 and 4 in their
response at 3 m/s to a torque of 1 N·m on the bar during 0.2 s (0.17 to 0.24, 0.70 to 1.03)"""
BLOCK = 512
"""control steps whose noise is drawn at once"""


class HumanMemory(NamedTuple):
    """State of the human pilot besides that of its path and speed."""

    state: tuple[float, ...]
    inputs: tuple[float, ...]
    readings: tuple[float, ...]
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
        full * ARMS_INERTIA,
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
    """

    def __init__(
        self,
        bicycle: BicycleParameters,
        human: PilotParameters,
        noise: np.random.SeedSequence,
        trunk: TrunkModel = RIGID,
        settings: ControlSettings | None = None,
        gravity: float = GRAVITY,
    ) -> None:
        self.human, self._trunk, self._noise = human, trunk, HumanNoise(noise)
        super().__init__(bicycle, settings, gravity)
        s, step = self.settings, self.period
        self._costs = (s.roll, s.steer, s.roll_rate, s.steer_rate, *(human.care * c for c in (s.heading, s.offset)))
        self._costs += (human.care * s.offset_integral,)
        self._models: dict[float, tuple[np.ndarray, np.ndarray]] = {}
        # the arms themselves: torque and its rate
        A, B = rider_model(bicycle, human, trunk, gravity, 1.0)
        still, faster = (lean_matrices(bicycle, trunk, gravity, speed)[2] for speed in (0.0, 1.0))
        numbers = Human(
            reaction=steering_reaction(bicycle, trunk),
            muscles=trunk.stiffness - trunk.support,
            levelling=float(trunk.levelling),
            largest_torque=human.largest_torque,
            arm_damping=human.arm_damping,
            muscle_sigma=command_noise(human, step),
            tremor=human.tremor,
            motor_noise=human.motor_noise,
            sigma=sensing_noise(human, step),
            arms=np.hstack(sampled(A[6:8, 6:8], B[6:8, :1], step)),
            still=still,
            moving=faster - still,
        )
        self._human = np.array(numbers[:8]), numbers.sigma, numbers.arms, np.stack(numbers[10:])

    def start(self, path: Path, speed: float = 0.0) -> None:
        """Begin a ride at the beginning of a path, at a speed (m/s), upright and with idle hands."""
        super().start(path, speed)
        slow, _ = delays(self.human, self.period)
        self._inputs, self._readings = np.zeros((slow + 1, 3)), np.zeros((slow + 1, 6))
        # of the internal model and of the arms
        self._state, self._count = np.zeros(STATES + 2), 0

    def update(self, seen: np.ndarray, speed: float, lean: float = 0.0) -> tuple[float, float]:
        """As :meth:`.Pilot.update`, steering as a human."""
        low, high, part = self._between(seen.item(SPEED))
        noise = self._noise.at(self._count)
        self._count += 1
        steer_humanly(
            *self._numbers, self._human, self.path.points, self._model(low), self._model(high), part, noise,
            seen, speed, lean, self._memory, self._state, self._inputs, self._readings,
        )  # fmt: skip
        return self._decided()

    def _model(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """What the rider knows at a speed (m/s) of the table: columns of all matrices, and gains."""
        if speed not in self._models:
            model = internal_model(
                self.bicycle, self.human, self._trunk, self._costs, self._gravity, speed, self.period
            )
            self._models[speed] = model.columns, model.gains
        return self._models[speed]

    def save(self) -> PilotMemory:
        """State without the path."""
        human = HumanMemory(
            tuple(self._state.tolist()),
            tuple(self._inputs.ravel().tolist()),
            tuple(self._readings.ravel().tolist()),
            self._count,
        )
        return super().save()._replace(human=human)

    def restore(self, memory: PilotMemory) -> None:
        """Undo :meth:`save`."""
        super().restore(memory)
        human = memory.human
        assert human is not None
        self._state[:] = human.state
        self._inputs.ravel()[:], self._readings.ravel()[:] = human.inputs, human.readings
        self._count = human.step
