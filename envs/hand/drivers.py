"""What moves the hand-held device: :class:`KinematicDriver` follows a gesture exactly, :class:`.ArmDriver` does not.

A driver returns the states of the device in blocks of samples. Estimates do not affect the motion, so sensors and truth
can be computed for many samples at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..sensors.ideal import BodyState
from .motion import Gesture


class States(NamedTuple):
    """States of the device at consecutive samples.

    Attributes:
        now: states ``(n, …)`` at the samples.
        earlier: states ``(n, …)`` one physics step (kinematic: one sample) before each of them.
    """

    now: BodyState
    earlier: BodyState


class MotionDriver(Protocol):
    """Source of the device's motion."""

    block: int
    """Preferred number of samples per block."""

    def start(self, gesture: Gesture, mass_factor: float = 1.0, generator: np.random.Generator | None = None) -> None:
        """Begin a gesture; the next state is that of sample 0. The generator is that of the arm's noise."""
        ...

    def advance(self, samples: int) -> States:
        """The states of the next samples."""
        ...

    def save(self) -> Any:
        """All memory, plain immutable data."""
        ...

    def restore(self, saved: Any) -> None:
        """Continue from saved memory, bitwise."""
        ...


class KinematicDriver:
    """The device follows the gesture exactly; no physics engine is involved.

    Args:
        rate: samples per second, Hz.
    """

    block = 6000

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._gesture: Gesture | None = None
        self._step = 0

    def start(self, gesture: Gesture, mass_factor: float = 1.0, generator: np.random.Generator | None = None) -> None:
        """Begin a gesture; mass and noise of an arm have no effect."""
        self._gesture, self._step = gesture, 0

    def advance(self, samples: int) -> States:
        """The states of the next samples, accelerations included."""
        assert self._gesture is not None
        states = self._gesture.sample(np.arange(self._step - 1, self._step + samples) / self.rate)
        self._step += samples
        return States(states.at(slice(1, None)), states.at(slice(None, -1)))

    def save(self) -> tuple[Gesture | None, int]:
        """All memory, plain immutable data."""
        return self._gesture, self._step

    def restore(self, saved: tuple[Gesture | None, int]) -> None:
        """Continue from saved memory, bitwise."""
        self._gesture, self._step = saved


@dataclass(frozen=True)
class Device:
    """A hand-held controller, a homogeneous box; the origin of the body frame is its centre.

    Attributes:
        mass: kg.
        size: ``(3,)`` extent along the body axes, m.
    """

    mass: float = 0.25
    size: tuple[float, float, float] = (0.16, 0.10, 0.05)

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Moments about the body axes, kg·m²."""
        x, y, z = (side * side for side in self.size)
        return self.mass * (y + z) / 12.0, self.mass * (x + z) / 12.0, self.mass * (x + y) / 12.0
