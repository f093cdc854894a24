"""Published benchmarks in the layouts of their authors; the real ones where POISE_DATA names their folder."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy.io

import poise
from poise.envs.data.formats.load import find_recordings
from poise.filters.core import rotation

from .motion import angles, axes, motion, readings, same, write_table
from .test_folders import senslogs

TIME, GYR, ACC, MAG, Q = readings()
T = len(TIME)


def repoimu(path, orientation=Q, rounding=4):
    names = (
        "Time (s);Vicon Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;IMU Magnetometer;;;\n;W;X;Y;Z" + ";X;Y;Z" * 3
    )
    table = np.column_stack([np.round(0.31 + TIME, rounding), orientation, ACC, GYR, MAG])
    rows = "".join(";".join(f"{value:.9g}" for value in row) + "\n" for row in table)
    path.write_text(f"{names};\n{rows}")
    return path


@pytest.mark.parametrize("start", ["level", "own"])
@pytest.mark.parametrize("rounding", [4, 2])
def test_repoimu_is_aligned_in_body_and_world(tmp_path, start, rounding):
    """The markers are turned by 3° to the sensor; the world of the pendulum is the attitude at its start."""
    body = rotation.exp(np.radians([1.0, -2.0, 2.0]))
    world = rotation.conjugate(Q[0]) if start == "own" else rotation.exp(np.radians([0.5, 1.0, 70.0]))
    written = rotation.multiply(world, rotation.multiply(Q, rotation.conjugate(body)))
    recording = poise.load_recording(repoimu(tmp_path / "TStick_Test01_Trial1.csv", written, rounding))
    assert recording.dt == pytest.approx(0.01, rel=1e-4)
    assert recording.metadata["group"] == "TStick"
    same(recording.measurements["imu/gyr"], GYR, 1e-5)
    assert recording.metadata["reference_alignment"]["sensor_deg"] == pytest.approx(3.0, abs=0.3)
    up = rotation.up_in_body(recording.truth["orientation"])
    error = np.degrees(np.arccos(np.clip((up * rotation.up_in_body(Q)).sum(axis=1), -1.0, 1.0)))
    # Eight seconds of simulated sensors: the mean of the specific force is not exactly vertical.
    assert np.sqrt(np.mean(error**2)) < 1.5


@pytest.mark.parametrize("truth_header", ["#timestamp, p_RS_R_x [m]", "#time(ns),px"])
@pytest.mark.parametrize("given", ["root", "mav0", "file"])
@pytest.mark.parametrize("every", [1, 5])
def test_euroc(tmp_path, truth_header, given, every):
    root, start = tmp_path / "V1_01_easy", 1_403_715_273_262_142_976
    ns = start + np.round(TIME * 1e9).astype(np.int64)
    imu = {"#timestamp [ns]": ns} | axes("w_RS_S_{} [rad s^-1]", GYR, "xyz") | axes("a_RS_S_{} [m s^-2]", ACC, "xyz")
    write_table(root / "mav0" / "imu0" / "data.csv", imu)
    position = motion().truth["position"]
    # The truth begins later and has stamps of its own, between those of the IMU.
    own = ns[20:-20:every] + 2_500_000
    between = Q[20:-20:every], Q[21:-19:every]
    step = rotation.log(rotation.multiply(rotation.conjugate(between[0]), between[1]))
    q = rotation.multiply(between[0], rotation.exp(0.25 * step))
    if "p_RS_R" in truth_header:
        table = (
            {"#timestamp": own} | axes(" p_RS_R_{} [m]", position[20:-20:every], "xyz") | axes(" q_RS_{} []", q, "wxyz")
        )
    else:
        table = {"#time(ns)": own} | axes("p{}", position[20:-20:every], "xyz") | axes("q{}", q, "wxyz")
    table |= axes("b_w_RS_S_{} [rad s^-1]", 0.0 * position[20:-20:every], "xyz")
    write_table(root / "mav0" / "state_groundtruth_estimate0" / "data.csv", table)
    path = {"root": root, "mav0": root / "mav0", "file": root / "mav0" / "imu0" / "data.csv"}[given]
    recording = poise.load_recording(path)
    assert recording.name == "V1_01_easy"
    assert recording.metadata["clock_start"] == start
    same(recording.measurements["imu/acc"], ACC)
    known = np.isfinite(recording.truth["orientation"]).all(axis=1)
    np.testing.assert_array_equal(recording.mask, known)
    assert not known[:20].any()
    assert known[25:-30].all()
    assert angles(recording.truth["orientation"][known], Q[known]).max() < (0.003 if every == 1 else 0.1)
    assert find_recordings(tmp_path) == [root]
    (root / "mav0" / "state_groundtruth_estimate0" / "data.csv").unlink()
    assert poise.load_recording(path).truth == {}


@pytest.mark.parametrize("transposed", [True, False])
@pytest.mark.parametrize("magnetometer", [True, False])
def test_archives_of_arrays(tmp_path, magnetometer, transposed):
    quat = Q.copy()
    quat[30:40] = np.nan
    arrays = {"t": TIME, "gyr": GYR, "acc": ACC, "quat": quat, "mask": TIME > 1.0} | (
        {"mag": MAG} if magnetometer else {}
    )
    turned = {name: values.T if transposed else values for name, values in arrays.items()}
    np.savez(tmp_path / "trial.npz", **turned)
    recording = poise.load_recording(tmp_path / "trial.npz")
    assert ("imu/mag" in recording.measurements) == magnetometer
    np.testing.assert_array_equal(recording.truth["orientation"], quat)
    np.testing.assert_array_equal(recording.mask, TIME > 1.0)
    assert abs(recording.metadata["reference_clock_offset"]) < 1e-3


@pytest.mark.parametrize("shift", [0.0, 1.25])
def test_phones_with_qualisys(tmp_path, shift):
    """Layout of the benchmark: ``android/<trial>`` beside ``qualisys/<trial>.mat``, its clock off by some seconds."""
    senslogs(tmp_path / "android" / "Texting")
    body = rotation.exp(np.array([0.0, 0.0, np.pi / 2]))
    matrices = rotation.to_matrix(rotation.multiply(Q, rotation.conjugate(body)))
    rotations = matrices.transpose(0, 2, 1).reshape(1, T, 9).transpose(0, 2, 1)
    (tmp_path / "qualisys").mkdir()
    content = {"Texting": {"Frames": T, "FrameRate": 100.0, "RigidBodies": {"Rotations": rotations}}}
    scipy.io.savemat(tmp_path / "qualisys" / "Texting.mat", content)
    (tmp_path / "android" / "Texting" / "timeAlignment.txt").write_text(f"  {-shift:.7e}\n")
    recording = poise.load_recording(tmp_path / "android" / "Texting")
    # Only what both recorded is known.
    expected = recording.measurements["imu/onboard_orientation"]
    known = recording.mask
    assert known.sum() > 300
    if shift == 0.0:
        up = rotation.up_in_body(recording.truth["orientation"][known])
        error = np.degrees(np.arccos(np.clip((up * rotation.up_in_body(expected[known])).sum(axis=1), -1.0, 1.0)))
        assert np.sqrt(np.mean(error**2)) < 2.0
    assert recording.metadata["source"] == "Michel et al. 2017"


FOLDERS = {"repoimu": 4, "smartphones": 6, "euroc": 1}


@pytest.mark.parametrize("name", FOLDERS)
def test_the_benchmarks_fit_their_gyroscopes(recordings_folder, name):
    trials = poise.load_recordings(recordings_folder / "benchmarks" / name)
    assert len(trials) == FOLDERS[name]
    for trial in trials:
        assert abs(trial.metadata["reference_clock_offset"]) < 1e-3, trial.name
        assert trial.uniform
        assert trial.mask.mean() > 0.8
        assert not trial.mask[~np.isfinite(trial.truth["orientation"]).all(axis=1)].any()


def test_archives_of_dates_and_of_what_is_no_reading(tmp_path):
    time, values = np.arange(300) / 100, np.random.default_rng(0).standard_normal((300, 3))
    dates = np.datetime64("2026-03-01T10:00") + np.timedelta64(10_000_000, "ns") * np.arange(300)
    for number, stamps in enumerate((dates, dates - dates[0], dates.astype("datetime64[us]"))):
        np.savez(tmp_path / f"{number}.npz", t=stamps, gyr=values, acc=values)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            np.testing.assert_allclose(poise.load_recording(tmp_path / f"{number}.npz").time, time, atol=1e-9)
    for name in ("gyr", "t"):
        arrays = {"t": time, "gyr": values, "acc": values}
        np.savez(tmp_path / "no.npz", **{**arrays, name: arrays[name].astype(complex)})
        with pytest.raises(ValueError, match=f"array '{name}' must hold real numbers, got dtype complex128"):
            poise.load_recording(tmp_path / "no.npz")
