"""What no sensor can have measured is no sample, in every estimator alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation
from poise.filters.core.estimator import check_measurements, run, without_impossible
from poise.filters.core.quantity import ACCELEROMETER, GYROSCOPE, MAGNETOMETER, Channel
from poise.filters.registry import FILTERS, make

Data = dict[str, np.ndarray]


def estimator_of(name: str) -> Any:
    entry = FILTERS[name]
    if entry.kind == "external":
        pytest.importorskip(entry.made_by.package)  # type: ignore[attr-defined]
    return make(name, dt=0.01)


def poses(estimator: Any, data: Data) -> np.ndarray:
    return np.concatenate(list(run(estimator, data).pose.values()), axis=-1)


@pytest.mark.parametrize("name", list(FILTERS))
def test_a_glitch_is_a_missing_sample(name: str, motion: Callable[..., Data]) -> None:
    estimator = estimator_of(name)
    data = motion(estimator, 3)
    for index, channel in enumerate(estimator.channels):
        # one tick in the middle and two at the start, alternately on one axis and on all
        ticks, axes = ([0, 1], slice(None)) if index % 2 else ([30], slice(0, 1))
        absent = {key: array.copy() for key, array in data.items()}
        absent[channel.name][ticks, slice(None) if channel.is_vector else axes] = np.nan
        expected = poses(estimator, absent)
        for glitch in (1e10, -1e18, 1e30, np.inf, 2.0 * channel.limit):
            glitched = {key: array.copy() for key, array in data.items()}
            glitched[channel.name][ticks, axes] = glitch
            np.testing.assert_array_equal(poses(estimator, glitched), expected, err_msg=f"{channel.name} {glitch}")


@pytest.mark.parametrize("name", list(FILTERS))
def test_zeros_without_a_direction_are_a_missing_sample(name: str, motion: Callable[..., Data]) -> None:
    estimator = estimator_of(name)
    data = motion(estimator, 4)
    for channel in estimator.channels:
        if channel.has_direction:
            results = []
            for value in (np.nan, 0.0, 5e-324, -1e-12):
                changed = {key: array.copy() for key, array in data.items()}
                changed[channel.name][[0, 1, 40, 41]] = value
                results.append(poses(estimator, changed))
            for result in results[1:]:
                np.testing.assert_array_equal(result, results[0], err_msg=channel.name)
            assert np.isfinite(results[0][2:]).all()


@pytest.mark.parametrize(
    ("channel", "sample", "kept"),
    [
        (GYROSCOPE, [0.0, 0.0, 0.0], True),
        (GYROSCOPE, [99.0, 0.0, 0.0], True),
        (GYROSCOPE, [101.0, 0.0, 0.0], False),
        (GYROSCOPE, [1.0, np.nan, 0.0], False),
        (ACCELEROMETER, [0.0, 0.0, 0.0], False),
        (ACCELEROMETER, [0.0, 1e-9, 0.0], True),
        (ACCELEROMETER, [0.0, 1e-10, 0.0], False),
        (MAGNETOMETER, [1e-12, -2e-12, 3e-12], False),
        (MAGNETOMETER, [1e-5, 0.0, -4e-5], True),
        (ACCELEROMETER, [0.0, -2001.0, 9.81], False),
        (MAGNETOMETER, [0.0, 0.0, 0.0], False),
        (MAGNETOMETER, [20e3, -5e3, 40e3], True),
        (MAGNETOMETER, [1e12, 1.0, 1.0], False),
        (Channel("relative/orientation", 4, "1"), [0.0, 0.0, 0.0, 0.0], False),
    ],
)
@pytest.mark.parametrize("batch", [(), (2, 3)])
def test_a_vector_is_there_or_it_is_not(
    channel: Channel, sample: list[float], kept: bool, batch: tuple[int, ...]
) -> None:
    samples = np.broadcast_to(np.array(sample), (*batch, channel.size))
    checked = without_impossible(channel, samples)
    np.testing.assert_array_equal(checked, samples if kept else np.full_like(samples, np.nan))


def test_numbers_that_are_no_vector_are_judged_alone() -> None:
    checked = without_impossible(Channel("seat/load_cells", 3, "N"), np.array([1.0, np.inf, 0.0]))
    np.testing.assert_array_equal(checked, [1.0, np.nan, 0.0])


def test_what_is_masked_is_missing() -> None:
    force = np.ma.masked_greater(np.array([[0.0, 0.0, 9.8], [999.0, 0.0, 9.8]]), 900.0)
    checked = check_measurements((ACCELEROMETER,), {"imu/acc": force}, time_axis=True)["imu/acc"]
    np.testing.assert_array_equal(checked, [[0.0, 0.0, 9.8], [np.nan] * 3])


@pytest.mark.parametrize("name", ["mekf-9", "bounded-motion-9"])
@pytest.mark.parametrize("glitch", [1e3, 1e5, 9e7])
def test_a_field_that_is_absurd_for_once_is_forgotten(name: str, glitch: float) -> None:
    trajectory = simulate_hand("slow", 5, rate=100.0, duration=25.0)
    data = {channel: array.copy() for channel, array in trajectory.measurements.items()}
    usual = run(make(name, dt=0.01), data).pose["orientation"]
    data["imu/mag"][900] = [glitch, -glitch, 0.5 * glitch]
    found = run(make(name, dt=0.01), data).pose["orientation"]
    turned = np.degrees(rotation.angle(rotation.multiply(found, rotation.conjugate(usual))))
    assert turned[901:].max() < 1.0
