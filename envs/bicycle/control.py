"""Balance, path and speed: what a rider's nervous system would do.

Steering is a linear-quadratic regulator on the Whipple model of rider and bicycle, extended by heading, offset from the
path and its integral, with gains scheduled on speed. Speed is held by a proportional-integral force at the wheel that
pedalling, or the brake, has to provide.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from .bicycle import BicycleState
from .parameters import BicycleParameters
from .path import Path
from .whipple import WhippleModel, whipple_model

LOWEST_SPEED = 0.3
"""m/s: gains are held below"""
PREVIEW_BIN = 0.1
"""s"""
PREVIEW_BINS = 20
"""how far the pilot looks ahead along the path"""


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
    speed_gain: float = 100.0
    """N/(m/s)"""
    speed_integral: float = 30.0
    """N/m"""
    largest_drive: float = 250.0
    """N at the wheel"""
    largest_brake: float = 150.0
    """N at the wheel"""
    lateral_acceleration: float = 2.0
    """m/s²: the pilot slows down for turns that would need more"""
    forward_acceleration: float = 0.8
    """m/s²: how fast the wanted speed follows changes"""
    rate: float = 250.0
    """Hz"""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            positive = name in ("effort", "largest_torque", "largest_drive", "lateral_acceleration", "rate")
            if not (value > 0.0 if positive else value >= 0.0) or not math.isfinite(value):
                raise ValueError(f"{name} must be {'positive' if positive else 'not negative'} and finite, got {value}")


@dataclass(frozen=True)
class PilotMemory:
    """What a pilot remembers."""

    distance: float
    offset: float
    offset_integral: float
    speed_integral: float
    target: float
    command: tuple[float, float]


def lateral_model(model: WhippleModel, bicycle: BicycleParameters, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Linear model of steering along a path: matrix ``(7, 7)`` and input column ``(7, 1)`` of the steer torque.

    State: roll, steer, roll rate, steer rate, heading error, offset, integral of the offset; all to the right positive.
    """
    cos = math.cos(bicycle.steer_axis_tilt) / bicycle.wheelbase
    A, B = np.zeros((7, 7)), np.zeros((7, 1))
    A[:4, :4] = model.state_matrix(speed)
    A[4, 1], A[4, 3] = speed * cos, bicycle.trail * cos
    A[5, 4] = speed
    A[6, 5] = 1.0
    B[:4, 0] = model.input_matrix()[:, 1]
    return A, B


