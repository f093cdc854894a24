"""Lines that serial ports lose, footers, texts between numbers, headers of R, labels of devices, units of arrays."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io

from poise.envs.data.formats.draft import draft_map
from poise.envs.data.formats.load import load_recording, load_recordings
from poise.envs.data.trajectory import Trajectory
from poise.filters.core import rotation

from .motion import G, axes, readings, same, write_table

TIME, GYR, ACC, _, _ = readings()
TABLE = {"time (s)": TIME} | axes("gyr_{} (deg/s)", np.degrees(GYR), "xyz") | axes("acc_{} (g)", ACC / G, "xyz")


def lines_of(tmp_path, separator: str = ",") -> list[str]:
    return write_table(tmp_path / "a.csv", TABLE, separator).read_text().splitlines()


def loaded(tmp_path, lines: list[str]) -> Trajectory:
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    return load_recording(tmp_path / "a.csv")


def check(recording: Trajectory) -> None:
    """The readings are those of their times, and nearly all are there."""
    index = np.rint(recording.time * 100.0).astype(int)
    assert len(index) >= len(TIME) - 5
    known = np.isfinite(recording.measurements["imu/gyr"]).all(axis=1)
    same(recording.measurements["imu/gyr"][known], GYR[index[known]])


@pytest.mark.parametrize("row", [100, 700])
@pytest.mark.parametrize(
    "damage",
    [
        lambda line, after: [line[: len(line) // 2]],
        lambda line, after: [line[:30] + after],
        lambda line, after: [line + ",1,2"],
        lambda line, after: [line, "EVENT,button pressed"],
        lambda line, after: [line, "*** buffer overflow ***"],
    ],
)
def test_lines_of_another_length_are_left_out(tmp_path, row, damage):
    lines = lines_of(tmp_path)
    lines[row : row + 1] = damage(lines[row], lines[row + 1])
    with pytest.warns(UserWarning, match=r"1 rows have another number of fields than 7 and are left out"):
        check(loaded(tmp_path, lines))


def test_many_long_lines_are_refused_with_their_row(tmp_path):
    lines = lines_of(tmp_path)
    lines[100:200] = [f"{line},1" for line in lines[100:200]]
    with pytest.raises(ValueError, match=r"a.csv.*: row 99 of its table has 8 fields, most rows have 7"):
        loaded(tmp_path, lines)


@pytest.mark.parametrize("text", ["Err", "OVF", "0\ufffd\ufffd1", "--.--"])
def test_texts_between_numbers_are_missing_samples(tmp_path, text):
    lines = lines_of(tmp_path)
    for row in (50, 60):
        lines[row] = lines[row].rsplit(",", 1)[0] + f",{text}"
    with pytest.warns(UserWarning, match=r"column acc_z holds no number in row 49 .*\(2 in all\) count as missing"):
        recording = loaded(tmp_path, lines)
    check(recording)
    assert np.isnan(recording.measurements["imu/acc"]).any(axis=1).sum() == 2


@pytest.mark.parametrize(
    "footer", ["Mean,0.1,0.2,0.3,0.4,0.5,0.6", ",0.1,0.2,0.3,0.4,0.5,0.6", "NaN,1,1,1,1,1,1", "Total samples: 801\nend"]
)
def test_footers_are_left_out(tmp_path, footer):
    with pytest.warns(UserWarning, match="left out"):
        check(loaded(tmp_path, [*lines_of(tmp_path), *footer.split("\n")]))


@pytest.mark.parametrize("place", [0, 1])
def test_a_header_without_a_name_for_the_row_numbers_of_r(tmp_path, place):
    names, *rows = lines_of(tmp_path)
    check(loaded(tmp_path, [names, *(f"{number + place},{row}" for number, row in enumerate(rows))]))


def test_units_may_stand_above_the_names_and_names_in_quotes(tmp_path):
    names = [f"'{name.split(' ')[0]}'" for name in TABLE]
    units = ["s", *["deg/s"] * 3, *["g"] * 3]
    check(loaded(tmp_path, [",".join(units), ",".join(names), *lines_of(tmp_path)[1:]]))


def test_axes_may_have_units_of_their_own(tmp_path):
    table = TABLE | {"gyr_y (deg/s)": GYR[:, 1]}
    lines = write_table(tmp_path / "a.csv", table).read_text().replace("gyr_y (deg/s)", "gyr_y (rad/s)").splitlines()
    check(loaded(tmp_path, lines))


@pytest.mark.parametrize("degrees", [True, False])
@pytest.mark.parametrize("clock", [1.0, 1 / 86_400.0])
def test_a_draft_guesses_the_unit_of_slow_rates_and_of_the_clock(tmp_path, degrees, clock):
    """A slow sway has no rate that tells the unit by its size."""
    time = np.arange(1200) / 100.0
    angles = np.sin(0.4 * np.pi * time)[:, None] * [0.2, 0.1, 0.05]
    gyr, acc = np.gradient(angles, 0.01, axis=0), rotation.up_in_body(rotation.exp(angles))
    table = {"time": 45_356.4 + clock * time if clock < 1.0 else time}
    table |= axes("gyr_{}", np.degrees(gyr) if degrees else gyr, "xyz") | axes("acc_{}", acc, "xyz")
    text = draft_map(write_table(tmp_path / "a.csv", table))
    (tmp_path / "a.toml").write_text(text)
    recording = load_recording(tmp_path / "a.toml")
    assert f'gyr = "{"deg" if degrees else "rad"}/s"  # guessed' in text
    np.testing.assert_allclose(recording.time, time, atol=1e-3)
    same(recording.measurements["imu/gyr"], gyr)


def test_decimal_commas_between_commas_are_refused(tmp_path):
    names, *rows = lines_of(tmp_path)
    with pytest.raises(
        ValueError, match="names 7 columns, but its rows have 14 fields: commas separate fields and mark"
    ):
        loaded(tmp_path, [names, *(row.replace(".", ",") for row in rows)])


def test_rows_of_two_devices_in_parquet_are_two_recordings(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frames = [pandas.DataFrame({"device": name} | TABLE) for name in ("left", "right")]
    pandas.concat(frames).sort_values("time (s)").to_parquet(tmp_path / "a.parquet")
    found = load_recordings(tmp_path / "a.parquet")
    assert [one.metadata["sensor"] for one in found] == ["left", "right"]
    assert len(found[0]) == len(TABLE["time (s)"])


@pytest.mark.parametrize("index", ["dates", "durations", "texts"])
def test_parquet_tables_have_times_of_any_type(tmp_path, index):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = pandas.DataFrame(TABLE)
    time = pandas.to_timedelta(frame.pop("time (s)"), unit="s")
    if index == "texts":
        frame = frame.assign(**{"time (s)": TIME}).astype(str)
    else:
        frame.index = pandas.Index(time + pandas.Timestamp("2024-03-05") if index == "dates" else time)
    frame.to_parquet(tmp_path / "a.parquet")
    check(load_recording(tmp_path / "a.parquet"))


def test_arrays_have_units_in_attributes_or_names(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values, unit in (("time", TIME, "s"), ("gyr", np.degrees(GYR), "deg/s"), ("acc", ACC / G, b"g")):
            file[name] = values
            file[name].attrs["units"] = unit
    scipy.io.savemat(tmp_path / "a.mat", {"Time_s": TIME, "Gyro_dps": np.degrees(GYR), "Acc_g": ACC / G})
    for name in ("a.h5", "a.mat"):
        check(load_recording(tmp_path / name))


def test_mt_manager_with_the_header_of_a_dot_keeps_its_clock(tmp_path):
    table = {"PacketCounter": np.arange(len(TIME)), "SampleTimeFine": 100 * np.arange(len(TIME))}
    table |= axes("Acc_{}", ACC) | axes("Gyr_{}", GYR)
    path = write_table(tmp_path / "a.csv", table, ",", "DeviceId:,0x0380\nUpdate Rate:,100.0Hz\n")
    check(load_recording(path))
