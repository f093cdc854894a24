"""A filter in plain NumPy, which branches on values and cannot be traced, runs all the same."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as LinearKalmanFilter

from poise.filters.compile import run as compiled
from poise.filters.core.estimator import run_by_steps
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model, Recurrence
from poise.filters.core.quantity import ACCELEROMETER, UP
from poise.filters.core.recursion import Observer


@dataclass(frozen=True)
class PlainVertical(Model):
    """The vertical as a random walk; samples that are too long or too short are left out by an ``if``."""

    walk: float = 0.1
    noise: float = 0.5

    channels: ClassVar = (ACCELEROMETER,)
    outputs: ClassVar = (UP,)
    state_size: ClassVar = 3
    error_size: ClassVar = 3
    residual_size: ClassVar = 3

    def prior(self, z: Any) -> Any:
        return z["imu/acc"] / np.linalg.norm(z["imu/acc"]), np.diag([0.1, 0.1, 0.1])

    def predict(self, x: Any, z: Any, previous: Any) -> Any:
        Q = np.zeros((3, 3))
        for i in range(3):
            Q[i, i] = self.walk**2 * self.dt
        return x, np.eye(3), Q

    def residual(self, x: Any, z: Any) -> Any:
        f = z["imu/acc"]
        if abs(np.linalg.norm(f) - 9.81) > 3.0:
            f = np.full(3, np.nan)
        return f / 9.81 - x, np.eye(3), self.noise**2 * np.eye(3)

    def pose(self, x: Any) -> Any:
        return {"up": x / np.linalg.norm(x)}


@dataclass(frozen=True)
class PlainTilt(Recurrence):
    """The direction of each sample that is there."""

    channels: ClassVar = (ACCELEROMETER,)
    outputs: ClassVar = (UP,)
    state_size: ClassVar = 3

    def prior(self, z: Any) -> Any:
        return z["imu/acc"] / np.linalg.norm(z["imu/acc"])

    def predict(self, x: Any, z: Any, previous: Any) -> Any:
        return x

    def finish(self, x: Any, z: Any) -> Any:
        if np.isnan(z["imu/acc"]).any():
            return x
        return z["imu/acc"] / np.linalg.norm(z["imu/acc"])

    def pose(self, x: Any) -> Any:
        return {"up": x}


def samples(*batch: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    force = rng.normal(size=(40, *batch, 3)) + np.array([0.0, 2.0, 9.6])
    force[1:][rng.random((39, *batch)) < 0.2] = np.nan
    return {"imu/acc": force}


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_COMPILED", {})


def test_it_runs_with_one_warning_that_names_the_method_and_the_remedy() -> None:
    with pytest.warns(UserWarning, match=r"PlainVertical\.prior: .*xp\.where") as caught:
        KalmanFilter(PlainVertical()).run(samples())
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        KalmanFilter(PlainVertical(noise=0.3)).run(samples())
        KalmanFilter(PlainVertical(), compiled=False).run(samples())


@pytest.mark.filterwarnings("ignore:.*runs as written")
def test_its_numbers_are_those_of_filterpy() -> None:
    data = samples()["imu/acc"]
    estimate = KalmanFilter(PlainVertical()).run({"imu/acc": data})
    oracle = LinearKalmanFilter(dim_x=3, dim_z=3)
    oracle.F, oracle.H, oracle.Q, oracle.R = np.eye(3), np.eye(3), 1e-4 * np.eye(3), 0.25 * np.eye(3)
    oracle.x, oracle.P = data[0][:, None] / np.linalg.norm(data[0]), 0.1 * np.eye(3)
    for t, f in enumerate(data):
        if t:
            oracle.predict()
            if abs(np.linalg.norm(f) - 9.81) <= 3.0:
                oracle.update(f[:, None] / 9.81)
        np.testing.assert_allclose(estimate.pose["up"][t], oracle.x[:, 0] / np.linalg.norm(oracle.x), atol=1e-12)
        np.testing.assert_allclose(estimate.covariance[t], oracle.P, atol=1e-12)


@pytest.mark.filterwarnings("ignore:.*runs as written")
@pytest.mark.parametrize("estimator", [KalmanFilter(PlainVertical()), Observer(PlainTilt())], ids=["model", "observer"])
def test_a_batch_is_its_sequences_and_running_is_stepping(estimator: Any) -> None:
    data = samples(2, 3)
    together = estimator.run(data)
    assert together.pose["up"].shape == (40, 2, 3, 3)
    for index in np.ndindex(2, 3):
        alone = estimator.run({"imu/acc": data["imu/acc"][(slice(None), *index)]})
        np.testing.assert_array_equal(together.pose["up"][(slice(None), *index)], alone.pose["up"])
    np.testing.assert_array_equal(run_by_steps(estimator, data).pose["up"], together.pose["up"])
