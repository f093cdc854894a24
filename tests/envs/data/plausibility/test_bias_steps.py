"""A gyroscope whose bias changes in motion is named with size and time; sound recordings are left in peace."""

from __future__ import annotations

import numpy as np
import pytest

import poise
from poise.envs.data.plausibility.bias_steps import bias_step
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand

HANDS = {gesture: simulate_hand(gesture, seed=41, rate=50.0, duration=60.0) for gesture in ("slow", "fast", "walk")}


def stepped(gesture: str, begin: int, size: list[float], *kinds: str) -> Trajectory:
    """With another bias (°/s) of the gyroscope from a sample on, and with some channels only."""
    measurements = {f"imu/{kind}": np.array(HANDS[gesture].measurements[f"imu/{kind}"]) for kind in kinds}
    measurements["imu/gyr"][begin:] += np.radians(size)
    return HANDS[gesture].replace(measurements=measurements, truth={})


def told(trajectory: Trajectory) -> list[str]:
    return [str(each) for each in poise.check_recording(trajectory) if each.severity == "warning"]


@pytest.mark.parametrize(
    ("gesture", "kinds"),
    [
        ("slow", ("gyr", "acc")),
        ("fast", ("gyr", "acc")),
        ("slow", ("gyr", "acc", "mag")),
        ("fast", ("gyr", "acc", "mag")),
        ("walk", ("gyr", "acc", "mag")),
    ],
)
@pytest.mark.parametrize(
    ("begin", "size"), [(1000, [10.0, 0.0, 0.0]), (1500, [0.0, -8.0, 6.0]), (2000, [6.0, 6.0, 6.0])]
)
def test_a_step_in_motion_is_named(gesture: str, kinds: tuple[str, ...], begin: int, size: list[float]) -> None:
    (found,) = told(stepped(gesture, begin, size, *kinds))
    assert found.startswith("imu/gyr: its bias changes by "), found
    # What turns about the vertical all the time shows in the field only.
    size_told = float(found.split(" by ")[1].split()[0])
    assert size_told == pytest.approx(np.linalg.norm(size), abs=2.5 if "mag" in kinds else 5.0)
    assert float(found.split(" at about ")[1].split()[0]) == pytest.approx(begin / 50.0, abs=6.0)


@pytest.mark.parametrize("gesture", ["slow", "severe", "mixed", "pointing", "shaking", "carried-running"])
def test_a_steady_bias_is_no_step(gesture: str) -> None:
    hand = simulate_hand(gesture, seed=8, rate=50.0, duration=40.0)
    biased = hand.measurements | {"imu/gyr": hand.measurements["imu/gyr"] + np.radians([3.0, -2.0, 1.0])}
    assert not [text for text in told(hand.replace(measurements=biased, truth={})) if "bias changes" in text]


def test_short_or_empty_recordings_tell_nothing() -> None:
    gyr, acc = (HANDS["slow"].measurements[name] for name in ("imu/gyr", "imu/acc"))
    assert bias_step(gyr[:200], acc[:200], 0.02) is None
    assert bias_step(np.full_like(gyr, np.nan), acc, 0.02) is None
    assert bias_step(gyr[::20], acc[::20], 0.4) is None
