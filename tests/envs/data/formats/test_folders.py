"""Devices that write a file a sensor, each with a clock of its own."""

from __future__ import annotations

import numpy as np
import pytest

import poise
from poise.envs.data.formats.load import find_recordings
from poise.envs.data.formats.tables.streams import Stream, joined
from poise.filters.core import rotation

from .motion import G, angles, axes, readings, same, write_table

TIME, GYR, ACC, MAG, Q = readings()
T = len(TIME)


def other_clock(values: np.ndarray, delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Stamps that lie ``delay`` s after those of the gyroscope, and the readings there."""
    return TIME[:-1] + delay, values[:-1] + delay / 0.01 * np.diff(values, axis=0)


def phyphox(folder, acc=ACC, pattern="{} ({})", name="Accelerometer", delay=0.0):
    time, forces = other_clock(acc, delay)

    def columns(values: np.ndarray, unit: str) -> dict[str, np.ndarray]:
        return {pattern.format(axis, unit): values[:, i] for i, axis in enumerate("XYZ")}

    write_table(folder / "Gyroscope.csv", {'"Time (s)"': TIME} | columns(GYR, "rad/s"))
    write_table(folder / f"{name}.csv", {'"Time (s)"': time} | columns(forces, "m/s^2"))
    write_table(folder / "Magnetometer.csv", {'"Time (s)"': TIME[::4]} | columns(MAG[::4], "µT"))
    return folder


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.0071])
@pytest.mark.parametrize("pattern", ["{} ({})", '"Sensor {} ({})"'])
def test_phyphox(tmp_path, delay, pattern):
    folder = phyphox(tmp_path / "run", delay=delay, pattern=pattern)
    recording = poise.load_recording(folder)
    assert recording.name == "run"
    assert recording.dt == pytest.approx(0.01)
    first = round((recording.metadata["clock_start"] - TIME[0]) / 0.01)
    length = len(recording)
    same(recording.measurements["imu/gyr"], GYR[first : first + length])
    # Linear between neighbours twice: exact at neither.
    error = recording.measurements["imu/acc"] - ACC[first : first + length]
    assert np.sqrt(np.nanmean(error**2)) < (1e-9 if delay == 0.0 else 0.3)
    known = np.isfinite(recording.measurements["imu/mag"]).all(axis=1)
    assert 0.2 < known.mean() < 0.3
    assert find_recordings(tmp_path) == [folder]
    with pytest.raises(ValueError, match=r"Gyroscope\.csv is one stream of a device.*load its folder"):
        poise.load_recording(folder / "Gyroscope.csv")


def test_an_accelerometer_without_gravity_is_refused_or_completed(tmp_path):
    up = G * rotation.up_in_body(Q)
    folder = phyphox(tmp_path / "run", ACC - up)
    with pytest.raises(ValueError, match=r"run: the accelerometer measures 0\.\d\d g: gravity was removed"):
        poise.load_recording(folder)
    table = {'"Time (s)"': TIME} | {f"{axis} (m/s^2)": up[:, i] for i, axis in enumerate("XYZ")}
    write_table(folder / "Gravity.csv", table)
    same(poise.load_recording(folder).measurements["imu/acc"], ACC[:-1], 1e-5)
    linear = phyphox(tmp_path / "two", ACC - up, name="Linear Accelerometer")
    time, forces = other_clock(ACC, 0.0)
    write_table(linear / "Accelerometer.csv", {'"Time (s)"': time} | axes("{} (m/s^2)", forces))
    same(poise.load_recording(linear).measurements["imu/acc"], ACC[:-1])


def sensor_logger(folder, scale, name="AccelerometerUncalibrated", order="zyx"):
    start = 1_714_564_800_000_000_000

    def write(name: str, values: np.ndarray, every: int = 1, shift: float = 0.0) -> None:
        time = TIME[::every] + shift
        table = {"time": start + (time * 1e9).astype(np.int64), "seconds_elapsed": time}
        write_table(folder / f"{name}.csv", table | {axis: values[::every, "xyz".index(axis)] for axis in order})

    write("GyroscopeUncalibrated", GYR)
    write(name, ACC * scale)
    write("MagnetometerUncalibrated", MAG, 2, 0.001)
    return folder


@pytest.mark.parametrize("order", ["zyx", "xyz"])
@pytest.mark.parametrize(("scale", "sign"), [(-1 / G, -1), (1.0, 1)])
def test_sensor_logger_on_both_systems(tmp_path, order, scale, sign):
    """Apple's devices report −1 g on an axis that points up, in g; Android +g, in m/s²."""
    recording = poise.load_recording(sensor_logger(tmp_path / "log", scale, order=order))
    same(recording.measurements["imu/gyr"], GYR)
    same(recording.measurements["imu/acc"], ACC, 1e-5)
    assert recording.metadata["accelerometer_sign"] == sign
    assert recording.metadata["format"] == "Sensor Logger"


@pytest.mark.parametrize(
    ("platform", "standardised", "sign"), [("ios", "false", -1), ("ios", "true", 1), ("android", "false", 1)]
)
def test_the_metadata_tell_the_sign_where_the_unit_does_not(tmp_path, platform, standardised, sign):
    folder = sensor_logger(tmp_path / "log", float(sign), "TotalAcceleration")
    (folder / "Metadata.csv").write_text(f"version,platform,standardisation\n3,{platform},{standardised}\n")
    same(poise.load_recording(folder).measurements["imu/acc"], ACC, 1e-5)


def senslogs(folder, ios=False):
    def write(name: str, values: np.ndarray, every: int = 1) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        np.savetxt(folder / name, np.column_stack([TIME[::every] + 0.43, values[::every]]), fmt="%.9g")

    write("gyroscope.txt", np.hstack([GYR + 0.1, np.full((T, 3), 0.1)]))
    write("accelerometer.txt", -ACC / G if ios else ACC)
    write("magnetometer-calibrated.txt", MAG, 4)
    if ios:
        write("attitude.txt", Q)
    else:
        write("gyroscope-calibrated.txt", GYR)
        write("rotation-vector.txt", np.hstack([rotation.to_xyzw(Q), np.full((T, 1), 0.17)]))
    return folder


@pytest.mark.parametrize("ios", [False, True])
def test_senslogs(tmp_path, ios):
    recording = poise.load_recording(senslogs(tmp_path / "walk", ios))
    same(recording.measurements["imu/gyr"], GYR + (0.1 if ios else 0.0), 1e-6)
    same(recording.measurements["imu/acc"], ACC, 1e-5)
    assert angles(recording.onboard_orientation, Q).max() < 1e-4


def test_streams_are_interpolated_or_kept_and_gaps_stay_gaps():
    time = np.arange(100) / 100.0
    gyr = Stream(time, np.ones((100, 3)))
    late = np.delete(np.arange(100), np.arange(40, 60))
    streams = {
        "imu/gyr": gyr,
        "imu/acc": Stream(time[late] + 0.004, time[late, None] * np.ones(3)),
        "imu/mag": Stream(time[::10] + 0.001, time[::10, None] * np.ones(3)),
    }
    stamps, found = joined(streams)
    assert stamps[0] == 0.01
    known = np.isfinite(found["imu/acc"]).all(axis=1)
    np.testing.assert_allclose(found["imu/acc"][known, 0], stamps[known] - 0.004, atol=1e-12)
    np.testing.assert_array_equal(np.isnan(found["imu/acc"][:, 0]), (stamps > 0.395) & (stamps < 0.604))
    np.testing.assert_allclose(found["imu/mag"][np.isfinite(found["imu/mag"][:, 0]), 0], np.arange(10) / 10.0)
    with pytest.raises(ValueError, match="share no time"):
        joined(streams | {"imu/acc": Stream(time + 50.0, np.ones((100, 3)))})
    with pytest.raises(ValueError, match="no stream imu/gyr"):
        joined({"imu/acc": gyr})
