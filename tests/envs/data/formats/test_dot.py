"""Exports of Movella DOT in their dialects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.envs.data.formats.load import load_recording
from poise.filters.core import rotation

N = 40
HEADER = (
    "sep=,\nDeviceTag:,chest\nFirmwareVersion:,3.0.0\nOutputRate:,{rate}Hz\n"
    "Measurement Mode:,Inertial data Mode\n© Movella Technologies B. V. 2005-2024\n\n"
)
INERTIAL = ("Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z", "Mag_X", "Mag_Y", "Mag_Z")


def write_dot(path: Path, clock: Any, columns: dict[str, Any], rate: int = 60, tail: str = "") -> Path:
    names = ["PacketCounter", "SampleTimeFine", *columns]
    rows = zip(range(1, len(clock) + 1), clock, *columns.values(), strict=True)
    table = "".join(",".join(str(value) for value in row) + tail + "\n" for row in rows)
    path.write_text(HEADER.format(rate=rate) + ",".join(names) + "\n" + table, encoding="utf-8")
    return path


@pytest.fixture
def columns() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(2)
    return {name: rng.standard_normal(N).round(6) for name in INERTIAL}


def clock_of(ticks: Any, start: int = 1000) -> np.ndarray:
    return (start + np.rint(np.asarray(ticks) * 1e6 / 60).astype(np.int64)) % 2**32


def test_dot_units_names_and_uniform_time(tmp_path, columns):
    ride = load_recording(write_dot(tmp_path / "ride.txt", clock_of(range(N)), columns, tail=","))
    assert len(ride) == N
    assert ride.uniform
    assert 1 / ride.dt == pytest.approx(60, rel=1e-4)
    for channel, stem, scale in (("imu/gyr", "Gyr", np.pi / 180), ("imu/acc", "Acc", 1.0), ("imu/mag", "Mag", 1.0)):
        expected = scale * np.stack([columns[f"{stem}_{axis}"] for axis in "XYZ"], axis=1)
        np.testing.assert_allclose(ride.measurements[channel], expected)
    assert ride.truth == {}
    assert ride.mask.all()
    assert ride.metadata["device"]["DeviceTag"] == "chest"
    assert ride.metadata["clock_start"] == 1000


def test_lost_packets_are_missing_and_the_clock_may_wrap(tmp_path, columns):
    ticks = np.r_[0:10, 13:20, 25 : 25 + N - 17]
    clock = clock_of(ticks, start=2**32 - 12 * 16667)
    assert (np.diff(clock) < 0).any()
    ride = load_recording(write_dot(tmp_path / "ride.csv", clock, columns))
    assert len(ride) == ticks[-1] + 1
    present = np.isfinite(ride.measurements["imu/acc"]).all(1)
    np.testing.assert_array_equal(np.flatnonzero(present), ticks)
    np.testing.assert_allclose(ride.measurements["imu/acc"][ticks, 0], columns["Acc_X"])
    assert ride.metadata["missing_samples"] == 8
    assert ride.uniform


def test_increments_and_onboard_orientation(tmp_path):
    rng = np.random.default_rng(4)
    rates, forces, euler = rng.standard_normal((N, 3)), rng.standard_normal((N, 3)), rng.uniform(-80, 80, (N, 3))
    turn = rotation.exp(rates * 0.016667)
    columns = {f"dq_{axis}": turn[:, i] for i, axis in enumerate("WXYZ")}
    columns |= {f"dv[{i + 1}]": forces[:, i] * 0.016667 for i in range(3)}
    columns |= {f"Euler_{axis}": euler[:, i] for i, axis in enumerate("XYZ")}
    ride = load_recording(write_dot(tmp_path / "a.csv", 16667 * np.arange(N), columns))
    np.testing.assert_allclose(ride.measurements["imu/gyr"], rates, atol=1e-9)
    np.testing.assert_allclose(ride.measurements["imu/acc"], forces, atol=1e-9)
    expected = rotation.from_euler_zyx(*np.radians(euler[:, ::-1]).T)
    np.testing.assert_allclose(ride.measurements["imu/onboard_orientation"], expected)
    assert "orientation" not in ride.quantities, "the sensor's own estimate is no truth"


@pytest.mark.parametrize(
    ("clock", "message"),
    [
        (np.r_[0:10, 5:35], "must increase, got .* in row 10 after"),
        (np.r_[0:20, 100_000:100_020], "must increase by less than 60 s"),
        (np.zeros(N), "must increase"),
    ],
)
def test_clocks_that_cannot_be_are_refused(tmp_path, columns, clock, message):
    path = write_dot(tmp_path / "ride.csv", clock_of(clock), columns)
    with pytest.raises(ValueError, match=message) as caught:
        load_recording(path)
    assert "ride.csv" in str(caught.value)


def test_the_rate_of_the_header_is_the_grid(tmp_path, columns):
    """Every second row lost: the stamps alone would say 30 Hz."""
    with pytest.warns(UserWarning, match="39 of 79 samples at 60 Hz are missing"):
        ride = load_recording(write_dot(tmp_path / "half.csv", clock_of(2 * np.arange(N)), columns))
    assert ride.dt == pytest.approx(1 / 60, rel=1e-4)
    assert ride.metadata["missing_samples"] == N - 1
    np.testing.assert_allclose(ride.measurements["imu/acc"][::2, 0], columns["Acc_X"])


def dialect(text: str, delimiter: str, decimal: str, end: str) -> bytes:
    """A comma-separated export in another dialect."""
    lines = text.splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("PacketCounter"))
    changed = [line.replace(",", delimiter) for line in lines[:first]]
    changed += [delimiter.join(field.replace(".", decimal) for field in line.split(",")) for line in lines[first:]]
    return (end.join(changed) + end).encode()


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(("delimiter", "decimal"), [(";", ","), (";", "."), ("\t", "."), ("\t", ","), (",", ".")])
@pytest.mark.parametrize("mark", [b"", "\ufeff".encode()])
@pytest.mark.parametrize("magnetometer", [True, False])
def test_dialects_mean_the_same(tmp_path, columns, end, delimiter, decimal, mark, magnetometer):
    kept = {name: values for name, values in columns.items() if magnetometer or not name.startswith("Mag")}
    path = write_dot(tmp_path / "ride.csv", clock_of(range(N)), kept)
    path.write_bytes(mark + dialect(path.read_text(encoding="utf-8"), delimiter, decimal, end))
    ride = load_recording(path)
    assert len(ride) == N
    assert ("imu/mag" in ride.measurements) == magnetometer
    for channel, stem, scale in (("imu/gyr", "Gyr", np.pi / 180), ("imu/acc", "Acc", 1.0)):
        expected = scale * np.stack([columns[f"{stem}_{axis}"] for axis in "XYZ"], axis=1)
        np.testing.assert_allclose(ride.measurements[channel], expected, atol=1e-9)


def test_wrong_dot_tables_are_refused(tmp_path, columns):
    clock = clock_of(range(N))
    free = {f"FreeAcc_{axis}": columns["Acc_X"] for axis in "XYZ"} | {"Gyr_X": clock, "Gyr_Y": clock, "Gyr_Z": clock}
    with pytest.raises(ValueError, match=r"accelerometer .* needed.*FreeAcc_X"):
        load_recording(write_dot(tmp_path / "free.csv", clock, free))
    with pytest.raises(ValueError, match="no table of numbers"):
        load_recording(write_dot(tmp_path / "none.csv", [], {name: [] for name in INERTIAL}))
    whole = write_dot(tmp_path / "whole.csv", clock, columns).read_text()
    (tmp_path / "cut.csv").write_text(whole[:-30])
    with pytest.warns(UserWarning, match=r"cut.csv: the last row is cut off"):
        assert len(load_recording(tmp_path / "cut.csv")) == N - 1
    (tmp_path / "text.csv").write_text(whole.replace(str(columns["Acc_X"][5]), "oops"))
    with pytest.raises(ValueError, match="column Acc_X holds no number in row 5 of the table: 'oops'"):
        load_recording(tmp_path / "text.csv")
    single = load_recording(write_dot(tmp_path / "one.csv", clock[:1], {k: v[:1] for k, v in columns.items()}))
    assert single.dt == pytest.approx(1 / 60)


@pytest.mark.parametrize("change", [str.lower, str.upper])
def test_the_case_of_names_does_not_matter_and_the_clock_tells_the_device_without_a_header(tmp_path, columns, change):
    text = write_dot(tmp_path / "ride.csv", clock_of(range(N)), columns).read_text(encoding="utf-8")
    table = text[text.index("PacketCounter") :]
    names, rows = table.split("\n", 1)
    (tmp_path / "bare.csv").write_text(change(names) + "\n" + rows)
    ride = load_recording(tmp_path / "bare.csv")
    assert ride.metadata["format"] == "Movella DOT"
    np.testing.assert_allclose(ride.measurements["imu/gyr"][:, 0], np.radians(columns["Gyr_X"]))
