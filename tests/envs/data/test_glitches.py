"""Samples that stand alone: found in recordings, left alone where a motion or an impact makes them."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import poise
from poise.envs.data.glitches import FULL, without_glitches
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
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


@pytest.mark.parametrize("gesture", ["severe", "carried-running"])
def test_motion_and_impacts_are_left_alone(gesture: str) -> None:
    hand = simulate_hand(gesture, seed=3, duration=20.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = without_glitches(hand)
    assert all(found[name] is hand.measurements[name] for name in found)


def test_what_lasts_two_samples_or_rings_on_is_a_motion() -> None:
    two = with_samples("acc", np.array([500, 501]), np.array([60.0, 0.0, 60.0]))
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


def test_a_range_that_is_known_tells_saturated_samples() -> None:
    limit = float(np.quantile(np.abs(KNOWN.measurements["imu/gyr"]), 0.98))
    clipped = np.clip(KNOWN.measurements["imu/gyr"], -limit, limit)
    told = KNOWN.replace(
        measurements=KNOWN.measurements | {"imu/gyr": clipped},
        metadata=KNOWN.metadata | {"full_scale": {"imu/gyr": limit}},
    )
    with pytest.warns(UserWarning, match="saturated"):
        found = without_glitches(told)["imu/gyr"]
    assert np.array_equal(np.isnan(found).any(axis=1), (np.abs(clipped) >= FULL * limit).any(axis=1))
