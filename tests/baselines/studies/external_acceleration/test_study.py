"""The study of the external-acceleration paper, on one trial of each test and one recording."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies import find_paper
from poise.baselines.studies.external_acceleration.items import LEVELS, TABLE_I, TABLE_II, TABLE_III
from poise.baselines.studies.external_acceleration.simulation import MODES, RATE, errors, estimate, reference, simulate
from poise.baselines.studies.external_acceleration.study import (
    QUANTITIES,
    STILL,
    claims,
    errors_of_test,
    sweep_of_mode_1,
)
from poise.baselines.studies.kit import Study
from poise.baselines.studies.report import Report
from poise.envs.hand.sensing import simulate_hand
from poise.filters.imu.external_acceleration import ExternalAcceleration


def test_the_printed_tables_agree_with_each_other():
    """Table I is the row c_a = 0.1 of table II and the row (0.2, 4) of table III."""
    for index, test in enumerate("ABC"):
        assert TABLE_I[test, 1][:2] == TABLE_II[0.1][index]
        assert TABLE_I[test, 3][:2] == TABLE_III[0.2, 4][index]
        for mode in MODES:
            roll, pitch, *axes, _ = TABLE_I[test, mode]
            angle = np.radians(np.hypot(roll, pitch))
            # what is left of the acceleration is 2 g sin of half the angle, for small angles of the attitude
            assert np.linalg.norm(axes) == pytest.approx(2.0 * 9.8 * np.sin(0.5 * angle), rel=0.15)


def test_errors_are_those_of_the_paper_s_reference():
    trial = simulate("B", [3])
    model = ExternalAcceleration(exact_rotation=False)
    found, pose = errors(trial, model), estimate(trial, model)
    assert set(QUANTITIES) <= set(found)
    # y_A cancels: the error of the acceleration is g times that of the vertical
    gap = 9.8 * np.linalg.norm(pose["up"] - trial.up, axis=-1)[:, 0]
    assert np.sqrt(np.mean(gap**2)) == pytest.approx(np.sqrt(sum(found[f"a_{axis}"][0] ** 2 for axis in "xyz")))
    off = pose["external_acceleration"] - trial.acceleration
    assert found["true a"][0] == pytest.approx(np.sqrt(np.mean(np.sum(off[:, 0] ** 2, axis=-1))))
    assert not np.allclose(reference(trial), trial.acceleration, atol=0.05)


def test_a_changed_test_has_the_motion_and_the_reference_that_were_asked():
    size = np.linalg.norm(simulate("A", [1]).acceleration, axis=-1)
    still = simulate("A", [1], **STILL)
    assert size.mean() == pytest.approx(LEVELS["A"][0], rel=0.02)
    assert np.linalg.norm(still.acceleration, axis=-1).mean() == pytest.approx(0.25 * LEVELS["A"][0], rel=0.1)
    assert len(still.up) == 180 * RATE + 1
    assert np.mean(still.measurements["imu/gyr"][:80]) == pytest.approx(np.radians(0.5), abs=np.radians(0.4))


def test_the_study_runs_and_says_what_it_must(tmp_path):
    hand = simulate_hand("fast", seed=1, duration=5.0)
    path = hand.save(tmp_path / "hand.h5")
    study = Study(
        tmp_path / "run",
        quick=True,
        subjects=(0,),
        seeds=1,
        duration=20.0,
        processes=1,
        recordings=(path,),
        progress=False,
    )
    report = Report(tmp_path / "run")
    find_paper("external-acceleration")(study, report)
    tables = {entry.title: entry.rows for entry in report.entries if entry.rows}
    assert len(tables["Table I: root mean square errors of the modes"]) == 9 * 6
    assert len(tables["Table II: mode 1 against c_a"]) == 3 * 8 * 2
    assert len(tables["Table III: mode 3 against threshold and window"]) == 3 * 5 * 2
    levels = tables["Levels of the tests (section III-B)"]
    assert all(row["ours"] == pytest.approx(row["published"], rel=0.05) for row in levels if "true" in row["quantity"])
    recorded = tables["Recordings: inclination error, deg"]
    assert [row["trial"] for row in recorded] == [hand.name, "mean"]
    assert recorded[0]["bounded-motion"] < recorded[0]["mode 2"]
    assert {path.name for path in (tmp_path / "run" / "figures").iterdir()} == {
        "truth.png",
        *(f"fig-{n}.png" for n in range(2, 8)),
    }
    assert len(report.results) == 18
    holds = {row["statement"]: row["holds"] for row in tables["What the paper says, and the inclination errors here"]}
    assert holds["Mode 2 fails in test B (more than three times mode 1)"]
    assert holds["Mode 2 fails in test C (more than three times mode 1)"]


def test_claims_follow_the_numbers():
    tests, still = {test: errors_of_test(test, [1]) for test in "ABC"}, sweep_of_mode_1("A", [1], {"duration": 5.0})
    as_found = {claim.statement: claim.holds for claim in claims(tests, still)}
    modes = tests["B"]["modes"]
    worse = tests | {"B": {**tests["B"], "modes": modes | {"2 published": modes["1 published"]}}}
    changed = {claim.statement: claim.holds for claim in claims(worse, still)}
    failed = {statement for statement in as_found if as_found[statement] != changed[statement]}
    assert failed == {"Mode 2 fails in test B (more than three times mode 1)"}
