"""Calibration from simulated runs to a filter's accuracy; records, files, and what is refused."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise import load_recording
from poise.envs.data.calibration.channels import accelerometer_record, gyroscope_record, magnetometer_record
from poise.envs.data.calibration.data import RateTableData, mounting_matrix, read_magnetometer, read_rate_table
from poise.envs.data.calibration.records import (
    CalibrationRecord,
    ChannelCalibration,
    apply_calibration,
    load_calibration,
    undo_calibration,
)
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.calibration_runs import (
    accelerometer_runs,
    built_with,
    gyroscope_runs,
    magnetometer_run,
    nominal_calibration,
    random_calibration,
)
from poise.envs.hand.sensing import simulate_hand
from poise.filters.arrays.array import CONTROLLER, OCTA, PLANAR, TRIAXIAL
from poise.filters.arrays.files import read_array
from poise.filters.arrays.spatial.orientation import ArrayOrientation
from poise.filters.core import metrics, rotation
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.quantity import ORIENTATION

SEEDS = range(5)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("array", [OCTA, TRIAXIAL, PLANAR], ids=lambda array: array.name)
def test_accelerometers_are_calibrated(array, seed):
    truth = random_calibration(array, seed)
    found = accelerometer_record(accelerometer_runs(array, truth, seed, hold=2.0), array)
    ((name, got),) = found.channels.items()
    true = truth.channels[name]
    np.testing.assert_allclose(np.diag(got.matrix), np.diag(true.matrix), rtol=1e-3)
    np.testing.assert_allclose(got.offset, true.offset, atol=5e-3)
    places = [axis["along"] for axis in found.details[name]["axes"]]
    np.testing.assert_allclose(places, np.sum(array.e * array.r, axis=1), atol=5e-4)
    # 0.1 m from the table's axis to the origin, along or against the sensitive axis
    first = found.details[name]["axes"][0]["positions"]
    sign = float(array.e[0][0])
    assert first["+z up, out +x"] == pytest.approx(places[0] + 0.1 * sign, abs=5e-4)
    assert first["-z up, out -x"] == pytest.approx(places[0] - 0.1 * sign, abs=5e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_axes_that_are_not_as_drawn_are_found(seed):
    truth, built = random_calibration(OCTA, seed), built_with(OCTA, math.radians(0.5), seed)
    runs = accelerometer_runs(built, truth, seed, hold=1.0)
    found, nominal = accelerometer_record(runs, OCTA, estimate_axes=True), accelerometer_record(runs, OCTA)
    details, true = found.details["array/acc"], truth.channels["array/acc"]
    array = read_array(details["array"])
    turned, left = (np.degrees(np.arccos(np.sum(one.e * built.e, axis=1))) for one in (OCTA, array))
    assert np.sqrt(np.mean(turned**2)) > 0.4
    assert left.max() < 0.05
    np.testing.assert_allclose([np.degrees(axis["turned"]) for axis in details["axes"]], turned, atol=0.05)
    np.testing.assert_allclose(np.diag(found.channels["array/acc"].matrix), np.diag(true.matrix), rtol=1e-3)
    np.testing.assert_allclose(found.channels["array/acc"].offset, true.offset, atol=5e-3)
    places = [axis["along"] for axis in details["axes"]]
    np.testing.assert_allclose(places, np.sum(built.e * built.r, axis=1), atol=5e-4)
    # taken for granted, the same axes spoil scale and offset
    assert np.abs(np.array(nominal.channels["array/acc"].offset) - true.offset).max() > 0.03
    assert np.mean([axis["residual"] for axis in details["axes"]]) < 0.03


@pytest.mark.parametrize("seed", SEEDS)
def test_gyroscope_and_magnetometer_are_calibrated(seed):
    truth = random_calibration(TRIAXIAL, seed)
    gyroscope = gyroscope_record(gyroscope_runs(truth, seed, hold=1.0))
    got, true = gyroscope.channels["imu/gyr"], truth.channels["imu/gyr"]
    np.testing.assert_allclose(np.diag(got.matrix), np.diag(true.matrix), rtol=2e-4)
    np.testing.assert_allclose(got.offset, true.offset, atol=math.radians(0.05))
    # 300 to 350 and -300, -325 °/s are beyond the range of 287 °/s
    assert min(axis["discarded"] for axis in gyroscope.details["imu/gyr"]["axes"]) > 300
    magnetometer = magnetometer_record(magnetometer_run(truth, seed))
    got, true = magnetometer.channels["imu/mag"], truth.channels["imu/mag"]
    u, stretch, v = np.linalg.svd(np.array(got.matrix) @ np.linalg.inv(np.array(true.matrix)))
    assert np.degrees(Rotation.from_matrix(u @ v).magnitude()) < 0.1
    np.testing.assert_allclose(stretch, 1.0, atol=3e-3)
    centre = -np.linalg.solve(got.matrix, got.offset)
    np.testing.assert_allclose(centre, -np.linalg.solve(true.matrix, true.offset), atol=0.5)
    assert magnetometer.details["imu/mag"]["dip_deg"] == pytest.approx(65.0, abs=0.1)


@pytest.fixture(scope="module")
def accuracy():
    """RMS errors of the thesis' filter after the first second, degrees, by seed: of raw data read by data sheet, by the
    record found, and of a perfect device."""
    runs, attitudes = [], []
    for seed in SEEDS:
        truth = random_calibration(CONTROLLER, seed)
        found = accelerometer_record(accelerometer_runs(CONTROLLER, truth, seed, hold=1.0), CONTROLLER)
        found = found.merged(gyroscope_record(gyroscope_runs(truth, seed, hold=1.0)))
        found = found.merged(magnetometer_record(magnetometer_run(truth, seed)))
        motion = simulate_hand("mixed", seed, "array-data-sheet", duration=8.0, device="controller")
        unit = motion.measurements["imu/mag"] / 50.0
        ideal = motion.replace(measurements=motion.measurements | {"imu/mag": unit})
        raw = undo_calibration(ideal, truth)
        runs += [apply_calibration(raw, nominal_calibration(CONTROLLER)), apply_calibration(raw, found), ideal]
        attitudes += [motion.truth["orientation"]] * 3
    model = ArrayOrientation(array=CONTROLLER, dt=0.01, array_std=0.1, gyroscope_std=0.01)
    channels = {name: np.stack([run.measurements[name] for run in runs], axis=1) for name in runs[0].measurements}
    estimate = KalmanFilter(model).run(channels)
    error = metrics.error(ORIENTATION, estimate.pose["orientation"], np.stack(attitudes, axis=1))
    return np.degrees(np.sqrt(np.mean(error[100:] ** 2, axis=0))).reshape(-1, 3)


def test_a_record_restores_the_accuracy_of_a_filter(accuracy):
    by_data_sheet, calibrated, perfect = accuracy.T
    assert (by_data_sheet > 5.0).all()
    assert (calibrated < 1.2 * perfect + 0.1).all()
    assert (calibrated < 0.2 * by_data_sheet).all()


def test_records_travel_as_files_and_loaders_apply_them(tmp_path):
    truth = random_calibration(CONTROLLER, 1)
    path = truth.save(tmp_path / "deep" / "record.json")
    again = load_calibration(path)
    assert again == truth
    motion = simulate_hand("fast", 0, duration=2.0, device="controller")
    raw = undo_calibration(motion, truth)
    assert raw.measurements["array/acc"].max() == np.rint(raw.measurements["array/acc"]).max()
    raw.save(tmp_path / "raw.h5")
    loaded = load_recording(tmp_path / "raw.h5", calibration=path)
    np.testing.assert_allclose(loaded.measurements["array/acc"], motion.measurements["array/acc"], atol=0.03)
    exact = apply_calibration(undo_calibration(motion, truth, rounded=False), truth)
    for name, values in motion.measurements.items():
        np.testing.assert_allclose(exact.measurements[name], values, atol=1e-9)
    with pytest.raises(ValueError, match=r"'array/acc' of .* is calibrated already"):
        apply_calibration(loaded, path)
    assert undo_calibration(loaded, truth).metadata["calibrated"] == []
    gap = raw.measurements["array/acc"].copy()
    gap[3, 2] = np.nan
    part = CalibrationRecord({"array/acc": truth.channels["array/acc"]})
    values = apply_calibration(raw.replace(measurements=raw.measurements | {"array/acc": gap}), part)
    assert np.isnan(values.measurements["array/acc"]).sum() == 1


def test_records_that_do_not_fit_are_refused(tmp_path):
    trajectory = Trajectory(np.arange(5.0), {"imu/acc": np.zeros((5, 3))})
    record = CalibrationRecord({"array/acc": ChannelCalibration.scaled([1.0] * 6, [0.0] * 6, "m/s²")})
    with pytest.raises(ValueError, match="lacks the channel 'array/acc' of the calibration"):
        apply_calibration(trajectory, record)
    other = CalibrationRecord({"imu/acc": record.channels["array/acc"]})
    with pytest.raises(ValueError, match="'imu/acc' of trajectory has 3 axes, the calibration 6"):
        apply_calibration(trajectory, other)
    with pytest.raises(FileNotFoundError, match="no calibration record at"):
        load_calibration(tmp_path / "none.json")
    for text, message in (
        ("{", "is not a calibration record"),
        ('{"format": "other"}', "its format is not 'poise-calibration'"),
        ('{"format": "poise-calibration", "version": 9}', "has version 9"),
        ('{"format": "poise-calibration", "version": 1, "channels": {"a": {"matrix": [[1]]}}}', "unusable calibration"),
    ):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(ValueError, match=message):
            load_calibration(tmp_path / "bad.json")
    with pytest.raises(ValueError, match="finite and regular"):
        ChannelCalibration(((1.0, 2.0), (2.0, 4.0)), (0.0, 0.0), "m/s²")
    with pytest.raises(ValueError, match="square matrix and as many offsets"):
        ChannelCalibration(((1.0,),), (0.0, 0.0), "m/s²")


def test_mountings_are_rotations_onto_the_table():
    for up, out in (("+z", "+x"), ("-y", "+z"), ("+x", "-y")):
        matrix = mounting_matrix(up, out)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
        axis = {"x": 0, "y": 1, "z": 2}
        sign = -1.0 if up[0] == "-" else 1.0
        np.testing.assert_allclose(matrix @ (sign * np.eye(3)[axis[up[1]]]), [0, 0, 1])
        sign = -1.0 if out[0] == "-" else 1.0
        np.testing.assert_allclose(matrix @ (sign * np.eye(3)[axis[out[1]]]), [1, 0, 0])
        attitude = rotation.from_matrix(matrix)
        np.testing.assert_allclose(rotation.to_matrix(attitude), matrix, atol=1e-12)


def test_files_of_runs_give_the_same_record(tmp_path):
    truth = random_calibration(TRIAXIAL, 3)
    data = accelerometer_runs(TRIAXIAL, truth, 3, hold=0.3)
    path = data.save(tmp_path / "runs.csv")
    again = read_rate_table([path])
    direct, read = accelerometer_record(data, TRIAXIAL), accelerometer_record(again, TRIAXIAL)
    assert json.dumps(read.describe()) == json.dumps(direct.describe())
    run = magnetometer_run(truth, 3, duration=20.0)
    read = magnetometer_record(read_magnetometer([run.save(tmp_path / "mag.csv")]))
    np.testing.assert_allclose(read.channels["imu/mag"].matrix, magnetometer_record(run).channels["imu/mag"].matrix)


def test_a_table_in_degrees_with_names_of_ones_own(tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text("# my table\ntime, up, rate_dps, gx, gy, gz\n0, z, 90, 1, 2, 3\n1, -x, -90, 4, 5, 6\n")
    data = read_rate_table([path])
    np.testing.assert_allclose(data.rate, [math.pi / 2, -math.pi / 2])
    assert data.up.tolist() == ["+z", "-x"]
    assert data.out.tolist() == ["", ""]
    assert data.raw.shape == (2, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,up,rate,a\n0,+z,1,3\n0,+z,1,3\n", "rows are not in order: time 0 s in row 2 follows 0 s"),
        ("time,up,a\n0,+z,3\n", "one of the columns rate"),
        ("time,up,rate\n0,+z,3\n", "no column of raw readings"),
        ("time,rate,a\n0,1,3\n", r"lacks the columns \['up'\]"),
        ("time,up,rate,a\n0,+w,1,3\n", "up must name an axis of the device"),
        ("time,up,out,rate,a\n0,+z,-z,1,3\n", "out must be another axis than up"),
        ("time,up,rate,a\n0,+z,1,three\n", "column 'a' must hold numbers"),
        ("time,up,rate,a\n0,+z,,3\n", "the rate must be known in every row"),
        ("time,up,rate,a\n", "has no rows"),
        ("time;up;rate;a\n0;+z;1;3\n", "columns must be separated by commas"),
        ("", "is not a table of comma-separated values"),
    ],
)
def test_unusable_files_are_refused(text, message, tmp_path):
    path = tmp_path / "runs.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        read_rate_table([path])
    assert "runs.csv" in str(error.value)


def test_wrong_counts_and_missing_poses_are_refused():
    truth = random_calibration(TRIAXIAL, 0)
    data = accelerometer_runs(TRIAXIAL, truth, 0, hold=0.2)
    with pytest.raises(ValueError, match="'controller' has 6 accelerometers, but the runs have 3 columns"):
        accelerometer_record(data, CONTROLLER)
    keep = np.char.find(data.up.astype(str), "z") < 0
    part = RateTableData(data.time[keep], data.up[keep], data.out[keep], data.rate[keep], data.raw[keep])
    with pytest.raises(ValueError, match="accelerometer 3 of 'triaxial': no pose in which the axis points up"):
        accelerometer_record(part, TRIAXIAL)
    with pytest.raises(ValueError, match=r"the data do not determine \['axis z'\]"):
        accelerometer_record(part, TRIAXIAL, estimate_axes=True)
    three = np.char.startswith(data.up.astype(str), "+")
    upright = RateTableData(data.time[three], data.up[three], data.out[three], data.rate[three], data.raw[three])
    assert accelerometer_record(upright, TRIAXIAL).channels
    with pytest.raises(ValueError, match="do not separate axis x, axis y, axis z, offset"):
        accelerometer_record(upright, TRIAXIAL, estimate_axes=True)
    with pytest.raises(ValueError, match="gyroscope axis z: no run in which it stood upright"):
        gyroscope_record(part)
    with pytest.raises(ValueError, match="a gyroscope has 3 axes, but the runs have 6"):
        gyroscope_record(accelerometer_runs(CONTROLLER, random_calibration(CONTROLLER, 0), 0, hold=0.2))
    with pytest.raises(ValueError, match="runs must have as many axes"):
        data.joined(RateTableData(data.time, data.up, data.out, data.rate, data.raw[:, :2]))
