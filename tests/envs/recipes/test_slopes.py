"""Rides on slopes that were ridden on level ground."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory
from poise.envs.recipes.slopes import pitch_profile, sloped
from poise.filters.core import rotation

T, DT = 2000, 0.01
MOUNTING = rotation.exp(np.array([0.3, -0.2, 0.1]))


def ride(yaw_rate=0.4):
    """Rolling and turning, with gyroscopes that describe the intervals that they end."""
    time = DT * np.arange(T)
    heading = rotation.exp(np.stack([0.0 * time, 0.0 * time, yaw_rate * time], axis=-1))
    roll = rotation.exp(np.stack([0.3 * np.sin(time), 0.0 * time, 0.0 * time], axis=-1))
    bicycle = rotation.multiply(heading, roll)
    trunk = rotation.multiply(bicycle, rotation.exp(np.array([0.0, 0.5, 0.0])))
    truth, measurements = {"bicycle/orientation": bicycle, "trunk/orientation": trunk}, {}
    for name in ("bicycle", "trunk"):
        truth[f"{name}_imu/rotation"] = np.broadcast_to(MOUNTING, (T, 4))
        measurements[f"{name}_imu/gyr"] = rates(rotation.multiply(truth[f"{name}/orientation"], MOUNTING))
        measurements[f"{name}_imu/acc"] = np.zeros((T, 3))
    measurements["relative/orientation"] = rotation.multiply(rotation.conjugate(bicycle), trunk)
    return Trajectory(time, measurements, truth)


def rates(orientation):
    turn = rotation.log(rotation.multiply(rotation.conjugate(orientation[:-1]), orientation[1:]))
    return np.concatenate([np.zeros((1, 3)), turn / DT])


def test_gyroscopes_and_camera_agree_with_the_new_orientations():
    level, pitched = ride(), sloped(ride(), np.random.default_rng(7))
    assert set(pitched.measurements) == {"bicycle_imu/gyr", "trunk_imu/gyr", "relative/orientation"}
    forward = rotation.rotate(pitched.truth["bicycle/orientation"], np.array([1.0, 0.0, 0.0]))
    assert np.degrees(np.arcsin(np.abs(forward[:, 2]).max())) > 2.0
    for name in ("bicycle", "trunk"):
        expected = rates(rotation.multiply(pitched.truth[f"{name}/orientation"], MOUNTING))
        np.testing.assert_allclose(pitched.measurements[f"{name}_imu/gyr"], expected, atol=2e-4)
        assert np.abs(expected - level.measurements[f"{name}_imu/gyr"]).max() > 0.05
    bicycle, trunk = (pitched.truth[f"{name}/orientation"] for name in ("bicycle", "trunk"))
    between = rotation.multiply(rotation.conjugate(bicycle), trunk)
    np.testing.assert_allclose(between, level.measurements["relative/orientation"], atol=1e-12)


def test_ground_begins_level_and_is_the_same_for_the_same_seed():
    first, again, other = (pitch_profile(6000, DT, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first[:200], 0.0)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01
    assert np.abs(np.diff(first)).max() / DT < 6.0


def test_a_trajectory_without_a_bicycle_is_refused():
    motion = ride().replace(truth={"trunk/orientation": np.tile([1.0, 0.0, 0.0, 0.0], (T, 1))})
    with pytest.raises(ValueError, match="needs the truth bicycle/orientation"):
        sloped(motion, np.random.default_rng(0))
