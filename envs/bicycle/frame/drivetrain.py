"""Chain and freewheel between crank and rear wheel."""

from __future__ import annotations

import math

import numpy as np

from ....filters.compile.cache import jit
from .parameters import DriveParameters

SLOW_CADENCE, FAST_CADENCE = 4.2, 8.5
"""rad/s (40 and 81 a minute): where a rider shifts down and up"""
SHIFT_PAUSE = 1.0
"""s between two shifts"""
AROUND_CADENCE = 1.25
"""1: part by which the cadence of a rider with a preference exceeds or misses it before a shift"""


@jit
def chain_torque(chain, crank, crank_rate, wheel, wheel_rate):  # type: ignore[no-untyped-def]
    """Torque on the rear wheel (N·m, not negative); the crank feels −ratio times it. To be called once a step.

    Args:
        chain: ratio, angle by which the wheel has run ahead (rad, updated), time of the last shift (s), stiffness
            (N·m/rad) and damping (N·m·s/rad).
        crank: angle, rad, growing when pedalling forward.
        crank_rate: rad/s.
        wheel: angle, rad, growing when rolling forward.
        wheel_rate: rad/s.
    """
    twist = chain[0] * crank - wheel - chain[1]
    if twist <= 0.0:
        chain[1] += twist
        return 0.0
    return max(0.0, chain[3] * twist + chain[4] * (chain[0] * crank_rate - wheel_rate))


class Drivetrain:
    """A chain as a one-way torsional spring with damping: it pulls, and slips freely when the wheel overtakes.

    The torque follows from the twist between the crank (times the ratio) and the wheel. The torques on crank and wheel,
    with their reactions on the frame, are those of a chain tension tangent to both sprockets.

    Args:
        parameters: gears, stiffness and damping.
    """

    def __init__(self, parameters: DriveParameters) -> None:
        self.parameters = parameters
        stiffness, damping = parameters.chain_stiffness, parameters.chain_damping
        self.prefer(None)
        self.chain = np.array([parameters.gears[0], 0.0, -math.inf, stiffness, damping])
        """of :func:`chain_torque`"""

    @property
    def ratio(self) -> float:
        """Revolutions of the wheel per revolution of the crank."""
        return float(self.chain[0])

    @property
    def slipped(self) -> float:
        """Angle by which the wheel has run ahead, rad."""
        return float(self.chain[1])

    def engage(self, crank: float, wheel: float, ratio: float | None = None) -> None:
        """Begin with the chain just taut, at these angles (rad), in a gear (None: the present one)."""
        ratio = self.ratio if ratio is None else ratio
        self.chain[:3] = ratio, ratio * crank - wheel, -math.inf

    def prefer(self, cadence: float | None) -> None:
        """Choose gears around a cadence (rad/s); None for the middle of the comfortable range."""
        self._slow, self._fast = SLOW_CADENCE, FAST_CADENCE
        if cadence is not None:
            self._slow, self._fast = cadence / AROUND_CADENCE, cadence * AROUND_CADENCE

    def gear_for(self, wheel_rate: float) -> float:
        """Ratio that brings the cadence nearest to the middle of the comfortable range."""
        middle = math.sqrt(self._slow * self._fast)
        return min(self.parameters.gears, key=lambda ratio: abs(math.log(max(1e-3, wheel_rate) / ratio / middle)))

    def next_gear(self, time: float, wheel_rate: float) -> float | None:
        """Ratio of the next gear if the cadence at ``wheel_rate`` (rad/s) is too slow or fast; None to stay."""
        ratio, _, shifted = self.chain[:3].tolist()
        cadence = wheel_rate / ratio
        higher = cadence > self._fast
        if time < shifted + SHIFT_PAUSE or not (higher or cadence < self._slow):
            return None
        gears = self.parameters.gears
        index = gears.index(ratio) + (1 if higher else -1)
        return gears[index] if 0 <= index < len(gears) else None

    def shift(self, time: float, crank: float, wheel: float, ratio: float) -> None:
        """Change to the gear of another ratio at these angles (rad); the chain falls just taut on the new sprocket."""
        self.engage(crank, wheel, ratio)
        self.chain[2] = time

    def save(self) -> tuple[float, float, float]:
        """Memory."""
        ratio, slipped, shifted = self.chain[:3].tolist()
        return ratio, slipped, shifted

    def restore(self, memory: tuple[float, float, float]) -> None:
        """Undo :meth:`save`."""
        self.chain[:3] = memory
