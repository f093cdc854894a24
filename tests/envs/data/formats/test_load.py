"""What is recognised and what is refused, in files and folders; and the real recordings where POISE_DATA names them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io

import poise
from poise.envs.data.formats.load import find_recordings, load_recording, load_recordings
from poise.envs.data.trajectory import Trajectory
from poise.filters.core import rotation

from .test_broad import WRITERS, broad_fields, write_mat5
from .test_dot import INERTIAL, N, clock_of, write_dot


def test_foreign_missing_and_truncated_files(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing"):
        load_recording(tmp_path / "nothing.mat")
    with pytest.raises(FileNotFoundError, match="it is a folder"):
        load_recording(tmp_path)
    (tmp_path / "mtw.csv").write_text("// Start Time: Unknown\nPacketCounter,SampleTimeFine,Acc_X\n1,2,3\n")
    (tmp_path / "noise").write_bytes(np.random.default_rng(0).bytes(1000))
    (tmp_path / "empty").write_bytes(b"")
    scipy.io.savemat(tmp_path / "other.mat", {"x": np.zeros(3)})
    for name in ("mtw.csv", "noise", "empty", "other.mat"):
        with pytest.raises(ValueError, match=rf"{name} is .*. Known formats: poise-trajectory .*BROAD.*DOT"):
            load_recording(tmp_path / name)
    for kind, write in WRITERS.items():
        write(tmp_path / f"{kind}.mat", broad_fields())
        content = (tmp_path / f"{kind}.mat").read_bytes()
        (tmp_path / f"{kind}.mat").write_bytes(content[: len(content) // 2])
        with pytest.raises(ValueError, match=rf"{kind}.mat.*truncated"):
            load_recording(tmp_path / f"{kind}.mat")


def test_folders_are_searched_for_readable_files(tmp_path):
    columns = {name: np.arange(N) / 10.0 for name in INERTIAL}
    (tmp_path / "b").mkdir()
    write_mat5(tmp_path / "b" / "1.mat", broad_fields())
    write_dot(tmp_path / "a.csv", clock_of(range(N)), columns)
    own = Trajectory(np.arange(3.0), {"imu/acc": np.zeros((3, 3))}).save(tmp_path / "c")
    (tmp_path / "readme.md").write_text("no recording")
    assert find_recordings(tmp_path) == [tmp_path / "a.csv", tmp_path / "b" / "1.mat", own]
    assert len(load_recording(own)) == 3
    with pytest.raises(FileNotFoundError, match="no folder"):
        find_recordings(tmp_path / "none")


@pytest.fixture
def data() -> Path:
    if "POISE_DATA" not in os.environ:
        pytest.skip("POISE_DATA names no folder of recordings")
    return Path(os.environ["POISE_DATA"])


def test_a_folder_is_read_without_what_cannot_be(tmp_path):
    columns = {name: np.arange(N) / 10.0 for name in INERTIAL}
    write_dot(tmp_path / "a.csv", clock_of(range(N)), columns)
    (tmp_path / "sub").mkdir()
    write_dot(tmp_path / "sub" / "b.csv", clock_of(range(N)), columns)
    write_dot(tmp_path / "c.csv", clock_of(range(N)), {name: columns[name] for name in INERTIAL[:3]})
    (tmp_path / "loop").symlink_to(tmp_path, target_is_directory=True)
    with pytest.warns(UserWarning, match=r"passed over: .*c\.csv: a gyroscope"):
        assert [one.name for one in load_recordings(tmp_path)] == ["a", "b"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileNotFoundError, match="a folder without recordings"):
        load_recordings(tmp_path / "empty")


REFUSED = {"fusion_mode_quaternion_only.csv": "a gyroscope .* and an accelerometer .* are needed"}
"""Real files that hold no inertial measurements, and what is said about them."""
ONBOARD = {"mtw_manager4": 0.25, "ximu3": 0.45, "moveo_csv-Static": 0.6, "moveo_csv-Upper": 0.7}
"""Root mean square inclination in deg of bounded-motion to the device's own, measured outside this package or here."""
RATES = {
    "mtw_manager4": 100.0,
    "ximu3": 49.915,
    "fusion_sensor_data": 100.0,
    "made_20hz": 20.0,
    "with_mag_60hz": 60.0,
    "made_without_mag_60hz": 60.0,
    "consensys_calibrated": 73.143,
    "phyphox": 99.87,
    "sensor_logger_ios": 99.75,
    "senslogs_android": 198.6,
    "TStick_Test11_Trial2": 100.0,
    "euroc": 200.0,
}


