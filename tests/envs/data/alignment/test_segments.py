"""Mounting of a sensor from rest and one known movement."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.data.alignment.segments import align_segment
from poise.envs.data.trajectory import Trajectory

RATE = 100.0
TIME = np.arange(1500) / RATE
MOUNTING = Rotation.from_euler("zyx", [130.0, 25.0, -160.0], degrees=True)
"""Sensor → segment."""
BIAS = np.array([0.01, -0.02, 0.015])


def leaning(axis: str = "x", amplitude: float = 15.0, other: float = 0.0) -> Trajectory:
    """Rest for 5 s, then leaning from side to side, first in the positive sense, about an axis of the segment."""
    angle = np.where(TIME > 5.0, np.radians(amplitude) * np.sin(2.0 * np.pi * 0.4 * (TIME - 5.0)), 0.0)
    vectors = np.outer(angle, np.eye(3)["xyz".index(axis)])
    vectors[:, 1] += np.where(TIME > 5.0, np.radians(other) * np.sin(2.0 * np.pi * 0.9 * (TIME - 5.0)), 0.0)
    attitude = Rotation.from_rotvec(vectors)  # segment → world
    rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() * RATE
    rate = np.concatenate([np.zeros((1, 3)), rate])
    force = attitude.inv().apply([0.0, 0.0, 9.81])
    generator = np.random.default_rng(0)
    gyr = MOUNTING.inv().apply(rate) + BIAS + generator.normal(0.0, 0.005, rate.shape)
    acc = MOUNTING.inv().apply(force) + generator.normal(0.0, 0.05, rate.shape)
    return Trajectory(TIME, {"imu/gyr": gyr, "imu/acc": acc}, {}, metadata={"name": "leaning"})


@pytest.mark.parametrize("axis", ["x", "y"])
def test_mounting_is_found(axis: str) -> None:
    """Within half a degree, with noise and a gyroscope bias."""
    found = align_segment(leaning(axis), (0.0, 4.5), (5.0, 15.0), axis)
    error = Rotation.from_quat(np.roll(found.rotation, -1)) * MOUNTING.inv()
    assert np.degrees(error.magnitude()) < 0.5
    np.testing.assert_allclose(found.gyroscope_bias, BIAS, atol=1e-3)
    assert found.dominance > 0.95


def test_a_movement_that_begins_in_the_negative_sense() -> None:
    found = align_segment(leaning("x", amplitude=-15.0), (0.0, 4.5), (5.0, 15.0), "-x")
    error = Rotation.from_quat(np.roll(found.rotation, -1)) * MOUNTING.inv()
    assert np.degrees(error.magnitude()) < 0.5


def test_applied_vectors_are_those_of_the_segment() -> None:
    recording = leaning()
    turned = align_segment(recording, (0.0, 4.5), (5.0, 15.0), "x").apply(recording)
    np.testing.assert_allclose(turned.measurements["imu/acc"][:400].mean(axis=0), [0.0, 0.0, 9.81], atol=0.1)
    rate = turned.measurements["imu/gyr"][600:] - MOUNTING.apply(BIAS)
    assert np.std(rate[:, 0]) > 20.0 * np.std(rate[:, 1])
    assert "mounting" in turned.metadata


def without_rates():
    """The same with a gyroscope that was off at rest."""
    recording = leaning()
    rates = np.where(recording.time[:, None] < 4.6, np.nan, recording.measurements["imu/gyr"])
    return recording.replace(measurements={**recording.measurements, "imu/gyr": rates})


@pytest.mark.parametrize(
    ("recording", "rest", "movement", "axis", "message"),
    [
        (leaning(), (0.0, 4.5), (5.0, 15.0), "w", "axis must be one of"),
        (leaning(), (6.0, 12.0), (5.0, 15.0), "x", "is no rest"),
        (leaning(), (0.0, 4.5), (0.0, 4.5), "x", "too weak"),
        (leaning(other=12.0), (0.0, 4.5), (5.0, 15.0), "x", "about several axes"),
        (leaning("z"), (0.0, 4.5), (5.0, 15.0), "z", "along gravity"),
        (leaning("z"), (0.0, 4.5), (5.0, 15.0), "x", "about the vertical"),
        (leaning(), (0.0, 4.5), (50.0, 60.0), "x", "movement must be"),
        (leaning(), (0.0, 4.5), (5.0, 60.0), "x", "movement must be"),
        (without_rates(), (0.0, 4.5), (5.0, 15.0), "x", "has 0 valid samples of imu/gyr"),
    ],
)
def test_what_does_not_serve_is_refused(recording, rest, movement, axis, message) -> None:
    with pytest.raises(ValueError, match=message):
        align_segment(recording, rest, movement, axis)


def test_missing_channel() -> None:
    with pytest.raises(ValueError, match="no channel trunk/gyr"):
        align_segment(leaning(), (0.0, 4.5), (5.0, 15.0), "x", site="trunk")
