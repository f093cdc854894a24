"""The ground: height and slope everywhere, compiled (each wheel needs them in every physics step).

A ground is a table of pieces whose heights add up; :func:`height_and_slope` evaluates it. Slopes are the
exact derivatives of the height, so that a wheel neither gains nor loses energy on an undulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....filters.compile.cache import jit

COLUMNS = 9
"""of the pieces of a table"""
LEVEL, BUMP, RAMP = 0.0, 1.0, 2.0
"""first column: height · middle x, y, cos and sin of the direction, height, length · start x, y, cos, sin, tangent of
the angle, rounding, steep, top"""
CELLS = 512
"""cells of a tile of rough surface along each side"""
SPACING = 0.02
"""m: side of a cell. A tile of 10.24 m repeats itself in both directions"""


GroundTable = tuple[np.ndarray, np.ndarray]
"""Pieces ``(rows, COLUMNS)``, whose first column says what piece it is and the others hold its numbers, and tiles
``(n, CELLS, CELLS)`` in m: coefficients of cubic B-splines, one every :data:`SPACING` along x and y."""


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
def _rough(tile, x, y):  # type: ignore[no-untyped-def]
    """Height and its derivatives of a tile ``(CELLS, CELLS)``: uniform cubic B-splines along x and along y."""
    place_x, place_y = x / SPACING, y / SPACING
    i, j = math.floor(place_x), math.floor(place_y)
    u, v = place_x - i, place_y - j
    # the four splines around the point, and their derivatives
    rises = ((1.0 - v) ** 3 / 6.0, 2.0 / 3.0 - v**2 + 0.5 * v**3, 0.0, v**3 / 6.0)
    rises = (rises[0], rises[1], 1.0 - rises[0] - rises[1] - rises[3], rises[3])
    tilts = (-0.5 * (1.0 - v) ** 2, 1.5 * v**2 - 2.0 * v, 0.5 + v - 1.5 * v**2, 0.5 * v**2)
    along = ((1.0 - u) ** 3 / 6.0, 2.0 / 3.0 - u**2 + 0.5 * u**3, 0.0, u**3 / 6.0)
    along = (along[0], along[1], 1.0 - along[0] - along[1] - along[3], along[3])
    slopes = (-0.5 * (1.0 - u) ** 2, 1.5 * u**2 - 2.0 * u, 0.5 + u - 1.5 * u**2, 0.5 * u**2)
    height = slope_x = slope_y = 0.0
    for a in range(4):
        row = tile[(i - 1 + a) % CELLS]
        value = tilt = 0.0
        for b in range(4):
            knot = row[(j - 1 + b) % CELLS]
            value += rises[b] * knot
            tilt += tilts[b] * knot
        height += along[a] * value
        slope_x += slopes[a] * value / SPACING
        slope_y += along[a] * tilt / SPACING
    return height, slope_x, slope_y


@jit
def height_and_slope(table, x, y):  # type: ignore[no-untyped-def]
    """Height (m) and its derivatives along x and y (1) of a :data:`GroundTable` at the world point (x, y)."""
    pieces, tiles = table
    height = slope_x = slope_y = 0.0
    for index in range(tiles.shape[0]):
        rough, tilt_x, tilt_y = _rough(tiles[index], x, y)
        height += rough
        slope_x += tilt_x
        slope_y += tilt_y
    for index in range(pieces.shape[0]):
        row = pieces[index]
        kind = row[0]
        if kind == LEVEL:
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
    def table(self) -> GroundTable:
        """Its pieces."""
        raise NotImplementedError(f"{type(self).__name__} must define its table")

    def height_and_slope(self, x: float, y: float) -> tuple[float, float, float]:
        """Height (m) and its derivatives along x and y (1) at the world point (x, y)."""
        found: tuple[float, float, float] = height_and_slope(self.table, float(x), float(y))
        return found


def _piece(kind: float, *numbers: float) -> GroundTable:
    row = [kind, *numbers, *[0.0] * (COLUMNS - 1 - len(numbers))]
    return np.array([row]), np.zeros((0, CELLS, CELLS))


@dataclass(frozen=True)
class FlatGround(Ground):
    """A level plane."""

    height: float = 0.0
    """m"""

    @cached_property
    def table(self) -> GroundTable:
        """See :class:`Ground`."""
        return _piece(LEVEL, self.height)


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
    def table(self) -> GroundTable:
        """See :class:`Ground`."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        return _piece(BUMP, *self.start, c, s, self.height, self.length)


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
    def table(self) -> GroundTable:
        """See :class:`Ground`."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        return _piece(RAMP, *self.start, c, s, math.tan(self.angle), self.rounding, self.steep, self.top)


class RoughTile(Ground):
    """A height map that repeats itself every ``CELLS · SPACING`` metres along x and y.

    Args:
        coefficients: ``(CELLS, CELLS)`` m, of cubic B-splines; :mod:`.surfaces` draws them.

    Raises:
        ValueError: another shape, or a number that is not finite.
    """

    def __init__(self, coefficients: np.ndarray) -> None:
        if np.shape(coefficients) != (CELLS, CELLS) or not np.all(np.isfinite(coefficients)):
            raise ValueError(f"coefficients must be {CELLS} × {CELLS} finite heights, got {np.shape(coefficients)}")
        self.coefficients = np.ascontiguousarray(coefficients, dtype=float)

    @cached_property
    def table(self) -> GroundTable:
        """See :class:`Ground`."""
        return np.zeros((0, COLUMNS)), self.coefficients[None]


class GroundSum(Ground):
    """Several grounds on top of each other, for instance bumps on paving."""

    def __init__(self, grounds: Sequence[Ground]) -> None:
        self.grounds = tuple(grounds)

    @cached_property
    def table(self) -> GroundTable:
        """See :class:`Ground`."""
        pieces, tiles = zip(*(ground.table for ground in self.grounds), strict=True) if self.grounds else ((), ())
        return (
            np.concatenate([np.zeros((0, COLUMNS)), *pieces]),
            np.concatenate([np.zeros((0, CELLS, CELLS)), *tiles]),
        )
