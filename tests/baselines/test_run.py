"""``poise.run``: the clock of trajectories, bare arrays, contradictions."""

import numpy as np
import pytest

import poise
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core.estimator import run as run_sequence
from poise.filters.core.metrics import DEGREES, direction_error, rms


@pytest.fixture(scope="module")
def motion():
    return simulate_hand("slow", seed=2, duration=30.0)


def at_rate(motion, rate):
    return motion.resampled(rate)


def error(estimate, trajectory, skip=2.0):
    late = trajectory.time > trajectory.time[0] + skip
    return float(rms(direction_error(estimate.pose["up"], trajectory.truth_of("up")), late)) * DEGREES


def test_a_trajectory_on_its_grid_gives_the_estimator_s_own_numbers(motion):
    estimate = poise.run("mekf", motion)
    expected = run_sequence(poise.make_estimator("mekf", dt=motion.dt), motion.measurements)
    for name, values in expected.pose.items():
        np.testing.assert_array_equal(estimate.pose[name], values)
    np.testing.assert_array_equal(estimate.covariance, expected.covariance)
    np.testing.assert_array_equal(estimate.time, motion.time)


@pytest.mark.parametrize("name", ["mekf", "bounded-motion", "vqf"])
@pytest.mark.parametrize("rate", [400.0, 286.0, 60.0])
def test_an_estimator_made_without_dt_runs_at_the_trajectory_s_rate(motion, name, rate):
    trajectory = at_rate(motion, rate)
    named, made = poise.run(name, trajectory), poise.run(poise.make_estimator(name), trajectory)
    np.testing.assert_allclose(named.pose["up"], made.pose["up"], atol=1e-12)
    assert error(named, trajectory) < 2.0


@pytest.mark.parametrize("kind", ["rounded to ms", "rows lost", "one gap", "jitter"])
def test_real_clocks_give_nearly_the_error_of_the_exact_one(motion, kind):
    exact = at_rate(motion, 286.0)
    time, kept = exact.time.copy(), np.ones(len(exact), bool)
    generator = np.random.default_rng(5)
    if kind == "rounded to ms":
        time = np.round(time, 3)
    elif kind == "rows lost":
        kept = generator.random(len(exact)) > 0.1
        kept[0] = True
    elif kind == "one gap":
        kept[3000:3150] = False
    else:
        time = time + generator.uniform(-0.4e-3, 0.4e-3, len(time))
    rows = np.flatnonzero(kept)
    trajectory = Trajectory(
        time[rows],
        {name: values[rows] for name, values in exact.measurements.items()},
        {name: values[rows] for name, values in exact.truth.items()},
    )
    estimate = poise.run("mekf", trajectory)
    assert estimate.pose["up"].shape == (len(trajectory), 3)
    np.testing.assert_array_equal(estimate.time, trajectory.time)
    allowed = 6.0 if kind == "one gap" else 0.3
    assert error(estimate, trajectory) < error(poise.run("mekf", exact), exact) + allowed
    on_grid = poise.run("mekf", trajectory, grid=True)
    assert np.ptp(np.diff(on_grid.time)) < 1e-6
    assert len(on_grid.time) >= len(trajectory)


def test_arrays_need_an_interval(motion):
    arrays = motion.measurements
    for estimator in ("mekf", poise.make_estimator("mekf")):
        with pytest.raises(ValueError, match="pass dt"):
            poise.run(estimator, arrays)
    estimate = poise.run("mekf", arrays, dt=motion.dt)
    np.testing.assert_array_equal(estimate.pose["up"], poise.run("mekf", motion).pose["up"])
    np.testing.assert_allclose(estimate.time, motion.time - motion.time[0], atol=1e-9)
    batch = {name: np.stack([values, values], axis=1) for name, values in arrays.items()}
    assert poise.run("mekf", batch, dt=motion.dt).pose["up"].shape == (len(motion), 2, 3)


def test_contradictions_are_errors(motion):
    with pytest.raises(ValueError, match="contradicts"):
        poise.run("mekf", motion, dt=0.02)
    with pytest.raises(ValueError, match=r"with_dt\(0.02\)"):
        poise.run(poise.make_estimator("mekf", dt=0.01), motion.measurements, dt=0.02)
    poise.run("mekf", motion, dt=motion.dt)


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf, "0.01", True, [0.01]])
def test_an_interval_is_a_positive_number(motion, dt):
    with pytest.raises(ValueError, match="dt must be a positive number"):
        poise.run("mekf", motion.measurements, dt=dt)


def test_other_data_are_named():
    with pytest.raises(ValueError, match="Trajectory or a mapping"):
        poise.run("mekf", np.zeros((10, 3)))


@pytest.mark.parametrize("channel", ["imu/gyr", "imu/acc"])
@pytest.mark.parametrize("value", [np.nan, 1e12])
def test_no_estimate_at_all_has_its_cause(motion, channel, value):
    empty = {**motion.measurements, channel: np.full((len(motion), 3), value)}
    cause = f"no estimate at all: {channel} without a valid sample"
    with pytest.warns(UserWarning, match=cause):
        poise.run("vqf", motion.replace(measurements=empty))
    with pytest.warns(UserWarning, match=cause):
        poise.run("vqf", empty, dt=motion.dt)
    with (
        pytest.warns(UserWarning, match="not run"),
        pytest.raises(ValueError, match=f"nothing could be run: vqf: {cause}"),
    ):
        poise.evaluate("vqf", motion.replace(measurements=empty))


def test_arrays_are_read_as_a_trajectory_of_them_would_be(motion):
    arrays = {name: np.array(motion.measurements[name]) for name in ("imu/gyr", "imu/acc")}
    arrays["imu/acc"][1000] = 70.0
    arrays["imu/gyr"][1500:1540] = arrays["imu/gyr"][1500]
    with pytest.warns(UserWarning, match="count as missing samples"):
        found = poise.run("bounded-motion", arrays, dt=motion.dt)
    with pytest.warns(UserWarning, match="count as missing samples"):
        expected = poise.run("bounded-motion", motion.replace(measurements=motion.measurements | arrays))
    np.testing.assert_allclose(found.pose["up"], expected.pose["up"], atol=1e-9)


def test_an_implausible_recording_is_told_once_and_a_simulated_one_is_not_checked(motion, recwarn):
    poise.run("mekf", motion)
    turned = motion.replace(measurements={**motion.measurements, "imu/gyr": -motion.measurements["imu/gyr"]})
    poise.run("mekf", turned, check=False)
    assert not recwarn
    with pytest.warns(UserWarning, match="of the gyroscope all signs are reversed") as told:
        poise.run("mekf", turned)
    assert told[0].filename == __file__
    poise.smooth("mekf", turned)
    assert not recwarn
    with pytest.raises(ValueError, match="check must be True or False, got 1"):
        poise.run("mekf", turned, check=1)
