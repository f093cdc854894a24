"""Tables and folders as loggers, phones, spreadsheets and robots write them: read right, or refused with what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from poise.envs.data.formats.load import load_recording
from poise.envs.data.formats.tables.table import factor
from poise.envs.data.inspection import inspect_recording

from .motion import G, angles, axes, readings, same, write_table

TIME, GYR, ACC, MAG, TRUTH = readings()
COUNT = len(TIME)
DEG = np.degrees(1.0)


def table(gyr: str = "rad/s", acc: str = "m/s^2", *, scale: tuple[float, float] = (1.0, 1.0)) -> dict[str, np.ndarray]:
    """Columns that name their units."""
    return (
        {"time (s)": TIME}
        | axes(f"gyr_{{}} ({gyr})", GYR * scale[0], "xyz")
        | axes(f"acc_{{}} ({acc})", ACC * scale[1], "xyz")
    )


def rewritten(path: Path, change: Callable[[str], str | bytes]) -> Path:
    """The file with its text changed."""
    content = change(path.read_text(encoding="utf-8"))
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def is_right(path: Path, tolerance: float = 1e-6, **arguments: object) -> None:
    found = load_recording(path, **arguments)
    same(found.measurements["imu/gyr"], GYR, tolerance)
    same(found.measurements["imu/acc"], ACC, tolerance)
    assert found.time[-1] - found.time[0] == pytest.approx(TIME[-1], abs=1e-5)


@pytest.mark.parametrize(
    ("kind", "unit", "expected"),
    [
        *[("gyr", unit, 1.0) for unit in ("radians per second", "rad.s-1", "rad s⁻¹", "rad·s^-1", "rad/second")],
        *[("gyr", unit, 1.0 / DEG) for unit in ("degrees per second", "deg.s-1", "d/s", "˚/s", "deg s-1")],
        *[("gyr", "deg/h", 1.0 / DEG / 3600.0), ("gyr", "cdeg/s", 0.01 / DEG), ("gyr", "millideg/s", 1e-3 / DEG)],
        *[("acc", unit, 1.0) for unit in ("m.s-2", "N/kg", "m·s⁻²", "meters / second^2")],
        *[("acc", "cm/s^2", 0.01), ("acc", "gal", 0.01), ("acc", "ft/s²", 0.3048), ("acc", "µg", 1e-6 * G)],
        *[("mag", "μT", 1.0), ("mag", "a.u.", 1.0), ("acc", "g-force", G)],
    ],
)
def test_units_by_any_spelling(kind: str, unit: str, expected: float) -> None:
    assert factor(kind, unit) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "text", ["--", "?", "1.#QNAN", "-1.#IND", "#VALUE!", "#DIV/0!", "nan(ind)", "N.A.", "undef", "<null>", "NaT", "inf"]
)
def test_no_value_in_many_languages(tmp_path: Path, text: str) -> None:
    lost = np.arange(0, COUNT, 7)
    columns: dict[str, np.ndarray] = {}
    for name, values in table().items():
        cells = values.astype(object)
        if name.startswith("acc"):
            cells[lost] = text
        columns[name] = cells
    path = rewritten(write_table(tmp_path / "a.csv", columns), lambda whole: whole.replace(f"'{text}'", text))
    found = load_recording(path).measurements["imu/acc"]
    assert np.array_equal(np.flatnonzero(np.isnan(found).any(axis=1)), lost)


@pytest.mark.parametrize("code", [-999.0, 9999.0, -32768.0])
def test_codes_for_no_value_are_missing_in_any_unit(tmp_path: Path, code: float) -> None:
    columns = table("deg/s", "g", scale=(DEG, 1.0 / G))
    lost = np.arange(3, COUNT, 11)
    for name, values in columns.items():
        if name.startswith("gyr"):
            columns[name] = np.where(np.isin(np.arange(COUNT), lost), code, values)
    with pytest.warns(UserWarning, match="for no value"):
        found = load_recording(write_table(tmp_path / "a.csv", columns)).measurements["imu/gyr"]
    assert np.array_equal(np.flatnonzero(np.isnan(found).any(axis=1)), lost)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.encode("utf-16-le"),
        lambda text: text.encode("utf-16-be"),
        lambda text: text.replace("-", "\u2212"),
        lambda text: text.replace("e-0", "D-0"),
        lambda text: text.replace(",", ",\u00a0"),
        lambda text: text.replace("\n", "\n[s],[rad/s],[rad/s],[rad/s],[m/s2],[m/s2],[m/s2]\n", 1),
    ],
)
def test_signs_letters_and_units_in_brackets(tmp_path: Path, change: Callable[[str], str | bytes]) -> None:
    is_right(rewritten(write_table(tmp_path / "a.csv", table()), change))


@pytest.mark.parametrize("style", ["{:,.6f}", "swiss", "german"])
def test_digits_in_groups_of_thousands(tmp_path: Path, style: str) -> None:
    def spelled(value: float) -> str:
        text = f"{value:,.6f}"
        if style == "german":
            return text.translate(str.maketrans(",.", ".,"))
        return text.replace(",", "'") if style == "swiss" else text

    columns = table("mdeg/s", scale=(1e3 * DEG, 1.0))
    rows = [";".join(columns), *(";".join(map(spelled, row)) for row in zip(*columns.values(), strict=True))]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    is_right(path, 1e-5)


@pytest.mark.parametrize("above", ["Sampling interval: 10 ms\n", "Sampling rate: 0.1 kHz\n", "Sample Rate: 100 Hz\n"])
def test_a_rate_or_an_interval_in_the_header(tmp_path: Path, above: str) -> None:
    columns = {name: values for name, values in table().items() if not name.startswith("time")}
    is_right(write_table(tmp_path / "a.csv", columns, above=above))


@pytest.mark.parametrize(
    "stamps",
    [
        {"timestamp": 133_500_000_000_000_000 + np.rint(1e7 * TIME).astype(np.int64)},
        {"timestamp": 1_700_000_000_000 + np.rint(1e3 * TIME).astype(np.int64)},
        {"counter": np.arange(COUNT) % 1024},
        {"counter": np.arange(COUNT) % 100},
        {"stamp.sec": (170.4 + TIME).astype(int), "stamp.nanosec": np.rint(1e9 * ((170.4 + TIME) % 1.0)).astype(int)},
        {"X[s]": TIME},
    ],
)
def test_clocks_of_windows_counters_and_robots(tmp_path: Path, stamps: dict[str, np.ndarray]) -> None:
    columns = stamps | {name: values for name, values in table().items() if not name.startswith("time")}
    is_right(write_table(tmp_path / "a.csv", columns, above="Rate: 100 Hz\n" if "counter" in stamps else ""))


@pytest.mark.parametrize(
    ("order", "scale"), [("scalar last", 1.0), ("as written", 16384.0), ("conjugate", 2.0**30), ("scalar last", 1e4)]
)
def test_onboard_quaternions_of_any_order_and_scale(tmp_path: Path, order: str, scale: float) -> None:
    written = TRUTH * [1.0, -1.0, -1.0, -1.0] if order == "conjugate" else TRUTH
    written = np.roll(written, -1, axis=1) if order == "scalar last" else written
    written = np.rint(scale * written) if scale > 1.0 else written
    columns = table() | {f"q{i}": written[:, i] for i in range(4)}
    with pytest.warns(UserWarning, match="from gravity|long, not 1"):
        found = load_recording(write_table(tmp_path / "a.csv", columns))
    assert angles(found.measurements["imu/onboard_orientation"], TRUTH).max() < 1e-3
    assert found.metadata["onboard_orientation"]["read"].startswith(order)


def ros() -> dict[str, np.ndarray]:
    vectors = axes("field.angular_velocity.{}", GYR, "xyz") | axes("field.linear_acceleration.{}", ACC, "xyz")
    return {"%time": 1_600_000_000_000_000_000 + np.rint(1e9 * TIME).astype(np.int64)} | vectors


def toolbox() -> dict[str, np.ndarray]:
    return {"time": TIME} | axes("gF{}", ACC / G, "xyz") | axes("a{}", 0.1 * ACC, "xyz") | axes("w{}", GYR, "xyz")


@pytest.mark.parametrize(
    "columns",
    [
        ros(),
        toolbox(),
        {"time_s": TIME}
        | axes("a{}_m/s/s", ACC, "xyz")
        | axes("g{}_deg/s", DEG * GYR, "xyz")
        | axes("m{}_T", MAG, "xyz"),
        {"timestamp": np.rint(1e6 * TIME).astype(int)}
        | axes("gyro_rad[{}]", GYR, "012")
        | axes("acc_m_s2[{}]", ACC, "012"),
        {"time (s)": TIME} | axes("Acc{}(g)", ACC / G) | axes("As{}(°/s)", DEG * GYR) | axes("H{}(uT)", MAG),
        {"X[s]": TIME} | axes("sensor 1: ACC.{} 1 [g]", ACC / G) | axes("sensor 1: GYRO.{} 1 [deg/s]", DEG * GYR),
        {"cts": 1e3 * TIME}
        | axes("Gyroscope ({}) [rad/s]", GYR, "xyz")
        | axes("Accelerometer ({}) [m/s²]", ACC, "xyz"),
    ],
)
@pytest.mark.filterwarnings("ignore:column")
def test_tables_of_apps_and_robots(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    is_right(write_table(tmp_path / "a.csv", columns))


@pytest.mark.parametrize("app", ["MetaWear", "MATLAB Mobile"])
def test_folders_of_apps(tmp_path: Path, app: str) -> None:
    if app == "MetaWear":
        name, stamps, pattern = (
            "MetaWear_2020_D1AA_{}_100.000Hz_1.5.0.csv",
            {"epoc (ms)": 1_600_000_000_000 + 1e3 * TIME},
            "{}-axis ",
        )
        write_table(tmp_path / name.format("Gyroscope"), stamps | axes(pattern + "(deg/s)", DEG * GYR, "xyz"))
        write_table(tmp_path / name.format("Accelerometer"), stamps | axes(pattern + "(g)", ACC / G, "xyz"))
    else:
        write_table(tmp_path / "AngularVelocity.csv", {"Timestamp": TIME} | axes("{}", GYR))
        write_table(tmp_path / "Acceleration.csv", {"Timestamp": TIME} | axes("{}", ACC))
    found = load_recording(tmp_path)
    same(found.measurements["imu/gyr"], GYR, 1e-4)
    same(found.measurements["imu/acc"], ACC, 1e-4)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"\x1f\x8b" + bytes(64), "packed"),
        (b"SQLite format 3\0" + bytes(64), "SQLite"),
        (b"#ROSBAG V2.0\n" + bytes(64), "rostopic"),
        (bytes((14, 16, 67, 8, 0, 0, 0, 0)) + b".FIT" + bytes(64), "FitCSVTool"),
        (b'{"t": {"gx": [1.0]}}' * 9000, "JSON"),
        (b"<samples><s t='0'/></samples>", "XML"),
    ],
)
def test_files_of_other_kinds_are_told_what_to_do(tmp_path: Path, content: bytes, told: str) -> None:
    (tmp_path / "a.dat").write_bytes(content)
    with pytest.raises(ValueError, match=told):
        load_recording(tmp_path / "a.dat")


def test_samples_of_two_sensors_under_one_another_are_told_by_their_type(tmp_path: Path) -> None:
    twice = np.repeat(np.arange(COUNT), 2)
    columns = {"time": TIME[twice], "type": np.tile([4, 1], COUNT)} | axes("{}", GYR[twice], "xyz")
    path = write_table(tmp_path / "a.csv", columns)
    found = load_recording(path, units={"gyr": "rad/s", "acc": "m/s^2"})
    same(found.measurements["imu/gyr"], GYR)
    with pytest.raises(ValueError, match=r"unknown column 'x' .*gyr_x"):
        load_recording(path, columns={"gyr": ["x", "y", "z"]}, time="time")


def test_columns_that_are_not_used_are_named(tmp_path: Path) -> None:
    path = write_table(tmp_path / "walk.csv", table() | {"FP1_Fz (N)": 700.0 + 0.0 * TIME, "button": 0.0 * TIME})
    found = load_recording(path)
    assert found.metadata["columns_not_used"] == ["FP1_Fz", "button"]
    assert inspect_recording(found).clock["columns not used"] == "FP1_Fz, button"
    assert "columns_not_used" not in load_recording(write_table(tmp_path / "plain.csv", table())).metadata
