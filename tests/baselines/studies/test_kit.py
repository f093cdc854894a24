"""What studies compute with: seeds, rides that are recorded once, results that are computed once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.studies import PAPERS, find_paper, kit
from poise.baselines.studies.kit import Study, load_ride
from poise.envs.bicycle.several_suites import record_suite_files
from poise.filters.support import resume
from poise.filters.support.version import code_version

FIXTURE = "poise/BicycleFixture-v0"
CALLS: list[tuple[float, ...]] = []


def root_sum(*values):
    CALLS.append(values)
    return {"sum": float(sum(values)), "roots": np.sqrt(values), "none": None}


def other(*values):
    return 0


def wrong(value):
    return {1, 2}


@pytest.fixture
def study(tmp_path):
    CALLS.clear()
    return Study(tmp_path, subjects=(0, 2), seeds=2, duration=1.0, processes=1, progress=False)


def equal(left, right):
    return all(values.tobytes() == right[name].tobytes() for name, values in left.items())


def test_seeds_depend_on_root_and_names_only(tmp_path):
    study = Study(tmp_path)
    assert study.seed_of("outdoor", 1, 2) == Study(tmp_path, quick=True, seeds=1).seed_of("outdoor", 1, 2)
    found = {
        Study(tmp_path, seed=root).seed_of(name, subject, index)
        for root in (0, 1)
        for name in ("outdoor", "indoor_circle")
        for subject in range(5)
        for index in range(3)
    }
    assert len(found) == 60


def test_rides_of_one_name_share_the_motion_whatever_the_sensors(study):
    settings = {"fidelity": "lumped"}
    paper, ideal = (
        [load_ride(path) for path in study.ride_files("straight", suite, **settings, **more)]
        for suite, more in (
            ("two-gyro", {}),
            (["bicycle_imu/acc", "bicycle_imu/gyr"], {"sensors": "ideal", "rate": 50.0}),
        )
    )
    assert [ride.name for ride in paper] == ["straight-0-0", "straight-0-1", "straight-2-0", "straight-2-1"]
    assert [(ride.metadata["subject"], ride.metadata["index"]) for ride in ideal] == [(0, 0), (0, 1), (2, 0), (2, 1)]
    assert paper[0].metadata["group"] == "straight"
    for fast, slow in zip(paper, ideal, strict=True):
        assert set(slow.measurements) == {"bicycle_imu/acc", "bicycle_imu/gyr"}
        np.testing.assert_array_equal(fast.truth["bicycle/position"][::2][:50], slow.truth["bicycle/position"][:50])
    assert not np.allclose(paper[0].truth["bicycle/position"], paper[1].truth["bicycle/position"])


def test_rides_of_several_works_are_ridden_once_and_found_by_each(study, tmp_path, monkeypatch):
    shared = replace(study, rides=tmp_path / "shared", subjects=(0,), seeds=1)
    settings = {"fidelity": "lumped"}
    jobs = [job for suite in ("two-gyro", "force-inertial") for job in shared.ride_jobs("outdoor", suite, **settings)]
    ridden = []
    monkeypatch.setattr(kit, "record_suite_files", lambda *job: ridden.append(job) or record_suite_files(*job))
    shared.record_together(jobs)
    shared.record_together(jobs)
    assert [[options["suite"] for options in every] for every, _, _ in ridden] == [["two-gyro", "force-inertial"]]
    monkeypatch.setattr(kit, "record_episode", lambda *job: pytest.fail("it was recorded before"))
    for suite in ("two-gyro", "force-inertial"):
        work = replace(shared, folder=tmp_path / suite)
        (path,) = work.ride_files("outdoor", suite, **settings)
        assert load_ride(path).name == "outdoor-0-0"


def test_a_ride_that_fails_is_left_to_the_work_that_needs_it(study, capsys):
    jobs = study.ride_jobs("outdoor", "two-gyro", style="nobody's")
    study.record_together(jobs)
    assert "outdoor-0-0 is recorded later: ValueError" in capsys.readouterr().err
    with pytest.raises(ValueError, match="nobody's"):
        study.ride_files("outdoor", "two-gyro", style="nobody's")


def test_recorded_episodes_are_kept_and_lost_ones_are_recorded_again_bit_for_bit(study):
    options = {"duration": 2.0}
    first = study.episodes(FIXTURE, 3, name="push", options=options)
    paths = sorted(study.folder.glob("rides/push-*/*.h5"))
    assert [load_ride(path).name for path in paths] == ["push-0", "push-1", "push-2"]
    stamps = [path.stat().st_mtime_ns for path in paths]
    paths[1].unlink()
    again = study.episodes(FIXTURE, 3, name="push", options=options)
    assert [path.stat().st_mtime_ns == stamp for path, stamp in zip(paths, stamps, strict=True)] == [True, False, True]
    assert all(equal(one.measurements, two.measurements) for one, two in zip(first, again, strict=True))
    longer = study.episodes(FIXTURE, 1, name="push", options={"duration": 3.0})
    assert len(longer[0]) > len(first[0])


def test_rides_of_two_processes_are_those_of_one(study, tmp_path):
    options = {"duration": 2.0}
    two = Study(tmp_path / "two", processes=2, progress=False).episodes(FIXTURE, 2, name="push", options=options)
    one = study.episodes(FIXTURE, 2, name="push", options=options)
    assert all(equal(left.measurements, right.measurements) for left, right in zip(one, two, strict=True))


def test_a_result_is_computed_once_and_again_when_its_arguments_change(study):
    expected = {"sum": 5.0, "roots": [1.0, 2.0], "none": None}
    assert study.cached("a key", root_sum, 1.0, 4.0) == expected
    assert study.cached("a key", root_sum, 1.0, 4.0) == expected
    assert CALLS == [(1.0, 4.0)]
    assert study.cached("a key", root_sum, 9.0)["sum"] == 9.0
    assert len(CALLS) == 2
    assert study.cached("a key", other, 9.0) == 0


def test_another_version_computes_again_and_says_so(study, monkeypatch, capsys):
    options = {"duration": 2.0}
    (first,) = study.episodes(FIXTURE, 1, name="push", options=options)
    assert study.cached("a key", root_sum, 1.0, 4.0)["sum"] == 5.0
    assert capsys.readouterr().err == ""
    for module in (kit, resume):
        monkeypatch.setattr(module, "code_version", lambda *layers: "9.9.9-changed")
    newer = Study(study.folder, processes=1, progress=False)
    assert newer.cached("a key", root_sum, 1.0, 4.0)["sum"] == 5.0
    (again,) = newer.episodes(FIXTURE, 1, name="push", options=options)
    assert CALLS == [(1.0, 4.0), (1.0, 4.0)]
    assert equal(first.measurements, again.measurements)
    assert len(list(study.folder.glob("rides/push-*/*.h5"))) == 2
    assert f"holds results of poise {code_version()}; this is poise 9.9.9-changed" in capsys.readouterr().err


def test_jobs_keep_their_order_and_only_the_missing_ones_run(study):
    assert [each["sum"] for each in study.map("sums", root_sum, [(1,), (2,)])] == [1.0, 2.0]
    assert [each["sum"] for each in study.map("sums", root_sum, [(1,), (2,), (3,)])] == [1.0, 2.0, 3.0]
    assert CALLS == [(1,), (2,), (3,)]
    assert study.map("none", root_sum, []) == []


def test_a_failed_job_leaves_no_file_and_says_what_it_gave(study):
    with pytest.raises(TypeError, match="got set"):
        study.cached("wrong", wrong, 1)
    assert not list(study.folder.rglob("wrong/*.json"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"subjects": ()}, "subjects"),
        ({"seeds": 0}, "seeds must be at least 1, got 0"),
        ({"processes": 0}, "processes"),
        ({"duration": 0.5}, "duration must be at least 1 s"),
        ({"duration": float("nan")}, "duration"),
    ],
)
def test_wrong_settings_are_named(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        Study(tmp_path, **changes)


@pytest.mark.parametrize("name", PAPERS)
def test_papers_are_found_by_name(name):
    assert callable(find_paper(name))


def test_an_unknown_paper_is_refused():
    with pytest.raises(ValueError, match="did you mean 'two-gyro'"):
        find_paper("two-gyros")
