"""What a rider sees of the path ahead, compiled: how fast it can be ridden, and the changes of the steady turn."""

from __future__ import annotations

import math

import numpy as np

from ....filters.compile.cache import jit
from ..course.path import SPACING

PREVIEW_BIN = 0.1
"""s"""
PREVIEW_BINS = 20
"""preview distance of the rider along the path"""
ANTICIPATED = 3
"""bins of lead of the target speed"""


@jit
def curvature_at(points, distance):  # type: ignore[no-untyped-def]
    """Curvature (1/m) of a path ``(n, 4)`` at an arc length (m); 0 beyond its ends."""
    last = len(points) - 1
    place = distance / SPACING
    if place < 0.0 or place > last:
        return 0.0
    index = min(int(place), last - 1)
    one, two = points[index, 3], points[index + 1, 3]
    return one + (place - index) * (two - one)


@jit
def speed_limits(curvatures, distances, lateral, braking):  # type: ignore[no-untyped-def]
    """The fastest speed ``(n,)`` m/s at each point ahead from which comfortable braking reaches all turns in time.

    v² = lateral acceleration / curvature + 2 · braking · distance, the least over all points beyond.

    Args:
        curvatures: ``(n,)`` of the path ahead, 1/m.
        distances: ``(n,)`` to there, m, rising.
        lateral: comfortable lateral acceleration, m/s².
        braking: comfortable deceleration, m/s².
    """
    limits = np.empty(len(curvatures))
    least = np.inf
    for index in range(len(curvatures) - 1, -1, -1):
        reach = 2.0 * braking * distances[index]
        least = min(least, lateral / max(1e-6, abs(curvatures[index])) + reach)
        limits[index] = math.sqrt(least - reach)
    return limits


@jit
def turns_ahead(points, distance, speed, turn, lateral, braking, changes):  # type: ignore[no-untyped-def]
    """Changes of the steady turn's roll and steer as they will come.

    Args:
        points: ``(n, 4)`` of the path.
        distance: arc length now, m.
        speed: now, m/s, positive.
        turn: steer per curvature (rad·m, right positive), and roll per steer at rest and what a squared speed adds.
        lateral: comfortable lateral acceleration, m/s².
        braking: comfortable deceleration, m/s².
        changes: ``(2 · PREVIEW_BINS,)`` of roll and of steer in each bin of time ahead, rad, right positive;
            overwritten.

    Returns:
        The highest speed (m/s) that will suit the path a reaction later.
    """
    count = PREVIEW_BINS + 1
    distances, curvatures = np.empty(count), np.empty(count)
    for index in range(count):
        distances[index] = speed * PREVIEW_BIN * index
        curvatures[index] = curvature_at(points, distance + distances[index])
    limits = speed_limits(curvatures, distances, lateral, braking)
    times, rolls, steers = np.empty(count), np.empty(count), np.empty(count)
    before = 0.0
    for index in range(count):
        now = min(speed, limits[index])
        # braking delays the arrival
        step = 2.0 * (distances[index] - distances[index - 1]) / (now + before) if index else 0.0
        times[index] = times[index - 1] + step if index else 0.0
        steers[index] = turn[0] * curvatures[index]
        rolls[index] = (turn[1] + turn[2] * now * now) * steers[index]
        before = now
    # roll and steer at the ends of the bins, linear between the points
    place, roll, steer = 0, rolls[0], steers[0]
    for index in range(1, count):
        time = PREVIEW_BIN * index
        while place < count - 2 and times[place + 1] < time:
            place += 1
        part = min(1.0, (time - times[place]) / (times[place + 1] - times[place]))
        next_roll = rolls[place] + part * (rolls[place + 1] - rolls[place])
        next_steer = steers[place] + part * (steers[place + 1] - steers[place])
        changes[index - 1], changes[PREVIEW_BINS + index - 1] = next_roll - roll, next_steer - steer
        roll, steer = next_roll, next_steer
    return limits[ANTICIPATED]
