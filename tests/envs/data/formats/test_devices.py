"""Files of single devices: Xsens MT Manager, x-io, APDM Moveo, Shimmer Consensys."""

from __future__ import annotations

import numpy as np
import pytest

import poise
from poise.filters.core import rotation

from .motion import XYZ, G, angles, axes, readings, same, write_table

TIME, GYR, ACC, MAG, Q = readings()
T = len(TIME)
MATRIX = {f"Mat[{i + 1}][{j + 1}]": rotation.to_matrix(Q)[:, i, j] for j in range(3) for i in range(3)}


def xsens(path, counter=None, above="// Start Time: Unknown\n// Update Rate: 100.0Hz\n", delimiter="\t", **columns):
    rows = np.arange(T) if counter is None else counter
    table = {"PacketCounter": rows, "SampleTimeFine": np.full(len(rows), None)} | columns
    return write_table(path, table, delimiter, above)


CHANNELS = axes("Acc_{}", ACC) | axes("Gyr_{}", GYR) | axes("Mag_{}", MAG)


@pytest.mark.parametrize("above", ["// Update Rate: 100.0Hz\n", "# Start: x\n# Update Rate: 100 Hz\n"])
@pytest.mark.parametrize("delimiter", ["\t", ",", ";"])
@pytest.mark.parametrize("orientation", ["matrix", "quaternion", "euler", "none"])
def test_mt_manager(tmp_path, above, delimiter, orientation):
    yaw, pitch, roll = np.degrees(rotation.to_euler_zyx(Q))
    extra = {
        "matrix": MATRIX,
        "quaternion": {f"Quat_q{i}": Q[:, i] for i in range(4)},
        "euler": {"Roll": roll, "Pitch": pitch, "Yaw": yaw},
        "none": {},
    }[orientation]
    path = xsens(tmp_path / "mt.txt", above=above, delimiter=delimiter, **CHANNELS, **extra)
    recording = poise.load_recording(path)
    assert recording.metadata["format"] == "Xsens MT Manager"
    assert recording.dt == pytest.approx(0.01)
    same(recording.measurements["imu/gyr"], GYR)
    same(recording.measurements["imu/acc"], ACC)
    same(recording.measurements["imu/mag"], MAG)
    if orientation == "none":
        assert recording.onboard_orientation is None
    else:
        assert angles(recording.onboard_orientation, Q).max() < 1e-5


@pytest.mark.parametrize("magnetometer", [True, False])
def test_the_packet_counter_wraps_and_loses_packets(tmp_path, magnetometer):
    kept = np.r_[0:200, 203:500, 520:T]
    counter = (65_536 - 350 + kept) % 65_536
    channels = {name: values[kept] for name, values in CHANNELS.items() if magnetometer or "Mag" not in name}
    recording = poise.load_recording(xsens(tmp_path / "mt.txt", counter, **channels))
    assert len(recording) == T
    known = np.isfinite(recording.measurements["imu/gyr"]).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(known), kept)
    same(recording.measurements["imu/acc"][known], ACC[kept])
    assert ("imu/mag" in recording.measurements) == magnetometer


def test_rows_that_end_in_a_delimiter_and_a_missing_rate(tmp_path):
    path = xsens(tmp_path / "mt.txt", **CHANNELS)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], *(line + "\t" for line in lines[2:])]) + "\r\n")
    same(poise.load_recording(path).measurements["imu/gyr"], GYR)
    fine = {"PacketCounter": np.arange(T), "SampleTimeFine": 7_000_000 + np.arange(T) * 100}
    recording = poise.load_recording(write_table(tmp_path / "fine.txt", fine | CHANNELS, "\t", "// Device: x\n"))
    assert recording.dt == pytest.approx(0.01)
    with pytest.raises(ValueError, match="neither a comment 'Update Rate' nor a column SampleTimeFine"):
        poise.load_recording(
            write_table(tmp_path / "no.txt", {"PacketCounter": np.arange(T)} | CHANNELS, "\t", "// x\n")
        )
    with pytest.raises(ValueError, match=r"unknown|missing|no known format"):
        poise.load_recording(xsens(tmp_path / "few.txt", **axes("Acc_{}", ACC)))


@pytest.mark.parametrize("change", [str.lower, str.upper])
def test_the_case_of_names_does_not_matter(tmp_path, change):
    path = xsens(tmp_path / "mt.txt", **CHANNELS, **{f"Quat_q{i}": Q[:, i] for i in range(4)})
    lines = path.read_text().split("\n")
    path.write_text("\n".join([*lines[:2], change(lines[2]), *lines[3:]]))
    recording = poise.load_recording(path)
    same(recording.measurements["imu/gyr"], GYR)
    assert angles(recording.onboard_orientation, Q).max() < 1e-5


