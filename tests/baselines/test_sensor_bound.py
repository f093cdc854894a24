"""The bound of the inclination by the errors of an IMU alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from poise import evaluate
from poise.baselines.sensor_bound import inclination_bound
from poise.envs.data.trajectory import Trajectory
from poise.envs.sensors.noise import NoiseModel
from poise.filters.core import rotation

G = 9.80665


def still(gyr: NoiseModel, acc: NoiseModel, **metadata: Any) -> Trajectory:
    """10 s of a sensor at rest, slanted; the last 2 s are scored."""
    time = np.arange(1000) * 0.01
    q = np.tile(rotation.exp(np.array([0.3, -0.4, 0.5])), (len(time), 1))
    described = [{"channel": f"imu/{name}", "noise": model.describe()} for name, model in (("gyr", gyr), ("acc", acc))]
    return Trajectory(
        time,
        {"imu/gyr": np.zeros((len(time), 3)), "imu/acc": G * np.asarray(rotation.up_in_body(q))},
        {"orientation": q, "up": np.asarray(rotation.up_in_body(q))},
        mask=time > 8.0,
        metadata={"name": "still", "source": "simulation", "sensors": {"sensors": described}} | metadata,
    )


def test_white_noises_balance() -> None:
    """Wiener process in white noise: the variance of the optimal filter is √(q r)."""
    gyr, acc = 2e-3, 0.05
    found = inclination_bound(still(NoiseModel(white_noise=gyr), NoiseModel(white_noise=acc)))
    assert found == pytest.approx(np.degrees(np.sqrt(2.0 * gyr * acc / G)), rel=0.02)


def test_at_rest_a_bias_of_the_accelerometer_stays() -> None:
    noises = NoiseModel(white_noise=1e-5), NoiseModel(white_noise=1e-4, turn_on_bias=0.03)
    assert inclination_bound(still(*noises)) == pytest.approx(np.degrees(np.sqrt(2.0) * 0.03 / G), rel=0.02)


def test_there_is_none_where_errors_are_not_known() -> None:
    noises = NoiseModel(white_noise=1e-3), NoiseModel(white_noise=1e-2)
    assert inclination_bound(still(*noises, source="a file")) is None
    assert inclination_bound(still(*noises, site="trunk_imu")) is None
    assert inclination_bound(still(NoiseModel(), NoiseModel())) is None, "an ideal sensor leaves nothing"


def test_estimates_are_compared_with_it() -> None:
    trajectory = still(NoiseModel(white_noise=1e-3), NoiseModel(white_noise=1e-2))
    table = evaluate("bounded-motion", trajectory, offline=True, check=False, detailed=True)
    (ratio,) = table[table["metric"] == "inclination over bound"]["value"]
    error = table[(table["metric"] == "inclination") & (table["estimator"] == "bounded-motion")]["value"].iloc[0]
    assert ratio == pytest.approx(error / inclination_bound(trajectory))
    assert set(table[table["metric"] == "nees degrees"]["value"]) == {2.0}
    lower, upper = (table[table["metric"] == f"nis {each}"]["value"].iloc[0] for each in ("lower", "upper"))
    assert 0.8 < lower < 1.0 < upper < 1.2
