"""What every study of rides has in common: errors in windows, baselines, and claims that the numbers decide."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.averages import interval_of_mean, mean_of, mean_rms, windowed
from poise.baselines.studies.report import Report
from poise.baselines.studies.ride_study import MEAN, ZERO
from poise.baselines.studies.two_gyro.motion import MOTIONS, Errors, simulate
from poise.baselines.studies.two_gyro.rides import RIDES, claims
from poise.filters.bicycle.two_gyro.truth import true_angles


def fabricated(errors, length=60.0):
    """Results of one ride with RMS errors of φ by method, the same in every window."""
    windows = {
        name: {"settled": {"φ": value}, "last 20 s": {"φ": value, "θ1": value}} for name, value in errors.items()
    }
    consistency = {name: {"NEES": 1.0, "NIS": 9.0} for name in RIDES.checked}
    ride = {"name": "r", "length": length, "rms": windows, "peak": {"Σ2": {"φ": 4.0}}, "consistency": consistency}
    return [ride | {"nees": {"φ": 2.5}, "bound": {"φ": 0.25}, "yaw": {"early": 1.0, "end": 3.0}}]


def verdicts(found):
    return {claim.statement: claim.holds for claim in found}


def test_baselines_are_the_truth_and_what_is_left_of_it_without_its_mean():
    ride = simulate(MOTIONS["circle"], 30.0, 0.05, Errors(), np.random.default_rng(0))
    truth = true_angles(ride.truth)
    found = RIDES.baselines(ride.time, truth)
    roll = np.degrees(truth["bicycle/roll"][:, 0])
    np.testing.assert_allclose(found[ZERO]["φ"], -roll, atol=1e-9)
    settled = roll[ride.time >= 10.0]
    assert windowed(found[MEAN], ride.time, 10.0)["φ"] == pytest.approx(settled.std(), rel=1e-3)


def test_windows_include_their_ends_and_are_unknown_beyond_a_ride():
    errors, time = {"a": np.array([3.0, 4.0, 12.0])}, np.array([0.0, 1.0, 2.0])
    assert windowed(errors, time, 0.0, 1.0)["a"] == pytest.approx(np.sqrt(12.5))
    assert np.isnan(windowed(errors, time, 5.0)["a"])
    assert mean_of([{"a": 1.0}, {"a": float("nan")}, {"a": 3.0}]) == {"a": 2.0}


def test_the_interval_of_a_mean_is_student_s():
    # t(0.975, 3) = 3.182, standard deviation 1.291, four values
    assert interval_of_mean([1.0, 2.0, 3.0, 4.0]) == "2.5 (0.45 … 4.6)"
    assert interval_of_mean([3.0]) == "3"


def test_numbers_decide_claims():
    methods = (*RIDES.variants, *RIDES.ablations, ZERO, MEAN)
    good = fabricated(dict.fromkeys(methods, 2.0) | {"Σ2": 0.5, "camera: white noise only": 0.1})
    bad = fabricated(dict.fromkeys(methods, 0.4) | {"Σ2": 0.9})
    drifts = "Σ1 drifts, Σ2 is less than half as wrong in the end"
    for results, holds in ((good, True), (bad, False)):
        found = verdicts(RIDES.claims("indoor", results))
        assert found[drifts] is holds
        assert found["The roll is estimated better than by zero"] is holds
        assert found["Σ2: NEES is right within a factor of two"] is True
        assert found["Σ2: NIS is right within a factor of two"] is False
    assert (
        verdicts(claims(fabricated(dict.fromkeys(methods, 1.0), length=20.0)))[
            "Σ2 does not drift: φ in the last 20 s and from 10 s on"
        ]
        is None
    )
    assert mean_rms(good, "Σ2") == {"φ": 0.5}


def test_a_course_is_reported(tmp_path):
    ride = simulate(MOTIONS["circle"], 12.0, 0.05, Errors(), np.random.default_rng(0))
    report, methods = Report(tmp_path), (*RIDES.variants, *RIDES.ablations, ZERO, MEAN)
    errors = RIDES.baselines(ride.time, true_angles(ride.truth))[ZERO]
    row = windowed(errors, ride.time, 10.0)
    results = fabricated(dict.fromkeys(methods, 1.0))
    results[0]["rms"] = {name: {"settled": row, "last 20 s": row} for name in methods}
    results[0]["peak"] = dict.fromkeys(methods, row)
    RIDES.report(report, "indoor_circle", results)
    titles = [entry.title for entry in report.entries]
    assert titles == [
        "Table I, indoor_circle",
        "Skill, indoor_circle, RMS in deg",
        "In short, indoor_circle, RMS in deg",
        "Variants, indoor_circle, mean RMS in deg",
        "Where errors come from, indoor_circle, mean RMS in deg",
        "Drift, indoor_circle, mean RMS in deg",
        "Consistency, indoor_circle",
        "What holds, indoor_circle",
    ]
    skill = {row["angle"]: row for row in report.entries[1].rows}
    assert skill["φ"]["posterior bound"] == 0.25
    assert skill["φ"]["NEES, 95 % interval"] == "2.5"
    assert skill["φ"]["published"] == "0.72 ± 0.22"
    assert skill["θ1"]["posterior bound"] is None
    roll, others = report.entries[2].rows
    assert (roll["error of"], roll["published"], roll["here"]) == ("roll of the bicycle", 0.72, skill["φ"]["Σ2"])
    assert others["published"] == pytest.approx((2.11 + 2.62 + 1.98) / 3, abs=0.005)
    assert others["posterior bound"] is None, "a mean over angles needs all of them"
    assert {row["filter"] for row in report.entries[3].rows} >= {"Σ2", ZERO, MEAN}
    assert len(report.results) == len(methods) * 4
