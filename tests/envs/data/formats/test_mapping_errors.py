"""What is said of mappings and tables that cannot be meant, instead of numbers."""

from __future__ import annotations

import os

import numpy as np
import pytest

import poise

TIME = np.arange(300) / 100.0
ANGLE = 2.0 * np.sin(TIME)
COLUMNS = {"gyr": ["p", "q", "r"], "acc": ["fx", "fy", "fz"]}


def write(path, extra: dict[str, list[object]] | None = None, repeat: int = 1):
    """A table of a sensor that turns about x; ``extra`` columns; every row ``repeat`` times."""
    zero = np.zeros(len(TIME))
    columns = {"time": TIME, "p": 2.0 * np.cos(TIME), "q": zero, "r": zero, "fx": zero}
    columns |= {"fy": 9.81 * np.sin(ANGLE), "fz": 9.81 * np.cos(ANGLE)}
    columns |= {"roll": ANGLE, "pitch": zero, "yaw": zero, "roll_deg": np.degrees(ANGLE)}
    table = {name: list(np.repeat(values, repeat)) for name, values in columns.items()} | (extra or {})
    lines = [",".join(table), *(",".join(str(cell) for cell in row) for row in zip(*table.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"units": "deg/s"}, "units must be a mapping from channel to unit, got 'deg/s'"),
        ({"units": {"gyr": 57.3}}, "unknown unit 57.3"),
        ({"signs": -1}, "signs must be a mapping from channel to sign, got -1"),
        ({"signs": {"acc": "-"}}, r"signs\['acc'\] must be 1 or -1, .*got '-'"),
        ({"signs": {"acc": 0}}, r"signs\['acc'\] must be 1 or -1, .*got 0"),
        ({"columns": {"gyr": None}}, "columns must be a name or a list of names .*got None"),
        ({"columns": {"gyr": 1.5}}, "columns must be a name or a list of names .*got 1.5"),
        ({"columns": {"gyr": ["p", "p", "r"]}}, r"columns\['gyr'\] must be different columns"),
        ({"columns": COLUMNS | {"magnetometer": ["p", "q", "r"]}}, "the channel is called 'mag', got 'magnetometer'"),
        ({"columns": {"chest/gyro": ["p", "q", "r"]}}, "the channel is called 'gyr', got 'chest/gyro'"),
        ({"reference": {"columns": ["roll", "pitch", "yaw"], "sensor": "leg"}}, "reference: unknown sensor 'leg'"),
        ({"reference": {"columns": ["roll", "pitch", "yaw"], "conjugate": "no"}}, "conjugate must be True or False"),
        ({"reference": {"columns": ["roll_deg", "pitch", "yaw"], "unit": "rad"}}, "unit must be 'deg', got 'rad'"),
    ],
)
def test_arguments_that_cannot_be_meant_are_named(tmp_path, given, message):
    path = write(tmp_path / "a.csv")
    with pytest.raises(ValueError, match=rf"a\.csv.*{message}"):
        poise.load_recording(path, **({"columns": COLUMNS, "time": "time"} | given))


def test_angles_in_rad_that_are_read_as_degrees_are_warned_of(tmp_path):
    path = write(tmp_path / "a.csv")
    with pytest.warns(UserWarning, match=r"angles in deg reach 2 only; are they in rad \(unit='rad'\)\?"):
        poise.load_recording(path, columns=COLUMNS, time="time", reference={"columns": ["roll", "pitch", "yaw"]})


@pytest.mark.parametrize("path", [3, None, ["a.csv"], b"a.csv", "a\0b"])
def test_what_is_no_path_is_named(path):
    with pytest.raises(ValueError, match="path of a recording must be a path"):
        poise.load_recording(path)


@pytest.mark.parametrize(
    ("column", "labels"),
    [("segment", ["thigh", "shank"]), ("sensor", [1, 2]), ("device id", [7, 3]), ("which", ["a", "b", "c"])],
)
def test_rows_of_several_sensors_under_one_another_are_sensors(tmp_path, column, labels):
    path = write(tmp_path / "a.csv", {column: labels * len(TIME)}, repeat=len(labels))
    found = poise.load_recordings(path, columns=COLUMNS, time="time")
    assert [one.metadata["sensor"] for one in found] == list(map(str, labels))
    assert {len(one) for one in found} == {len(TIME)}


def test_labels_that_change_now_and_then_are_no_sensors(tmp_path, recwarn):
    path = write(tmp_path / "a.csv", {"activity": ["walk"] * 100 + ["stand"] * 100 + ["walk"] * 100})
    assert len(poise.load_recording(path, columns=COLUMNS, time="time")) == len(TIME)
    assert not recwarn


@pytest.mark.parametrize("style", ["{0} [{1}]", "{0}, {1}", "{0} ({1})"])
def test_a_mapping_may_spell_columns_as_the_header_does(tmp_path, style):
    path = write(tmp_path / "a.csv")
    spelled = {name: style.format(name, unit) for names, unit in zip(COLUMNS.values(), ("deg/s", "g"), strict=True)
               for name in names}  # fmt: skip
    lines = path.read_text().split("\n")
    header = ";".join(spelled.get(name, name) for name in lines[0].split(","))
    path.write_text("\n".join([header, *(line.replace(",", ";") for line in lines[1:])]))
    columns = {channel: [spelled[name] for name in names] for channel, names in COLUMNS.items()}
    recording = poise.load_recording(path, columns=columns, time="time")
    assert recording.measurements["imu/gyr"][0, 0] == pytest.approx(np.radians(2.0))


@pytest.mark.parametrize(
    ("gyr", "acc"), [("gyr_{}_dps", "acc_{}_g"), ("gyro_dps_{}", "accel_mg_{}"), ("w{}_rad_s", "acc_{}_m_s2")]
)
def test_units_within_names(tmp_path, gyr, acc):
    path = write(tmp_path / "a.csv")
    names = {"p": gyr.format("x"), "q": gyr.format("y"), "r": gyr.format("z")}
    names |= {"fx": acc.format("x"), "fy": acc.format("y"), "fz": acc.format("z")}
    lines = path.read_text().split("\n")
    path.write_text("\n".join([",".join(names.get(name, name) for name in lines[0].split(",")), *lines[1:]]))
    recording = poise.load_recording(path)
    scale = {"dps": np.pi / 180.0, "rad": 1.0}["dps" if "dps" in gyr else "rad"]
    force = 9.80665e-3 if "mg" in acc else 9.80665 if acc.endswith("_g") else 1.0
    assert recording.measurements["imu/gyr"][0, 0] == pytest.approx(2.0 * scale)
    assert recording.measurements["imu/acc"][0, 2] == pytest.approx(9.81 * force)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ValueError, match="neither a file nor a folder"):
        poise.load_recording(tmp_path / "pipe.csv")
    with pytest.raises(FileNotFoundError, match="without recordings"):
        poise.load_recordings(tmp_path)
