"""Recording of rides: what a force sensor reads between two samples."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.record import record

FORCES = ["seat/wrench", "seat/load_cells", "handlebar/force", "wheel/speed"]


def ride(rate, sampling):
    """Measurements of ideal force sensors on a ride over rough ground, and the time of the physics of sample 1."""
    env = RiderBicycleEnv(
        "outdoor", suite=FORCES, sensors="ideal", rate=rate, duration=0.6, sampling=sampling, fidelity="lumped"
    )
    read = record(env, seed=3).measurements
    env.close()
    return np.concatenate([read[name] for name in FORCES], axis=1)


@pytest.fixture(scope="module")
def fast():
    return ride(500.0, "interval")


def ends(fast, slow):
    """Rows of the fast ride at which the samples of the slow one end: the ride is the same, the first sample is not."""
    start = min(range(20), key=lambda row: np.abs(fast[row + 10 : row + 260 : 10] - slow[1:26]).sum())
    return start + 10 * np.arange(1, 26)


def test_a_force_sample_is_the_mean_over_its_interval(fast):
    slow, instant = ride(50.0, "interval"), ride(50.0, "instant")
    rows = ends(fast, instant)
    np.testing.assert_allclose(instant[1:26], fast[rows], atol=1e-9)
    means = np.mean(fast[rows[:, None] + np.arange(-9, 1)], axis=1)
    np.testing.assert_allclose(slow[1:26], means, atol=1e-9)
    # over bumps the last physics step says little about the interval
    assert np.sqrt(np.mean((instant[1:26] - means)[:, 2] ** 2)) > 5.0
