"""The motion driver of a device that an arm pulls along a gesture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from ...sensors.ideal import BodyState
from ..drivers import Device, States
from ..motion import Gesture
from ..parts.noise import Noise
from .arm import Arm

NOISE_BAND = (0.5, 12.0)
"""Hz, of the noise of muscles: what is faster they do not follow"""
CLEARANCE = 0.01
"""m, at least, between the device at the start and the table"""


class ArmDriver:
    """The device is pulled along the gesture by an arm: it lags, shakes, rings, and bumps into a table.

    Args:
        rate: samples per second, Hz.
        device: what is moved.
        arm: what moves it.
        planar: the noise stays in the plane of east and up.
        longest_step: upper bound of the physics step, s.
        gravity: m/s².
    """

    block = 500

    def __init__(
        self,
        rate: float,
        device: Device | None = None,
        arm: Arm | None = None,
        *,
        planar: bool = False,
        longest_step: float = 5e-4,
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        # imported here, because kinematic motion does not need the compiler
        from .kernel import pulled

        self.rate, self.device, self.arm, self.gravity = rate, device or Device(), arm or Arm(), gravity
        self.substeps = max(1, math.ceil(1.0 / (rate * longest_step) - 1e-9))
        self.time_step = 1.0 / (rate * self.substeps)
        self._pulled = pulled
        # force along east and up, torque about north
        self._axes = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0]) if planar else np.ones(6)
        self._gesture: Gesture | None = None
        self._noise: Noise | None = None
        self._mass_factor, self._step = 1.0, 0
        self._table = -math.inf
        self._state = np.zeros(13)
        self._late = np.zeros((max(1, round(self.arm.delay / self.time_step)), 12))

    def start(self, gesture: Gesture, mass_factor: float = 1.0, generator: np.random.Generator | None = None) -> None:
        """Begin a gesture, without noise if there is no generator; the arm does not know the factor of the mass."""
        self._gesture, self._mass_factor, self._step = gesture, mass_factor, 0
        self._late = np.zeros_like(self._late)
        self._noise = None
        if generator is not None and self.arm.noise:
            length = gesture.duration + 1.0
            drawn = Noise.draw(generator, length, NOISE_BAND, 1.0, derivative=0, size=6, start=-0.5)
            self._noise = drawn.scaled(self._axes)
        first = gesture.sample(np.zeros(1))
        self._state = np.concatenate(
            [first.position[0], first.orientation[0], first.velocity[0], first.angular_velocity[0]]
        )
        self._table = -math.inf
        if self.arm.table is not None:
            reach = 0.5 * np.abs(rotation.to_matrix(first.orientation[0])[2]) @ np.array(self.device.size)
            self._table = float(first.position[0, 2] - max(self.arm.table, reach + CLEARANCE))

    def advance(self, samples: int) -> States:
        """The states of the next samples; accelerations are unknown (None)."""
        assert self._gesture is not None
        h, rows = self.time_step, []
        if self._step == 0:
            # at rest, or as the gesture moves there
            before = self._gesture.sample(np.array([-h]))
            earlier = np.concatenate([field[0] for field in before[1:5]])
            rows.append(np.stack([earlier, self._state])[None])
        count = samples - len(rows)
        start = (self._step + len(rows) - 1) * self.substeps
        if count:
            states = np.concatenate([self._state[None], self._follow(start, count * self.substeps)])
            ends = np.arange(1, count + 1) * self.substeps
            rows.append(np.stack([states[ends - 1], states[ends]], axis=1))
        times = np.arange(self._step, self._step + samples) / self.rate
        self._step += samples
        whole = np.concatenate(rows)
        earlier_states, now = (
            BodyState(at, side[:, :3], side[:, 3:7], side[:, 7:10], side[:, 10:13])
            for at, side in ((times - h, whole[:, 0]), (times, whole[:, 1]))
        )
        return States(now, earlier_states)

    def _follow(self, start: int, steps: int) -> np.ndarray:
        """States after each of ``steps`` physics steps from number ``start`` on."""
        assert self._gesture is not None
        times = (start + np.arange(steps)) * self.time_step
        wanted = self._gesture.sample(times)
        noise = np.zeros((steps, 6)) if self._noise is None else self._noise.sample(times)[0]
        assert wanted.acceleration is not None
        assert wanted.angular_acceleration is not None
        reference = np.concatenate(
            [
                *(wanted.position, wanted.velocity, wanted.acceleration),
                *(wanted.orientation, wanted.angular_velocity, wanted.angular_acceleration, noise),
            ],
            axis=1,
        )
        states = np.empty((steps, 13))
        device, state, late = self.device, self._state.copy(), self._late.copy()
        parameters = self.arm.parameters(device.mass, device.inertia, self._mass_factor, self.gravity, self._table)
        half = 0.5 * np.array(device.size)
        self._pulled(state, late, start, reference, half, parameters, self.time_step, states)
        self._state, self._late = state, late
        return states

    def save(self) -> tuple[Any, ...]:
        """All memory; arrays in it are never changed."""
        return self._gesture, self._noise, self._mass_factor, self._step, self._table, self._state, self._late

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Continue from saved memory, bitwise."""
        self._gesture, self._noise, self._mass_factor, self._step, self._table, self._state, self._late = saved
