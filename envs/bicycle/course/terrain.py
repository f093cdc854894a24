"""Analytic ground: height and slope everywhere, in closed form, compiled (each wheel needs them in every physics step).

A ground is a table ``(rows, COLUMNS)`` of pieces whose heights add up; the first column of a row says what piece it is,
the others hold its numbers. :func:`height_and_slope` evaluates a table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....filters.compile.cache import jit

COLUMNS = 9
"""of a table"""
LEVEL, BUMP, RAMP, WAVE = 0.0, 1.0, 2.0, 3.0
"""first column: height · middle x, y, cos and sin of the direction, height, length · start x, y, cos, sin, tangent of
the angle, rounding, steep, top · wave numbers along x and y, amplitude, phase"""


@jit
def _climb(s, r, steep):  # type: ignore[no-untyped-def]
    """Height and slope ``s`` metres after the beginning of one rise of slope 1."""
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


@jit
def height_and_slope(table, x, y):  # type: ignore[no-untyped-def]
    """Height (m) and its derivatives along x and y (1) of a table ``(rows, COLUMNS)`` at the world point (x, y)."""
    height = slope_x = slope_y = 0.0
    for index in range(table.shape[0]):
        row = table[index]
        kind = row[0]
        if kind == WAVE:
            angle = row[1] * x + row[2] * y + row[4]
            height += row[3] * math.sin(angle)
            rise = row[3] * math.cos(angle)
            slope_x += row[1] * rise
            slope_y += row[2] * rise
        elif kind == LEVEL:
            height += row[1]
        else:
            along, slope = (x - row[1]) * row[3] + (y - row[2]) * row[4], 0.0
            if kind == BUMP:
                tall, length = row[5], row[6]
                if abs(along) < 0.5 * length:
                    phase = 2.0 * math.pi * along / length
                    height += 0.5 * tall * (1.0 + math.cos(phase))
                    slope = -math.pi * tall / length * math.sin(phase)
            else:
                rounding, steep = row[6], row[7]
                up, up_slope = _climb(along, rounding, steep)
                down, down_slope = _climb(along - 2.0 * rounding - steep - row[8], rounding, steep)
                height += row[5] * (up - down)
                slope = row[5] * (up_slope - down_slope)
            slope_x += slope * row[3]
            slope_y += slope * row[4]
    return height, slope_x, slope_y


class Ground:
    """Height of the ground over the horizontal plane: a sum of the pieces in :attr:`table`."""

    @cached_property
    def table(self) -> np.ndarray:
        """Its pieces ``(rows, COLUMNS)``."""
        raise NotImplementedError

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """Height (m) and its derivatives along x and y (1) at the world point (x, y)."""
        found: tuple[float, float, float] = height_and_slope(self.table, float(x), float(y))
        return found


def _row(kind: float, *numbers: float) -> list[float]:
    return [kind, *numbers, *[0.0] * (COLUMNS - 1 - len(numbers))]


@dataclass(frozen=True)
class FlatGround(Ground):
    """A level plane."""

    height: float = 0.0
    """m"""

    @cached_property
    def table(self) -> np.ndarray:
        """See :class:`Ground`."""
        return np.array([_row(LEVEL, self.height)])


@dataclass(frozen=True)
class Bump(Ground):
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

    @cached_property
    def table(self) -> np.ndarray:
        """See :class:`Ground`."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        return np.array([_row(BUMP, *self.start, c, s, self.height, self.length)])


@dataclass(frozen=True)
class Ramp(Ground):
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

    @cached_property
    def table(self) -> np.ndarray:
        """See :class:`Ground`."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        numbers = (*self.start, c, s, math.tan(self.angle), self.rounding, self.steep, self.top)
        return np.array([_row(RAMP, *numbers)])


@dataclass(frozen=True)
class RoughGround(Ground):
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

    @cached_property
    def table(self) -> np.ndarray:
        """See :class:`Ground`."""
        waves = zip(self.wave_numbers, self.amplitudes, self.phases, strict=True)
        return np.array([_row(WAVE, *numbers, amplitude, phase) for numbers, amplitude, phase in waves])


class GroundSum(Ground):
    """Several grounds on top of each other, for instance bumps on paving."""

    def __init__(self, grounds: Sequence[Ground]) -> None:
        self.grounds = tuple(grounds)

    @cached_property
    def table(self) -> np.ndarray:
        """See :class:`Ground`."""
        tables = [ground.table for ground in self.grounds]
        return np.concatenate([np.zeros((0, COLUMNS)), *tables])
