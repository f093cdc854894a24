"""The Kalman recursion against FilterPy, in both of its forms, and what it promises for every model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from filterpy.kalman import KalmanFilter as LinearKalmanFilter
from scipy.stats import chi2

from poise.filters.core.backend import Array, constant, expand, namespace
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Gain, Model
from poise.filters.core.quantity import Channel, Measurement, Quantity

POSITION = Channel("test/position", 1, "m")
VELOCITY = Channel("test/velocity", 1, "m/s")
DEVIATION = Channel("test/deviation", 2, "1")


@dataclass(frozen=True)
class ConstantVelocity(Model):
    """Position and velocity, both measured, with a standard deviation that comes with each sample."""

    acceleration_noise: float = 0.7
    measurement_noise: float = 1.0

    channels: ClassVar = (POSITION, VELOCITY, DEVIATION)
    outputs: ClassVar = (Quantity("state", "vector", 2, "m, m/s"),)
    state_size: ClassVar = 2
    error_size: ClassVar = 2
    residual_size: ClassVar = 2
    gains: ClassVar = {
        "process": Gain("acceleration_noise"),
        "measurement": Gain("measurement_noise", maximum=50.0),
    }

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        x = namespace(z["test/position"]).concat([z["test/position"], 0.0 * z["test/position"]], axis=-1)
        return x, constant([[4.0, 0.5], [0.5, 3.0]], x) + 0.0 * x[..., None]

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        one = constant([[1.0, 0.0], [0.0, 1.0]], x) + 0.0 * x[..., None]
        F = one + expand(self.dt, 2) * constant([[0.0, 1.0], [0.0, 0.0]], x)
        half = 0.5 * self.dt**2
        column = constant([[1.0], [0.0]], x) * half + constant([[0.0], [1.0]], x) * self.dt
        return (F @ x[..., None])[..., 0], F, expand(self.acceleration_noise**2, 2) * (column @ column.mT) + 0.0 * one

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        measured = namespace(x).concat([z["test/position"], z["test/velocity"]], axis=-1)
        one = constant([[1.0, 0.0], [0.0, 1.0]], x) + 0.0 * x[..., None]
        deviation = expand(self.measurement_noise, 1) * z["test/deviation"]
        return measured - x, one, (deviation**2)[..., None] * one

    def pose(self, x: Array) -> dict[str, Array]:
        return {"state": x}


@dataclass(frozen=True)
class Range(ConstantVelocity):
    """The same motion, seen as the distance from a point one metre beside the line: not linear."""

    channels: ClassVar = (POSITION,)
    residual_size: ClassVar = 1

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        one = 1.0 + 0.0 * z["test/position"]
        x = namespace(one).concat([5.0 * one, one], axis=-1)
        return x, constant([[4.0, 0.5], [0.5, 3.0]], x) + 0.0 * x[..., None]

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        xp = namespace(x)
        position = x[..., :1]
        distance = xp.sqrt(position * position + 1.0)
        H = xp.concat([position / distance, 0.0 * position], axis=-1)[..., None, :]
        return z["test/position"] - distance, H, expand(self.measurement_noise**2, 2) + 0.0 * H[..., :1]


def linear_data(seed: int, length: int = 120) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    data = {
        "test/position": np.cumsum(rng.normal(size=(length, 1)), axis=0),
        "test/velocity": rng.normal(size=(length, 1)),
        "test/deviation": rng.uniform(0.3, 3.0, (length, 2)),
    }
    data["test/position"][rng.random(length) < 0.3] = np.nan
    data["test/velocity"][rng.random(length) < 0.5] = np.nan
    data["test/position"][0] = 1.5
    return data


@pytest.mark.parametrize("compiled", [False, True], ids=["arrays", "compiled"])
@pytest.mark.parametrize("seed", range(4))
def test_linear_model_equals_filterpy(seed: int, compiled: bool) -> None:
    data, model = linear_data(seed), ConstantVelocity(dt=0.1)
    estimate = KalmanFilter(model, compiled=compiled).run(data)

    oracle = LinearKalmanFilter(dim_x=2, dim_z=2)
    oracle.F = np.array([[1.0, 0.1], [0.0, 1.0]])
    column = np.array([[0.005], [0.1]])
    oracle.Q = 0.49 * column @ column.T
    oracle.x, oracle.P = np.array([[1.5], [0.0]]), np.array([[4.0, 0.5], [0.5, 3.0]])
    for t in range(1, len(data["test/position"])):
        oracle.predict()
        z = np.concatenate([data["test/position"][t], data["test/velocity"][t]])
        seen = np.isfinite(z)
        nis = 0.0
        if seen.any():
            H, R = np.eye(2)[seen], np.diag(data["test/deviation"][t] ** 2)[np.ix_(seen, seen)]
            oracle.dim_z = int(seen.sum())
            oracle._I = np.eye(2)
            oracle.update(z[seen][:, None], R=R, H=H)
            nis = float((oracle.y.T @ oracle.SI @ oracle.y).item())
        np.testing.assert_allclose(estimate.pose["state"][t], oracle.x[:, 0], atol=1e-9, rtol=0)
        np.testing.assert_allclose(estimate.covariance[t], oracle.P, atol=1e-9, rtol=0)
        assert estimate.nis[t] == pytest.approx(nis, abs=1e-9)


@pytest.mark.parametrize("compiled", [False, True], ids=["arrays", "compiled"])
def test_nonlinear_model_equals_filterpy(compiled: bool) -> None:
    rng = np.random.default_rng(5)
    truth = 5.0 + 0.1 * np.arange(200)
    measured = np.sqrt(truth**2 + 1.0) + rng.normal(0.0, 0.5, 200)
    measured[60:90] = np.nan
    estimate = KalmanFilter(Range(dt=0.1, measurement_noise=0.5), compiled=compiled).run(
        {"test/position": measured[:, None]}
    )

    oracle = ExtendedKalmanFilter(dim_x=2, dim_z=1)
    oracle.F = np.array([[1.0, 0.1], [0.0, 1.0]])
    column = np.array([[0.005], [0.1]])
    oracle.Q, oracle.R = 0.49 * column @ column.T, np.array([[0.25]])
    oracle.x, oracle.P = np.array([[5.0], [1.0]]), np.array([[4.0, 0.5], [0.5, 3.0]])
    for t in range(1, len(measured)):
        oracle.predict()
        if np.isfinite(measured[t]):
            oracle.update(
                np.array([[measured[t]]]),
                HJacobian=lambda x: np.array([[x[0, 0] / np.hypot(x[0, 0], 1.0), 0.0]]),
                Hx=lambda x: np.array([[np.hypot(x[0, 0], 1.0)]]),
            )
        np.testing.assert_allclose(estimate.pose["state"][t], oracle.x[:, 0], atol=1e-9, rtol=0)
        np.testing.assert_allclose(estimate.covariance[t], oracle.P, atol=1e-9, rtol=0)


def test_covariance_stays_symmetric_and_positive() -> None:
    data = linear_data(1, 100_000)
    estimate = KalmanFilter(ConstantVelocity(dt=0.01, acceleration_noise=1e-3, measurement_noise=1e-3)).run(data)
    P = estimate.covariance[-1000:]
    np.testing.assert_array_equal(P, np.swapaxes(P, -1, -2))
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("compiled", [False, True], ids=["arrays", "compiled"])
def test_gains_of_zero_change_no_bit(compiled: bool) -> None:
    data = linear_data(2)
    kalman = KalmanFilter(ConstantVelocity(dt=0.1), compiled=compiled)
    plain, neutral = kalman.run(data), kalman.run(data, {"process": 0.0, "measurement": np.zeros(120)})
    np.testing.assert_array_equal(plain.pose["state"], neutral.pose["state"])
    np.testing.assert_array_equal(plain.covariance, neutral.covariance)


@pytest.mark.parametrize("compiled", [False, True], ids=["arrays", "compiled"])
def test_a_gain_scales_the_variance(compiled: bool) -> None:
    data = linear_data(3)
    kalman = KalmanFilter(ConstantVelocity(dt=0.1), compiled=compiled)
    scaled = KalmanFilter(ConstantVelocity(dt=0.1, measurement_noise=3.0), compiled=compiled).run(data)
    np.testing.assert_allclose(
        kalman.run(data, {"measurement": np.log(9.0)}).pose["state"], scaled.pose["state"], atol=1e-12
    )
    limit = KalmanFilter(ConstantVelocity(dt=0.1, measurement_noise=50.0), compiled=compiled).run(data)
    np.testing.assert_allclose(kalman.run(data, {"measurement": 1e3}).pose["state"], limit.pose["state"], atol=1e-12)


@pytest.mark.parametrize("compiled", [False, True], ids=["arrays", "compiled"])
def test_gains_per_tick_and_per_sequence(compiled: bool) -> None:
    data = {name: np.stack([array, array], axis=1) for name, array in linear_data(3).items()}
    factors = np.random.default_rng(0).normal(size=(120, 2))
    kalman = KalmanFilter(ConstantVelocity(dt=0.1), compiled=compiled)
    together = kalman.run(data, {"process": factors})
    for index in (0, 1):
        alone = kalman.run(linear_data(3), {"process": factors[:, index]})
        np.testing.assert_allclose(together.pose["state"][:, index], alone.pose["state"], atol=1e-12)
    assert np.abs(together.pose["state"][:, 0] - together.pose["state"][:, 1]).max() > 1e-3


def test_unknown_gains_are_refused() -> None:
    kalman = KalmanFilter(ConstantVelocity(dt=0.1))
    with pytest.raises(ValueError, match=r"unknown gains \['speed'\].*measurement.*process"):
        kalman.run(linear_data(0), {"speed": 0.0})
    with pytest.raises(ValueError, match="120 samples first"):
        kalman.run(linear_data(0), {"process": np.zeros(7)})


@pytest.mark.parametrize("compiled", [False, True], ids=["arrays", "compiled"])
def test_it_starts_when_the_prior_is_finite(compiled: bool) -> None:
    data = {name: np.stack([array, array], axis=1) for name, array in linear_data(4).items()}
    data["test/position"][:7, 1] = np.nan
    data["test/position"][7, 1] = 2.5
    estimate = KalmanFilter(ConstantVelocity(dt=0.1), compiled=compiled).run(data)
    assert np.isfinite(estimate.pose["state"][:, 0]).all()
    assert np.isnan(estimate.pose["state"][:7, 1]).all()
    assert np.isnan(estimate.covariance[:7, 1]).all()
    np.testing.assert_array_equal(estimate.nis[:8, 1], 0.0)
    np.testing.assert_array_equal(estimate.pose["state"][7, 1], [2.5, 0.0])
    assert np.isfinite(estimate.pose["state"][7:, 1]).all()


def test_innovations_of_a_true_model_are_chi_square() -> None:
    rng, dt, length, batch = np.random.default_rng(6), 0.1, 400, 50
    position = rng.normal(0.0, 2.0, batch)
    velocity = rng.normal(0.0, np.sqrt(3.0), batch)
    truth = np.empty((length, batch, 2))
    for t in range(length):
        push = rng.normal(0.0, 0.7, batch)
        position, velocity = position + dt * velocity + 0.5 * dt**2 * push, velocity + dt * push
        truth[t] = np.stack([position, velocity], axis=-1)
    deviation = rng.uniform(0.3, 3.0, (length, batch, 2))
    measured = truth + deviation * rng.normal(size=truth.shape)
    data = {
        "test/position": measured[..., :1],
        "test/velocity": measured[..., 1:],
        "test/deviation": deviation,
    }
    estimate = KalmanFilter(ConstantVelocity(dt=dt)).run(data)
    nis = estimate.nis[100:]  # the prior, which starts at a noisy sample, is forgotten by then
    low, high = chi2.ppf([0.0005, 0.9995], 2 * nis.size) / nis.size
    assert low < nis.mean() < high
    whitened = estimate.innovation[100:].reshape(-1, 2)
    np.testing.assert_allclose(whitened.T @ whitened / len(whitened), np.eye(2), atol=0.03)
    error = estimate.pose["state"][100:] - truth[100:]
    nees = np.einsum("tbi,tbij,tbj->tb", error, np.linalg.inv(estimate.covariance[100:]), error)
    assert nees.mean() == pytest.approx(2.0, rel=0.1)
