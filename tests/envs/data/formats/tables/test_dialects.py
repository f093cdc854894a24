"""Tables as strangers write them: languages, durations, parts of units, order of rows, parts of an acceleration."""

import json

import numpy as np
import pytest

import poise

from ..motion import G, readings, same

HEADER = ["t (s)", *(f"gyr_{axis} (rad/s)" for axis in "xyz"), *(f"acc_{axis} (m/s^2)" for axis in "xyz")]
SI = {"gyr": "rad/s", "acc": "m/s^2"}


def table(path, header, time, *blocks, mark=",", end=""):
    rows = [mark.join([str(t), *(str(v) for block in blocks for v in block[i])]) + end for i, t in enumerate(time)]
    path.write_text("\n".join([*([header] if isinstance(header, str) else [mark.join(header)]), *rows]) + "\n")
    return path


def right(path, **given):
    found = poise.load_recording(path, **given)
    _, gyr, acc, *_ = readings()
    same(found.measurements["imu/gyr"], gyr, 1e-5)
    same(found.measurements["imu/acc"], acc, 1e-5)
    return found


@pytest.mark.parametrize(
    ("time", "acceleration", "rate"),
    [
        ("Zeit [s]", "Beschleunigung {} [m/s²]", "Drehrate {} [rad/s]"),
        ("Zeit [s]", "Beschleunigung_{} [m/s²]", "Winkelgeschwindigkeit_{} [rad/s]"),
        ("Temps (s)", "Accélération {} (m/s^2)", "Vitesse angulaire {} (rad/s)"),
        ("Tiempo (s)", "Aceleración {} (m/s²)", "Giroscopio {} (rad/s)"),
        ("Tempo (s)", "Accelerazione {} (m/s²)", "Velocità angolare {} (rad/s)"),
        ("时间(s)", "加速度{}(m/s²)", "角速度{}(rad/s)"),
        ("時間 [s]", "加速度 {} [m/s²]", "ジャイロ {} [rad/s]"),
    ],
)
def test_names_of_other_languages(tmp_path, time, acceleration, rate):
    stamps, gyr, acc, *_ = readings()
    names = [time, *(acceleration.format(axis) for axis in "XYZ"), *(rate.format(axis) for axis in "XYZ")]
    right(table(tmp_path / "a.csv", names, stamps, acc, gyr, mark=";"))


@pytest.mark.parametrize("written", ["{:.2f} sec", "{:.2f} s", "{:.3f}sec"])
def test_durations_with_their_unit(tmp_path, written):
    stamps, gyr, acc, *_ = readings()
    header = ["Time", *HEADER[1:]]
    found = right(table(tmp_path / "a.csv", header, [written.format(t) for t in stamps], gyr, acc))
    assert found.dt == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("unit", "scale"), [("1/16 deg/s", 16 * 180 / np.pi), ("1/900 rad/s", 900), ("1/131 dps", 131 * 180 / np.pi)]
)
def test_parts_of_a_unit(tmp_path, unit, scale):
    stamps, gyr, acc, *_ = readings()
    header = ["t (s)", *(f"gyr_{axis} [{unit}]" for axis in "xyz"), *(f"acc_{axis} [1/100 m/s^2]" for axis in "xyz")]
    right(table(tmp_path / "a.csv", header, stamps, scale * gyr, 100.0 * acc))


@pytest.mark.parametrize("range_of", ["16 g", "8g"])
def test_a_range_is_no_unit(tmp_path, range_of):
    stamps, gyr, acc, *_ = readings()
    header = [*HEADER[:4], *(f"acc_{axis} ({range_of})" for axis in "xyz")]
    with pytest.raises(ValueError, match="do not identify"):
        poise.load_recording(table(tmp_path / "a.csv", header, stamps, gyr, acc / G))


@pytest.mark.parametrize("end", [",", ",,", ",,,,"])
def test_empty_fields_at_the_end_of_rows(tmp_path, end):
    stamps, gyr, acc, *_ = readings()
    right(table(tmp_path / "a.csv", HEADER, stamps, gyr, acc, end=end))


def test_the_newest_row_may_be_the_first(tmp_path):
    stamps, gyr, acc, *_ = readings()
    path = table(tmp_path / "a.csv", HEADER, stamps[::-1], gyr[::-1], acc[::-1])
    with pytest.warns(UserWarning, match="out of order in time and were sorted"):
        right(path)


