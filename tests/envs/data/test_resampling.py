"""Resampled sensors integrate to the pose of the original ones."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory
from poise.filters.core import rotation


def strapdown(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Attitude and velocity at every tick from the samples of the intervals that end there, from rest at tick 0."""
    attitude, velocity = [np.array([1.0, 0, 0, 0])], [np.zeros(3)]
    gyr, acc = trajectory.measurements["imu/gyr"], trajectory.measurements["imu/acc"]
    for k, dt in enumerate(np.diff(trajectory.time), start=1):
        middle = rotation.multiply(attitude[-1], rotation.exp(0.5 * dt * gyr[k]))
        velocity.append(velocity[-1] + dt * rotation.rotate(middle, acc[k]))
        attitude.append(rotation.multiply(attitude[-1], rotation.exp(dt * gyr[k])))
    return np.array(attitude), np.array(velocity)


@pytest.fixture
def wobble() -> Trajectory:
    """Coning and sculling, strong enough that plain means fail."""
    time = np.arange(601) / 300.0
    phase = 2 * np.pi * 8.0 * time
    gyr = np.stack([6 * np.cos(phase), 6 * np.sin(phase), 0.5 + 0 * time], axis=1)
    acc = np.stack([10 * np.cos(phase + 0.4), 5 * np.sin(phase), 9.81 + 0 * time], axis=1)
    bare = Trajectory(time, {"imu/gyr": gyr, "imu/acc": acc})
    orientation, velocity = strapdown(bare)
    mag = rotation.rotate_back(orientation, np.array([0.0, 20.0, -40.0]))
    return bare.replace(
        measurements=bare.measurements | {"imu/mag": mag},
        truth={"orientation": orientation, "velocity": velocity, "up": rotation.up_in_body(orientation)},
    )


@pytest.mark.parametrize("rate", [150.0, 100.0, 60.0])
def test_strapdown_integration_survives(wobble, rate):
    thin = wobble.resampled(rate)
    assert thin.uniform
    assert 1 / thin.dt == pytest.approx(rate)
    assert len(thin) == int(2 * rate) + 1
    attitude, velocity = strapdown(thin)
    np.testing.assert_allclose(rotation.positive(attitude), rotation.positive(thin.truth["orientation"]), atol=1e-9)
    np.testing.assert_allclose(velocity, thin.truth["velocity"], atol=1e-9)
    plain = wobble.measurements["imu/gyr"][1:].reshape(-1, int(300 / rate), 3).mean(axis=1)
    assert np.abs(plain - thin.measurements["imu/gyr"][1:]).max() > 1e-3, "the motion does not need the exact way"


def test_rates_that_do_not_divide_keep_the_attitude(wobble):
    thin = wobble.resampled(286.0 / 3)
    attitude, _ = strapdown(thin)
    error = rotation.angle(rotation.multiply(rotation.conjugate(attitude), thin.truth["orientation"]))
    assert error.max() < 1e-9


def test_truth_lies_on_the_great_circle_and_the_same_rate_changes_nothing(wobble):
    dense = wobble.resampled(600.0)
    np.testing.assert_allclose(rotation.norm(dense.truth["orientation"]), 1.0)
    np.testing.assert_allclose(rotation.norm(dense.truth["up"]), 1.0)
    np.testing.assert_allclose(dense.truth["orientation"][::2], wobble.truth["orientation"], atol=1e-12)
    same = wobble.resampled(300.0)
    assert len(same) == len(wobble)
    for name, values in wobble.measurements.items():
        np.testing.assert_allclose(same.measurements[name], values, atol=1e-9)


