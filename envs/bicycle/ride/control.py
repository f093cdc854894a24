"""Rider control model: balance, path and speed.

Steering is a linear-quadratic regulator on the Whipple model of rider and bicycle, extended by heading, offset from the
path and its integral, with gains scheduled on speed. The speed controller follows the target speed within the limits of
the curvature ahead. Its output is a force at the wheels, provided by pedalling or brakes: known resistances plus a
proportional-integral correction.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ....filters.core.quantity import GRAVITY
from ....filters.support.parameters import check_positive
from ..course.path import Path
from ..frame.bicycle import SPEED
from ..frame.parameters import AIR_DENSITY, BicycleParameters
from ..frame.whipple import WhippleModel, whipple_model
from .preview import PREVIEW_BIN, PREVIEW_BINS, speed_limits
from .regulator import lateral_model, preview_regulator, sampled
from .steering import (
    AHEAD,
    COASTING,
    DISTANCE,
    DRIVE,
    LOWEST_SPEED,
    MEMORY,
    OFFSET,
    TARGET,
    TORQUE,
    Piloted,
    steer_exactly,
)

HIGHEST_SPEED = 7.0
"""m/s: end of the gain table"""
POSITIVE = ("effort", "largest_torque", "largest_drive", "largest_power", "lateral_acceleration", "braking", "rate")
"""settings that must not be zero"""


@dataclass(frozen=True)
class ControlSettings:
    """Weights of the regulator and gains of the speed control; choices of this project.

    Raises:
        ValueError: a weight that is negative, or a limit or rate that is not positive.
    """

    roll: float = 20.0
    """cost of a squared rad"""
    steer: float = 5.0
    roll_rate: float = 2.0
    steer_rate: float = 0.2
    heading: float = 4.0
    offset: float = 1.0
    """cost of a squared m"""
    offset_integral: float = 0.3
    """cost of a squared m·s"""
    effort: float = 0.05
    """cost of a squared N·m"""
    largest_torque: float = 40.0
    """N·m"""
    speed_gain: float = 150.0
    """N/(m/s)"""
    speed_integral: float = 40.0
    """N/m"""
    largest_drive: float = 250.0
    """N at the wheel"""
    largest_power: float = 450.0
    """W at the wheel: a sprint of some seconds, in the saddle"""
    largest_brake: float = 4.2
    """m/s² by both brakes together, slope included; the rear wheel would lift off at 5"""
    lateral_acceleration: float = 2.0
    """m/s²: the rider slows down before turns that would need more"""
    forward_acceleration: float = 0.7
    """m/s²: largest increase of the target speed"""
    braking: float = 1.5
    """m/s²: largest decrease, also assumed before a turn"""
    rate: float = 250.0
    """Hz"""

    def __post_init__(self) -> None:
        check_positive(self, *POSITIVE, or_zero=[name for name in vars(self) if name not in POSITIVE])


class PilotMemory(NamedTuple):
    """State of a pilot."""

    memory: tuple[float, ...]
    """see :mod:`.steering`"""
    human: Any = None
    """state of a :class:`.human.HumanPilot`"""


def regulator(
    model: WhippleModel, bicycle: BicycleParameters, speed: float, settings: ControlSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Gains of the steer torque at one speed.

    Returns:
        Gains ``(7,)`` on the state of :func:`.lateral_model`, relative to the steady turn at the path's curvature, and
        ``(2, PREVIEW_BINS)`` on the change of that turn's roll and steer, rad, in each bin ahead.
    """
    s, step = settings, 1.0 / settings.rate
    cost = np.diag([s.roll, s.steer, s.roll_rate, s.steer_rate, s.heading, s.offset, s.offset_integral])
    A, B = sampled(*lateral_model(model, bicycle, speed), step)
    return preview_regulator(A, B, cost, s.effort, step, np.eye(7)[:, :2])


@lru_cache(maxsize=4096)
def gain_row(bicycle: BicycleParameters, settings: ControlSettings, gravity: float, speed: float) -> np.ndarray:
    """Gains at one speed (m/s) on the state and on turns ahead ``(7 + 2 · PREVIEW_BINS,)``; computed when first needed.

    A ride needs few speeds, and each costs some milliseconds.
    """
    gains, kernel = regulator(whipple_model(bicycle, gravity), bicycle, speed, settings)
    return np.concatenate([gains, kernel.ravel()])


