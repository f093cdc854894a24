"""Samples that stand alone: found in recordings, left alone where a motion or an impact makes them."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import poise
from poise.envs.data.glitches import FEWEST, SamplesSoFar, no_samples, without_glitches
from poise.envs.data.ranges import FULL
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.envs.recipes.registry import recipe
from poise.filters.core import metrics

KNOWN = simulate_hand("mixed", seed=11, duration=12.0)


def with_samples(kind: str, rows: np.ndarray, values: np.ndarray, **metadata: object) -> Trajectory:
    changed = np.array(KNOWN.measurements[f"imu/{kind}"])
    changed[rows] = values
    return KNOWN.replace(measurements=KNOWN.measurements | {f"imu/{kind}": changed}, metadata=KNOWN.metadata | metadata)


def inclination(trajectory: Trajectory) -> float:
    up = poise.run("bounded-motion", trajectory).pose["up"]
    return float(np.degrees(metrics.direction_error(up, KNOWN.truth_of("up"))[200:].mean()))


@pytest.mark.parametrize(("kind", "size"), [("gyr", 20.0), ("gyr", 30.0), ("acc", 80.0), ("acc", 150.0)])
def test_a_sample_that_stands_alone_counts_as_missing(kind: str, size: float) -> None:
    rows = np.arange(150, 1150, 97)
    glitched = with_samples(kind, rows, size * np.array([0.6, -0.8, 0.0]))
    with pytest.warns(UserWarning, match=f"imu/{kind}: {len(rows)} glitches"):
        found = without_glitches(glitched)
    assert np.isnan(found[f"imu/{kind}"][rows]).all()
    assert np.isfinite(np.delete(found[f"imu/{kind}"], rows, axis=0)).all()
    with pytest.warns(UserWarning, match="glitches"):
        assert inclination(glitched) < inclination(KNOWN) + 0.3


@pytest.mark.parametrize("times", [2, 3])
@pytest.mark.parametrize(("kind", "value"), [("gyr", 35.0), ("gyr", -34.9), ("acc", 156.9), ("acc", -39.2)])
def test_a_glitch_that_was_written_several_times_is_one(kind: str, value: float, times: int) -> None:
    rows = (np.arange(150, 1150, 97)[:, None] + np.arange(times)).ravel()
    glitched = with_samples(kind, rows, np.full(3, value))
    with pytest.warns(UserWarning, match=f"imu/{kind}: {len(rows)} glitches"):
        found = without_glitches(glitched)[f"imu/{kind}"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found).any(axis=1)), rows)
    arriving, _ = so_far({f"imu/{name}": glitched.measurements[f"imu/{name}"] for name in ("gyr", "acc")}, {})
    np.testing.assert_array_equal(np.isnan(arriving[f"imu/{kind}"]), np.isnan(found))


@pytest.mark.parametrize(("kind", "value"), [("gyr", 99.99), ("acc", -999.0)])
def test_the_first_sample_and_the_first_after_a_gap_may_be_glitches(kind: str, value: float) -> None:
    rows = np.array([0, *range(600, 641)])
    glitched = with_samples(kind, rows, np.where(np.isin(rows, (0, 640)), value, np.nan)[:, None])
    with pytest.warns(UserWarning, match=f"imu/{kind}: 2 glitches"):
        found = without_glitches(glitched)[f"imu/{kind}"]
    assert np.isnan(found[[0, 640]]).all()
    assert np.isnan(found).any(axis=1).sum() == 42


@pytest.mark.parametrize("gesture", ["severe", "carried-running"])
def test_motion_and_impacts_are_left_alone(gesture: str) -> None:
    hand = simulate_hand(gesture, seed=3, duration=20.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = without_glitches(hand)
    assert all(found[name] is hand.measurements[name] for name in found)


def test_what_lasts_two_samples_or_rings_on_is_a_motion() -> None:
    two = with_samples("acc", np.array([500, 501]), np.array([[60.0, 0.0, 60.0], [58.0, 1.0, 63.0]]))
    ringing = np.array(KNOWN.measurements["imu/acc"])
    ringing[500:530, 2] += 90.0 * np.exp(-np.arange(30) / 6.0) * (-1.0) ** np.arange(30)
    for trajectory in (two, KNOWN.replace(measurements=KNOWN.measurements | {"imu/acc": ringing})):
        assert without_glitches(trajectory)["imu/acc"] is trajectory.measurements["imu/acc"]


def test_rows_of_zeros_of_both_sensors_are_no_rest() -> None:
    rows = np.arange(200, 1200, 9)
    zeros = with_samples("gyr", rows, np.zeros(3))
    zeros = zeros.replace(measurements=zeros.measurements | with_samples("acc", rows, np.zeros(3)).measurements)
    zeros = zeros.replace(
        measurements=zeros.measurements | {"imu/gyr": with_samples("gyr", rows, np.zeros(3)).measurements["imu/gyr"]}
    )
    with pytest.warns(UserWarning, match="rows of zeros"):
        assert np.isnan(without_glitches(zeros)["imu/gyr"][rows]).all()


def test_a_motion_beyond_a_known_range_keeps_its_saturated_readings() -> None:
    limit = float(np.quantile(np.abs(KNOWN.measurements["imu/gyr"]), 0.98))
    clipped = np.clip(KNOWN.measurements["imu/gyr"], -limit, limit)
    told = KNOWN.replace(
        measurements=KNOWN.measurements | {"imu/gyr": clipped},
        metadata=KNOWN.metadata | {"full_scale": {"imu/gyr": limit}},
    )
    assert (np.abs(clipped) >= FULL * limit).any()
    np.testing.assert_array_equal(without_glitches(told)["imu/gyr"], clipped)


def so_far(measurements: dict[str, np.ndarray], ranges: dict[str, float]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """What counts in the end, and how many samples each new one decides on."""
    watch, length = SamplesSoFar(ranges), len(next(iter(measurements.values())))
    found = {name: np.array(values) for name, values in measurements.items()}
    decided = np.zeros(length, int)
    for row in range(length):
        last = watch.add({name: values[row] for name, values in measurements.items()})
        decided[row] = len(last)
        for name, values in found.items():
            values[row + 1 - len(last) : row + 1] = [each[name] for each in last]
    return found, decided


@pytest.mark.parametrize("length", [1, 5, 9, 12, 400])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_samples_that_arrive_are_judged_as_those_of_a_recording(seed: int, length: int) -> None:
    generator = np.random.default_rng(seed)
    measurements = {name: np.array(KNOWN.measurements[f"imu/{name}"][300 : 300 + length]) for name in ("gyr", "acc")}
    for name, size in (("gyr", 25.0), ("acc", 120.0)):
        for row in generator.integers(0, length, 1 + length // 25):
            measurements[name][row] = size * generator.standard_normal(3)
            measurements[name][min(row + 3, length - 1)] = generator.choice([0.0, np.nan, size])
    both = generator.integers(0, length, 2)
    for values in measurements.values():
        values[both] = 0.0
    ranges = {"imu/gyr": 30.0}
    channels = {f"imu/{name}": values for name, values in measurements.items()}
    found, decided = so_far(channels, ranges)
    # bursts and blocks are looked for in recordings alone
    none = {name: np.logical_or.reduce(list(parts.values())) for name, parts in no_samples(channels, ranges).items()}
    expected = {name: np.where(none[name][:, None], np.nan, values) for name, values in channels.items()}
    for name in channels:
        if length > 1:  # the last one may be withheld until the next one shows what it is
            np.testing.assert_array_equal(found[name][:-1], expected[name][:-1])
        np.testing.assert_array_equal(np.isnan(found[name][-1]) | (found[name][-1] == expected[name][-1]), True)
    assert decided.max() <= FEWEST
    if length == 400:
        assert decided.max() > 1


@pytest.mark.parametrize("gesture", ["severe", "carried-running", "mixed"])
def test_nothing_is_withheld_from_motion_and_impacts_that_arrive(gesture: str) -> None:
    hand = simulate_hand(gesture, seed=3, duration=20.0)
    inertial = {name: hand.measurements[name] for name in ("imu/gyr", "imu/acc")}
    found, decided = so_far(inertial, {})
    assert decided.max() == 1
    for name, values in inertial.items():
        np.testing.assert_array_equal(found[name], values)


def test_a_glitch_that_arrives_is_withheld_at_once() -> None:
    glitched = with_samples("gyr", np.array([200]), [20.0, -25.0, 0.0]).measurements
    watch = SamplesSoFar()
    last = [watch.add({name: values[row] for name, values in glitched.items()})[-1] for row in range(201)]
    assert np.isnan(last[200]["imu/gyr"]).all()
    assert np.isfinite(last[200]["imu/acc"]).all()


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize(
    ("kind", "value"),
    [
        ("gyr", np.radians([2000.0, 2000.0, 2000.0])),
        ("gyr", np.radians([np.nan, -1999.94, np.nan])),
        ("acc", 9.80665 * np.array([-16.0, 16.0, 16.0])),
        ("acc", np.array([np.nan, np.nan, 300.0])),
    ],
)
def test_a_few_samples_in_a_row_at_the_end_of_the_range_count_as_missing(kind, value, count) -> None:
    rows = np.array([*range(400, 400 + count), *range(900, 900 + count)])
    before = KNOWN.measurements[f"imu/{kind}"][rows]
    glitched = with_samples(kind, rows, np.where(np.isnan(value), before, value))
    with pytest.warns(UserWarning, match=f"imu/{kind}: {len(rows)} jumps to the end of the range"):
        found = without_glitches(glitched)[f"imu/{kind}"]
    assert np.array_equal(np.flatnonzero(np.isnan(found).any(axis=1)), rows)
    told = [finding for finding in poise.check_recording(glitched) if finding.channel == f"imu/{kind}"]
    assert any("saturation" in finding.cause for finding in told)


@pytest.mark.parametrize("share", [0.8, 0.9])
def test_a_peak_within_the_range_that_is_held_is_motion(share) -> None:
    gyr = KNOWN.measurements["imu/gyr"]
    row = int(np.argmax(np.abs(gyr).max(axis=1)))
    held = with_samples("gyr", np.array([row, row + 1]), share * gyr[row])
    assert not np.isnan(without_glitches(held)["imu/gyr"]).any()


def test_readings_that_saturate_in_a_strong_motion_are_nearer_to_it_than_held_ones() -> None:
    motion = recipe("hand-held").episode(0, 24)
    gyr = motion.measurements["imu/gyr"]
    assert np.count_nonzero(np.abs(gyr).max(axis=1) >= FULL * np.radians(2000.0)) > 3
    np.testing.assert_array_equal(without_glitches(motion)["imu/gyr"], gyr)
