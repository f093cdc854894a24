"""Analytic ground: height and slope everywhere, in closed form, for plain floats (one wheel, every physics step)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Ground(Protocol):
    """Height of the ground over the horizontal plane."""

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """Height (m) and its derivatives along x and y (1) at the world point (x, y)."""
        ...


@dataclass(frozen=True)
class FlatGround:
    """A level plane."""

    height: float = 0.0
    """m"""

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """See :class:`Ground`."""
        return self.height, 0.0, 0.0


@dataclass(frozen=True)
class Bump:
    """A straight cosine bump across a road.

    Raises:
        ValueError: a length that is not positive, or a bump with slopes steeper than 45°.
    """

    start: tuple[float, float]
    """m: a world point (x, y) on its middle line"""
    direction: float
    """rad: heading of the road, counter-clockwise from east"""
    height: float = 0.04
    """m"""
    length: float = 0.5
    """m along the road"""

    def __post_init__(self) -> None:
        if not (self.length > 0.0 and math.pi * abs(self.height) < self.length):
            raise ValueError(f"a bump needs π |height| < length, got {self.height} m over {self.length} m")

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """See :class:`Ground`."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        along = (x - self.start[0]) * c + (y - self.start[1]) * s
        if abs(along) >= 0.5 * self.length:
            return 0.0, 0.0, 0.0
        phase = 2.0 * math.pi * along / self.length
        slope = -math.pi * self.height / self.length * math.sin(phase)
        return 0.5 * self.height * (1.0 + math.cos(phase)), slope * c, slope * s


@dataclass(frozen=True)
class Ramp:
    """A road that climbs and comes down again along one direction, its slope rounded.

    The slope rises smoothly over ``rounding`` metres to tan(angle), stays, and falls back to zero; after ``top`` level
    metres the same happens downwards.

    Raises:
        ValueError: a length that is not positive, or an angle of 45° or more.
    """

    start: tuple[float, float]
    """m: a world point (x, y) where the climb begins"""
    direction: float
    """rad: heading of the road, counter-clockwise from east"""
    angle: float = math.radians(20.0)
    """rad: steepest pitch"""
    rounding: float = 2.0
    """m"""
    steep: float = 1.0
    """m of full slope"""
    top: float = 3.0
    """m of level road above"""

    def __post_init__(self) -> None:
        if not (self.rounding > 0.0 and self.steep >= 0.0 and self.top >= 0.0 and abs(self.angle) < math.pi / 4.0):
            raise ValueError(
                f"a ramp needs lengths that are not negative and less than 45°, got {self.rounding}, {self.steep}, "
                f"{self.top} m and {math.degrees(self.angle):.0f}°"
            )

    def _climb(self, s: float) -> tuple[float, float]:
        """Height and slope ``s`` metres after the beginning of one rise of slope 1."""
        r, steep = self.rounding, self.steep
        if s <= 0.0:
            return 0.0, 0.0
        if s < r:
            return 0.5 * (s - r / math.pi * math.sin(math.pi * s / r)), 0.5 * (1.0 - math.cos(math.pi * s / r))
        if s < r + steep:
            return 0.5 * r + s - r, 1.0
        s -= r + steep
        if s < r:
            rise = 0.5 * (s + r / math.pi * math.sin(math.pi * s / r))
            return 0.5 * r + steep + rise, 0.5 * (1.0 + math.cos(math.pi * s / r))
        return r + steep, 0.0

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """See :class:`Ground`."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        along = (x - self.start[0]) * c + (y - self.start[1]) * s
        up, up_slope = self._climb(along)
        down, down_slope = self._climb(along - 2.0 * self.rounding - self.steep - self.top)
        steepness = math.tan(self.angle)
        slope = steepness * (up_slope - down_slope)
        return steepness * (up - down), slope * c, slope * s


@dataclass(frozen=True)
class RoughGround:
    """Random uneven paving: plane waves of random directions and phases.

    Elevation falls with wave number as 1/n² in power density, as on roads (ISO 8608, waviness 2).
    """

    wave_numbers: tuple[tuple[float, float], ...]
    """rad/m along x and y, one pair a wave"""
    amplitudes: tuple[float, ...]
    """m"""
    phases: tuple[float, ...]
    """rad"""

    @classmethod
    def random(
        cls,
        rng: np.random.Generator,
        deviation: float = 0.002,
        shortest: float = 0.3,
        longest: float = 5.0,
        waves: int = 12,
    ) -> RoughGround:
        """Draw a ground.

        Args:
            rng: source of randomness.
            deviation: root mean square of the height, m.
            shortest: shortest wavelength, m; below the length of a tyre's contact a point contact is too rough.
            longest: longest wavelength, m.
            waves: how many.

        Raises:
            ValueError: no waves, a negative deviation, or wavelengths that are not ordered and positive.
        """
        if not (waves > 0 and deviation >= 0.0 and 0.0 < shortest < longest):
            raise ValueError(
                f"need waves > 0, deviation ≥ 0 and 0 < shortest < longest, got {waves}, {deviation}, {shortest}, "
                f"{longest}"
            )
        edges = np.geomspace(2.0 * math.pi / longest, 2.0 * math.pi / shortest, waves + 1)
        numbers = np.exp(rng.uniform(np.log(edges[:-1]), np.log(edges[1:])))
        directions, phases = rng.uniform(0.0, 2.0 * math.pi, (2, waves))
        amplitudes = np.sqrt(np.diff(edges)) / numbers
        amplitudes *= deviation / math.sqrt(0.5 * float(amplitudes @ amplitudes))
        vectors = numbers[:, None] * np.stack([np.cos(directions), np.sin(directions)], axis=1)
        return cls(tuple(map(tuple, vectors.tolist())), tuple(amplitudes.tolist()), tuple(phases.tolist()))

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """See :class:`Ground`."""
        height = slope_x = slope_y = 0.0
        for (kx, ky), amplitude, phase in zip(self.wave_numbers, self.amplitudes, self.phases, strict=True):
            angle = kx * x + ky * y + phase
            height += amplitude * math.sin(angle)
            rise = amplitude * math.cos(angle)
            slope_x += kx * rise
            slope_y += ky * rise
        return height, slope_x, slope_y


class GroundSum:
    """Several grounds on top of each other, for instance bumps on paving."""

    def __init__(self, grounds: Sequence[Ground]) -> None:
        self.grounds = tuple(grounds)

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """See :class:`Ground`."""
        height = slope_x = slope_y = 0.0
        for ground in self.grounds:
            h, sx, sy = ground.height_and_slope(x, y)
            height += h
            slope_x += sx
            slope_y += sy
        return height, slope_x, slope_y
