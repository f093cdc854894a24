"""Fixed-interval smoothing against FilterPy and a dense least-squares problem, and what it promises for every model."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as LinearKalmanFilter

from poise.baselines.registry import make_estimator
from poise.filters.compile import run as compiled
from poise.filters.core.kalman import KalmanFilter

from .test_kalman import ConstantVelocity

LENGTH = 60


@pytest.fixture
def samples() -> dict[str, np.ndarray]:
    """Noisy samples with missing ones, single and in a row, and of one channel only."""
    generator = np.random.default_rng(4)
    time = 0.1 * np.arange(LENGTH)
    position = np.sin(time)[:, None] + generator.normal(0.0, 0.3, (LENGTH, 1))
    velocity = np.cos(time)[:, None] + generator.normal(0.0, 0.2, (LENGTH, 1))
    position[[7, 20, 21, 22, 23, 40]] = np.nan
    velocity[[7, 21, 22, 50]] = np.nan
    return {"test/position": position, "test/velocity": velocity, "test/deviation": np.tile([0.3, 0.2], (LENGTH, 1))}


def matrices(model: ConstantVelocity) -> tuple[np.ndarray, np.ndarray]:
    """F and Q of the model."""
    column = np.array([[0.5 * model.dt**2], [model.dt]])
    return np.array([[1.0, model.dt], [0.0, 1.0]]), model.acceleration_noise**2 * column @ column.T + 1e-9 * np.eye(2)


class Regular(ConstantVelocity):
    """With a process covariance that can be inverted, as the least-squares problem needs it."""

    def predict(self, x, z, previous):  # type: ignore[no-untyped-def]
        after, F, Q = super().predict(x, z, previous)
        unit = F - np.array([[0.0, 1.0], [0.0, 0.0]]) * self.dt
        return after, F, Q + 1e-9 * unit


def test_equals_filterpy(samples: dict[str, np.ndarray]) -> None:
    model = ConstantVelocity(dt=0.1)
    F, Q = matrices(model)
    oracle = LinearKalmanFilter(dim_x=2, dim_z=2)
    oracle.x, oracle.P = np.array([[samples["test/position"][0, 0]], [0.0]]), np.array([[4.0, 0.5], [0.5, 3.0]])
    oracle.F, oracle.Q = F, Q - 1e-9 * np.eye(2)
    means, covariances = [oracle.x.copy()], [oracle.P.copy()]
    for t in range(1, LENGTH):
        oracle.predict()
        values = np.array([samples["test/position"][t, 0], samples["test/velocity"][t, 0]])
        use = np.isfinite(values)
        if use.any():
            H, R = np.eye(2)[use], np.diag(samples["test/deviation"][t, use] ** 2)
            oracle.dim_z = int(use.sum())
            oracle._I = np.eye(2)
            oracle.update(values[use, None], R=R, H=H)
        means.append(oracle.x.copy())
        covariances.append(oracle.P.copy())
    wanted, covariance, _, _ = oracle.rts_smoother(np.array(means), np.array(covariances))
    estimate = KalmanFilter(model).smooth(samples)
    np.testing.assert_allclose(estimate.pose["state"], wanted[..., 0], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(estimate.covariance, covariance, rtol=0.0, atol=1e-9)


def test_equals_dense_least_squares(samples: dict[str, np.ndarray]) -> None:
    """All samples, transitions and the prior as one weighted linear problem."""
    model = Regular(dt=0.1)
    F, Q = matrices(model)
    rows, values = [], []

    def add(blocks: dict[int, np.ndarray], value: np.ndarray, covariance: np.ndarray) -> None:
        white = np.linalg.inv(np.linalg.cholesky(covariance))
        row = np.zeros((len(value), 2 * LENGTH))
        for t, block in blocks.items():
            row[:, 2 * t : 2 * t + 2] = block
        rows.append(white @ row)
        values.append(white @ value)

    add({0: np.eye(2)}, np.array([samples["test/position"][0, 0], 0.0]), np.array([[4.0, 0.5], [0.5, 3.0]]))
    for t in range(1, LENGTH):
        add({t - 1: -F, t: np.eye(2)}, np.zeros(2), Q)
        for axis, name in enumerate(("test/position", "test/velocity")):
            if np.isfinite(samples[name][t, 0]):
                variance = samples["test/deviation"][t, axis] ** 2
                add({t: np.eye(2)[axis : axis + 1]}, samples[name][t], np.array([[variance]]))
    A, b = np.concatenate(rows), np.concatenate(values)
    orthogonal, upper = np.linalg.qr(A)
    solution = np.linalg.solve(upper, orthogonal.T @ b).reshape(LENGTH, 2)
    inverse = np.linalg.inv(upper)
    covariance = inverse @ inverse.T
    estimate = KalmanFilter(model).smooth(samples)
    np.testing.assert_allclose(estimate.pose["state"], solution, rtol=0.0, atol=1e-7)
    for t in range(LENGTH):
        own = covariance[2 * t : 2 * t + 2, 2 * t : 2 * t + 2]
        np.testing.assert_allclose(estimate.covariance[t], own, rtol=1e-6, atol=1e-9)


def test_the_last_estimate_is_that_of_the_filter(samples: dict[str, np.ndarray]) -> None:
    kalman = KalmanFilter(ConstantVelocity(dt=0.1))
    filtered, smoothed = kalman.run(samples), kalman.smooth(samples)
    np.testing.assert_array_equal(filtered.pose["state"][-1], smoothed.pose["state"][-1])
    np.testing.assert_array_equal(filtered.innovation, smoothed.innovation)
    np.testing.assert_array_equal(filtered.nis, smoothed.nis)
    trace = [np.trace(each.covariance, axis1=1, axis2=2) for each in (smoothed, filtered)]
    assert np.all(trace[0] <= trace[1] + 1e-12)


@pytest.mark.parametrize("name", ["external-acceleration", "mekf", "bounded-motion", "mekf-9"])
def test_batches_and_stretches_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(1)
    arrays = {
        "imu/gyr": generator.normal(0.0, 0.5, (300, 2, 3)),
        "imu/acc": np.array([0.0, 0.0, 9.81]) + generator.normal(0.0, 1.0, (300, 2, 3)),
        "imu/mag": np.array([20.0, 0.0, -40.0]) + generator.normal(0.0, 1.0, (300, 2, 3)),
    }
    arrays["imu/acc"][:10, 1] = np.nan
    arrays["imu/acc"][100:120] = np.nan
    estimator = make_estimator(name, dt=0.01)
    both = estimator.smooth(arrays)
    monkeypatch.setattr(compiled, "RECORDED", 1)
    for b in range(2):
        one = estimator.smooth({key: array[:, b] for key, array in arrays.items()})
        for quantity, values in one.pose.items():
            np.testing.assert_array_equal(values, both.pose[quantity][:, b])
        np.testing.assert_array_equal(one.covariance, both.covariance[:, b])
    assert np.isnan(both.pose["up"][5, 1]).all()
    assert np.isfinite(both.pose["up"][:, 0]).all()


def test_a_gap_is_bridged_from_both_sides() -> None:
    """A constant rate turns the sensor by 90° within a gap of the accelerometer and a gyroscope that is wrong there."""
    dt, rate, length = 0.01, 0.5, 1200
    angle = rate * dt * np.arange(length)
    up = np.stack([np.zeros(length), np.sin(angle), np.cos(angle)], axis=1)
    arrays = {"imu/gyr": np.tile([rate, 0.0, 0.0], (length, 1)), "imu/acc": 9.81 * up}
    arrays["imu/acc"][500:700] = np.nan
    arrays["imu/gyr"][500:700, 0] += 0.05
    estimator = make_estimator("mekf", dt=dt)

    def error(pose: np.ndarray) -> np.ndarray:
        return np.degrees(np.arccos(np.clip(np.sum(pose * up, axis=1), -1.0, 1.0)))

    filtered, smoothed = error(estimator.run(arrays).pose["up"]), error(estimator.smooth(arrays).pose["up"])
    assert filtered[699] > 4.0
    assert smoothed[500:700].max() < 0.6 * filtered[500:700].max()


def test_what_cannot_be_smoothed_says_so() -> None:
    torch = pytest.importorskip("torch")
    kalman = KalmanFilter(ConstantVelocity(dt=0.1))
    with pytest.raises(ValueError, match="torch"):
        kalman.smooth({channel.name: torch.zeros((3, channel.size)) for channel in kalman.channels})
    with pytest.raises(ValueError, match="unknown gains"):
        kalman.smooth({channel.name: np.ones((3, channel.size)) for channel in kalman.channels}, {"nothing": 0.0})
