"""A magnetic field that is another for good is named with the time; what stays or comes and goes is left in peace."""

from __future__ import annotations

import numpy as np
import pytest

import poise
from poise.envs.data.plausibility.field_changes import change_of
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation

HANDS = {gesture: simulate_hand(gesture, seed=31, rate=50.0, duration=60.0) for gesture in ("slow", "mixed", "turn")}


def changed(gesture: str, rows: slice, vector: np.ndarray, of_sensor: bool = True) -> Trajectory:
    """With a field (µT) added to some rows, in the axes of the sensor or of the world."""
    hand, field = HANDS[gesture], np.zeros((len(HANDS[gesture]), 3))
    field[rows] = vector
    if not of_sensor:
        field = rotation.rotate_back(hand.truth["orientation"], field)
    return hand.replace(measurements=hand.measurements | {"imu/mag": hand.measurements["imu/mag"] + field})


def told(trajectory: Trajectory) -> list[str]:
    return [str(each) for each in poise.check_recording(trajectory) if each.severity == "warning"]


@pytest.mark.parametrize("vector", [[60.0, 0.0, 0.0], [0.0, -45.0, 30.0], [20.0, 30.0, 80.0]])
@pytest.mark.parametrize(("begin", "of_sensor"), [(1000, True), (1800, True), (1500, False)])
@pytest.mark.parametrize("gesture", HANDS)
def test_a_magnet_or_another_place_is_named_with_the_time(
    gesture: str, begin: int, of_sensor: bool, vector: list[float]
) -> None:
    (found,) = told(changed(gesture, slice(begin, None), np.array(vector), of_sensor))
    assert found.startswith("imu/mag: the field is another from"), found
    assert float(found.split(" from ")[1].split()[0]) == pytest.approx(begin / 50.0, abs=4.0)


@pytest.mark.parametrize("gesture", HANDS)
def test_a_magnet_that_is_taken_off_is_named_by_the_run(gesture: str) -> None:
    with pytest.warns(UserWarning, match="the field is another from"):
        poise.run("mekf-9", changed(gesture, slice(0, 1500), np.array([50.0, 20.0, -40.0])))


@pytest.mark.parametrize("gesture", ["slow", "fast", "severe", "walk", "pointing", "shaking"])
def test_one_field_is_no_change(gesture: str) -> None:
    assert not told(simulate_hand(gesture, seed=7, rate=50.0, duration=40.0))


def test_what_comes_and_goes_or_was_always_there_is_no_change() -> None:
    for rows in (slice(1000, 1300), slice(0, None)):
        assert not [each for each in told(changed("slow", rows, np.array([25.0, 0.0, 0.0]))) if "another" in each]
    generator = np.random.default_rng(0)
    for count in (3, 12, 13, 60):
        noise = np.stack([generator.uniform(20.0, 80.0, count), generator.uniform(-90.0, 90.0, count), np.ones(count)])
        assert change_of(noise) is None
    step = np.stack([np.repeat([45.0, 90.0], 12), np.full(24, 66.0), np.ones(24)])
    assert change_of(step) in (11, 12)
    assert change_of(step * [[np.nan], [1.0], [1.0]]) is None
    assert change_of(step * [[1.0], [1.0], [0.5]]) is None


@pytest.mark.parametrize("samples", [2, 9, 40, 150])
def test_a_recording_too_short_to_compare_fields_is_checked(samples):
    motion = simulate_hand("slow", seed=1, duration=3.0)[:samples]
    poise.check_recording(motion)
    estimate = poise.run("mekf-9", motion, check=True)
    assert len(estimate.time) == samples
