"""What is told of a recording is what was put into it."""

import numpy as np
import pytest

from poise.envs.data.inspection import inspect_recording
from poise.envs.data.trajectory import Trajectory


def recording(rate=200.0, bias=(0.02, -0.01, 0.03), gyr_noise=0.004, acc_noise=0.03, dip=65.0, lost=0.0, jitter=0.0):
    """Ten seconds of rest, ten of motion, ten of rest, with known errors."""
    generator = np.random.default_rng(1)
    time = np.arange(0.0, 30.0, 1.0 / rate)
    moving = (time > 10.0) & (time < 20.0)
    gyr = np.asarray(bias) + gyr_noise * generator.normal(size=(len(time), 3))
    gyr[moving] += np.sin(5.0 * time[moving, None] + np.arange(3))
    acc = np.array([0.0, 0.0, 9.81]) + acc_noise * generator.normal(size=(len(time), 3))
    acc[moving] += np.sin(7.0 * time[moving, None] + np.arange(3))
    field = 48.0 * np.array([np.cos(np.radians(dip)), 0.0, -np.sin(np.radians(dip))])
    mag = np.tile(field, (len(time), 1)) + 0.2 * generator.normal(size=(len(time), 3))
    rows = np.flatnonzero(generator.random(len(time)) >= lost)
    stamps = time + jitter * generator.uniform(-1.0, 1.0, len(time))
    return Trajectory(
        stamps[rows], {"imu/gyr": gyr[rows], "imu/acc": acc[rows], "imu/mag": mag[rows]}, metadata={"name": "known"}
    )


@pytest.mark.parametrize("rate", [50.0, 100.0, 400.0])
def test_rest_noise_and_bias_are_found(rate):
    found = inspect_recording(recording(rate))
    (sensor,) = found.sensors
    assert sensor["rest %"] == pytest.approx(100.0 * 2.0 / 3.0, abs=5.0)
    assert sensor["bias °/s"] == pytest.approx(np.degrees(np.linalg.norm([0.02, -0.01, 0.03])), rel=0.02)
    assert sensor["noise °/s"] == pytest.approx(np.degrees(0.004), rel=0.1)
    assert sensor["noise m/s²"] == pytest.approx(0.03, rel=0.1)
    assert sensor["|acc| at rest"] == pytest.approx(9.81, abs=0.01)
    assert found.clock["rate"] == f"{rate:.4g} Hz"


@pytest.mark.parametrize("dip", [65.0, 0.0, -50.0])
def test_the_field_is_described(dip):
    (sensor,) = inspect_recording(recording(dip=dip)).sensors
    assert sensor["dip °"] == pytest.approx(dip, abs=1.0)
    assert sensor["|mag|"] == pytest.approx(48.0, rel=0.01)
    assert sensor["|mag| varies %"] < 1.0


def test_the_clock_is_described():
    found = inspect_recording(recording(lost=0.1, jitter=5e-4)).clock
    assert found["missing rows"].split(" of ")[0].isdigit()
    assert 8.0 < float(found["missing rows"].split("(")[1].split(" %")[0]) < 12.0
    assert 0.1 < float(found["jitter of the stamps"].split()[0]) < 0.6


def test_a_noisy_sensor_rests_and_a_moving_one_does_not():
    assert inspect_recording(recording(gyr_noise=0.03)).rest["imu"].mean() > 0.5
    motion = recording()
    moving = motion[int(0.4 * len(motion)) : int(0.6 * len(motion))]
    assert not inspect_recording(moving).rest["imu"].any()


def test_short_and_partial_recordings_are_described():
    motion = recording()
    for part in (motion[:1], motion[:5], motion.replace(measurements={"imu/acc": motion.measurements["imu/acc"]})):
        part = part.replace(metadata={"name": "part", "rate": 200.0})
        found = inspect_recording(part)
        assert found.channels
        assert found.sensors[0]["sensor"] == "imu"


@pytest.mark.parametrize(("seconds", "rests"), [(1.0, False), (10.0, True)])
def test_a_steady_turn_of_a_second_is_no_rest(seconds, rests):
    """A walker who turns a corner: only who stays so for long has a bias of that size."""
    generator, time = np.random.default_rng(4), np.arange(6000) / 100.0
    gyr = 0.5 * generator.normal(size=(len(time), 3))
    acc = np.array([0.0, 0.0, 9.81]) + generator.normal(size=(len(time), 3))
    steady = (time >= 30.0) & (time < 30.0 + seconds)
    gyr[steady] = np.array([0.0, 0.0, 0.2]) + 0.002 * generator.normal(size=(steady.sum(), 3))
    acc[steady] = np.array([0.0, 0.0, 9.81]) + 0.02 * generator.normal(size=(steady.sum(), 3))
    trajectory = Trajectory(time, {"imu/gyr": gyr, "imu/acc": acc}, metadata={"name": "corner"})
    (sensor,) = inspect_recording(trajectory).sensors
    assert ("bias °/s" in sensor) == rests
