"""Bounded motion that measures the bias at rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from poise.filters.core.estimator import run_by_steps
from poise.filters.core.metrics import heading_error
from poise.filters.core.quantity import GRAVITY
from poise.filters.registry import make

BIAS = np.radians([3.0, -1.0, 2.0])


def still(seconds: float, rate: float = 100.0) -> dict[str, np.ndarray]:
    """A device that lies still, whose gyroscope has a bias."""
    count, rng = int(seconds * rate), np.random.default_rng(0)
    gyr = BIAS + np.radians(0.1) * rng.standard_normal((count, 3))
    acc = np.array([0.0, 3.0, 9.33]) + 0.02 * rng.standard_normal((count, 3))
    acc[0] = [0.0, 3.0, np.sqrt(GRAVITY**2 - 9.0)]
    return {"imu/gyr": gyr, "imu/acc": acc}


def bias(name: str, data: dict[str, np.ndarray]) -> np.ndarray:
    estimator: Any = make(name, dt=0.01, bias_prior=np.radians(1.5))
    return np.asarray(estimator.run(data).pose["gyroscope_bias"])


def test_a_rest_tells_the_bias() -> None:
    data = still(4.0)
    found = bias("bounded-motion-rest", data)
    assert np.degrees(np.abs(found[-1] - BIAS)).max() < 0.05
    np.testing.assert_allclose(found[:140], bias("bounded-motion", data)[:140], atol=1e-12)
    assert np.degrees(np.abs(bias("bounded-motion", data)[-1] - BIAS)).max() > 1.0


def test_a_rest_of_any_length_leaves_the_doubt_about_motion() -> None:
    """The deviation of the bias ends at σ_D about each axis; with a σ_R that tells nothing it stays where it was."""
    data = still(8.0)
    for parameters, lowest, highest in (({}, 0.045, 0.055), ({"rest_noise": 20.0}, 0.9, 1.6)):
        estimator: Any = make("bounded-motion-rest", dt=0.01, **parameters)
        spread = np.sqrt(np.diagonal(estimator.run(data).covariance[-1, 3:6, 3:6]))
        # gravity tells the rest of it about the horizontal axes
        assert lowest < np.degrees(spread.max()) < highest


def test_a_start_in_motion_is_not_believed() -> None:
    data = still(0.1)
    data["imu/acc"][0] = [6.0, 0.0, 9.0]
    for name, least in (("bounded-motion", 0.0), ("bounded-motion-rest", 0.1)):
        estimator: Any = make(name, dt=0.01)
        start = estimator.run(data).covariance[0]
        assert least < np.sqrt(start[0, 0]) < 0.06 + least


def test_motion_and_fast_rotation_tell_nothing() -> None:
    """Without rest it is the filter of bounded motion, up to rounding."""
    swing = 0.2 * np.sin(6.0 * np.arange(400) / 100.0)[:, None] * [1.0, 0.0, 1.0]
    for rotation in (swing, [0.0, 0.0, 0.3]):
        data = still(4.0)
        data["imu/gyr"] = data["imu/gyr"] + rotation
        np.testing.assert_allclose(bias("bounded-motion-rest", data), bias("bounded-motion", data), atol=1e-9)


@pytest.mark.parametrize("compiled", [True, False])
def test_stepping_and_gaps(compiled: bool) -> None:
    data = still(3.0)
    data["imu/acc"][250:260] = np.nan
    data["imu/gyr"][:2] = np.nan
    estimator: Any = make("bounded-motion-rest", dt=0.01)
    whole = estimator.run(data)
    other = run_by_steps(estimator, data) if compiled else type(estimator)(estimator.model, compiled=False).run(data)
    np.testing.assert_allclose(other.pose["gyroscope_bias"], whole.pose["gyroscope_bias"], atol=1e-10, equal_nan=True)


def test_with_a_magnetometer_too() -> None:
    data = still(3.0) | {"imu/mag": np.tile([20.0, 0.0, -45.0], (300, 1))}
    found = bias("bounded-motion-rest-9", data)
    assert np.degrees(np.abs(found[-1] - BIAS)).max() < 0.05
    assert np.degrees(np.abs(bias("bounded-motion-9", data)[-1] - BIAS)).max() > 1.0
    orientation = make("bounded-motion-rest-9", dt=0.01).run(data).pose["orientation"]
    assert np.degrees(heading_error(orientation[-1], orientation[0])) < 1.0
