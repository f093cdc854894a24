"""A gyroscope whose unit, signs or axes change on the way is named; each half of a sound recording is left in peace."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import poise
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand

HANDS = {gesture: simulate_hand(gesture, seed=51, rate=50.0, duration=40.0) for gesture in ("slow", "fast", "mixed")}


def from_on(gesture: str, begin: int, change: Callable[[np.ndarray], np.ndarray]) -> Trajectory:
    gyr = np.array(HANDS[gesture].measurements["imu/gyr"])
    gyr[begin:] = change(gyr[begin:])
    return HANDS[gesture].replace(measurements=HANDS[gesture].measurements | {"imu/gyr": gyr}, truth={})


@pytest.mark.parametrize("gesture", HANDS)
@pytest.mark.parametrize("begin", [800, 1150])
@pytest.mark.parametrize(
    "change",
    [
        lambda gyr: gyr * [1.0, -1.0, 1.0],
        lambda gyr: gyr * [-1.0, -1.0, 1.0],
        lambda gyr: gyr[:, [1, 0, 2]],
        lambda gyr: -gyr,
        np.degrees,
    ],
)
def test_what_changes_on_the_way_is_named(gesture: str, begin: int, change: Callable[[np.ndarray], np.ndarray]) -> None:
    assert any(each.severity == "warning" for each in poise.check_recording(from_on(gesture, begin, change)))


@pytest.mark.parametrize("gesture", ["fast", "mixed"])
def test_the_half_is_named(gesture: str) -> None:
    found = [str(each) for each in poise.check_recording(from_on(gesture, 1150, lambda gyr: gyr * [1.0, -1.0, 1.0]))]
    assert any("in the second half, gyroscope and" in each and "the sign of y is reversed" in each for each in found)


@pytest.mark.parametrize("gesture", ["slow", "fast", "severe", "walk", "turn", "pointing", "shaking"])
def test_halves_of_sound_recordings_are_silent(gesture: str) -> None:
    hand = simulate_hand(gesture, seed=9, rate=50.0, duration=30.0).replace(truth={})
    assert not [each for each in poise.check_recording(hand) if each.severity == "warning"]
