"""Text tables in the dialects of devices, spreadsheets and scripts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.envs.data.formats.described import RATES
from poise.envs.data.formats.load import load_recording
from poise.envs.data.formats.tables.arrays import read_table
from poise.envs.data.formats.tables.names import classify, groups, time_column
from poise.envs.data.formats.tables.table import Table, factor, split_unit

VALUES = np.round(np.random.default_rng(5).standard_normal((50, 4)), 4)
NAMES = ["t", "Gyr_X", "Gyr_Y", "Gyr_Z"]


def text(delimiter: str = ",", decimal: str = ".", end: str = "\n", tail: str = "", above: tuple[str, ...] = ()) -> str:
    rows = [delimiter.join(f"{value:.4f}".replace(".", decimal) for value in row) + tail for row in VALUES]
    return end.join([*above, delimiter.join(NAMES) + tail, *rows]) + end


def table_of(path: Path, content: str | bytes):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_table(path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("delimiter", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), (" ", ".")]
)
@pytest.mark.parametrize("tail", ["", "delimiter"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_dialects_give_the_same_numbers(tmp_path, end, delimiter, decimal, tail, encoding):
    content = text(delimiter, decimal, end, delimiter if tail else "")
    table = table_of(tmp_path / "a.txt", content.encode(encoding))
    assert list(table.arrays) == NAMES
    np.testing.assert_allclose(table.matrix(NAMES), VALUES)


@pytest.mark.parametrize(
    "above",
    [
        ("# a comment", "# Rate: 100 Hz"),
        ("// Update Rate: 100.0Hz", "// Option: on"),
        ("sep=,", "Device:,x", "Rate:,100,Hz", ""),
        ("\n", "A title of the recording", ""),
        ("% MATLAB", "% rate = 100"),
    ],
)
def test_lines_above_the_table_are_kept(tmp_path, above):
    table = table_of(tmp_path / "a.csv", text(above=above))
    assert list(table.arrays) == NAMES
    assert table.preamble == tuple(line for line in above if line.strip())
    if "100" in "".join(above):
        assert table.rate_in_header("Rate", "Update Rate") == 100.0


def test_headers_of_several_lines(tmp_path):
    groups_over_axes = "Time (s);IMU Gyroscope;;;Vicon Orientation;;;;\n;X;Y;Z;W;X;Y;Z;\n" + "".join(
        f"{k / 100};1;2;3;1;0;0;0\n" for k in range(5)
    )
    table = table_of(tmp_path / "a.csv", groups_over_axes)
    assert table.units == {"Time": "s"}
    assert [group.columns[0] for group in groups(table)] == ["IMU Gyroscope/X", "Vicon Orientation/W"]
    units_below = "Time,Foot/Acceleration/X,Foot/Acceleration/Y\ns,m/s^2,m/s^2\n0,1,2\n1,1,2\n2,1,2\n"
    table = table_of(tmp_path / "b.csv", units_below)
    assert table.unit(["Foot/Acceleration/X", "Foot/Acceleration/Y"]) == "m/s^2"
    table = table_of(tmp_path / "c.txt", "0.1 1 2 3\n0.2 1 2 3\n0.3 1 2 3\n")
    assert not table.named
    np.testing.assert_allclose(table.matrix(["0"])[:, 0], [0.1, 0.2, 0.3])


@pytest.mark.parametrize("missing", ["", "NaN", "nan", "NULL", "None", "-", "n/a", "#N/A"])
def test_texts_for_missing_values_are_missing(tmp_path, missing):
    lines = text().splitlines()
    fields = lines[4].split(",")
    lines[4] = ",".join([fields[0], missing, *fields[2:]])
    lines.insert(9, "")
    values = table_of(tmp_path / "a.csv", "\n".join(lines)).matrix(NAMES)
    assert len(values) == len(VALUES)
    assert np.argwhere(np.isnan(values)).tolist() == [[3, 1]]


def test_unreadable_cells_are_named_when_they_are_needed(tmp_path):
    content = text().replace(f"{VALUES[7, 2]:.4f}", "oops")
    table = table_of(tmp_path / "a.csv", content)
    assert len(table.matrix(["Gyr_X"])) == len(VALUES)
    with pytest.raises(ValueError, match="column Gyr_Y holds no number in row 7 of the table: 'oops'"):
        table.matrix(NAMES)
    with pytest.raises(ValueError, match=r"unknown column 'Gyr_y', did you mean 'Gyr_.'"):
        table.matrix(["Gyr_y"])


def test_a_last_row_that_was_cut_off_is_left_out(tmp_path):
    content = text()
    for end in (content.rindex(","), len(content) - 3):
        with pytest.warns(UserWarning, match=r"the last row is cut off"):
            table = table_of(tmp_path / "a.csv", content[:end])
        np.testing.assert_allclose(table.matrix(NAMES), VALUES[:-1])
    np.testing.assert_allclose(table_of(tmp_path / "a.csv", content[:-1]).matrix(NAMES), VALUES)


@pytest.mark.parametrize(
    "content", [b"", b"hello\nworld\n", b"a,b,c\n", bytes(range(256)) * 4, b"PK\x03\x04" + bytes(40)]
)
def test_what_holds_no_table_is_refused(tmp_path, content):
    with pytest.raises(ValueError, match=r"no table|neither a text|is empty|not a readable|without NumPy"):
        table_of(tmp_path / "a", content)


def test_a_header_between_the_rows_is_left_out_with_a_warning(tmp_path):
    head, rows = "time,gx,gy,gz", [f"{k / 100},{k},1,2" for k in range(60)]
    with pytest.warns(UserWarning, match="header stands 2 more times"):
        table = table_of(tmp_path / "a.csv", "\n".join([head, *rows[:20], head, *rows[20:40], head, *rows[40:]]) + "\n")
    np.testing.assert_array_equal(table.column("gx"), np.arange(60))


@pytest.mark.parametrize(
    ("unit", "kind", "expected"),
    [
        ("deg/s", "gyr", np.pi / 180),
        ("°/s", "gyr", np.pi / 180),
        ("rad s^-1", "gyr", 1.0),
        ("dps", "gyr", np.pi / 180),
        ("mdps", "gyr", np.pi / 180e3),
        ("g", "acc", 9.80665),
        ("mg", "acc", 9.80665e-3),
        ("m s^-2", "acc", 1.0),
        ("m/(s^2)", "acc", 1.0),
        ("G", "acc", 9.80665),
        ("uT", "mag", 1.0),
        ("mT", "mag", 1000.0),
        ("gauss", "mag", 100.0),
        ("us", "time", 1e-6),
    ],
)
def test_units_have_one_factor(unit, kind, expected):
    assert factor(kind, unit) == pytest.approx(expected)
    assert split_unit(f"Some name ({unit})") == ("Some name", unit)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Gyr_X", ("", "gyr", "x")),
        ("gyroX", ("", "gyr", "x")),
        ("gx", ("", "gyr", "x")),
        ("wz", ("", "gyr", "z")),
        ("Acc. Y", ("", "acc", "y")),
        ("angular_velocity.z", ("", "gyr", "z")),
        ("accelerometerAccelerationX", ("", "acc", "x")),
        ("LeftFoot.acc.z", ("left foot", "acc", "z")),
        ("Static/Angular Velocity/X", ("static", "gyr", "x")),
        ("w_RS_S_x", ("", "gyr", "x")),
        ("Quat_q1", ("", "quaternion", "1")),
        ("Mat[1][2]", ("", "matrix", "12")),
        ("mag_z", ("", "mag", "z")),
    ],
)
def test_names_say_kind_and_axis(name, expected):
    found = classify(name)
    assert found is not None
    assert (found[0], found[1], found[3]) == expected


@pytest.mark.parametrize(
    "name",
    ["FreeAcc_X", "Linear Acceleration x", "motionUserAccelerationX", "gravity_x", "VelInc_X", "px", "Roll", "t"],
)
def test_what_lacks_gravity_or_is_none_of_the_sensors_is_left_alone(name):
    assert classify(name) is None


def test_the_finest_clock_is_the_time(tmp_path):
    rows = "".join(f"{946684800000000000 + 10**7 * k},{k / 100},{k},1\n" for k in range(5))
    table = table_of(tmp_path / "a.csv", "time,seconds_elapsed,counter,x\n" + rows)
    assert time_column(table) == "seconds_elapsed"


HEADER = "Time [s],gyr_x [rev/s],gyr_y [rev/s],gyr_z [rev/s],acc_x [g],acc_y [g],acc_z [g]"
ROWS = [[f"{0.01 * k:.2f}", *(f"{value:.4f}" for value in (*VALUES[k % 50, :3], 0, 0, 1))] for k in range(1000)]


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (",", ","), (";", ","), ("\t", ".")])
def test_every_cell_in_quotes_however_long_the_file(tmp_path, delimiter, decimal):
    lines = [HEADER.split(","), *([cell.replace(".", decimal) for cell in row] for row in ROWS)]
    content = "\n".join(delimiter.join(f'"{cell}"' for cell in line) for line in lines)
    (tmp_path / "quoted.csv").write_text(content + "\n")
    recording = load_recording(tmp_path / "quoted.csv")
    assert len(recording) == 1000
    np.testing.assert_allclose(recording.measurements["imu/gyr"][:50], 2.0 * np.pi * VALUES[:, :3])


@pytest.mark.parametrize("form", ["{}/{}", "{}/({})", "{} / {}", "{}:{}", "{} - {}"])
def test_a_unit_may_stand_after_its_quantity(tmp_path, form):
    units = {"gyr": "deg/s", "acc": "m/s^2"}
    names = [form.format("time", "s")]
    names += [form.format(f"{kind}_{axis}", unit) for kind, unit in units.items() for axis in "xyz"]
    (tmp_path / "a.csv").write_text("\n".join([",".join(names), *(",".join(row) for row in ROWS)]) + "\n")
    recording = load_recording(tmp_path / "a.csv")
    np.testing.assert_allclose(recording.measurements["imu/gyr"][:50], np.radians(VALUES[:, :3]), atol=1e-9)
    np.testing.assert_allclose(recording.measurements["imu/acc"][0], [0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", ["Right Foot/Acceleration/X", "seat/g", "Mat[1][2]", "imu/gyr/x"])
def test_a_path_of_names_is_no_unit(name):
    assert split_unit(name) == (name, "")


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("gyro_x_rpm", "gyro_x", "rpm"),
        ("gyr_deg_per_s_y", "gyr_y", "deg/s"),
        ("w_z_rad_per_sec", "w_z", "rad/s"),
        ("gyro_z_degpersec", "gyro_z", "deg/s"),
        ("acc_m_s_2_x", "acc_x", "m/s2"),
        ("accel_y_m_per_s2", "accel_y", "m/s2"),
        ("acc_x_cm_s2", "acc_x", "cm/s2"),
        ("ax_g", "ax", "g"),
        ("gyro_rad[0]", "gyro[0]", "rad/s"),
        ("mag_mG[1]", "mag[1]", "mg"),
    ],
)
def test_a_unit_may_end_a_name_in_any_spelling(name, stem, unit):
    assert split_unit(name) == (stem, unit)


@pytest.mark.parametrize("name", ["acc_rad", "imu_1", "pos_t", "speed_m_s", "force_n", "acc_t", "gyr_g"])
def test_what_ends_a_name_is_a_unit_only_of_its_kind(name):
    assert split_unit(name) == (name, "")


def test_names_that_occur_twice_are_named(tmp_path):
    columns = HEADER.split(",")
    lines = [",".join([*columns, *columns[1:]]), *(",".join([*row, *row[1:]]) for row in ROWS)]
    (tmp_path / "twice.csv").write_text("\n".join(lines) + "\n")
    with pytest.warns(UserWarning, match=r"twice.csv: names of columns occur more than once.*'gyr_x.1'"):
        load_recording(tmp_path / "twice.csv")


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("# Sample Rate: 51.2 Hz", 51.2),
        ("# ODR: 1.6 kHz", 1600.0),
        ("# Sampling Rate: 100 s-1", 100.0),
        ("# Sample Period: 10 ms", 100.0),
        ("# Sampling Interval: 10000 µs", 100.0),
        ("# Sampling Interval = 0.01", 100.0),
        ("# Sample Period, 5", 200.0),
    ],
)
def test_a_rate_or_an_interval_in_a_header(line, rate):
    assert Table({}, preamble=(line,)).rate_in_header(*RATES) == pytest.approx(rate)


def test_each_of_several_columns_of_one_name_is_kept(tmp_path):
    lines = ["t,x,x.1,x,x"] + [f"{0.01 * row:.2f},{row},{row}.1,{row}.2,{row}.3" for row in range(1, 30)]
    with pytest.warns(UserWarning, match="more than once"):
        table = table_of(tmp_path / "a.csv", "\n".join(lines))
    first = {name: float(values[0]) for name, values in table.arrays.items()}
    assert first == {"t": 0.01, "x": 1.0, "x.1": 1.1, "x.2": 1.2, "x.3": 1.3}


def test_a_parquet_table_with_units_needs_no_mapping(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = pandas.DataFrame(np.array(ROWS, dtype=float), columns=HEADER.split(","))
    frame.to_parquet(tmp_path / "a.parquet")
    recording = load_recording(tmp_path / "a.parquet")
    np.testing.assert_allclose(recording.measurements["imu/acc"][0], [0.0, 0.0, 9.80665])


def test_a_first_row_with_little_in_it_does_not_lose_the_header(tmp_path):
    content = text().replace(",".join(f"{value:.4f}" for value in VALUES[0]), f"{VALUES[0, 0]:.4f},,,")
    table = table_of(tmp_path / "a.csv", content)
    assert list(table.arrays) == NAMES
    assert np.isnan(table.matrix(NAMES[1:])[0]).all()
    np.testing.assert_allclose(table.matrix(NAMES)[1:], VALUES[1:])


@pytest.mark.parametrize(("mark", "delimiter"), [(".", ";"), (",", ";"), (",", "\t")])
def test_whole_numbers_in_groups_are_read(tmp_path, mark, delimiter):
    stamps = 999_950 + np.arange(100)
    number = "1,5" if mark == "." else "1.5"
    rows = [delimiter.join([f"{stamp:,d}".replace(",", mark), number, number]) for stamp in stamps]
    table = table_of(tmp_path / "a.csv", "\n".join([delimiter.join(["time_ms", "x", "y"]), *rows, ""]))
    np.testing.assert_array_equal(table.arrays["time_ms"], stamps)
    np.testing.assert_array_equal(table.arrays["x"], 1.5)


def test_a_name_over_two_lines_has_no_unit_and_stops_nothing() -> None:
    assert split_unit("angle of\nthe head") == ("angle of\nthe head", "")
