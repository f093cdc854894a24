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
from typing import Any

import numpy as np

from ..course.path import Path, PathPoint
from ..frame.bicycle import AIR_DENSITY, BicycleState
from ..frame.parameters import BicycleParameters
from ..frame.whipple import WhippleModel, whipple_model
from .regulator import PREVIEW_BIN, PREVIEW_BINS, lateral_model, preview_regulator, sampled

LOWEST_SPEED = 0.3
"""m/s: gains are held below"""
REACTION = 0.2
"""s, time constant of a rider's pedalling or braking"""
ANTICIPATED = 3
"""bins of lead of the target"""
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
        for name, value in vars(self).items():
            positive = name in POSITIVE
            if not (value > 0.0 if positive else value >= 0.0) or not math.isfinite(value):
                raise ValueError(f"{name} must be {'positive' if positive else 'not negative'} and finite, got {value}")


@dataclass(frozen=True)
class PilotMemory:
    """State of the rider control model."""

    distance: float
    offset: float
    offset_integral: float
    speed_integral: float
    target: float
    acceleration: float
    command: tuple[float, float]
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
        highest_speed: highest speed of the gain table, m/s.
        lean_effect: part of a lean of the trunk by which the common mass centre leans.
    """

    def __init__(
        self,
        bicycle: BicycleParameters,
        settings: ControlSettings | None = None,
        gravity: float = 9.81,
        highest_speed: float = 7.0,
        lean_effect: float = 0.0,
    ) -> None:
        self.bicycle, self.lean_effect = bicycle, lean_effect
        self.settings = ControlSettings() if settings is None else settings
        self.model = whipple_model(bicycle, gravity)
        slow, fast = np.arange(LOWEST_SPEED, 0.95, 0.1), np.arange(1.0, highest_speed + 0.25, 0.25)
        self._grid = [*slow.tolist(), *fast.tolist()]
        self._ahead = PREVIEW_BIN * np.arange(PREVIEW_BINS + 1)
        self._mass, self._gravity = sum(part.mass for part in bicycle.parts), gravity
        # a steady turn's roll, a part of its steer that grows with the square of the speed
        still, moving = (self.model.steady_turn(speed, 1.0)[0] for speed in (0.0, 1.0))
        self._roll_share = (still, moving - still)
        self.period = 1.0 / self.settings.rate
        self.start(Path(np.zeros(2)))

    def start(self, path: Path, speed: float = 0.0) -> None:
        """Begin a ride at the beginning of a path, at a speed (m/s)."""
        self.path, self.distance, self.target = path, 0.0, speed
        self.offset = self.offset_integral = self.speed_integral = self.acceleration = 0.0
        self.command = (0.0, 0.0)

    def comfortable_speed(self, path: Path, speed: float) -> float:
        """The most of ``speed`` (m/s) with which to begin a path that may turn soon."""
        distances = max(speed, LOWEST_SPEED) * self._ahead
        return min(speed, float(self.speed_limits(path.curvatures(distances), distances)[0]))

    def speed_limits(self, curvatures: np.ndarray, distances: np.ndarray) -> np.ndarray:
        """The fastest ``(n,)`` m/s at each point ahead from which comfortable braking reaches all turns beyond in time.

        v² = lateral acceleration / curvature + 2 · braking · distance, the least over all points beyond.

        Args:
            curvatures: ``(n,)`` of the path ahead, 1/m.
            distances: ``(n,)`` to there, m, rising.
        """
        s = self.settings
        reach = 2.0 * s.braking * distances
        turns = s.lateral_acceleration / np.maximum(1e-6, np.abs(curvatures)) + reach
        return np.sqrt(np.minimum.accumulate(turns[::-1])[::-1] - reach)

    def turns_ahead(self, speed: float) -> tuple[np.ndarray, float]:
        """Changes ``(2 · PREVIEW_BINS,)`` of the steady turn's roll and steer, rad, right positive, as they will come.

        Args:
            speed: now, m/s.

        Returns:
            The changes in each bin of time ahead, and the highest speed (m/s) that will suit the path a reaction later.
        """
        speed = max(speed, LOWEST_SPEED)
        distances = speed * self._ahead
        curvatures = self.path.curvatures(self.distance + distances)
        limits = self.speed_limits(curvatures, distances)
        speeds = np.minimum(speed, limits)
        # braking delays the arrival
        times = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(distances) / (speeds[1:] + speeds[:-1]))])
        steers = -self.bicycle.wheelbase / math.cos(self.bicycle.steer_axis_tilt) * curvatures
        rolls = (self._roll_share[0] + self._roll_share[1] * speeds**2) * steers
        changes = [np.diff(np.interp(self._ahead, times, values)) for values in (rolls, steers)]
        return np.concatenate(changes), float(limits[ANTICIPATED])

    def _between(self, speed: float) -> tuple[float, float, float]:
        """The two speeds of the table around one (m/s), and how far between them it lies."""
        speed = min(max(speed, LOWEST_SPEED), self._grid[-1])
        index = min(bisect_right(self._grid, speed), len(self._grid) - 1)
        low, high = self._grid[index - 1], self._grid[index]
        return low, high, (speed - low) / (high - low)

    def gains(self, speed: float) -> np.ndarray:
        """Interpolated gains: 7 on the state, then those on the changes of roll and steer ahead."""
        low, high, part = self._between(speed)
        first, second = (gain_row(self.bicycle, self.settings, self._gravity, each) for each in (low, high))
        return (1.0 - part) * first + part * second

    def update(self, state: BicycleState, speed: float, lean: float = 0.0) -> tuple[float, float]:
        """Decide for the next control period.

        Args:
            state: of the bicycle.
            speed: wanted, m/s; less is ridden in and before sharp turns.
            lean: of the trunk to the bicycle that the rider intends, rad, right positive. Who leans to the right keeps
                the bicycle further to the left.

        Returns:
            Steer torque (N·m, left positive) and force at the wheels (N, forward positive, braking negative).
        """
        point, offset, heading = self._follow(state)
        self.offset_integral = max(-2.0, min(2.0, self.offset_integral + self.period * offset))
        steer = self._turn(point.curvature, offset)
        roll, torque = self.model.steady_turn(state.speed, -steer)
        errors = (
            state.roll - roll + self.lean_effect * lean,
            steer - state.steer,
            state.roll_rate,
            -state.steer_rate,
            -heading,
            -offset,
            -self.offset_integral,
        )
        ahead, limit = self.turns_ahead(state.speed)
        # the model counts turns to the right
        right = torque - float(self.gains(state.speed) @ np.concatenate([errors, ahead]))
        largest = self.settings.largest_torque
        self._wish(min(speed, limit))
        self.command = (max(-largest, min(largest, -right)), self._driver(state))
        return self.command

    def _follow(self, state: BicycleState) -> tuple[PathPoint, float, float]:
        """The point of the path at the bicycle, and offset (m) and heading (rad) from it, left positive."""
        self.distance, self.offset = self.path.progress(self.distance, state.x, state.y)
        point = self.path.at(self.distance)
        heading = math.remainder(state.yaw - point.heading, 2.0 * math.pi)
        # beyond a metre or half a radian off the path, limit the correction
        return point, max(-1.0, min(1.0, self.offset)), max(-0.5, min(0.5, heading))

    def _turn(self, curvature: float, offset: float) -> float:
        """Steering angle (rad, left positive) of the turn to ride, at an offset (m, left positive) from the path."""
        # beside the path a turn about the same middle has another radius
        curvature /= max(0.5, 1.0 - curvature * offset)
        return math.atan(self.bicycle.wheelbase * curvature) / math.cos(self.bicycle.steer_axis_tilt)

    def _wish(self, speed: float) -> None:
        """Rate-limit the target speed."""
        s = self.settings
        change = max(-s.braking * self.period, min(s.forward_acceleration * self.period, speed - self.target))
        self.target += change
        self.acceleration += (change / self.period - self.acceleration) * self.period / REACTION

    def _driver(self, state: BicycleState) -> float:
        """Force at the wheels: for slope, drag and the wanted acceleration, and against the error of the speed.

        The error's integral is held while the force is at a limit.
        """
        s, bicycle, error = self.settings, self.bicycle, self.target - state.speed
        weight = self._mass * self._gravity
        drag = bicycle.rolling_resistance * weight + 0.5 * AIR_DENSITY * bicycle.drag_area * state.speed**2
        known = self._mass * self.acceleration - weight * math.sin(state.pitch) + drag
        integral = self.speed_integral + self.period * s.speed_integral * error
        force, largest_brake = known + s.speed_gain * error + integral, self._mass * s.largest_brake
        largest_drive = min(s.largest_drive, s.largest_power / max(LOWEST_SPEED, state.speed))
        if -largest_brake < force < largest_drive:
            self.speed_integral = integral
        return max(-largest_brake, min(largest_drive, force))

    def save(self) -> PilotMemory:
        """State without the path."""
        return PilotMemory(
            self.distance,
            self.offset,
            self.offset_integral,
            self.speed_integral,
            self.target,
            self.acceleration,
            self.command,
        )

    def restore(self, memory: PilotMemory) -> None:
        """Undo :meth:`save`."""
        self.distance, self.offset, self.offset_integral = memory.distance, memory.offset, memory.offset_integral
        self.speed_integral, self.target = memory.speed_integral, memory.target
        self.acceleration, self.command = memory.acceleration, memory.command
