"""What happens on a ride besides path, speed and ground: gusts and pushes from the side, coasting, the cadence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..frame.parameters import AIR_DENSITY

SAMPLES = 50.0
"""Hz: samples of a force over time"""
SIDE_AREA = 0.9
"""m²: drag coefficient times area of rider and bicycle from the side (round figure of this project)"""


class SideForce:
    """Force on the bicycle from the side over time, linear between samples; nothing after the last one.

    Args:
        values: ``(n,)`` N at :data:`SAMPLES` a second, to the left positive.

    Raises:
        ValueError: values that are not finite.
    """

    def __init__(self, values: np.ndarray) -> None:
        self.values = np.asarray(values, dtype=float)
        if self.values.ndim != 1 or not np.all(np.isfinite(self.values)):
            raise ValueError(f"values must be (n,) finite numbers (N), got shape {self.values.shape}")

    def __call__(self, time: float) -> float:
        """Force (N) at a time (s)."""
        place = time * SAMPLES
        index = int(place)
        if not 0 <= index < len(self.values) - 1:
            return 0.0
        first, second = self.values[index], self.values[index + 1]
        return float(first + (place - index) * (second - first))


@dataclass(frozen=True)
class Events:
    """Events of one ride."""

    side: SideForce | None = None
    """gusts and pushes"""
    coasting: tuple[tuple[float, float], ...] = ()
    """s: begin and end of phases in which the legs rest, unless brakes are needed"""
    cadence: float | None = None
    """rad/s of the crank that the rider prefers, as far as gears allow; None for that of the drivetrain"""

    def coasts(self, time: float) -> bool:
        """Whether the legs rest at a time (s)."""
        return bool(self.coasting) and any(begin <= time < end for begin, end in self.coasting)


def gusts(rng: np.random.Generator, speed: float, duration: float) -> SideForce:
    """Cross wind of a breezy day, and pushes as by passing lorries, for a ride at a mean speed (m/s).

    The wind across is a mean of up to 4 m/s with turbulence of 1.5 m/s (standard deviation, first-order spectrum of 2
    s). A push of 15 to 40 N lasts 0.4 to 1 s and comes every 8 to 16 s. All are round figures of this project.
    """
    size = max(2, math.ceil(duration * SAMPLES) + 1)
    fade = math.exp(-1.0 / (2.0 * SAMPLES))
    wind, noise = np.empty(size), rng.standard_normal(size)
    wind[0] = noise[0]
    for index in range(1, size):
        wind[index] = fade * wind[index - 1] + math.sqrt(1.0 - fade * fade) * noise[index]
    wind = rng.uniform(-4.0, 4.0) + 1.5 * wind
    force = 0.5 * AIR_DENSITY * SIDE_AREA * wind * np.hypot(wind, speed)
    seconds = np.arange(size) / SAMPLES
    time = float(rng.uniform(4.0, 10.0))
    while time < duration:
        length, strength = float(rng.uniform(0.4, 1.0)), float(rng.uniform(15.0, 40.0)) * (1 - 2 * int(rng.integers(2)))
        inside = (seconds >= time) & (seconds < time + length)
        force[inside] += strength * np.sin(math.pi * (seconds[inside] - time) / length)
        time += float(rng.uniform(8.0, 16.0))
    # nothing at the start, so that nobody begins off balance
    return SideForce(force * np.clip(0.5 * seconds, 0.0, 1.0))


def coasting_phases(rng: np.random.Generator, duration: float) -> tuple[tuple[float, float], ...]:
    """Phases of 3 to 7 s without pedalling, 8 to 20 s apart."""
    phases, time = [], float(rng.uniform(5.0, 12.0))
    while time < duration:
        end = time + float(rng.uniform(3.0, 7.0))
        phases.append((time, end))
        time = end + float(rng.uniform(8.0, 20.0))
    return tuple(phases)


def usual_cadence(rng: np.random.Generator) -> float:
    """Cadence that a rider prefers, rad/s: 50 to 100 a minute."""
    return float(rng.uniform(50.0, 100.0)) * math.pi / 30.0
