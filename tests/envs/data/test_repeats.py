"""Samples that a recorder wrote again where none came: found, and left alone where they are a sensor's own."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import poise
from poise.baselines.online import OnlineEstimator
from poise.envs.data.plausibility.recording import check_recording
from poise.envs.data.repeats import RunsSoFar, moves, repeated, repeated_blocks, runs_of, zeros_in_motion
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import metrics

KNOWN = simulate_hand("mixed", seed=22, duration=30.0)


def frozen(*kinds: str, begin: int = 1000, end: int | None = 1200, every: int | None = None) -> Trajectory:
    """The recording with the last sample instead of those of some rows, once or again and again."""
    changed = {name: np.array(values) for name, values in KNOWN.measurements.items()}
    length = (len(KNOWN) if end is None else end) - begin
    for start in range(begin, len(KNOWN), every) if every else (begin,):
        for kind in kinds:
            changed[f"imu/{kind}"][start + 1 : start + length] = changed[f"imu/{kind}"][start]
    return KNOWN.replace(measurements=changed)


def largest(name: str, trajectory: Trajectory) -> float:
    up = poise.run(name, trajectory).pose["up"]
    return float(np.degrees(metrics.direction_error(up, KNOWN.truth_of("up")))[1400:].max())


@pytest.mark.parametrize(
    ("trajectory", "channels"),
    [
        (frozen("gyr", "acc", "mag"), ("gyr", "acc", "mag")),
        (frozen("gyr", end=1020), ("gyr",)),
        (frozen("acc", end=1500), ("acc",)),
        (frozen("mag", end=2000), ("mag",)),
        (frozen("gyr", "acc", begin=600, end=610, every=200), ("gyr", "acc")),
        (frozen("acc", begin=1500, end=None), ("acc",)),
        (frozen("mag", begin=0, end=None), ("mag",)),
    ],
)
def test_a_sensor_that_is_stuck_gives_no_samples(trajectory: Trajectory, channels: tuple[str, ...]) -> None:
    for name, values in trajectory.measurements.items():
        wrong = (values != KNOWN.measurements[name]).any(axis=1)
        found = repeated(values, 0.01, moves(trajectory.measurements["imu/gyr"]))
        if name == "imu/mag" and wrong[1:].all():
            wrong[0] = False
        np.testing.assert_array_equal(found, wrong, err_msg=name)
        assert wrong.any() == (name.rpartition("/")[2] in channels)
    told = {finding.channel for finding in check_recording(trajectory)}
    assert told >= {f"imu/{kind}" for kind in channels}


@pytest.mark.parametrize("name", ["mekf", "bounded-motion-9", "vqf"])
def test_what_it_repeats_misleads_nobody(name: str) -> None:
    trajectory = frozen("gyr", "acc", "mag", end=1040)
    with pytest.warns(UserWarning, match="imu/gyr: 39 repeats of an earlier sample"):
        error = largest(name, trajectory)
    absent = {key: np.where(repeated(v, 0.01)[:, None], np.nan, v) for key, v in trajectory.measurements.items()}
    assert error == largest(name, KNOWN.replace(measurements=absent))


@pytest.mark.parametrize(("begin", "end"), [(0, 200), (900, 1000), (2500, 2600)])
def test_a_gyroscope_s_zeros_in_motion_are_no_rates(begin: int, end: int) -> None:
    changed = {name: np.array(values) for name, values in KNOWN.measurements.items()}
    changed["imu/gyr"][begin:end] = 0.0
    with pytest.warns(UserWarning, match=f"imu/gyr: {end - begin} rows of zeros"):
        found = poise.run("mekf", KNOWN.replace(measurements=changed)).pose["up"]
    changed["imu/gyr"][begin:end] = np.nan
    np.testing.assert_array_equal(found, poise.run("mekf", KNOWN.replace(measurements=changed)).pose["up"])


def test_a_gyroscope_that_writes_zeros_at_rest_is_believed() -> None:
    rng = np.random.default_rng(1)
    force = np.array([0.0, 0.0, 9.81]) + 0.05 * rng.standard_normal((len(KNOWN), 3))
    rates = np.array(KNOWN.measurements["imu/gyr"])
    rates[1000:2000] = 0.0
    assert not zeros_in_motion(rates, force, 0.01).any()


def test_a_sensor_s_own_repeats_are_left_alone() -> None:
    rng = np.random.default_rng(0)
    gyr, acc, mag = (np.array(KNOWN.measurements[f"imu/{kind}"]) for kind in ("gyr", "acc", "mag"))
    turning = np.ones(len(gyr), bool)
    slow = np.repeat(mag[::10], 10, axis=0)[: len(mag)]
    irregular = mag[np.minimum.accumulate(np.sort(rng.choice(len(mag), len(mag)))[::-1])[::-1]]
    coarse = np.round(0.3 * rng.standard_normal((3000, 3)))
    for values in (gyr, acc, mag, slow, irregular, coarse):
        assert not repeated(values, 0.01, turning).any()
    assert int(runs_of(coarse)[1].max()) > 4
    # a rest without noise
    still = np.concatenate([acc[:500], np.tile(acc[500], (300, 1)), acc[500:]])
    rates = np.concatenate([gyr[:500], np.zeros((300, 3)), gyr[500:]])
    assert not repeated(still, 0.01, moves(rates)).any()
    assert not repeated(rates, 0.01, moves(rates)).any()
    # a pause of a slow sensor
    slow[1000:1200] = slow[1000]
    assert repeated(slow, 0.01, turning)[1001:1200].all()


@pytest.mark.parametrize("sensors", [None, "ideal"])
@pytest.mark.parametrize("gesture", ["slow", "fast", "walk", "pointing"])
def test_nothing_is_found_in_simulations(gesture: str, sensors: str | None) -> None:
    hand = simulate_hand(gesture, seed=3, sensors=sensors, duration=15.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        poise.run("tilt", hand)


def test_repeats_that_arrive_are_none_from_the_first_that_is_too_many() -> None:
    trajectory, runs = frozen("gyr", "acc", end=1040), RunsSoFar()
    rows = [{name: values[row] for name, values in trajectory.measurements.items()} for row in range(1100)]
    found = [runs.without_repeats(row, 0.01) for row in rows]
    missing = np.array([np.isnan(each["imu/gyr"]).all() for each in found])
    np.testing.assert_array_equal(np.flatnonzero(missing), np.arange(1004, 1040))
    assert all(np.isfinite(each["imu/mag"]).all() for each in found)


def test_a_loop_that_is_stuck_predicts() -> None:
    trajectory, stepping = frozen("gyr", "acc", "mag", end=1100), OnlineEstimator(poise.make_estimator("mekf", dt=0.01))
    for row in range(1100):
        estimate = stepping.step({name: values[row] for name, values in trajectory.measurements.items()})
    assert estimate.covariance is not None
    assert np.degrees(np.sqrt(np.trace(estimate.covariance[:3, :3]) / 3.0)) > 10.0


def written_again(kind: str, begin: int, length: int, lag: int) -> Trajectory:
    """The recording with the samples from ``begin`` on overwritten by those that stood there ``lag`` before."""
    changed = np.array(KNOWN.measurements[f"imu/{kind}"])
    changed[begin : begin + length] = np.resize(changed[begin - lag : begin], (length, 3))
    return KNOWN.replace(measurements=KNOWN.measurements | {f"imu/{kind}": changed})


@pytest.mark.parametrize("kind", ["gyr", "acc", "mag"])
@pytest.mark.parametrize(
    ("begin", "length", "lag"), [(1000, 50, 50), (2000, 12, 12), (1500, 200, 40), (2500, 30, 1700)]
)
def test_blocks_that_were_written_again_are_none(kind: str, begin: int, length: int, lag: int) -> None:
    faulty = written_again(kind, begin, length, lag)
    with pytest.warns(UserWarning, match=f"imu/{kind}: {length} samples of blocks that were written again"):
        found = poise.run("bounded-motion-9", faulty)
    absent = np.array(faulty.measurements[f"imu/{kind}"])
    absent[begin : begin + length] = np.nan
    expected = poise.run("bounded-motion-9", faulty.replace(measurements=faulty.measurements | {f"imu/{kind}": absent}))
    np.testing.assert_array_equal(found.pose["up"], expected.pose["up"])
    told = [each.what for each in check_recording(faulty) if each.channel == f"imu/{kind}"]
    assert any(f"from sample {begin}" in what for what in told)


def test_rows_that_were_sent_twice_are_named_where_they_begin() -> None:
    order = np.r_[0:1200, 1150:1200, 1200 : len(KNOWN)]
    measurements = {name: values[order] for name, values in KNOWN.measurements.items()}
    twice = Trajectory(np.arange(len(order)) * 0.01, measurements)
    told = [str(each) for each in check_recording(twice)]
    assert sum("50 samples in blocks that stood there before, from sample 1200" in each for each in told) == 3


@pytest.mark.parametrize(("kind", "axis"), [("gyr", 0), ("gyr", 2), ("acc", 1), ("mag", 0)])
@pytest.mark.parametrize(("begin", "end"), [(1200, 1300), (1500, 3001)])
def test_an_axis_that_fails_on_the_way_is_named_and_leaves_no_samples(
    kind: str, axis: int, begin: int, end: int
) -> None:
    changed = np.array(KNOWN.measurements[f"imu/{kind}"])
    changed[begin:end, axis] = changed[begin, axis]
    faulty = KNOWN.replace(measurements=KNOWN.measurements | {f"imu/{kind}": changed})
    np.testing.assert_array_equal(np.flatnonzero(repeated(changed, 0.01)), np.arange(begin + 1, min(end, len(changed))))
    told = [str(each) for each in check_recording(faulty) if each.severity == "warning"]
    assert any(f"imu/{kind}: axis {'xyz'[axis]} stands at" in each and f"sample {begin}" in each for each in told)


def test_what_may_be_equal_by_chance_or_in_a_loop_is_left_alone() -> None:
    rng = np.random.default_rng(2)
    rest = np.round(1.2 * rng.standard_normal((30000, 3)))
    slow = np.repeat(rest[:3000], 10, axis=0)
    loop = np.tile(KNOWN.measurements["imu/gyr"][:500], (4, 1))
    for values in (rest, slow, loop, np.zeros((400, 3)), np.full((400, 3), np.nan), loop[:12]):
        assert not repeated_blocks(values).any()
    coarse = np.round(KNOWN.measurements["imu/gyr"], 2)
    assert not repeated_blocks(coarse).any()
    coarse[2000:2040] = coarse[700:740]
    assert repeated_blocks(coarse)[2000:2040].mean() > 0.9
