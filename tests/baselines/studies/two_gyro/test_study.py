"""The two-gyroscope study: errors that are taken away from sensors, cases, and the whole of it on short rides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.studies.averages import windowed
from poise.baselines.studies.kit import Study
from poise.baselines.studies.report import Report
from poise.baselines.studies.sensors import without_errors
from poise.baselines.studies.two_gyro.bounds import bound
from poise.baselines.studies.two_gyro.motion import DEG, IDEAL, MOTIONS, Errors, simulate
from poise.baselines.studies.two_gyro.rides import RIDES
from poise.baselines.studies.two_gyro.simulation import Case, final_consistency, outcome
from poise.baselines.studies.two_gyro.study import reproduce
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.two_gyro.truth import true_angles
from poise.filters.core import rotation

GYROSCOPES, CAMERA = ("bicycle_imu/gyr", "trunk_imu/gyr"), "relative/orientation"


def test_errors_are_taken_away():
    """What is left are the samples of ideal sensors, the same gaps, and white noise only."""
    errors = Errors(camera_interval=4)
    ride = simulate(MOTIONS["circle"], 5.0, 0.01, errors, np.random.default_rng(0))
    ideal = simulate(MOTIONS["circle"], 5.0, 0.01, replace(IDEAL, camera_interval=4))
    exact = without_errors(ride, exact=(*GYROSCOPES, CAMERA))
    for name, samples in ideal.measurements.items():
        np.testing.assert_allclose(exact[name][1:], samples[1:], atol=1e-9)
    unbiased = without_errors(ride, unbiased=GYROSCOPES)
    for place in ("bicycle_imu", "trunk_imu"):
        white = unbiased[f"{place}/gyr"] - ideal.measurements[f"{place}/gyr"]
        np.testing.assert_allclose(white.std(axis=0), 0.1 * DEG, rtol=0.15)
        np.testing.assert_allclose(white.mean(axis=0), 0.0, atol=0.015 * DEG)
    np.testing.assert_array_equal(unbiased["relative/orientation"], ride.measurements["relative/orientation"])

    turned = np.array([0.02, -0.01, 0.03])
    off = rotation.multiply(ideal.measurements["relative/orientation"], rotation.exp(turned))
    biased = ideal.replace(
        measurements={**ideal.measurements, "relative/orientation": off},
        truth={**ideal.truth, "relative/orientation_bias": np.tile(turned, (len(ideal), 1))},
    )
    found = without_errors(biased, unbiased=(CAMERA,))["relative/orientation"]
    np.testing.assert_allclose(found, ideal.measurements["relative/orientation"], atol=1e-12)


def test_a_tilted_gyroscope_stays_tilted():
    ride = simulate(MOTIONS["circle"], 1.0, 0.01)
    tilted = ride.replace(metadata={"geometry": RiderGeometry().describe()})
    level, mounted = (without_errors(each, exact=GYROSCOPES)["bicycle_imu/gyr"] for each in (ride, tilted))
    turn = rotation.exp(np.array([0.0, -RiderGeometry().bicycle_imu_tilt, 0.0]))
    np.testing.assert_allclose(rotation.rotate(turn, mounted), level, atol=1e-12)


def test_errors_and_their_windows():
    ride = simulate(MOTIONS["circle"], 30.0, 0.1)
    truth = true_angles(ride.truth)
    pose = {name: truth[name] + 2.0 * DEG for name in ("bicycle/roll", "two-gyro/relative_angles")}
    pose["bicycle/roll"][:50] += 1.0
    errors = RIDES.errors(pose, truth)
    assert windowed(errors, ride.time, 10.0) == pytest.approx({"θ1": 2.0, "θ2": 2.0, "θ3": 2.0, "φ": 2.0})
    assert windowed(errors, ride.time, 0.0)["φ"] > 20.0
    assert np.isnan(windowed(errors, ride.time / 10.0, 10.0)["φ"])


def test_a_simulated_case():
    """The wrong start shows at first and is gone later; a drawn start is consistent on the whole."""
    found = outcome(Case(start=20.0, prior=15.0, duration=40.0), 0)
    assert found["peak"] < 1.5
    assert found["late"][3] < 0.3
    assert found["first"][3] > found["late"][3]
    normalised = final_consistency(Case(duration=5.0), 0)
    assert 0.0 < normalised["nees"] < 40.0
    assert normalised["nis"] == pytest.approx(3.0, rel=0.2)


def test_bounds_of_a_case():
    deviations = bound(MOTIONS["circle"], "sigma2", 3.0)
    assert deviations.shape == (151, 4)
    assert deviations[0, 0] == pytest.approx(5.0)
    assert deviations[-1].max() < 1.0


@pytest.mark.slow
def test_the_whole_study(tmp_path):
    study = Study(tmp_path, quick=True, subjects=(0,), seeds=1, duration=20.0, progress=False)
    report = Report(tmp_path)
    reproduce(study, report)
    titles = [entry.title for entry in report.entries]
    assert {"Table I, indoor_circle", "Fixture (figures 6 to 8)", "Generic rank by Lie derivatives", "Pitch"} <= set(
        titles
    )
    table = next(entry.rows for entry in report.entries if entry.title.startswith("Where errors come from, indoor"))
    roll = {row["sensors"]: row["φ"] for row in table}
    assert roll["no errors"] < 0.2
    claims = [row for entry in report.entries for row in entry.rows if "statement" in row]
    assert {row["holds"] for row in claims} >= {True, False}
    assert all(entry.figure.stat().st_size > 10_000 for entry in report.entries if entry.figure is not None)