def regulator(
    model: WhippleModel, bicycle: BicycleParameters, speed: float, settings: ControlSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Feedback and preview gains of the steer torque for one speed, for torques held between control ticks.

    The state is counted from that of the steady turn at the path's curvature, so that changes of curvature disturb it;
    these are known ahead, and the optimal torque answers them before they come (linear-quadratic preview control, M.
    Tomizuka, Optimal continuous finite preview problem, IEEE Trans. Autom. Control 20 (1975)).

    Returns:
        Gains ``(7,)`` on the state, and ``(PREVIEW_BINS,)`` N·m·m on the change of curvature in each bin ahead.
    """
    A, B = lateral_model(model, bicycle, speed)
    step = 1.0 / settings.rate
    block = expm(step * np.block([[A, B], [np.zeros((1, 8))]]))
    A, B = block[:7, :7], block[:7, 7:]
    s = settings
    cost = np.diag([s.roll, s.steer, s.roll_rate, s.steer_rate, s.heading, s.offset, s.offset_integral]) * step
    solution = solve_discrete_are(A, B, cost, np.array([[s.effort * step]]))
    left = np.linalg.solve(s.effort * step + B.T @ solution @ B, B.T)
    gains = left @ solution @ A
    steer = bicycle.wheelbase / math.cos(bicycle.steer_axis_tilt)
    turn = np.array([model.steady_turn(speed, steer)[0], steer, 0.0, 0.0, 0.0, 0.0, 0.0])
    closed, effect = (A - B @ gains).T, -solution @ turn
    each = round(PREVIEW_BIN * settings.rate)
    kernel = np.zeros(PREVIEW_BINS)
    for index in range(PREVIEW_BINS * each):
        kernel[index // each] += (left @ effect).item() / each
        effect = closed @ effect
    return gains[0], kernel


@lru_cache(maxsize=64)
def gain_table(
    bicycle: BicycleParameters, settings: ControlSettings, gravity: float, highest_speed: float
) -> tuple[list[float], np.ndarray]:
    """Speeds (m/s) and, for each, the gains on the state and on the curvature ahead ``(n, 7 + PREVIEW_BINS)``."""
    model = whipple_model(bicycle, gravity)
    slow, fast = np.arange(LOWEST_SPEED, 0.95, 0.1), np.arange(1.0, highest_speed + 0.25, 0.25)
    speeds = [*slow.tolist(), *fast.tolist()]
    return speeds, np.array([np.concatenate(regulator(model, bicycle, speed, settings)) for speed in speeds])


class Pilot:
    """Keeps a bicycle upright, on a path and at a speed.

    Args:
        bicycle: rider included, see :meth:`BicycleParameters.with_load`.
        settings: weights.
        gravity: m/s².
        highest_speed: up to which gains are computed, m/s.
    """

    def __init__(
        self,
        bicycle: BicycleParameters,
        settings: ControlSettings | None = None,
        gravity: float = 9.81,
        highest_speed: float = 7.0,
    ) -> None:
        self.bicycle = bicycle
        self.settings = ControlSettings() if settings is None else settings
        self.model = whipple_model(bicycle, gravity)
        self._grid, self._gains = gain_table(bicycle, self.settings, gravity, highest_speed)
        self._ahead = PREVIEW_BIN * np.arange(PREVIEW_BINS + 1)
        self.period = 1.0 / self.settings.rate
        self.start(Path(np.zeros(2)))

    def start(self, path: Path, speed: float = 0.0) -> None:
        """Begin a ride at the beginning of a path, at a speed (m/s)."""
        self.path, self.distance, self.target = path, 0.0, speed
        self.offset = self.offset_integral = self.speed_integral = 0.0
        self.command = (0.0, 0.0)

    def comfortable_speed(self, path: Path, speed: float) -> float:
        """The most of ``speed`` (m/s) with which to begin a path that may turn soon."""
        ahead = np.abs(path.curvatures(max(speed, LOWEST_SPEED) * self._ahead)).max()
        return min(speed, math.sqrt(self.settings.lateral_acceleration / max(1e-6, float(ahead))))

    def gains(self, speed: float) -> np.ndarray:
        """Interpolated gains: 7 on the state, then those on the curvature ahead."""
        speed = min(max(speed, LOWEST_SPEED), self._grid[-1])
        index = min(bisect_right(self._grid, speed), len(self._grid) - 1)
        low, high = self._grid[index - 1], self._grid[index]
        part = (speed - low) / (high - low)
        return (1.0 - part) * self._gains[index - 1] + part * self._gains[index]

    def update(self, state: BicycleState, speed: float, roll_bias: float = 0.0) -> tuple[float, float]:
        """Decide for the next control period.

        Args:
            state: of the bicycle.
            speed: wanted, m/s; less is ridden in sharp turns.
            roll_bias: rad to add to the roll angle that a steady turn needs, for instance because the rider leans.

        Returns:
            Steer torque (N·m, left positive) and force at the wheel (N, forward positive, braking negative).
        """
        self.distance, self.offset = self.path.progress(self.distance, state.x, state.y)
        point = self.path.at(self.distance)
        heading = math.remainder(state.yaw - point.heading, 2.0 * math.pi)
        # beyond a metre or half a radian off the path, come back steadily instead of ever harder
        offset = max(-1.0, min(1.0, self.offset))
        heading = max(-0.5, min(0.5, heading))
        self.offset_integral = max(-2.0, min(2.0, self.offset_integral + self.period * offset))
        steer = math.atan(self.bicycle.wheelbase * point.curvature) / math.cos(self.bicycle.steer_axis_tilt)
        roll, torque = self.model.steady_turn(state.speed, -steer)
        errors = (
            state.roll - roll - roll_bias,
            steer - state.steer,
            state.roll_rate,
            -state.steer_rate,
            -heading,
            -offset,
            -self.offset_integral,
        )
        ahead = self.path.curvatures(self.distance + max(state.speed, LOWEST_SPEED) * self._ahead)
        # the model counts turns to the right
        right = torque - float(self.gains(state.speed) @ np.concatenate([errors, ahead[:-1] - ahead[1:]]))
        largest = self.settings.largest_torque
        sharpest = max(1e-6, float(np.abs(ahead).max()))
        speed = min(speed, math.sqrt(self.settings.lateral_acceleration / sharpest))
        change = self.period * self.settings.forward_acceleration
        self.target += max(-2.0 * change, min(change, speed - self.target))
        self.command = (max(-largest, min(largest, -right)), self._drive(state.speed, self.target))
        return self.command

    def _drive(self, now: float, wanted: float) -> float:
        """Force at the wheel, its integral held while the force is at a limit."""
        s, error = self.settings, wanted - now
        integral = self.speed_integral + self.period * s.speed_integral * error
        force = s.speed_gain * error + integral
        if -s.largest_brake < force < s.largest_drive:
            self.speed_integral = integral
        return max(-s.largest_brake, min(s.largest_drive, force))

    def save(self) -> PilotMemory:
        """All memory but the path."""
        return PilotMemory(
            self.distance, self.offset, self.offset_integral, self.speed_integral, self.target, self.command
        )

    def restore(self, memory: PilotMemory) -> None:
        """Undo :meth:`save`."""
        self.distance, self.offset, self.offset_integral = memory.distance, memory.offset, memory.offset_integral
        self.speed_integral, self.target, self.command = memory.speed_integral, memory.target, memory.command