def test_core_motion_reports_minus_g_on_an_axis_that_points_up(tmp_path):
    table = {"loggingSample(N)": np.arange(T), "motionTimestamp_sinceReboot(s)": 5.0 + TIME}
    table |= axes("accelerometerAcceleration{}(G)", -ACC / G) | axes("motionRotationRate{}(rad/s)", GYR)
    table |= axes("motionUserAcceleration{}(G)", ACC / G) | axes("motionGravity{}(G)", ACC / G)
    table |= axes("motionQuaternion{}(R)", Q, "WXYZ")
    recording = poise.load_recording(write_table(tmp_path / "log.csv", table))
    same(recording.measurements["imu/acc"], ACC)
    same(recording.measurements["imu/gyr"], GYR)
    assert angles(recording.onboard_orientation, Q).max() < 1e-5


def test_an_app_that_writes_everything_into_one_table(tmp_path):
    """Gravity and linear acceleration beside the accelerometer, and milliseconds named in words."""
    table = axes("ACCELEROMETER {} (m/s²)", ACC) | axes("GRAVITY {} (m/s²)", 0.0 * ACC)
    table |= axes("LINEAR ACCELERATION {} (m/s²)", 0.0 * ACC) | axes("GYROSCOPE {} (rad/s)", GYR)
    table |= axes("MAGNETIC FIELD {} (μT)", MAG) | {"Time since start in ms ": (1e3 * TIME).round().astype(int)}
    recording = poise.load_recording(write_table(tmp_path / "log.csv", table, ";"))
    same(recording.measurements["imu/acc"], ACC)
    same(recording.measurements["imu/gyr"], GYR)
    assert recording.dt == pytest.approx(0.01)


def x_io(gyr_unit="deg/s", acc_unit="g"):
    table = {"Time (s)": TIME}
    table |= axes(f"Gyroscope {{}} ({gyr_unit})", GYR * {"deg/s": 180 / np.pi, "rad/s": 1.0}[gyr_unit])
    table |= axes(f"Accelerometer {{}} ({acc_unit})", ACC * {"g": 1 / G, "m/s^2": 1.0}[acc_unit])
    return table | axes("Magnetometer {} (uT)", MAG)


@pytest.mark.parametrize("gyr_unit", ["deg/s", "rad/s"])
@pytest.mark.parametrize("acc_unit", ["g", "m/s^2"])
@pytest.mark.parametrize("jitter", [0.0, 1e-3])
def test_tables_that_name_their_units(tmp_path, gyr_unit, acc_unit, jitter):
    table = x_io(gyr_unit, acc_unit)
    table["Time (s)"] = TIME + jitter * np.random.default_rng(0).uniform(-1, 1, T)
    recording = poise.load_recording(write_table(tmp_path / "sensor_data.csv", table))
    same(recording.measurements["imu/gyr"], GYR)
    same(recording.measurements["imu/acc"], ACC)
    assert recording.dt == pytest.approx(0.01, rel=1e-4)
    assert len(recording.on_grid()) == T


@pytest.mark.parametrize("magnetometer", ["slow", "none"])
@pytest.mark.parametrize("open_file", [True, False])
def test_x_imu3(tmp_path, magnetometer, open_file):
    folder, us = tmp_path / "ximu3", (392_093_562 + TIME * 1e6).astype(np.int64)
    inertial = {"Timestamp (us)": us} | axes("Gyroscope {} (deg/s)", np.degrees(GYR))
    write_table(folder / "Inertial.csv", inertial | axes("Accelerometer {} (g)", ACC / G))
    write_table(folder / "Quaternion.csv", {"Timestamp (us)": us} | axes("{} Element", Q, "WXYZ"))
    if magnetometer == "slow":
        slow = slice(3, None, 5)
        write_table(
            folder / "Magnetometer.csv", {"Timestamp (us)": us[slow] + 2000} | axes("{} Axis (a.u.)", MAG[slow])
        )
    recording = poise.load_recording(folder / "Inertial.csv" if open_file else folder)
    same(recording.measurements["imu/gyr"], GYR)
    same(recording.measurements["imu/acc"], ACC)
    assert angles(recording.onboard_orientation, Q).max() < 1e-5
    if magnetometer == "slow":
        known = np.isfinite(recording.measurements["imu/mag"]).all(axis=1)
        assert 0.15 < known.mean() < 0.25
        same(recording.measurements["imu/mag"][4::5][:50], MAG[3::5][:50])
    else:
        assert "imu/mag" not in recording.measurements


