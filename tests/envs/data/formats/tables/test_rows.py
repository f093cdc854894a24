"""Rows of several devices, and tables with a row a reading, become the recordings that they are."""

import json

import numpy as np
import pytest

import poise
from poise.envs.data.formats.draft import draft_map

from ..motion import readings, same

UNITS = {"gyr": "rad/s", "acc": "m/s^2"}


def long_rows(names, block=False, devices=(None,)):
    """Time, device, sensor, x, y, z of every reading, in the order of time or sensor after sensor."""
    time, *channels, _ = readings()
    rows = [
        (float(t + 0.002 * k), device, name, *map(float, (1.0 + 0.1 * d) * values[i]))
        for d, device in enumerate(devices)
        for k, (name, values) in enumerate(zip(names, channels, strict=False))
        for i, t in enumerate(time)
    ]
    return rows if block else sorted(rows, key=lambda row: row[0])


@pytest.mark.parametrize("block", [False, True])
@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("time,sensor,x,y,z", ("gyr", "acc", "mag")),
        ("timestamp;type;X;Y;Z", ("Gyroscope", "Accelerometer", "Magnetometer")),
        ("t\tsensor_name\tv0\tv1\tv2", ("GYRO", "ACCEL", "MAG")),
        ("seconds,stream,value_1,value_2,value_3", ("angular velocity", "acceleration")),
        ("Time (s),Sensor,values_x,values_y,values_z", ("gyroscope_uncalibrated", "accelerometer")),
    ],
)
def test_a_row_a_reading(tmp_path, header, names, block):
    mark = next(mark for mark in ",;\t" if mark in header)
    path = tmp_path / "long.csv"
    lines = [mark.join(map(str, (row[0], *row[2:]))) for row in long_rows(names, block)]
    path.write_text("\n".join([header, *lines]) + "\n")
    with pytest.raises(ValueError, match=r"they suggest imu/gyr = \['gyr_x', 'gyr_y', 'gyr_z'\]"):
        poise.load_recording(path)
    found = poise.load_recording(path, units=UNITS)
    _, gyr, acc, *_ = readings()
    same(found.measurements["imu/gyr"], gyr[1:])
    # an accelerometer is read 2 ms later: interpolated
    assert np.abs(found.measurements["imu/acc"] - acc[1:]).max() < 0.25 * np.abs(np.diff(acc, axis=0)).max() + 1e-6
    text = draft_map(path)
    assert 'gyr = ["gyr_x", "gyr_y", "gyr_z"]' in text
    (tmp_path / "long.toml").write_text(text)
    same(poise.load_recording(tmp_path / "long.toml").measurements["imu/gyr"], gyr[1:])


def test_units_of_a_row_a_reading_are_read(tmp_path):
    path = tmp_path / "long.csv"
    unit = {"gyro": "deg/s", "acc": "g"}
    lines = [
        f"{row[0]},{row[2]},{','.join(map(str, np.array(row[3:]) / (np.pi / 180 if row[2] == 'gyro' else 9.80665)))},"
        f"{unit[row[2]]}"
        for row in long_rows(("gyro", "acc"))
    ]
    path.write_text("\n".join(["time (s),sensor,x,y,z,unit", *lines]) + "\n")
    same(poise.load_recording(path).measurements["imu/gyr"], readings()[1][1:])


@pytest.mark.parametrize("lines", [False, True])
def test_json_records_are_a_row_a_reading(tmp_path, lines):
    path = tmp_path / "log.json"
    records = [
        {"sensor": row[2], "time": int(1.7e18 + 1e9 * row[0]), "values": dict(zip("xyz", row[3:], strict=True))}
        for row in long_rows(("Gyroscope", "TotalAcceleration"))
    ]
    path.write_text("\n".join(map(json.dumps, records)) if lines else json.dumps(records))
    same(poise.load_recording(path, units=UNITS).measurements["imu/gyr"], readings()[1][1:], 1e-5)


