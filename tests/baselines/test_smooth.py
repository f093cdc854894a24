"""Smoothing by name and over trajectories, in tables too."""

import numpy as np
import pytest

import poise
from poise.filters.core.offline import Offline


@pytest.fixture(scope="module")
def trajectory():
    return poise.record("poise/HandMotion-v0", seed=5)


def rms(table, label):
    chosen = table[(table.estimator == label) & (table.metric == "inclination")]
    return float(chosen.value.iloc[0])


def test_offline_estimates_are_better_and_stand_in_the_table(trajectory):
    table = poise.evaluate(["bounded-motion", "mekf", "tilt"], trajectory, offline=True)
    assert set(table.estimator) == {"bounded-motion", "mekf", "tilt", "bounded-motion (offline)", "mekf (offline)"}
    assert rms(table, "bounded-motion (offline)") < 0.9 * rms(table, "bounded-motion")
    assert rms(table, "mekf (offline)") < 0.9 * rms(table, "mekf")
    assert table.attrs["skipped"] == []


def test_smooth_takes_names_filters_and_smoothers(trajectory):
    by_name = poise.smooth("mekf", trajectory)
    estimator = poise.make_estimator("mekf", dt=trajectory.dt)
    for other in (
        poise.smooth(estimator, trajectory),
        poise.run("mekf (offline)", trajectory),
        poise.run(Offline(estimator), trajectory.measurements, dt=trajectory.dt),
        poise.smooth("mekf", trajectory.measurements, dt=trajectory.dt),
    ):
        np.testing.assert_array_equal(by_name.pose["up"], other.pose["up"])
        np.testing.assert_array_equal(by_name.covariance, other.covariance)
    filtered = poise.run("mekf", trajectory)
    np.testing.assert_array_equal(filtered.innovation, by_name.innovation)
    np.testing.assert_array_equal(filtered.pose["up"][-1], by_name.pose["up"][-1])
    assert "std_roll" in by_name.to_frame()


def test_rows_that_were_lost_are_bridged(trajectory):
    """Smoothing is better inside of gaps than the filter, and knows it."""
    keep = np.ones(len(trajectory), bool)
    keep[800:840] = keep[1500:1550] = False
    lost = poise.Trajectory(
        trajectory.time[keep],
        {name: values[keep] for name, values in trajectory.measurements.items()},
        {name: values[keep] for name, values in trajectory.truth.items()},
    )
    filtered, smoothed = (call("bounded-motion", lost, grid=True) for call in (poise.run, poise.smooth))
    assert len(filtered.pose["up"]) == len(smoothed.pose["up"]) == len(trajectory)

    def error(estimate):
        cosine = np.sum(estimate.pose["up"] * trajectory.truth["up"], axis=1)
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))

    gaps = ~keep
    assert error(smoothed)[gaps].mean() < error(filtered)[gaps].mean()
    variance = [np.trace(each.covariance[:, :3, :3], axis1=1, axis2=2)[gaps].mean() for each in (smoothed, filtered)]
    assert variance[0] < variance[1]


def test_vqf_has_the_offline_form_of_its_package(trajectory):
    vqf = pytest.importorskip("vqf")
    arrays = {name: np.array(trajectory.measurements[name]) for name in ("imu/gyr", "imu/acc")}
    wanted = vqf.offlineVQF(arrays["imu/gyr"], arrays["imu/acc"], None, trajectory.dt)
    estimate = poise.smooth("vqf", trajectory)
    np.testing.assert_allclose(estimate.pose["relative_orientation"], wanted["quat6D"], atol=1e-12)
    arrays["imu/acc"][100:110] = np.nan
    assert np.isfinite(poise.smooth("vqf", arrays, dt=trajectory.dt).pose["up"]).all()
    with pytest.raises(ValueError, match="at least one valid sample"):
        poise.smooth("vqf", {**arrays, "imu/acc": np.full((len(trajectory), 3), np.nan)}, dt=trajectory.dt)


@pytest.mark.parametrize(
    ("name", "message"),
    [("gru", "has no smoother"), ("tilt", "has no smoother"), ("bounded", "did you mean"), (3, "has no smoother")],
)
def test_what_cannot_be_smoothed_is_named(name, message, trajectory):
    with pytest.raises(ValueError, match=message):
        poise.smooth(name, trajectory)


def test_arrays_need_an_interval_and_steps_are_refused(trajectory):
    with pytest.raises(ValueError, match="pass dt"):
        poise.smooth("mekf", trajectory.measurements)
    with pytest.raises(TypeError, match="whole recording"):
        poise.make_estimator("mekf (offline)").init({"imu/gyr": np.zeros(3), "imu/acc": np.ones(3)})