class Pilot:
    """Controller that keeps a bicycle upright, on a path and at a speed.

    Args:
        bicycle: rider included, see :meth:`BicycleParameters.with_load`.
        settings: weights.
        gravity: m/s².
        lean_effect: part of a lean of the trunk by which the common mass centre leans.
    """

    def __init__(
        self,
        bicycle: BicycleParameters,
        settings: ControlSettings | None = None,
        gravity: float = GRAVITY,
        lean_effect: float = 0.0,
    ) -> None:
        self.bicycle, self.lean_effect = bicycle, lean_effect
        self.settings = ControlSettings() if settings is None else settings
        self.model = whipple_model(bicycle, gravity)
        slow, fast = np.arange(LOWEST_SPEED, 0.95, 0.1), np.arange(1.0, HIGHEST_SPEED + 0.25, 0.25)
        self._grid, self._place = [*slow.tolist(), *fast.tolist()], 1
        self._ahead = PREVIEW_BIN * np.arange(PREVIEW_BINS + 1)
        self._gravity, self._rows = gravity, dict[float, np.ndarray]()
        self.period = 1.0 / self.settings.rate
        piloted = self._piloted()
        self._numbers = np.array(piloted[:16]), np.stack(piloted[16:])
        self.start(Path(np.zeros(2)))

    def _piloted(self) -> Piloted:
        s, bicycle = self.settings, self.bicycle
        mass = sum(part.mass for part in bicycle.parts)
        return Piloted(
            period=self.period,
            wheelbase=bicycle.wheelbase,
            tilt=math.cos(bicycle.steer_axis_tilt),
            mass=mass,
            weight=mass * self._gravity,
            rolling=bicycle.rolling_resistance,
            drag=0.5 * AIR_DENSITY * bicycle.drag_area,
            largest_torque=s.largest_torque,
            speed_gain=s.speed_gain,
            speed_integral=s.speed_integral,
            largest_drive=s.largest_drive,
            largest_power=s.largest_power,
            largest_brake=mass * s.largest_brake,
            lateral_acceleration=s.lateral_acceleration,
            forward_acceleration=s.forward_acceleration,
            braking=s.braking,
            still=self._gravity * self.model.K0,
            moving=self.model.K2,
        )

    def start(self, path: Path, speed: float = 0.0) -> None:
        """Begin a ride at the beginning of a path, at a speed (m/s)."""
        self.path, self._memory, self.command = path, np.zeros(MEMORY), (0.0, 0.0)
        self._memory[TARGET] = speed

    def coast(self, resting: bool) -> None:
        """Whether the legs rest, from the next control step on; brakes still act."""
        self._memory[COASTING] = resting

    @property
    def distance(self) -> float:
        """Arc length on the path, m."""
        return float(self._memory[DISTANCE])

    @property
    def offset(self) -> float:
        """Distance to the left of the path, m."""
        return float(self._memory[OFFSET])

    @property
    def curvature_ahead(self) -> float:
        """Of the path where the rider will be soon, 1/m, left positive."""
        return float(self._memory[AHEAD])

    def comfortable_speed(self, path: Path, speed: float) -> float:
        """The most of ``speed`` (m/s) with which to begin a path that may turn soon."""
        distances = max(speed, LOWEST_SPEED) * self._ahead
        return min(speed, float(self.speed_limits(path.curvatures(distances), distances)[0]))

    def speed_limits(self, curvatures: np.ndarray, distances: np.ndarray) -> np.ndarray:
        """See :func:`.preview.speed_limits`."""
        s = self.settings
        found: np.ndarray = speed_limits(curvatures, distances, s.lateral_acceleration, s.braking)
        return found

    def _between(self, speed: float) -> tuple[float, float, float]:
        """The two speeds of the table around one (m/s), and how far between them it lies."""
        grid, place = self._grid, self._place
        speed = min(max(speed, LOWEST_SPEED), grid[-1])
        if not grid[place - 1] <= speed < grid[place]:
            self._place = place = min(bisect_right(grid, speed), len(grid) - 1)
        low, high = grid[place - 1], grid[place]
        return low, high, (speed - low) / (high - low)

    def _row(self, speed: float) -> np.ndarray:
        """Gains at a speed (m/s) of the table."""
        if speed not in self._rows:
            self._rows[speed] = gain_row(self.bicycle, self.settings, self._gravity, speed)
        return self._rows[speed]

    def update(self, seen: np.ndarray, speed: float, lean: float = 0.0) -> tuple[float, float]:
        """Decide for the next control period.

        Args:
            seen: :attr:`.BicycleState.numbers` of the bicycle now.
            speed: wanted, m/s; less is ridden in and before sharp turns.
            lean: of the trunk to the bicycle that the rider intends, rad, right positive. Who leans to the right keeps
                the bicycle further to the left.

        Returns:
            Steer torque (N·m, left positive) and force at the wheels (N, forward positive, braking negative).
        """
        low, high, part = self._between(seen.item(SPEED))
        rows, lean = (self._row(low), self._row(high)), self.lean_effect * lean
        steer_exactly(*self._numbers, self.path.points, *rows, part, seen, speed, lean, self._memory)
        return self._decided()

    def _decided(self) -> tuple[float, float]:
        torque, drive = self._memory[TORQUE : DRIVE + 1].tolist()
        self.command = torque, drive
        return self.command

    def save(self) -> PilotMemory:
        """State without the path."""
        return PilotMemory(tuple(self._memory.tolist()))

    def restore(self, memory: PilotMemory) -> None:
        """Undo :meth:`save`."""
        self._memory[:] = memory.memory
        self._decided()
