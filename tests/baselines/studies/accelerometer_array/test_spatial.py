"""Chapter 5 of the thesis on the game controller: the study's functions, and that sections of the report are made."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.accelerometer_array import comparison as array_comparison
from poise.baselines.studies.accelerometer_array import spatial as spatial_study
from poise.baselines.studies.accelerometer_array.experiment import attitude_nees
from poise.baselines.studies.accelerometer_array.spatial import (
    METHODS,
    PROPOSED,
    attitude_errors,
    attitude_table,
    pointed,
)
from poise.baselines.studies.kit import Study
from poise.baselines.studies.report import Report
from poise.filters.arrays.array import CONTROLLER
from poise.filters.core import metrics, rotation


@pytest.fixture
def study(tmp_path):
    return Study(tmp_path, quick=True, processes=1, progress=False)


def test_a_row_tells_the_errors_of_pointing():
    (row,) = attitude_errors("controller", 3, 12.0, methods=(PROPOSED,))
    assert (row["device"], row["method"], row["seed"]) == ("controller", PROPOSED, 3)
    assert 0.0 < row["pitch"] < row["pitch_max"] < 4.0
    assert row["pitch"] < row["total"] < 3.0
    assert row["inside"] > 0.95
    (line,) = attitude_table([row, row | {"pitch": row["pitch"] + 2.0, "pitch_max": 9.0}])
    assert line["pitch, rms"] == pytest.approx(row["pitch"] + 1.0)
    assert line["pitch, max"] == 9.0


def test_readings_are_the_thesis():
    trajectory = pointed("controller", 0, 20.0, dip=0.5)
    truth = trajectory.truth
    field = 50.0 * np.array([0.0, np.cos(0.5), -np.sin(0.5)])
    magnetic = rotation.rotate(truth["orientation"], trajectory.measurements["imu/mag"])
    np.testing.assert_allclose(magnetic.mean(axis=0), field, atol=0.1)
    assert (magnetic - field).std() == pytest.approx(0.5, rel=0.1)
    gyroscope = trajectory.measurements["imu/gyr"] - truth["angular_rate"]
    assert gyroscope.std() == pytest.approx(0.1, rel=0.1)
    moving = truth["acceleration"][200:]
    assert np.sqrt((moving**2).mean()) == pytest.approx(5.0, rel=0.4)


def test_errors_of_pitch_are_signed_and_those_of_azimuth_wrap():
    truth = rotation.from_euler_zyx(np.array([3.1]), np.array([0.0]), np.array([0.2]))
    estimate = rotation.from_euler_zyx(np.array([-3.1]), np.array([0.0]), np.array([0.3]))
    pitch, azimuth, total = spatial_study.pointing_errors(estimate, truth)
    np.testing.assert_allclose(pitch, 0.1, atol=1e-12)
    np.testing.assert_allclose(azimuth, -(2.0 * np.pi - 6.2), atol=1e-12)
    assert total[0] > 0.1


def test_the_covariance_of_the_controller_is_that_of_its_errors():
    assert 0.3 < attitude_nees("controller", 1, 20.0, calibrated=False) < 3.0


def canned(device, seed, duration, dip=0.0, methods=()):
    """What :func:`attitude_errors` would say, without simulating."""
    keys = ("pitch", "pitch_max", "azimuth", "azimuth_max", "inside", "total")
    numbers = dict(zip(keys, (0.5, 2.0, 0.6, 2.5, 0.9, 1.5), strict=True))
    chosen = [method for method in METHODS[device] if not methods or method in methods]
    return [{"device": device, "method": method, "seed": seed} | numbers for method in chosen]


PRIORS = ("closed prior", "open prior", "open prior, first order")
SHARES = (
    "proposed, exact rotation, beyond the arctangent",
    "tilt sensor, beyond the arcsine",
    f"{spatial_study.READING}, beyond the arcsine",
)


def canned_curves(device, seed, duration):
    line = [0.0, 1.0]
    return {"time": line, "pitch": line, "azimuth": line, "errors": {PROPOSED: [line, line]}}


def test_the_section_has_its_tables_and_figures(study, monkeypatch, tmp_path):
    monkeypatch.setattr(spatial_study, "attitude_errors", canned)
    monkeypatch.setattr(spatial_study, "simulated_curves", canned_curves)
    monkeypatch.setattr(spatial_study, "wrong_start", lambda seed: {prior: [3.0, 1.0] for prior in PRIORS})
    monkeypatch.setattr(spatial_study, "cone", lambda seed, duration: dict.fromkeys(SHARES, 0.1))
    report = Report(tmp_path / "run")
    spatial_study.spatial(study, report)
    titles = [entry.title for entry in report.entries]
    assert [title.split(":")[0] for title in titles] == [
        "Figures 5.6 to 5.10 and Table 5.1, simulation",
        "Figures 5.6 to 5.10",
        "Chapter 5",
        "Inclined field, 70° below the horizon",
        "Start rolled by 40°",
        "Figure 5.22",
        "Chapter 5, beyond the figures",
        "Figures 5.6 and 5.7",
        "Figure 5.8",
        "Figures 5.9 and 5.10",
        "Figure 5.11",
        "Figures 5.3 and 5.4",
        "Figure 5.5",
    ]
    compared = report.entries[0].rows
    assert len(compared) == 12
    assert {row["device"] for row in compared} == {"controller", "octa"}
    assert {row["trajectory"].split()[0] for row in report.results} == {"controller", "octa"}
    assert all(entry.figure is None or entry.figure.exists() for entry in report.entries)


def test_the_array_of_a_controller_stands_in_for_an_imu():
    trajectory = array_comparison.carried("slow", "array-data-sheet", 1, 5.0)
    truth = trajectory.truth
    force = rotation.rotate_back(truth["orientation"], np.array([0.0, 0.0, 9.80665])) + truth["external_acceleration"]
    error = metrics.vector_error(trajectory.measurements["imu/acc"], force)
    assert float(np.nanmax(error)) < 6 * 0.022
    noise = array_comparison.noise_of("array-data-sheet")
    left = trajectory.measurements["array/acc"] - CONTROLLER.readings(
        force, truth["angular_acceleration"], truth["angular_rate"]
    )
    assert noise["array_std"] == pytest.approx(float(np.nanstd(left)), rel=0.1)
    assert noise["gyroscope_std"] == pytest.approx(0.0052, rel=0.1)


def test_scores_join_what_an_estimator_tells():
    trajectory = array_comparison.carried("slow", "array-data-sheet", 1, 3.0)
    rows = array_comparison.scores(trajectory, {"six": "external-acceleration", "nine": "mekf-9"})
    assert [row["estimator"] for row in rows] == ["six", "nine"]
    assert rows[0]["total"] is None
    assert rows[0]["inclination"] < 3.0
    assert rows[1]["inclination"] <= rows[1]["total"]


def test_works_are_compared_in_tables(study, monkeypatch, tmp_path):
    def gestures(gesture, sensors, seed, duration):
        common = {"gesture": gesture, "sensors": sensors, "seed": seed, "skipped": None}
        both = {"estimator": "b", "total": 2.0, "inclination": 1.0, "heading": 1.0}
        none = dict.fromkeys(("total", "inclination", "heading"))
        lost = common | {"estimator": "c", "skipped": "no channel imu/mag"} | none
        return [common | both, common | {"estimator": "a"} | none | {"inclination": 0.5}, lost]

    monkeypatch.setattr(array_comparison, "gesture_errors", gestures)
    report = Report(tmp_path / "run")
    array_comparison.comparison(study, report)
    total, inclination, nothing = report.entries
    assert [row["estimator"] for row in total.rows] == ["b"]
    assert [row["estimator"] for row in inclination.rows] == ["a", "b"]
    assert inclination.rows[0] == {"estimator": "a", "fast": 0.5, "pointing": 0.5, "mean": 0.5}
    assert total.text.endswith("Not run: c (no channel imu/mag).")
    assert "POISE_DATA" in nothing.text


@pytest.mark.slow
def test_the_controller_keeps_three_degrees_over_ten_motions():
    """The figures that the page quotes: ten motions of 100 s, sound form."""
    rows = [attitude_errors("controller", seed, methods=(PROPOSED,))[0] for seed in range(10)]
    octa = [
        row
        for seed in range(3)
        for row in attitude_errors("octa", seed, methods=("proposed, exact rotation, no gyroscope",))
    ]
    assert np.mean([row["pitch"] for row in rows]) < 0.65
    assert np.mean([row["inside"] for row in rows]) > 0.98
    assert np.mean([row["total"] for row in rows]) < 2.0
    assert min(row["inside"] for row in octa) < 0.6, "OCTA without gyroscope does not keep them"
