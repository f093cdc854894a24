"""Magnetometer calibrated by the motion of a recording."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import poise
from poise.envs.data.alignment.magnetic import calibrate_magnetometer
from poise.envs.hand.sensing import simulate_hand

TUMBLED = simulate_hand("severe", seed=2, duration=60.0)
SOFT = np.array([[1.15, 0.06, -0.03], [0.06, 0.9, 0.04], [-0.03, 0.04, 1.05]])
HARD = np.array([30.0, -12.0, 18.0])
MISALIGNED = Rotation.from_euler("zyx", [4.0, -3.0, 2.0], degrees=True)


def distorted() -> poise.Trajectory:
    """The recording with iron on the device and a magnetometer that is turned against the other sensors."""
    field = np.array(TUMBLED.measurements["imu/mag"])
    raw = MISALIGNED.apply(field) @ SOFT.T + HARD
    return TUMBLED.replace(measurements={**TUMBLED.measurements, "imu/mag": raw})


@pytest.mark.filterwarnings("ignore:.*heading of the truth differs")
def test_directions_are_those_of_the_field() -> None:
    """Within a degree, and the heading of a nine-axis filter is that of the undisturbed recording."""
    recording = distorted()
    record = calibrate_magnetometer(recording)
    calibrated = poise.apply_calibration(recording, record)
    field, found = (one.measurements["imu/mag"] for one in (TUMBLED, calibrated))
    seen = np.isfinite(field).all(axis=1) & np.isfinite(found).all(axis=1)
    cosine = np.sum(field[seen] * found[seen], axis=1) / np.linalg.norm(field[seen], axis=1)
    cosine /= np.linalg.norm(found[seen], axis=1)
    assert np.degrees(np.sqrt(np.mean(2.0 * (1.0 - np.minimum(cosine, 1.0))))) < 1.5
    heading = {}
    for name, one in (("clean", TUMBLED), ("raw", recording), ("calibrated", calibrated)):
        table = poise.evaluate("mekf-9", one, check=False)
        heading[name] = float(table[table.metric == "heading"].value.iloc[0])
    assert heading["raw"] > 3.0 * heading["clean"]
    assert heading["calibrated"] < heading["clean"] + 0.5
    details = record.details["imu/mag"]
    assert details["dip_variation_deg"] < 2.0


def test_axes_that_are_swapped() -> None:
    swapped = TUMBLED.measurements["imu/mag"][:, [1, 0, 2]] * [1, -1, 1]
    with pytest.raises(ValueError, match="check the order and signs"):
        calibrate_magnetometer(TUMBLED.replace(measurements={**TUMBLED.measurements, "imu/mag": swapped}))


def test_missing_channel_and_too_little_motion() -> None:
    with pytest.raises(ValueError, match="lacks imu/mag"):
        calibrate_magnetometer(
            TUMBLED.replace(measurements={k: v for k, v in TUMBLED.measurements.items() if k != "imu/mag"})
        )
    with pytest.raises(ValueError, match=r"turn the device about|cover too little"):
        calibrate_magnetometer(simulate_hand("slow", seed=0, duration=5.0))


def test_a_sensor_that_was_off_is_named() -> None:
    off = {**TUMBLED.measurements, "imu/acc": np.full((len(TUMBLED), 3), np.nan)}
    with pytest.raises(ValueError, match="has 0 samples of imu/gyr, imu/acc, imu/mag together"):
        calibrate_magnetometer(TUMBLED.replace(measurements=off))
