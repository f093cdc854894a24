"""Stamps as devices write them: rounded, jittering, with gaps, in packets, in other units."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import poise
from poise.envs.data.clock import fit_clock
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand

N = 6000


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def make(time: np.ndarray, **metadata: Any) -> Trajectory:
    count = np.arange(len(time), dtype=float)
    return Trajectory(
        time, {"imu/gyr": np.stack([count, count, count], axis=1)}, {"heading": count[:, None]}, metadata=metadata
    )


@pytest.mark.parametrize("rate", [286.0, 400.0, 60.0, 2000 / 7, 128.0, 59.94, 800.0, 1600.0])
def test_rounding_to_milliseconds_does_not_change_the_rate(rate):
    index = np.arange(int(60 * rate))
    clock = fit_clock(np.round(index / rate, 3))
    assert clock.interval == pytest.approx(1.0 / rate, rel=1e-6)
    np.testing.assert_array_equal(clock.index, index)


@pytest.mark.parametrize("rate", [286.0, 400.0, 60.0, 100.0])
@pytest.mark.parametrize("lost", [0.02, 0.3, 0.6])
def test_lost_rows_leave_their_places(rate, lost):
    index = np.flatnonzero(rng().random(N) >= lost)
    clock = fit_clock(np.round(index / rate, 3))
    assert clock.interval == pytest.approx(1.0 / rate, rel=1e-5)
    np.testing.assert_array_equal(clock.index, index - index[0])


@pytest.mark.parametrize("jitter", [0.02, 0.1, 0.2])
def test_jitter_is_not_irregularity(jitter):
    time = np.sort(np.arange(N) + jitter * rng().standard_normal(N)) / 100.0
    clock = fit_clock(time)
    assert clock.interval == pytest.approx(0.01, rel=1e-5)
    assert clock.missing == 0
    assert clock.jitter == pytest.approx(0.01 * jitter, rel=0.1)


@pytest.mark.parametrize("size", [2, 3, 10, 50])
@pytest.mark.parametrize("within", [0.0, 1e-6])
def test_packets_are_spread_over_the_interval_before_their_stamp(size, within):
    index = np.arange(N // size * size)
    kept = np.repeat(rng().random(len(index) // size) > 0.1, size)
    stamps = (index // size * size + size - 1) / 100.0 + within * (index % size)
    clock = fit_clock(stamps[kept])
    assert clock.interval == pytest.approx(0.01, rel=1e-6)
    np.testing.assert_array_equal(clock.index, index[kept] - index[kept][0])


def test_samples_that_a_busy_computer_stamped_late_stay_in_their_places():
    time = np.arange(N) / 100.0
    for late in rng().choice(N - 20, 30, replace=False):
        time[late : late + 10] = np.maximum(time[late : late + 10], time[late] + 0.05 + 1e-4 * np.arange(10))
    clock = fit_clock(np.maximum.accumulate(time))
    assert clock.interval == pytest.approx(0.01, rel=1e-5)
    assert np.mean(clock.index != np.arange(N)) < 0.01


@pytest.mark.parametrize("gap", [0.1, 0.5, 5.0, 60.0])
def test_a_gap_becomes_missing_samples(gap):
    samples = round(gap * 100)
    index = np.r_[0:1000, 1000 + samples : 2000 + samples]
    recorded = make(index / 100.0)
    grid = recorded.on_grid()
    assert len(grid) == 2000 + samples
    assert grid.uniform
    assert grid.dt == pytest.approx(0.01)
    known = np.isfinite(grid.measurements["imu/gyr"]).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(known), index)
    np.testing.assert_array_equal(grid.mask, known)
    np.testing.assert_array_equal(grid.truth["heading"][known, 0], np.arange(2000.0))
    np.testing.assert_array_equal(recorded.time, index / 100.0)


def test_an_interruption_of_minutes_separates_recordings():
    with pytest.raises(ValueError, match=r"gap of 3590 s before sample 1000 separates two recordings.*\[:1000\]"):
        make(np.r_[0:1000, 360_000:361_000] / 100.0).on_grid()


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_random_intervals_have_no_rate(scale):
    time = scale * np.cumsum(rng().uniform(0.37, 1.07, 2000))
    with pytest.raises(ValueError, match=r"no sampling rate explains the time stamps: intervals range from .* nominal"):
        _ = make(time).dt


def test_a_nominal_rate_decides_the_grid_of_irregular_stamps():
    """More than half of the rows lost; stamps by arrival; and a header that the stamps contradict."""
    index = np.sort(rng().permutation(N)[: N // 4])
    grid = make(index / 60.0, nominal_rate=60.0).on_grid()
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(grid.measurements["imu/gyr"][:, 0])), index - index[0])
    every_second = make(np.arange(100) / 30.0, nominal_rate=60.0).on_grid()
    assert len(every_second) == 199
    arrival = np.sort(np.arange(N) / 60.0 + rng().exponential(0.03, N))
    with pytest.raises(ValueError, match="no sampling rate"):
        fit_clock(arrival)
    clock = fit_clock(arrival, 60.0)
    assert clock.interval == pytest.approx(1 / 60.0, rel=1e-3)
    assert clock.missing < 0.02 * N
    assert make(np.arange(600) / 120.0, nominal_rate=60.0).dt == pytest.approx(1 / 120.0)


@pytest.mark.parametrize(
    ("time", "unit"),
    [
        (np.arange(1000) * 10.0, r"ms \(that would be 100 Hz\)"),
        (np.round(np.arange(1000) * 3.4965), r"ms \(that would be 286 Hz\)"),
        (np.arange(1000) * 10_000.0, r"µs \(that would be 100 Hz\)"),
        (1.4e18 + np.arange(1000) * 5_000_000.0, r"ns \(that would be 200 Hz\)"),
        (np.arange(1000.0), r"sample numbers"),
        (7 + np.arange(1000.0), r"sample numbers"),
        (np.arange(1000) * 0.01 / 86400, r"days \(that would be 100 Hz\)"),
        (np.arange(1000) * 0.7, "which no inertial sensor is"),
    ],
)
def test_other_units_of_time_are_named(time, unit):
    with pytest.raises(ValueError, match=f"time must be in s.*{unit}"):
        make(time).on_grid()


@pytest.mark.parametrize("rate", [100.0, 2000 / 7, 60.0, 1000.0])
def test_an_exact_grid_is_left_alone(rate):
    for time in (np.arange(5000) / rate, 0.5 + np.arange(5000) * (1.0 / rate)):
        trajectory = make(time)
        assert trajectory.on_grid() is trajectory
        assert trajectory.dt == float(np.median(np.diff(time)))


def test_repeated_rows_are_dropped_and_a_shared_stamp_is_not_lost():
    time = np.repeat(np.arange(1000) / 100.0, np.where(np.arange(1000) % 100 == 50, 2, 1))
    values = np.repeat(rng().standard_normal((1000, 3)), np.where(np.arange(1000) % 100 == 50, 2, 1), axis=0)
    grid = Trajectory(time, {"imu/gyr": values}).on_grid()
    assert len(grid) == 1000
    assert np.isfinite(grid.measurements["imu/gyr"]).all()
    with pytest.warns(UserWarning, match=r"100 time stamps are shared.*100 Hz"):
        spread = make(np.repeat(np.arange(1, 101) / 10.0, 10)).on_grid()
    np.testing.assert_array_equal(spread.measurements["imu/gyr"][:, 0], np.arange(1000.0))
    assert spread.dt == pytest.approx(0.01)


@pytest.mark.parametrize(("resolution", "start"), [(60.0, 50.0), (60.0, 0.0), (10.0, 5.0)])
def test_stamps_that_are_too_coarse_have_no_rate(resolution, start):
    time = np.floor((start + np.arange(2000) / 100) / resolution) * resolution
    with pytest.raises(ValueError, match=r"share .* stamp"):
        fit_clock(time)


def test_samples_of_one_stamp_have_no_rate():
    with pytest.raises(ValueError, match="time must increase"):
        make(np.zeros(5))


def test_fast_sensors_with_coarse_stamps_and_lost_rows_are_doubted():
    index = np.flatnonzero(rng().random(N) >= 0.3)
    with pytest.warns(UserWarning, match="missing; if it is not the device's rate, name it"):
        make(np.round(index / 512.0, 3)).on_grid()
    grid = make(np.round(index / 512.0, 3), nominal_rate=512.0)
    assert grid.dt == pytest.approx(1 / 512.0, rel=1e-4)


@pytest.mark.parametrize("seed", range(60))
def test_grids_of_any_rate_jitter_loss_and_gap(seed):
    """Rates from 10 to 400 Hz; the grid is the sensor's, or (with much jitter and loss) there is an error."""
    draw = np.random.default_rng(seed)
    rate = float(np.exp(draw.uniform(np.log(10.0), np.log(400.0))))
    jitter, loss, gap = draw.choice([0.0, 0.02, 0.1]), draw.choice([0.0, 0.01, 0.1, 0.3]), draw.choice([0.0, 0.0, 1.0])
    index = np.arange(2000)
    index = np.where(index > 1000, index + int(gap * rate), index)
    index = index[(draw.random(2000) >= loss) | (np.arange(2000) == 0)]
    time = draw.choice([0.0, 1000.0, 1.7e9]) + np.sort(index + jitter * draw.standard_normal(len(index))) / rate
    clock = fit_clock(np.round(time, 3) if draw.random() < 0.5 else time)
    assert clock.interval == pytest.approx(1.0 / rate, rel=1e-3)
    # One tick at the start, or one of a gap, may be in doubt.
    assert np.abs(np.diff(clock.index) - np.diff(index)).sum() <= 0.02 * len(index)


