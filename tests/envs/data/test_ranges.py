"""Ranges of sensors in headers become saturation limits; other numbers do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import poise
from poise.envs.data.formats.tables.table import Table
from poise.envs.data.glitches import without_glitches
from poise.envs.data.ranges import stated_ranges

DPS, G = np.pi / 180.0, 9.80665


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("# Gyroscope range: ±2000 deg/s", {"gyr": 2000 * DPS}),
        ("// Gyro Full Scale (dps), 500", {"gyr": 500 * DPS}),
        ("Gyroscope range: 2,000 deg/s", {"gyr": 2000 * DPS}),
        ("gyr_range=34.9 rad/s", {"gyr": 34.9}),
        ('"GyroRange";"1000"', {"gyr": 1000 * DPS}),
        ("Angular velocity range [deg/s]: 450", {"gyr": 450 * DPS}),
        ("% Accelerometer Range +/- 16 g", {"acc": 16 * G}),
        ("AccelRange: 8g", {"acc": 8 * G}),
        ("acc sensor full-scale range: 156.9 m/s^2", {"acc": 156.9}),
        ("accel_range_mg: 4000", {"acc": 4 * G}),
        ("Accelerometer range: 4", {"acc": 4 * G}),
        ("Gyroscope Range: 3", {}),  # the code of a setting
        ("Accelerometer range: low", {}),
        ("accuracy range: 5 m", {}),
        ("temperature range: 125", {}),
        ("Gyroscope ranging: 2000", {}),
    ],
)
def test_lines_of_headers(line: str, expected: dict[str, float]) -> None:
    assert stated_ranges(Table({}, preamble=(line,))) == pytest.approx(expected)


def test_of_several_ranges_the_largest_counts() -> None:
    table = Table({}, preamble=("Low-noise accel range: 2 g", "Wide-range accel range: 16 g"))
    assert stated_ranges(table) == pytest.approx({"acc": 16 * G})


def clipped(tmp_path: Path, limit: float, stated: str) -> Path:
    time = np.arange(600) / 100.0
    rate = np.clip(700.0 * np.sin(2.0 * np.pi * 0.5 * time), -limit, limit)
    rows = "".join(f"{t:.2f},{w:.3f},0.1,0.2,0.0,0.1,1.0\n" for t, w in zip(time, rate, strict=True))
    head = "time (s),gyr_x (deg/s),gyr_y (deg/s),gyr_z (deg/s),acc_x (g),acc_y (g),acc_z (g)\n"
    path = tmp_path / "ranged.csv"
    path.write_text(f"# Gyroscope range: {stated}\n# Accelerometer range: 8 g\n{head}{rows}")
    return path


def test_a_stated_range_is_that_of_the_channel(tmp_path: Path) -> None:
    recording = poise.load_recording(clipped(tmp_path, 500.0, "500 deg/s"))
    assert recording.metadata["full_scale"] == pytest.approx({"imu/gyr": 500 * DPS, "imu/acc": 8 * G})
    saturated = np.isclose(recording.measurements["imu/gyr"][:, 0], 500 * DPS)
    assert saturated.sum() > 50
    assert np.isfinite(without_glitches(recording)["imu/gyr"][saturated]).all()


def test_a_range_that_readings_exceed_is_not_theirs(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="states a range of 4.363 for imu/gyr, whose readings reach 12.2"):
        recording = poise.load_recording(clipped(tmp_path, 700.0, "250 deg/s"))
    assert set(recording.metadata["full_scale"]) == {"imu/acc"}