def test_missing_samples_and_unknown_truth_stay_missing(wobble):
    gyr = wobble.measurements["imu/gyr"].copy()
    gyr[100] = np.nan
    orientation = wobble.truth["orientation"].copy()
    orientation[50] = np.nan
    mask = np.ones(len(wobble), bool)
    mask[200] = False
    holes = wobble.replace(
        measurements=wobble.measurements | {"imu/gyr": gyr}, truth={"orientation": orientation}, mask=mask
    )
    thin = holes.resampled(100.0)
    assert np.flatnonzero(np.isnan(thin.measurements["imu/gyr"]).any(1)).tolist() == [34]
    assert np.flatnonzero(np.isnan(thin.measurements["imu/acc"]).any(1)).tolist() == [34]
    assert not np.isnan(thin.measurements["imu/mag"]).any()
    assert np.isnan(holes.resampled(150.0).truth["orientation"][25]).all()
    assert (~holes.resampled(150.0).mask).sum() == 1
    np.testing.assert_allclose(thin.truth["orientation"], orientation[::3], atol=1e-12)


def test_instants_are_interpolated(wobble):
    thin = wobble.resampled(100.0, sampling="instant")
    for name, values in wobble.measurements.items():
        np.testing.assert_allclose(thin.measurements[name], values[::3], atol=1e-12)
    dense = wobble.resampled(600.0, sampling="instant")
    gyr = wobble.measurements["imu/gyr"].copy()
    np.testing.assert_allclose(dense.measurements["imu/gyr"][1::2], 0.5 * (gyr[1:] + gyr[:-1]), atol=1e-12)
    gyr[100] = np.nan
    holed = wobble.replace(measurements=wobble.measurements | {"imu/gyr": gyr})
    assert not np.isnan(holed.resampled(75.0, sampling="instant").measurements["imu/mag"]).any()
    assert np.isnan(holed.resampled(600.0, sampling="instant").measurements["imu/gyr"][199:202]).all()
    with pytest.raises(ValueError, match="sampling must be"):
        wobble.resampled(100.0, sampling="mean")


@pytest.mark.parametrize("first", [0, 3])
def test_sensors_slower_than_the_ticks_keep_their_own_intervals(wobble, first):
    """Every third tick has a sample, as in an episode with a slow sensor; its interval reaches back to the last one."""
    slow = wobble.resampled(100.0)
    spread = {name: np.full((601, 3), np.nan) for name in slow.measurements}
    for name, values in slow.measurements.items():
        spread[name][first::3] = values[first // 3 :]
    mixed = wobble.replace(measurements=spread)
    for sampling in ("interval", "instant"):
        back = mixed.resampled(100.0, sampling=sampling)
        for name, values in slow.measurements.items():
            np.testing.assert_allclose(back.measurements[name][first // 3 :], values[first // 3 :], atol=1e-9)
            assert np.isnan(back.measurements[name][: first // 3]).all()
    spread["imu/acc"][300] = np.nan
    holed = mixed.replace(measurements=spread).resampled(100.0)
    assert np.flatnonzero(np.isnan(holed.measurements["imu/acc"][1:]).any(1)).tolist() == [99]


def test_a_rate_must_be_positive(wobble):
    for rate in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="rate must be a positive"):
            wobble.resampled(rate)


def test_short_gaps_are_interpolated_and_long_ones_stay(wobble):
    kept = np.setdiff1d(np.arange(len(wobble)), [*range(50, 53), *range(200, 300)])
    rows = {name: values[kept] for name, values in wobble.measurements.items()}
    lossy = Trajectory(wobble.time[kept], rows, {"up": wobble.truth["up"][kept]})
    filled = lossy.interpolated(0.02)
    assert filled.metadata["interpolated"]["samples"] == {"imu/gyr": 3, "imu/acc": 3}
    gyr = wobble.measurements["imu/gyr"]
    np.testing.assert_allclose(filled.measurements["imu/gyr"][50:53], gyr[49] + np.c_[1:4] / 4 * (gyr[53] - gyr[49]))
    assert np.isnan(filled.measurements["imu/gyr"][200:300]).all()
    assert np.isnan(filled.measurements["imu/mag"][50:53]).all()
    np.testing.assert_array_equal(np.flatnonzero(~filled.mask), [*range(50, 53), *range(200, 300)])
    with pytest.raises(ValueError, match="longest must be a positive time in s, got -1"):
        lossy.interpolated(-1)
