"""Bounded motion that measures the bias at rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from poise.filters.core.estimator import run_by_steps
from poise.filters.registry import make

BIAS = np.radians([3.0, -1.0, 2.0])


def still(seconds: float, rate: float = 100.0) -> dict[str, np.ndarray]:
    """A device that lies still, whose gyroscope has a bias."""
    count, rng = int(seconds * rate), np.random.default_rng(0)
    gyr = BIAS + np.radians(0.1) * rng.standard_normal((count, 3))
    acc = np.array([0.0, 3.0, 9.33]) + 0.02 * rng.standard_normal((count, 3))
    return {"imu/gyr": gyr, "imu/acc": acc}


def bias(name: str, data: dict[str, np.ndarray]) -> np.ndarray:
    estimator: Any = make(name, dt=0.01)
    return np.asarray(estimator.run(data).pose["gyroscope_bias"])


def test_a_rest_tells_the_bias() -> None:
    data = still(4.0)
    found = bias("bounded-motion-rest", data)
    assert np.degrees(np.abs(found[-1] - BIAS)).max() < 0.05
    np.testing.assert_allclose(found[:140], bias("bounded-motion", data)[:140], atol=1e-12)
    assert np.degrees(np.abs(bias("bounded-motion", data)[-1] - BIAS)).max() > 1.0


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
