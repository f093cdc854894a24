"""The force/inertial study: exact data, consistency, better sensors, the order of the synthetic table."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.force_inertial.motion import NO_ERRORS, Errors, draw_motion, simulate
from poise.baselines.studies.force_inertial.observability import ideal_consistency
from poise.baselines.studies.force_inertial.simulation import synthetic, variant, without_forces
from poise.baselines.studies.force_inertial.states import from_the_truth, torques, true_states
from poise.baselines.studies.force_inertial.study import reproduce
from poise.baselines.studies.kit import Study
from poise.baselines.studies.report import Report
from poise.baselines.studies.sensors import without_errors
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.record import record
from poise.filters.bicycle.force_inertial.filter import ForceInertial
from poise.filters.core.kalman import KalmanFilter


def test_the_model_predicts_what_the_exact_data_read():
    """Only the low-passed differences lag behind."""
    samples, truth = synthetic("outdoor", 1, 8.0, 0, NO_ERRORS)
    samples, truth = ({name: array[:, 0] for name, array in part.items()} for part in (samples, truth))
    read, predicted = torques(ForceInertial.published(), samples, truth)
    assert np.abs(read[50:]).max() > 30.0
    assert np.abs(predicted - read)[50:].max() < 2.5
    quick = ForceInertial.published(gyroscope_filter=0.0, speed_filter=0.0)
    assert np.abs(torques(quick, samples, truth)[1] - read)[50:].max() < 1.0


def test_true_states_remember_as_the_filter_does():
    samples, truth = synthetic("indoor", 1, 2.0, 1, Errors())
    samples, truth = ({name: array[:, 0] for name, array in part.items()} for part in (samples, truth))
    model = ForceInertial.published()
    x = true_states(model, samples, truth)
    for k in (1, 7, 60):
        now, before = ({name: array[j] for name, array in samples.items()} for j in (k, k - 1))
        np.testing.assert_allclose(model.predict(x[k - 1], now, before)[0][7:], x[k][7:], atol=1e-9)


def test_consistent_where_the_model_is_exact():
    for name, found in ideal_consistency(60, 4.0, 1, level=0.999).items():
        assert found.consistent, (name, found)


def test_sensors_without_errors_are_the_environment_s():
    rides = []
    for sensors in ("paper", "ideal"):
        settings = {"fidelity": "lumped", "duration": 0.6, "suite": "force-inertial", "sensors": sensors}
        env = RiderBicycleEnv("straight", 2, **settings)
        rides.append(record(env, seed=3))
        env.close()
    noisy, ideal = rides
    forces = ("seat/wrench", "handlebar/force")
    found = without_errors(noisy, exact=forces)
    for name in forces:
        sampled = np.isfinite(ideal.measurements[name]) & np.isfinite(noisy.measurements[name])
        np.testing.assert_allclose(found[name][sampled], ideal.measurements[name][sampled], atol=1e-6)
    known = without_errors(noisy, unbiased=forces)
    assert np.nanmax(np.abs(known["seat/wrench"] - noisy.measurements["seat/wrench"])) > 0.0
    np.testing.assert_array_equal(known["trunk_imu/gyr"], noisy.measurements["trunk_imu/gyr"])
    with pytest.raises(ValueError, match="the ride has no channel 'disk/gyr'"):
        without_errors(noisy, unbiased=("disk/gyr",))
    with pytest.raises(ValueError, match="ideal samples of 'wheel/speed' are not known"):
        without_errors(noisy, exact=("wheel/speed",))


def test_integration_from_the_truth_ignores_forces():
    samples, truth = synthetic("indoor", 2, 2.0, 4, NO_ERRORS)
    kalman = KalmanFilter(ForceInertial.published(shoulder_noise=1e6, gyroscope_sample="previous"), compiled=False)
    pose = from_the_truth(kalman, without_forces(samples), truth)
    error = pose["force-inertial/trunk_angles"][-1] - truth["force-inertial/trunk_angles"][-1]
    assert np.degrees(np.abs(error)).max() < 0.5
    off = from_the_truth(kalman, without_forces(samples), truth, 0.1)["force-inertial/trunk_angles"]
    assert np.abs(off[0, :, 0] - truth["force-inertial/trunk_angles"][1, :, 0] - 0.1).max() < 0.02


def test_exact_data_repeat():
    motion = draw_motion(np.random.default_rng(0), "indoor", Errors())
    first, again = (
        simulate(motion, Errors(), ForceInertial.published(), 0.5, np.random.default_rng(1))[0] for _ in range(2)
    )
    for name, array in first.items():
        np.testing.assert_array_equal(array, again[name])
    with pytest.raises(ValueError, match="course must be"):
        draw_motion(np.random.default_rng(0), "hall", Errors())  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_synthetic_table_in_order_and_size():
    names = (
        "exact: differentiated gyroscopes, apparent vertical",
        "same, (13) as published",
        "static torque, (13) as published",
    )
    exact, raw, static = (variant(name, "indoor", 2, 30.0, 0) for name in names)
    assert max(exact[:3]) < 1.5
    assert exact[3] < 0.3
    assert 7.0 < raw[3] < 11.0
    assert static[0] > 5.0 * exact[0]


@pytest.mark.slow
def test_the_whole_study(tmp_path):
    study = Study(tmp_path, quick=True, subjects=(0,), seeds=1, duration=14.0, processes=1, progress=False)
    report = Report(tmp_path)
    reproduce(study, report)
    titles = [entry.title for entry in report.entries]
    assert "Table II, indoor_circle" in titles
    assert "Consistency where the model is exact" in titles
    assert report.results