@pytest.mark.parametrize("field", ["/imu/data/{}/{}", "imu.{}.{}", ".imu.{}.{}"])
def test_fields_of_a_ros_message_are_known_however_they_are_joined(tmp_path, field):
    stamps, gyr, acc, *_ = readings()
    names = [field.format(kind, axis) for kind in ("angular_velocity", "linear_acceleration") for axis in "xyz"]
    right(table(tmp_path / "a.csv", ["__time", *names], stamps, gyr, acc))


def test_gravity_and_the_acceleration_of_the_user_are_added(tmp_path):
    stamps, gyr, acc, *_ = readings()
    gravity = np.tile([0.1, -0.2, -0.97], (len(stamps), 1))
    header = ["motionTimestamp_sinceReboot(s)"]
    for name, unit in (("RotationRate", "rad/s"), ("UserAcceleration", "G"), ("Gravity", "G")):
        header += [f"motion{name}{axis}({unit})" for axis in "XYZ"]
    right(table(tmp_path / "a.csv", header, stamps, gyr, -acc / G - gravity, gravity))


def test_gyroscope_and_accelerometer_of_core_motion_are_one_sensor(tmp_path):
    stamps, gyr, acc, *_ = readings()
    header = ["time(s)", *(f"gyroRotation{axis}(rad/s)" for axis in "XYZ")]
    header += [f"accelerometerAcceleration{axis}(G)" for axis in "XYZ"]
    right(table(tmp_path / "a.csv", header, stamps, gyr, -acc / G))


def test_several_rows_of_names_and_one_of_the_index(tmp_path):
    stamps, gyr, acc, *_ = readings()
    right(
        table(tmp_path / "a.csv", ",gyr,gyr,gyr,acc,acc,acc\n,x,y,z,x,y,z\ntime (s),,,,,,", stamps, gyr, acc), units=SI
    )


@pytest.mark.parametrize("column", ["I", "instance", "unit_no", "k"])
def test_instances_that_share_stamps_are_sensors(tmp_path, column):
    stamps, gyr, acc, *_ = readings()
    twice = np.repeat(np.arange(len(stamps)), 2)
    number = np.tile([[0], [1]], (len(stamps), 1))
    path = table(tmp_path / "a.csv", ["t (s)", column, *HEADER[1:]], stamps[twice], number, gyr[twice], acc[twice])
    assert [one.metadata["sensor"] for one in poise.load_recordings(path)] == ["0", "1"]
    same(poise.load_recording(path, sensor="1").measurements["imu/gyr"], gyr)


@pytest.mark.parametrize("within", [False, True])
def test_json_with_a_list_a_column_or_one_of_records(tmp_path, within):
    stamps, gyr, acc, *_ = readings()
    columns = {"time": stamps} | {f"gyr_{axis}": gyr[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"acc_{axis}": acc[:, i] for i, axis in enumerate("xyz")}
    lists = {name: values.tolist() for name, values in columns.items()}
    records = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]
    (tmp_path / "a.json").write_text(json.dumps({"device": "x", "samples": records} if within else lists))
    right(tmp_path / "a.json", units=SI)


@pytest.mark.parametrize(
    ("encoding", "time", "acceleration", "rate", "unit"),
    [
        ("gbk", "时间(s)", "加速度{}(m/s²)", "角速度{}(°/s)", "deg/s"),
        ("shift_jis", "時間 [s]", "加速度 {} [m/s^2]", "角速度 {} [rad/s]", "rad/s"),
        ("cp949", "시간 [s]", "가속도 {} [m/s^2]", "각속도 {} [°/s]", "deg/s"),
        ("mac_roman", "Temps [s]", "Accélération {} [m/s^2]", "Gyro {} [°/s]", "deg/s"),
    ],
)
def test_encodings_without_a_mark(tmp_path, encoding, time, acceleration, rate, unit):
    stamps, gyr, acc, *_ = readings()
    names = [time, *(acceleration.format(axis) for axis in "XYZ"), *(rate.format(axis) for axis in "XYZ")]
    path = table(tmp_path / "a.csv", names, stamps, acc, np.degrees(gyr) if unit == "deg/s" else gyr)
    path.write_bytes(path.read_text().replace("m/s²", "m/s^2").encode(encoding))
    if encoding == "mac_roman":
        path.write_bytes(path.read_bytes().replace("Accélération".encode(encoding), b"Acceleration"))
    right(path)


