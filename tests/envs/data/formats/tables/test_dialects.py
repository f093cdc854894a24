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
