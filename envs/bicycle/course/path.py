"""Paths on the horizontal plane, given by their curvature over arc length."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit

SPACING = 0.02
"""m between the points that a path keeps"""


RUN_UP = 12.0
"""m over which a random path begins to turn"""


class PathPoint(NamedTuple):
    """One point of a path."""

    x: float
    """m, world"""
    y: float
    heading: float
    """rad, counter-clockwise from east, not wrapped"""
    curvature: float
    """1/m, left positive"""


@jit
def point_at(points, distance):  # type: ignore[no-untyped-def]
    """x, y (m), heading (rad) and curvature (1/m) of a path ``(n, 4)`` at an arc length (m); it goes on straight."""
    last = len(points) - 1
    place = distance / SPACING
    if place <= 0.0 or place >= last:
        row = points[0 if place <= 0.0 else last]
        over = distance if place <= 0.0 else distance - last * SPACING
        return row[0] + over * math.cos(row[2]), row[1] + over * math.sin(row[2]), row[2], 0.0
    index = int(place)
    part = place - index
    one, two = points[index], points[index + 1]
    return (
        one[0] + part * (two[0] - one[0]),
        one[1] + part * (two[1] - one[1]),
        one[2] + part * (two[2] - one[2]),
        one[3] + part * (two[3] - one[3]),
    )


@jit
def nearest(points, distance, x, y):  # type: ignore[no-untyped-def]
    """Arc length (m) of the point of a path nearest to (x, y), and how far (m) that lies to the left of the path there.

    Args:
        points: ``(n, 4)`` of the path.
        distance: a guess near the answer, for instance the last one.
        x: m, world.
        y: m, world.
    """
    left = 0.0
    for _ in range(2):
        px, py, heading, curvature = point_at(points, distance)
        c, s = math.cos(heading), math.sin(heading)
        dx, dy = x - px, y - py
        left = c * dy - s * dx
        distance += (c * dx + s * dy) / max(0.2, 1.0 - curvature * left)
    return distance, left


class Path:
    """A path with continuous curvature, straight beyond its end.

    Args:
        curvature: ``(n,)`` 1/m at points ``SPACING`` apart along the path, left positive.
        start: x, y (m) and heading (rad) of the first point.

    Raises:
        ValueError: fewer than two points, or a curvature that is not finite.
    """

    def __init__(self, curvature: np.ndarray, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        curvature = np.asarray(curvature, dtype=float)
        if curvature.ndim != 1 or len(curvature) < 2 or not np.all(np.isfinite(curvature)):
            raise ValueError(f"curvature must be (n ≥ 2,) finite numbers, got shape {curvature.shape}")
        turn = 0.5 * SPACING * (curvature[1:] + curvature[:-1])
        heading = start[2] + np.concatenate([[0.0], np.cumsum(turn)])
        # the middle heading of each piece: exact to third order in its turn
        middle = 0.5 * (heading[1:] + heading[:-1])
        x = start[0] + np.concatenate([[0.0], np.cumsum(SPACING * np.cos(middle))])
        y = start[1] + np.concatenate([[0.0], np.cumsum(SPACING * np.sin(middle))])
        self.points = np.stack([x, y, heading, curvature], axis=1)

    @property
    def length(self) -> float:
        """Arc length, m."""
        return SPACING * (len(self.points) - 1)

    def at(self, distance: float) -> PathPoint:
        """The point at an arc length (m); beyond its ends the path is straight."""
        return PathPoint(*point_at(self.points, float(distance)))

    def curvatures(self, distances: np.ndarray) -> np.ndarray:
        """Curvature ``(n,)`` at several arc lengths (m), 1/m."""
        places = np.asarray(distances) / SPACING
        return np.interp(places, np.arange(len(self.points)), self.points[:, 3], left=0.0, right=0.0)

    def progress(self, distance: float, x: float, y: float) -> tuple[float, float]:
        """See :func:`nearest`."""
        found: tuple[float, float] = nearest(self.points, distance, x, y)
        return found


def smooth_curvature(curvature: Callable[[np.ndarray], np.ndarray], length: float, blend: float = 1.0) -> np.ndarray:
    """Curvature (1/m) at the points of a path of some length, averaged over ``blend`` (m) so that it has no jumps.

    ``curvature`` is a function of arc length ``(n,)``, m.

    Raises:
        ValueError: a length that is not positive.
    """
    if not (length > 0.0 and blend > 0.0):
        raise ValueError(f"length and blend must be positive (m), got {length} and {blend}")
    half = max(1, round(0.5 * blend / SPACING))
    distances = SPACING * np.arange(-2 * half, math.ceil(length / SPACING) + 2 * half + 1)
    values = curvature(distances)
    window = np.hanning(2 * half + 1 + 2)[1:-1]
    return np.convolve(values, window / window.sum(), "same")[2 * half : -2 * half]


def wandering_path(
    rng: np.random.Generator,
    length: float,
    size: tuple[float, float] = (50.0, 40.0),
    smallest_radius: float = 4.0,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    widest_radius: float | None = None,
    shortest_leg: float = 0.0,
) -> Path:
    """A random ride inside a rectangle around the origin, from one random goal to the next.

    Args:
        rng: source of randomness.
        length: m.
        size: of the rectangle, m.
        smallest_radius: of the turns, m.
        start: x, y (m) and heading (rad) of the first point.
        widest_radius: the radius of each turn is drawn between both, and less wide where a wall is near, m; None for
            the smallest always.
        shortest_leg: from one goal to the next, m.

    Raises:
        ValueError: a rectangle narrower than four turns or half a leg, or radii that are not ordered.
    """
    if not (4.0 * smallest_radius <= min(size) and smallest_radius > 0.0):
        raise ValueError(f"a rectangle of {size} m has no room for turns of {smallest_radius} m")
    widest = smallest_radius if widest_radius is None else widest_radius
    if not smallest_radius <= widest < math.inf:
        raise ValueError(f"widest_radius must be at least {smallest_radius} m and finite, got {widest_radius}")
    inner = 0.5 * np.array(size) - 1.3 * smallest_radius
    # every point of the inner rectangle has a corner at least this far away
    if not 0.0 <= shortest_leg <= 0.95 * math.hypot(*inner):
        raise ValueError(f"shortest_leg must lie in [0, {0.95 * math.hypot(*inner):.0f}] m, got {shortest_leg}")
    x, y, heading = start

    def next_goal() -> tuple[np.ndarray, float]:
        goal = rng.uniform(-inner, inner)
        while math.hypot(goal[0] - x, goal[1] - y) < shortest_leg:
            goal = rng.uniform(-inner, inner)
        room = float((0.5 * np.array(size) - np.abs([x, y])).min())
        if widest == smallest_radius:
            return goal, smallest_radius
        return goal, max(smallest_radius, min(float(rng.uniform(smallest_radius, widest)), 0.4 * room))

    # the straight beginning has used some of the length
    goal, radius = next_goal()[0], smallest_radius
    values = np.empty(max(2, math.ceil(length / SPACING) + 1))
    index, curvature, reached = 0, 0.0, goal
    while index < len(values):
        limits = (radius, smallest_radius, *inner.tolist())
        index, curvature, x, y, heading = _ride_to(values, index, curvature, x, y, heading, goal, reached, limits)
        if index < len(values):
            reached, (goal, radius) = goal, next_goal()
    return Path(values, start)


@jit
def _ride_to(values, index, curvature, x, y, heading, goal, reached, limits):  # type: ignore[no-untyped-def]
    """Ride towards a goal until it is near; returns the index reached, and curvature, position and heading there.

    Args:
        values: ``(n,)`` curvatures, written from ``index`` on.
        index: where the ride goes on.
        curvature: there, 1/m.
        x: there, m.
        y: there, m.
        heading: there, rad.
        goal: ``(2,)`` m.
        reached: the goal that is left here, towards which the first step still goes; the same at the start of a ride.
        limits: wanted and smallest radius of turns, half length and half width of the inner rectangle, m.
    """
    radius, smallest, inner_x, inner_y = limits
    for place in range(index, len(values)):
        dx, dy = goal[0] - x, goal[1] - y
        if place == index and index > 0:
            dx, dy = reached[0] - x, reached[1] - y
        elif dx * dx + dy * dy < (1.2 * smallest) ** 2:
            return place, curvature, x, y, heading
        values[place] = curvature
        bearing = math.atan2(dy, dx) - heading
        bearing -= 2.0 * math.pi * np.round(bearing / (2.0 * math.pi))
        # a ride begins straight
        onset = min(1.0, place * SPACING / RUN_UP)
        sharpest = onset / radius
        # near a wall, or for a goal inside the circle of the present turn, a tighter turn is needed
        if dx * dx + dy * dy < (2.0 * radius) ** 2 or abs(x) > inner_x or abs(y) > inner_y:
            sharpest = max(sharpest, onset / smallest)
        wanted = max(-sharpest, min(sharpest, 0.5 * bearing))
        # a rider changes the steering angle over one or two metres
        curvature += (wanted - curvature) * SPACING / 1.2
        heading += curvature * SPACING
        x, y = x + math.cos(heading) * SPACING, y + math.sin(heading) * SPACING
    return len(values), curvature, x, y, heading