def test_every_real_file_loads_or_says_why_not(recordings_folder):
    """Rate and gravity are those of the device, and its own orientation agrees with an estimate from its readings."""
    seen = set()
    for path in find_recordings(recordings_folder / "field_files"):
        if path.name in REFUSED:
            with pytest.raises(ValueError, match=REFUSED[path.name]):
                load_recording(path)
            continue
        for recording in load_recordings(path):
            seen.add(recording.name)
            rate = RATES.get(recording.name, 128.0)
            assert 1 / recording.dt == pytest.approx(rate, rel=1e-3), recording.name
            size = np.nanmedian(np.linalg.norm(recording.measurements["imu/acc"], axis=1))
            assert 9.6 < size < 10.2, recording.name
            if recording.name in ONBOARD:
                estimate = poise.run("bounded-motion", recording)
                up = rotation.up_in_body(recording.onboard_orientation)
                cosine = np.clip((up * estimate.pose["up"]).sum(axis=1), -1.0, 1.0)[int(2 * rate) :]
                error = np.degrees(np.sqrt(np.nanmean(np.arccos(cosine) ** 2)))
                assert error < ONBOARD[recording.name], recording.name
    assert seen >= set(RATES) | set(ONBOARD)


@pytest.mark.recordings
def test_broad_trials_hold_together(data):
    """Frames, units and order are right: the gyroscope is the derivative of the reference, gravity is up at rest."""
    paths = find_recordings(data / "broad")
    assert paths
    for path in paths:
        trial = load_recording(path)
        assert 1 / trial.dt == pytest.approx(2000 / 7)
        assert 0.4 < trial.mask.mean() < 0.7
        orientation = trial.truth["orientation"]
        steps = rotation.log(rotation.multiply(rotation.conjugate(orientation[:-10]), orientation[10:])) / (
            10 * trial.dt
        )
        gyr = np.stack(
            [np.convolve(column, np.ones(10) / 10, "valid") for column in trial.measurements["imu/gyr"].T], axis=1
        )
        difference = np.linalg.norm(steps - gyr[1:], axis=1)[trial.mask[10:]]
        assert np.nanmedian(difference) < 0.1 * np.nanmedian(np.linalg.norm(steps, axis=1)[trial.mask[10:]]) + 0.02
        rest = np.linalg.norm(trial.measurements["imu/gyr"], axis=1) < 0.05
        rest &= np.isfinite(orientation).all(1)
        tilt = trial.measurements["imu/acc"][rest].mean(0), trial.truth_of("up")[rest].mean(0)
        assert np.degrees(np.arccos(np.dot(*(v / np.linalg.norm(v) for v in tilt)))) < 3.0, path.name


@pytest.mark.recordings
def test_the_two_sensors_of_a_bicycle_ride_share_their_clock(data):
    rides = [load_recording(path) for path in find_recordings(data / "bike_ride")]
    assert {ride.name for ride in rides} == {"chest", "head"}
    assert len({ride.metadata["clock_start"] for ride in rides}) == 1
    for ride in rides:
        assert len(ride) == 18391
        assert ride.metadata["missing_samples"] == 0
        assert np.linalg.norm(ride.measurements["imu/acc"].mean(0)) == pytest.approx(9.8, abs=0.6)
        assert np.abs(ride.measurements["imu/gyr"]).max() < 15.0