@pytest.mark.parametrize("block", [False, True])
@pytest.mark.parametrize(("column", "devices"), [("sensor_id", ("1", "2")), ("device", ("left", "right", "chest")),
    ("MAC", ("D4:22:CD:00:11:22", "D4:22:CD:00:11:23"))])  # fmt: skip
def test_rows_of_several_devices(tmp_path, column, devices, block):
    time, gyr, acc, *_ = readings()
    rows = [
        (t, device, *((1.0 + 0.1 * d) * gyr[i]), *acc[i])
        for d, device in enumerate(devices)
        for i, t in enumerate(time)
    ]
    rows = rows if block else sorted(rows, key=lambda row: row[0])
    header = f"time (s),{column},gyr_x (rad/s),gyr_y (rad/s),gyr_z (rad/s),acc_x (m/s^2),acc_y (m/s^2),acc_z (m/s^2)"
    path = tmp_path / "all.csv"
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    found = poise.load_recordings(path)
    assert [one.metadata["sensor"] for one in found] == list(devices)
    for d, one in enumerate(found):
        same(one.measurements["imu/gyr"], (1.0 + 0.1 * d) * gyr)
        assert one.metadata["units"]["imu/gyr"] == "rad/s"
    with pytest.warns(UserWarning, match=f"holds several sensors .{devices[0]}, {devices[1]}"):
        poise.load_recording(path)
    same(poise.load_recording(path, sensor=devices[1]).measurements["imu/gyr"], 1.1 * gyr)
    with pytest.raises(ValueError, match="unknown sensor 'hip'"):
        poise.load_recording(path, sensor="hip")
    (tmp_path / "all.toml").write_text(draft_map(path))
    assert len(poise.load_recordings(tmp_path / "all.toml")) == len(devices)


def test_several_devices_with_a_row_a_reading(tmp_path):
    path = tmp_path / "long.csv"
    rows = long_rows(("gyro", "acc"), devices=("left", "right"))
    path.write_text("\n".join(["time,device,sensor,x,y,z", *(",".join(map(str, row)) for row in rows)]) + "\n")
    left, right = poise.load_recordings(path, units=UNITS)
    assert (left.metadata["sensor"], right.metadata["sensor"]) == ("left", "right")
    same(right.measurements["imu/gyr"], 1.1 * readings()[1][1:])


@pytest.mark.parametrize(
    "names", [("imu1_gyro", "imu1_acc", "imu2_gyro", "imu2_acc"), ("left gyr", "left acc", "right gyr", "right acc")]
)
def test_kinds_that_name_their_device(tmp_path, names):
    time, gyr, acc, *_ = readings()
    blocks = (gyr, acc, 1.1 * gyr, acc)
    rows = [f"{t},{names[k]},{','.join(map(str, blocks[k][i]))}" for i, t in enumerate(time) for k in range(4)]
    (tmp_path / "a.csv").write_text("\n".join(["t,sensor,x,y,z", *rows]) + "\n")
    one, other = poise.load_recordings(tmp_path / "a.csv", units=UNITS)
    assert one.metadata["sensor"] == names[0].replace("imu", "").replace("_", " ").split()[0]
    same(one.measurements["imu/gyr"], gyr)
    same(other.measurements["imu/gyr"], 1.1 * gyr)


@pytest.mark.parametrize("column", ["type", "activity_id", "channel"])
@pytest.mark.parametrize("labels", [("walk", "stand"), (1, 2)])
def test_labels_of_what_was_done_are_no_devices(tmp_path, column, labels):
    time, gyr, acc, *_ = readings()
    label = np.where(time % 4.0 < 2.0, *labels)
    header = f"time (s),{column},gyr_x (rad/s),gyr_y (rad/s),gyr_z (rad/s),acc_x (m/s^2),acc_y (m/s^2),acc_z (m/s^2)"
    rows = [",".join(map(str, (t, label[i], *gyr[i], *acc[i]))) for i, t in enumerate(time)]
    (tmp_path / "one.csv").write_text("\n".join([header, *rows]) + "\n")
    (found,) = poise.load_recordings(tmp_path / "one.csv")
    same(found.measurements["imu/gyr"], gyr)