@pytest.mark.parametrize(
    ("name", "stamp"),
    [
        ("t (ms)", lambda t: f"{1e6 + 1e3 * t:,.0f}".replace(",", " ")),
        ("t (ms)", lambda t: f"{1e6 + 1e3 * t:,.0f}".replace(",", "\u202f")),
        ("timestamp", lambda t: f"{1.7e13 + 1e4 * t:.0f}"),
        ("timestamp (ms)", lambda t: f"0x{round(2**31 - 2000 + 1e3 * t):08X}"),
    ],
)
def test_stamps_in_other_spellings(tmp_path, name, stamp):
    stamps, gyr, acc, *_ = readings()
    assert right(
        table(tmp_path / "a.csv", [name, *HEADER[1:]], [stamp(t) for t in stamps], gyr, acc, mark=";")
    ).dt == pytest.approx(0.01)


def test_registers_in_hexadecimal_have_a_sign(tmp_path):
    stamps, gyr, acc, *_ = readings()
    counts = [np.vectorize(lambda v: f"0x{round(v) & 0xFFFF:04x}")(values) for values in (gyr / 1e-3, acc / 5e-3)]
    found = poise.load_recording(
        table(tmp_path / "a.csv", ["time", *(each.split()[0] for each in HEADER[1:])], stamps, *counts),
        units={"gyr": "0.001 rad/s", "acc": "0.005 m/s^2"},
    )
    same(found.measurements["imu/gyr"], gyr, 6e-4)
    same(found.measurements["imu/acc"], acc, 3e-3)


@pytest.mark.parametrize("coarse", ["High-g Accelerometer {} (g)", "highg_acc_{} (g)", "acc_high_{} (g)"])
def test_a_second_accelerometer_is_no_gyroscope(tmp_path, coarse):
    stamps, gyr, acc, *_ = readings()
    header = [*HEADER, *(coarse.format(axis) for axis in "XYZ")]
    right(table(tmp_path / "a.csv", header, stamps, gyr, acc, 1.02 * acc / G))


def test_a_covariance_is_no_orientation(tmp_path):
    stamps, gyr, acc, *_ = readings()
    header = [*HEADER, *(f"orientation_covariance_{k}" for k in range(9))]
    found = right(table(tmp_path / "a.csv", header, stamps, gyr, acc, np.tile(np.eye(3).ravel(), (len(stamps), 1))))
    assert list(found.measurements) == ["imu/gyr", "imu/acc"]


@pytest.mark.parametrize("faster", [False, True])
def test_each_channel_may_have_a_time_of_its_own(tmp_path, faster):
    """As an electromyograph's program writes them, whose electrodes are faster than the sensors in them."""
    stamps, gyr, acc, *_ = readings()
    fast = np.arange(10 * len(stamps) if faster else len(stamps)) / (1000.0 if faster else 100.0)
    header, columns = ["X[s]", "EMG 1 [V]"], [fast, 0.0 * fast]
    for name, values in (("GYRO.{} 1 [rad/s]", gyr), ("ACC.{} 1 [m/s^2]", acc)):
        for i, axis in enumerate("XYZ"):
            header += ["X[s]", f"Electrode 1: {name.format(axis)}"]
            columns += [stamps, values[:, i]]
    rows = [[str(column[k]) if k < len(column) else "" for column in columns] for k in range(len(fast))]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(",".join(row) for row in [header, *rows]) + "\n")
    with pytest.warns(UserWarning, match="names of columns occur more than once"):
        assert right(path).dt == pytest.approx(0.01)


def test_a_table_without_time_and_rate_says_so(tmp_path):
    stamps, gyr, acc, *_ = readings()
    path = table(tmp_path / "a.csv", ["temperature", *HEADER[1:]], 0.0 * stamps + 20.0, gyr, acc)
    with pytest.raises(ValueError, match="neither a column of the time nor a sampling rate is told"):
        poise.load_recording(path)
    right(path, rate=100.0)