def test_stamps_of_single_precision_are_named():
    stamps = (1.7e9 + np.arange(100) / 100.0).astype(np.float32)
    with pytest.raises(ValueError, match="the stamps are of single precision"):
        Trajectory(stamps, {"imu/gyr": np.zeros((100, 3))})


@pytest.mark.parametrize("nominal", [5.0, 50.0])
def test_a_nominal_rate_that_the_stamps_contradict_is_named(nominal):
    motion = simulate_hand("slow", seed=0, duration=2.0)
    named = motion.replace(metadata={"nominal_rate": nominal})
    with pytest.warns(UserWarning, match=f"a nominal rate of {nominal:g} Hz is named, but the stamps are 100 Hz"):
        assert named.on_grid().dt == pytest.approx(0.01)
    assert any("is named, but" in str(finding) for finding in poise.check_recording(named))


@pytest.mark.parametrize("rate", [104.0, 120.0, 128.0, 286.0])
@pytest.mark.parametrize("resolution", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("rounded", [np.round, np.floor])
def test_stamps_coarser_than_the_interval_keep_rate_and_gaps(rate, resolution, rounded):
    index = np.delete(np.arange(int(40 * rate)), np.arange(int(20 * rate), int(25 * rate)))
    stamps = rounded(index / rate / resolution + 1e-9) * resolution
    clock = fit_clock(1000.0 + stamps)
    # Where a gap begins within a stamp, its length is known to a stamp.
    assert clock.interval == pytest.approx(1.0 / rate, rel=5e-3 if resolution == 1.0 else 5e-4)
    assert np.abs(clock.index - index).max() <= 1.5 * resolution * rate + 1
    assert clock.packets > 0
