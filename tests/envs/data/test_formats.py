"""Loaders on small files made here, and on the real recordings where POISE_DATA names their folder."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from poise.envs.data.formats.broad import group_of
from poise.envs.data.formats.dot import grid
from poise.envs.data.formats.load import find_recordings, load_recording
from poise.envs.data.trajectory import Trajectory
from poise.filters.core import rotation

N = 40


def broad_fields() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    quat = rotation.random(rng, (N,))
    quat[7] = np.nan
    return {
        "imu_gyr": rng.standard_normal((N, 3)),
        "imu_acc": rng.standard_normal((N, 3)),
        "imu_mag": rng.standard_normal((N, 3)),
        "opt_quat": quat,
        "opt_pos": rng.standard_normal((N, 3)),
        "movement": (np.arange(N) >= 5).astype(np.uint8)[:, None],
        "sampling_rate": np.array([[2000 / 7]]),
    }


def write_mat5(path: Path, fields: dict[str, Any]) -> None:
    scipy.io.savemat(path, fields, do_compression=True)


def write_hdf5(path: Path, fields: dict[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in fields.items():
            file[name] = values[:, 0] if name == "movement" else values


def write_mat73(path: Path, fields: dict[str, Any]) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in fields.items():
            file[name] = values.T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


WRITERS = {"mat5": write_mat5, "hdf5": write_hdf5, "mat73": write_mat73}


@pytest.mark.parametrize("kind", WRITERS)
def test_broad_is_read_whatever_the_container_and_extension(tmp_path, kind):
    path, fields = tmp_path / "06_undisturbed_fast_rotation_A.dat", broad_fields()
    # scipy would append its own extension.
    WRITERS[kind](tmp_path / "x.mat", fields)
    (tmp_path / "x.mat").rename(path)
    trial = load_recording(path)
    assert len(trial) == N
    assert 1 / trial.dt == pytest.approx(2000 / 7)
    for name, channel in {"imu_gyr": "imu/gyr", "imu_acc": "imu/acc", "imu_mag": "imu/mag"}.items():
        np.testing.assert_allclose(trial.measurements[channel], fields[name])
    np.testing.assert_allclose(trial.truth["orientation"], fields["opt_quat"])
    np.testing.assert_allclose(trial.truth["position"], fields["opt_pos"])
    assert np.isnan(trial.truth_of("up")[7]).all()
    np.testing.assert_array_equal(trial.mask, (np.arange(N) >= 5) & (np.arange(N) != 7))
    assert trial.metadata["group"] == "fast rotation"
    assert trial.metadata["licence"] == "CC BY 4.0"


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"opt_quat": None}, r"missing are \['opt_quat'\]"),
        ({"imu_acc": np.zeros((N - 1, 3))}, "equally long"),
        ({"imu_acc": np.zeros((N, 2))}, r"imu_acc must be a real array of shape \(T, 3\).*\(40, 2\)"),
        ({"opt_quat": 2.0 * np.ones((N, 4))}, "unit quaternions"),
        ({"sampling_rate": np.array([[0.0]])}, "sampling_rate must be one positive"),
        ({"imu_gyr": np.full((N, 3), np.inf)}, "infinite at tick 0"),
    ],
)
def test_wrong_broad_fields_are_named(tmp_path, kind, changes, message):
    fields = {name: value for name, value in (broad_fields() | changes).items() if value is not None}
    path = tmp_path / "trial.mat"
    WRITERS[kind](path, fields)
    with pytest.raises(ValueError, match=message) as caught:
        load_recording(path)
    assert "trial.mat" in str(caught.value)


def test_a_broad_trial_without_samples_is_refused(tmp_path):
    fields = {name: values if name == "sampling_rate" else values[:0] for name, values in broad_fields().items()}
    write_hdf5(tmp_path / "empty.hdf5", fields)
    with pytest.raises(ValueError, match="no samples"):
        load_recording(tmp_path / "empty.hdf5")


def test_groups_follow_from_the_names_of_trials():
    assert group_of("02_undisturbed_slow_rotation_B") == "slow rotation"
    assert group_of("18_undisturbed_fast_translation_with_breaks_B") == "fast translation"
    assert group_of("21_undisturbed_fast_combined") == "fast combined"
    assert group_of("32_disturbed_attached_magnet_1cm") == "disturbed"
    assert group_of("my own") is None


HEADER = (
    "sep=,\nDeviceTag:,chest\nFirmwareVersion:,3.0.0\nOutputRate:,{rate}Hz\n"
    "Measurement Mode:,Inertial data Mode\n© Movella Technologies B. V. 2005-2024\n\n"
)
INERTIAL = ("Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z", "Mag_X", "Mag_Y", "Mag_Z")


def write_dot(path: Path, clock: Any, columns: dict[str, Any], rate: int = 60, tail: str = "") -> Path:
    names = ["PacketCounter", "SampleTimeFine", *columns]
    rows = zip(range(1, len(clock) + 1), clock, *columns.values(), strict=True)
    table = "".join(",".join(str(value) for value in row) + tail + "\n" for row in rows)
    path.write_text(HEADER.format(rate=rate) + ",".join(names) + "\n" + table, encoding="utf-8")
    return path


@pytest.fixture
def columns() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(2)
    return {name: rng.standard_normal(N).round(6) for name in INERTIAL}


def clock_of(ticks: Any, start: int = 1000) -> np.ndarray:
    return (start + np.rint(np.asarray(ticks) * 1e6 / 60).astype(np.int64)) % 2**32


def test_dot_units_names_and_uniform_time(tmp_path, columns):
    ride = load_recording(write_dot(tmp_path / "ride.txt", clock_of(range(N)), columns, tail=","))
    assert len(ride) == N
    assert ride.uniform
    assert 1 / ride.dt == pytest.approx(60, rel=1e-4)
    for channel, stem, scale in (("imu/gyr", "Gyr", np.pi / 180), ("imu/acc", "Acc", 1.0), ("imu/mag", "Mag", 1.0)):
        expected = scale * np.stack([columns[f"{stem}_{axis}"] for axis in "XYZ"], axis=1)
        np.testing.assert_allclose(ride.measurements[channel], expected)
    assert ride.truth == {}
    assert ride.mask.all()
    assert ride.metadata["device"]["DeviceTag"] == "chest"
    assert ride.metadata["clock_start"] == 1000


def test_lost_packets_are_missing_and_the_clock_may_wrap(tmp_path, columns):
    ticks = np.r_[0:10, 13:20, 25 : 25 + N - 17]
    clock = clock_of(ticks, start=2**32 - 12 * 16667)
    assert (np.diff(clock) < 0).any()
    ride = load_recording(write_dot(tmp_path / "ride.csv", clock, columns))
    assert len(ride) == ticks[-1] + 1
    present = np.isfinite(ride.measurements["imu/acc"]).all(1)
    np.testing.assert_array_equal(np.flatnonzero(present), ticks)
    np.testing.assert_allclose(ride.measurements["imu/acc"][ticks, 0], columns["Acc_X"])
    assert ride.metadata["missing_ticks"] == 8
    assert ride.uniform


def test_the_rounding_of_the_clock_does_not_add_up():
    ticks, interval = grid(clock_of(range(400_000)).astype(float))
    np.testing.assert_array_equal(ticks, np.arange(400_000))
    assert interval == pytest.approx(1e6 / 60, rel=1e-9)


def test_increments_and_onboard_orientation(tmp_path):
    rng = np.random.default_rng(4)
    rates, forces, euler = rng.standard_normal((N, 3)), rng.standard_normal((N, 3)), rng.uniform(-80, 80, (N, 3))
    turn = rotation.exp(rates * 0.016667)
    columns = {f"dq_{axis}": turn[:, i] for i, axis in enumerate("WXYZ")}
    columns |= {f"dv[{i + 1}]": forces[:, i] * 0.016667 for i in range(3)}
    columns |= {f"Euler_{axis}": euler[:, i] for i, axis in enumerate("XYZ")}
    ride = load_recording(write_dot(tmp_path / "a.csv", 16667 * np.arange(N), columns))
    np.testing.assert_allclose(ride.measurements["imu/gyr"], rates, atol=1e-9)
    np.testing.assert_allclose(ride.measurements["imu/acc"], forces, atol=1e-9)
    expected = rotation.from_euler_zyx(*np.radians(euler[:, ::-1]).T)
    np.testing.assert_allclose(ride.measurements["imu/onboard_orientation"], expected)
    assert "orientation" not in ride.quantities, "the sensor's own estimate is no truth"


@pytest.mark.parametrize(
    ("clock", "message"),
    [
        (np.r_[0:10, 9:39], r"got .* in row 10 after"),
        (np.r_[0:10, 5:35], "must increase"),
        (np.r_[0:20, 100_000:100_020], "must increase by less than"),
        (np.arange(N) * 2, "OutputRate 60 Hz"),
        (np.r_[0:20, np.arange(20, 40) - 0.7], "irregular"),
    ],
)
def test_clocks_that_cannot_be_are_refused(tmp_path, columns, clock, message):
    path = write_dot(tmp_path / "ride.csv", clock_of(clock), columns)
    with pytest.raises(ValueError, match=message) as caught:
        load_recording(path)
    assert "ride.csv" in str(caught.value)


def test_wrong_dot_tables_are_refused(tmp_path, columns):
    clock = clock_of(range(N))
    free = {f"FreeAcc_{axis}": columns["Acc_X"] for axis in "XYZ"} | {"Gyr_X": clock, "Gyr_Y": clock, "Gyr_Z": clock}
    with pytest.raises(ValueError, match=r"accelerometer .* needed.*FreeAcc_X"):
        load_recording(write_dot(tmp_path / "free.csv", clock, free))
    with pytest.raises(ValueError, match="no samples"):
        load_recording(write_dot(tmp_path / "none.csv", [], {name: [] for name in INERTIAL}))
    whole = write_dot(tmp_path / "whole.csv", clock, columns).read_text()
    (tmp_path / "cut.csv").write_text(whole[:-30])
    with pytest.raises(ValueError, match=r"cut.csv.*truncated"):
        load_recording(tmp_path / "cut.csv")
    (tmp_path / "text.csv").write_text(whole.replace(str(columns["Acc_X"][5]), "oops"))
    with pytest.raises(ValueError, match="column Acc_X holds no finite number in row 5"):
        load_recording(tmp_path / "text.csv")
    single = load_recording(write_dot(tmp_path / "one.csv", clock[:1], {k: v[:1] for k, v in columns.items()}))
    assert single.dt == pytest.approx(1 / 60)


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
        with pytest.raises(ValueError, match=rf"{name} is .*; accepted are poise-trajectory .*BROAD.*DOT"):
            load_recording(tmp_path / name)
    for kind, write in WRITERS.items():
        write(tmp_path / f"{kind}.mat", broad_fields())
        content = (tmp_path / f"{kind}.mat").read_bytes()
        (tmp_path / f"{kind}.mat").write_bytes(content[: len(content) // 2])
        with pytest.raises(ValueError, match=rf"{kind}.mat.*truncated"):
            load_recording(tmp_path / f"{kind}.mat")


def test_folders_are_searched_for_readable_files(tmp_path, columns):
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


@pytest.mark.recordings
def test_broad_trials_hold_together(data):
    """Frames, units and order are right: the gyroscope is the derivative of the reference, gravity is up at rest."""
    paths = [path for path in find_recordings(data) if path.suffix in (".mat", ".hdf5")]
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
    rides = [load_recording(path) for path in find_recordings(data) if path.suffix == ".csv"]
    assert {ride.name for ride in rides} == {"chest", "head"}
    assert len({ride.metadata["clock_start"] for ride in rides}) == 1
    for ride in rides:
        assert len(ride) == 18391
        assert ride.metadata["missing_ticks"] == 0
        assert np.linalg.norm(ride.measurements["imu/acc"].mean(0)) == pytest.approx(9.8, abs=0.6)
        assert np.abs(ride.measurements["imu/gyr"]).max() < 15.0
