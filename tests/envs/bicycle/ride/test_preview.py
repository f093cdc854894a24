"""Compiled preview against the same definitions over arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from poise.envs.bicycle.course.path import Path, wandering_path
from poise.envs.bicycle.ride.preview import ANTICIPATED, PREVIEW_BIN, PREVIEW_BINS, curvature_at, turns_ahead

LATERAL, BRAKING = 2.0, 1.5
TURN = (-1.1, -0.4, -0.15)
"""steer per curvature, roll per steer at rest, and what a squared speed adds"""


def expected(path: Path, distance: float, speed: float) -> tuple[np.ndarray, float]:
    """Changes of roll and steer in each bin and the speed limit, by interpolation of arrays."""
    ahead = PREVIEW_BIN * np.arange(PREVIEW_BINS + 1)
    distances = speed * ahead
    curvatures = path.curvatures(distance + distances)
    reach = 2.0 * BRAKING * distances
    least = np.minimum.accumulate((LATERAL / np.maximum(1e-6, np.abs(curvatures)) + reach)[::-1])[::-1]
    limits = np.sqrt(least - reach)
    speeds = np.minimum(speed, limits)
    times = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(distances) / (speeds[1:] + speeds[:-1]))])
    steers = TURN[0] * curvatures
    rolls = (TURN[1] + TURN[2] * speeds**2) * steers
    return np.concatenate([np.diff(np.interp(ahead, times, each)) for each in (rolls, steers)]), limits[ANTICIPATED]


@pytest.mark.parametrize("speed", [0.3, 2.0, 6.0])
def test_turns_ahead_are_those_of_the_steady_turn(speed):
    path = wandering_path(np.random.default_rng(1), 120.0)
    changes = np.empty(2 * PREVIEW_BINS)
    for distance in np.linspace(0.0, 125.0, 300):
        limit = turns_ahead(path.points, distance, speed, TURN, LATERAL, BRAKING, changes)
        wanted, wanted_limit = expected(path, distance, speed)
        np.testing.assert_allclose(changes, wanted, atol=1e-12)
        assert limit == pytest.approx(wanted_limit)


def test_curvature_ends_with_the_path():
    path = Path(np.linspace(0.1, 0.3, 11))
    places = np.linspace(-0.1, 0.35, 46)
    found = [curvature_at(path.points, place) for place in places]
    np.testing.assert_allclose(found, path.curvatures(places), atol=1e-12)
    assert math.isclose(curvature_at(path.points, path.length), 0.3)
