"""A day of samples: estimates stay finite, and the last hours are as good as the first ones."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.registry import make_estimator

RATE = 100.0
HOUR = round(3600 * RATE)
BIAS = np.array([0.004, -0.003, 0.002])


def motion(start: int, generator: np.random.Generator) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """An hour of a sensor that swings about an axis of its own, with noise, bias, drop-outs and a gap; and up."""
    time = (start + np.arange(HOUR)) / RATE
    axis = np.array([0.6, 0.8, 0.0])
    angle, rate = 0.8 * np.sin(0.7 * time), 0.56 * np.cos(0.7 * time)
    # The vertical in sensor axes: z, turned back about the axis (Rodrigues; the axis is horizontal).
    up = np.sin(angle)[:, None] * np.cross([0.0, 0.0, 1.0], axis) + np.cos(angle)[:, None] * np.array([0.0, 0.0, 1.0])
    arrays = {
        "imu/gyr": rate[:, None] * axis + BIAS + generator.normal(0.0, 0.01, (HOUR, 3)),
        "imu/acc": 9.81 * up + generator.normal(0.0, 0.1, (HOUR, 3)),
    }
    for samples in arrays.values():
        samples[generator.random(HOUR) < 0.01] = np.nan
        samples[HOUR // 2 : HOUR // 2 + 200] = np.nan
    return arrays, up


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bounded-motion", "mekf", "external-acceleration", "mahony"])
def test_the_last_hours_are_as_good_as_the_first(name: str) -> None:
    generator = np.random.default_rng(0)
    estimator = make_estimator(name, dt=1.0 / RATE)
    state, errors, trace = None, [], []
    for hour in range(24):
        arrays, up = motion(hour * HOUR, generator)
        estimate, state = estimator.run_from(state, arrays)
        cosine = np.sum(np.asarray(estimate.pose["up"]) * up, axis=1)
        assert np.isfinite(cosine[100:]).all()
        error = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        settled = error[60 * round(RATE) :]
        errors.append(float(np.sqrt(np.mean(settled**2))))
        trace.append(float(np.trace(np.asarray(state.covariance))))
    print(f"{name}: {np.round(errors, 3)}")
    early, late = np.array(errors[:6]), np.array(errors[-6:])
    assert late.mean() < 1.2 * early.mean() + 0.02
    assert np.isfinite(trace).all()  # that of an unknown heading grows, by right
