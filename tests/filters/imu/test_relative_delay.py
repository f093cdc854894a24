"""The delay between accelerometer and gyroscope from innovations: known curves, a hand with a late accelerometer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import metrics, rotation
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model
from poise.filters.core.offline import Offline
from poise.filters.core.quantity import Measurement
from poise.filters.imu.bounded_motion import BoundedMotion
from poise.filters.imu.relative_delay import LARGEST, LONGEST, PRIOR, SECTION, STEP, merged, relative_delay

DT = 0.01
LENGTH = 10 * round(SECTION / DT)


def innovations(delay: float, scatter: float = 0.0, length: int = LENGTH) -> list[np.ndarray]:
    """Squares with their least sum at a delay, which scatters between the sections by ``scatter`` (s)."""
    sections = delay + scatter * np.resize([1.0, -1.0], -(-length // round(SECTION / DT)))
    own = np.repeat(sections, round(SECTION / DT))[:length]
    return [1.0 + ((lag - own) / STEP) ** 2 for lag in (-STEP, 0.0, STEP)]


@pytest.mark.parametrize("delay", [-3e-3, -0.4e-3, 0.0, 2e-3])
def test_the_delay_of_a_parabola_is_found(delay: float) -> None:
    assert relative_delay(*innovations(delay), dt=DT) == pytest.approx(delay, abs=1e-12)


def test_a_delay_is_believed_as_far_as_it_is_certain() -> None:
    scatter = 4e-3
    deviation = scatter / np.sqrt(10.0)
    expected = 2e-3 / (1.0 + (deviation / PRIOR) ** 2)
    assert relative_delay(*innovations(2e-3, scatter), dt=DT) == pytest.approx(expected, rel=1e-12)


def test_what_is_no_delay_is_none() -> None:
    assert relative_delay(*innovations(1.1 * LARGEST), dt=DT) == 0.0
    assert relative_delay(*innovations(2e-3, length=2 * round(SECTION / DT)), dt=DT) == 0.0
    before, now, after = innovations(2e-3)
    assert relative_delay(-before, -now, -after, dt=DT) == 0.0
    missing = np.full(LENGTH, np.nan)
    assert relative_delay(missing, missing, missing, dt=DT) == 0.0


def test_sequences_of_a_batch_tell_one_delay() -> None:
    pairs = zip(innovations(1e-3), innovations(3e-3), strict=True)
    assert relative_delay(*(np.stack(pair, axis=1) for pair in pairs), dt=DT) == pytest.approx(2e-3, rel=0.2)


def test_a_late_accelerometer_is_found_and_smoothing_gains_by_it() -> None:
    hand = simulate_hand("severe", 2, rate=100.0, duration=60.0)
    time, late = hand.time, 3e-3
    force = np.stack([np.interp(time - late, time, column) for column in hand.measurements["imu/acc"].T], axis=1)
    data = {"imu/gyr": np.asarray(hand.measurements["imu/gyr"]), "imu/acc": force}
    model = BoundedMotion(dt=hand.dt)

    def nis(equations: Model, samples: Measurement) -> np.ndarray:
        return np.asarray(KalmanFilter(equations).run(samples).nis)

    def error(estimate: object) -> float:
        return float(np.sqrt(np.mean(metrics.direction_error(estimate.pose["up"], hand.truth["up"])[500:] ** 2)))

    assert model.fitted(data, nis).accelerometer_lag == pytest.approx(late, abs=1e-3)
    assert error(Offline(KalmanFilter(model)).run(data)) < 0.8 * error(KalmanFilter(model).smooth(data))
    chosen = replace(model, accelerometer_lag=1e-3)
    assert chosen.fitted(data, nis) is chosen


def test_merged_samples_turn_into_the_same_velocity_as_those_that_they_were() -> None:
    hand = simulate_hand("severe", 1, rate=300.0, duration=10.0)
    data = {name: np.asarray(hand.measurements[name]) for name in ("imu/gyr", "imu/acc")}
    samples, interval = merged(data, 0.0175, hand.dt)
    assert interval == pytest.approx(5.0 * hand.dt)

    def velocity(part: dict[str, np.ndarray], dt: float) -> np.ndarray:
        turns = rotation.exp(dt * part["imu/gyr"])
        half = rotation.exp(0.5 * dt * part["imu/gyr"])
        q, v = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        for turn, middle, force in zip(turns, half, part["imu/acc"], strict=True):
            v = v + dt * rotation.rotate(rotation.multiply(q, middle), force)
            q = rotation.multiply(q, turn)
        return v

    whole = {name: values[: 5 * len(samples["imu/gyr"])] for name, values in data.items()}
    assert np.abs(velocity(samples, interval) - velocity(whole, hand.dt)).max() < 0.1


def test_long_recordings_are_looked_at_where_they_are_lively_and_zeros_are_no_samples() -> None:
    count = round((LONGEST + 60.0) / DT)
    data = {"imu/gyr": np.full((count, 3), 0.01), "imu/acc": np.tile([0.0, 0.0, 9.81], (count, 1))}
    data["imu/gyr"][-1000:] = [3.0, 0.0, 0.0]
    data["imu/acc"][-2] = 0.0
    samples, interval = merged(data, 0.0, DT)
    assert interval == DT
    assert len(samples["imu/gyr"]) == round(LONGEST / DT)
    assert samples["imu/gyr"][-1].tolist() == [3.0, 0.0, 0.0]
    assert np.isnan(samples["imu/acc"][-2]).all()
