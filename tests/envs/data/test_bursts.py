"""Bursts of wild samples: found in recordings of every pace, left alone where a motion or an impact makes them."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import poise
from poise.envs.data.bursts import bursts
from poise.envs.data.glitches import without_glitches
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import metrics

HANDS = {gesture: simulate_hand(gesture, seed=21, duration=30.0) for gesture in ("slow", "walk", "mixed")}


def burst(gesture: str, kind: str, rows: slice, values: np.ndarray) -> poise.Trajectory:
    changed = np.array(HANDS[gesture].measurements[f"imu/{kind}"])
    changed[rows] = values
    return HANDS[gesture].replace(measurements=HANDS[gesture].measurements | {f"imu/{kind}": changed})


def wild(form: str, size: float, length: int, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    if form == "level":
        return np.tile(size * np.array([0.6, -0.8, 0.0]), (length, 1))
    if form == "one axis":
        return np.outer(size * generator.choice([-1.0, 1.0], length), [0.0, 1.0, 0.0])
    return generator.normal(0.0, size, (length, 3))


@pytest.mark.parametrize("form", ["level", "one axis", "random"])
@pytest.mark.parametrize(
    ("gesture", "kind", "size", "length"),
    [
        ("slow", "gyr", np.radians(300.0), 8),
        ("slow", "gyr", np.radians(600.0), 2),
        ("walk", "gyr", np.radians(2000.0), 15),
        ("mixed", "gyr", np.radians(800.0), 5),
        ("slow", "acc", 120.0, 8),
        ("mixed", "acc", 400.0, 5),
    ],
)
def test_a_burst_counts_as_missing_and_is_named(gesture: str, kind: str, size: float, length: int, form: str) -> None:
    rows = slice(1500, 1500 + length)
    faulty = burst(gesture, kind, rows, wild(form, size, length, seed=length))
    with pytest.warns(UserWarning, match=f"imu/{kind}: .*(samples of bursts|glitches)"):
        found = without_glitches(faulty)[f"imu/{kind}"]
    missing = np.isnan(found).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(missing), np.arange(1500, 1500 + length))
    told = [each.what for each in poise.check_recording(faulty) if each.channel == f"imu/{kind}"]
    assert any("jump away and back at once, from sample 150" in what or "stand alone" in what for what in told)


@pytest.mark.parametrize("name", ["bounded-motion", "vqf", "mekf"])
@pytest.mark.parametrize("form", ["level", "random"])
def test_a_burst_of_the_gyroscope_misleads_nobody(name: str, form: str) -> None:
    faulty = burst("walk", "gyr", slice(1500, 1508), wild(form, np.radians(1500.0), 8, seed=1))
    truth = HANDS["walk"].truth_of("up")

    def largest(trajectory: poise.Trajectory) -> float:
        up = poise.run(name, trajectory).pose["up"]
        return float(np.degrees(metrics.direction_error(up, truth))[1500:2000].max())

    with pytest.warns(UserWarning, match="bursts"):
        assert largest(faulty) < largest(HANDS["walk"]) + 1.5


@pytest.mark.parametrize("rate", [25.0, 286.0])
@pytest.mark.parametrize(
    "gesture", ["slow", "fast", "severe", "mixed", "shaking", "carried-running", "hand-held", "rotation"]
)
def test_motions_and_impacts_are_none(gesture: str, rate: float) -> None:
    hand = simulate_hand(gesture, seed=3, rate=rate, duration=20.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        without_glitches(hand)


def test_what_stays_away_or_comes_gradually_is_none() -> None:
    gyr = HANDS["slow"].measurements["imu/gyr"]
    stays, gradual = np.array(gyr), np.array(gyr)
    stays[1500:, 0] += 5.0
    gradual[1500:1520, 0] += 5.0 * np.sin(np.linspace(0.0, np.pi, 20))
    for values in (stays, gradual, gyr[:10], np.full((50, 3), np.nan)):
        assert not bursts(values, "gyr", 0.01).any()
    assert not bursts(gyr[::20], "gyr", 0.2).any()


def test_a_knock_is_none() -> None:
    force = np.array(HANDS["slow"].measurements["imu/acc"])
    force[1500:1503] += [[30.0, 0.0, 90.0], [60.0, 0.0, 150.0], [20.0, 0.0, 60.0]]
    assert not bursts(force, "acc", 0.01).any()