def test_the_quaternion_of_an_ngimu_is_the_conjugate(tmp_path):
    table = x_io() | {"Barometer (hPa)": np.full(T, 1013.0)}
    write_table(tmp_path / "ngimu" / "sensors.csv", table)
    write_table(tmp_path / "ngimu" / "quaternion.csv", {"Time (s)": TIME} | axes("{}", rotation.conjugate(Q), "WXYZ"))
    recording = poise.load_recording(tmp_path / "ngimu")
    assert recording.metadata["format"] == "x-io NGIMU"
    assert recording.metadata["onboard_orientation"]["read"] == "as written"
    assert angles(recording.onboard_orientation, Q).max() < 1e-5
    same(recording.measurements["imu/mag"], MAG)


def apdm(path, sensors, quaternion=Q):
    table, units = {"Time": 0.0075 + TIME}, ["s"]
    for name, sign in sensors.items():
        table |= axes(f"{name}/Acceleration/{{}}", sign * ACC) | axes(f"{name}/Angular Velocity/{{}}", GYR)
        table |= axes(f"{name}/Magnetic Field/{{}}", MAG)
        table |= dict(zip((f"{name}/Orientation/{axis}" for axis in ("Scalar", *XYZ)), quaternion.T, strict=True))
        table |= {f"{name}/Temperature/Scalar": np.full(T, 22.0), f"{name}/Pressure/Scalar": np.full(T, 100.5)}
        units += ["m/s^2"] * 3 + ["rad/s"] * 3 + ["uT"] * 3 + [""] * 4 + ["deg C", "kPa"]
    commas = "," * (len(table) - 2)
    return write_table(path, table, ",", f"Test Name:,Walk 1{commas}\nSample Rate:,100,Hz{commas}\n", ",".join(units))


def test_moveo_has_several_sensors(tmp_path):
    path = apdm(tmp_path / "walk.csv", {"Lumbar": 1.0, "Right Foot": 1.0})
    lumbar, foot = poise.load_recordings(path)
    assert (lumbar.metadata["sensor"], foot.metadata["sensor"]) == ("Lumbar", "Right Foot")
    assert foot.metadata["nominal_rate"] == 100.0
    same(foot.measurements["imu/gyr"], GYR)
    assert angles(foot.onboard_orientation, Q).max() < 1e-5
    with pytest.warns(UserWarning, match=r"several sensors \(Lumbar, Right Foot\)"):
        poise.load_recording(path)
    assert poise.load_recording(path, sensor="right foot").metadata["sensor"] == "Right Foot"
    single = poise.load_recording(apdm(tmp_path / "one.csv", {"Lumbar": 1.0}))
    same(single.measurements["imu/acc"], ACC)


@pytest.mark.parametrize("written", ["conjugate", "as written, z down", "conjugate, z down"])
def test_an_orientation_that_gravity_contradicts_is_turned(tmp_path, written):
    flip = np.array([0.0, 1.0, 0.0, 0.0])
    q = rotation.multiply(flip, Q) if "z down" in written else Q
    q = rotation.conjugate(q) if "conjugate" in written else q
    with pytest.warns(UserWarning, match=f"from gravity as written .* as {written}, which is taken"):
        recording = poise.load_recording(apdm(tmp_path / "walk.csv", {"Lumbar": 1.0}, q))
    up = rotation.up_in_body(recording.onboard_orientation)
    np.testing.assert_allclose(up, rotation.up_in_body(Q), atol=1e-6)
    assert recording.metadata["onboard_orientation"]["read"] == written


@pytest.mark.parametrize("saturates", [True, False])
def test_shimmer_has_two_accelerometers(tmp_path, saturates):
    """The one of low noise, unless it saturates at ±2 g; then the one of wide range."""
    wide = 3.0 * ACC if saturates else ACC
    low = np.clip(wide, -2 * G, 2 * G) if saturates else wide
    ms = 946_684_800_000.0 + TIME * 1e3
    table = {"Shimmer_952D_Timestamp_Unix_CAL": ms} | axes("Shimmer_952D_Accel_LN_{}_CAL", low)
    table |= axes("Shimmer_952D_Accel_WR_{}_CAL", wide + 1e-3) | {"Shimmer_952D_Battery_CAL": np.full(T, 4170.0)}
    table |= axes("Shimmer_952D_Gyro_{}_CAL", np.degrees(GYR)) | axes("Shimmer_952D_Mag_{}_CAL", MAG)
    units = ["ms"] + ["m/(s^2)"] * 6 + ["mV"] + ["deg/s"] * 3 + ["local_flux"] * 3
    path = write_table(tmp_path / "s.csv", table, ",", '"sep=,"\n', ",".join(units) + ",")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], *(line.rstrip(",") + "," for line in lines[1:])]) + "\n")
    recording = poise.load_recording(path)
    same(recording.measurements["imu/gyr"], GYR)
    same(recording.measurements["imu/acc"], wide + 1e-3 if saturates else low)
    assert recording.dt == pytest.approx(0.01, rel=1e-4)
    assert recording.metadata["format"] == "Shimmer Consensys"
