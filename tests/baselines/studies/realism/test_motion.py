"""Motion statistics against a motion whose statistics are known."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.realism.motion import UNITS, motion_statistics
from poise.envs.data.trajectory import Trajectory
from poise.filters.core import rotation

RATE = 100.0


def swinging(rate: float = RATE) -> Trajectory:
    """A sensor that nods by 0.2 rad at 1 Hz and moves 0.1 m at 0.1 Hz and 1 mm at 15 Hz, east and west."""
    time = np.arange(1, round(60.0 * rate) + 1) / rate
    w, slow, fast = 2 * np.pi * 1.0, 2 * np.pi * 0.1, 2 * np.pi * 15.0
    angle, turning = 0.2 * np.sin(w * time), 0.2 * w * np.cos(w * time)
    zero = np.zeros_like(time)
    east = 0.1 * np.sin(slow * time) + 1e-3 * np.sin(fast * time)
    moved = -0.1 * slow**2 * np.sin(slow * time) - 1e-3 * fast**2 * np.sin(fast * time)
    orientation = rotation.exp(np.stack([zero, angle, zero], axis=1))
    force = rotation.rotate_back(orientation, np.stack([moved, zero, zero + 9.80665], axis=1))
    return Trajectory(
        time,
        {"imu/gyr": np.stack([zero, turning, zero + 0.1], axis=1), "imu/acc": force},
        {"orientation": orientation, "position": np.stack([east, zero, zero], axis=1)},
    )


def test_statistics_of_a_swinging_sensor():
    found = motion_statistics(swinging())
    assert list(found) == list(UNITS)
    assert found["gyr_rms"] == pytest.approx(np.degrees(0.2 * 2 * np.pi / np.sqrt(2.0)), rel=1e-2)
    assert found["gyr_f95"] == pytest.approx(1.0, abs=0.2)
    assert found["gyr_above_3"] < 0.1
    assert found["gyr_sinusoids"] > 0.99
    fast = 1e-3 * (2 * np.pi * 15.0) ** 2 / np.sqrt(2.0)
    # gravity that turns with the sensor is not acceleration, but it is specific force
    assert found["acc_rms"] == pytest.approx(fast, rel=0.02)
    assert found["acc_f95"] == pytest.approx(15.0, abs=0.2)
    assert found["acc_above_10"] == pytest.approx(100.0, abs=0.5)
    assert found["force_above_10"] == pytest.approx(fast, rel=0.02)
    assert found["acc_jerk"] == pytest.approx(fast * 2 * np.pi * 15.0, rel=0.02)
    assert found["slow_velocity"] == pytest.approx(0.1 * 2 * np.pi * 0.1 / np.sqrt(2.0), rel=0.05)


def test_bandwidth_makes_other_rates_comparable():
    slow, fast = (motion_statistics(swinging(rate), bandwidth=20.0) for rate in (60.0, 200.0))
    for name in ("gyr_rms", "acc_rms", "acc_jerk", "force_f95"):
        assert slow[name] == pytest.approx(fast[name], rel=0.01), name
    with pytest.raises(ValueError, match="bandwidth must be above 10 Hz and at most half"):
        motion_statistics(swinging(60.0), bandwidth=40.0)


def test_what_is_unknown_is_nan_and_a_missing_channel_an_error():
    ride = swinging()
    found = motion_statistics(ride.replace(truth={}))
    assert np.isnan([found["acc_rms"], found["slow_velocity"]]).all()
    assert np.isfinite(found["gyr_rms"])
    with pytest.raises(ValueError, match="no channel head/gyr; it has imu/gyr, imu/acc"):
        motion_statistics(ride, "head")
