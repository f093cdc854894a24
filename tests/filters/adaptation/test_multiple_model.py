"""A bank of tunings: its probabilities are those of filterpy's, and it finds the right tuning."""

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from poise.filters.adaptation.multiple_model import MultipleModel, bank_of
from poise.filters.core.backend import constant, expand, namespace
from poise.filters.core.estimator import run_by_steps
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Gain, Model
from poise.filters.core.quantity import Channel, Quantity


@dataclass(frozen=True)
class Level(Model):
    """A level that wanders, read with noise."""

    walk: float = 0.1
    noise: float = 1.0

    channels: ClassVar = (Channel("tank/level", 1, "m"),)
    outputs: ClassVar = (Quantity("level", "vector", 1, "m"),)
    state_size: ClassVar = 1
    error_size: ClassVar = 1
    residual_size: ClassVar = 1
    gains: ClassVar = {"process": Gain("walk"), "measurement": Gain("noise")}

    def prior(self, z):
        level = z["tank/level"]
        return level, 1.0 + 0.0 * level[..., None]

    def predict(self, x, z, previous):
        one = 1.0 + 0.0 * x[..., None]
        return x, one, expand(self.walk**2, 2) * one

    def residual(self, x, z):
        one = constant([[1.0]], x) + 0.0 * x[..., None]
        return z["tank/level"] - x, one, expand(self.noise**2, 2) * one

    def pose(self, x):
        return {"level": namespace(x).concat([x], axis=-1)}


FACTORS = ((0.0, 0.0), (3.0, 0.0), (0.0, 3.0))


def readings(walk=0.1, noise=1.0, length=400):
    rng = np.random.default_rng(3)
    level = np.cumsum(walk * rng.standard_normal(length))
    return level, {"tank/level": (level + noise * rng.standard_normal(length))[:, None]}


def test_a_linear_bank_equals_that_of_filterpy():
    filterpy = pytest.importorskip("filterpy.kalman")
    _, measurements = readings()
    z = measurements["tank/level"][:, 0]
    bank = MultipleModel(KalmanFilter(Level()), ("process", "measurement"), FACTORS, stay=1e12)
    ours = bank.run(measurements).pose["level"][:, 0]
    filters = []
    for process, measurement in FACTORS:
        one = filterpy.KalmanFilter(dim_x=1, dim_z=1)
        one.x, one.P, one.F, one.H = np.array([[z[0]]]), np.eye(1), np.eye(1), np.eye(1)
        one.Q, one.R = 0.01 * np.exp(process) * np.eye(1), np.exp(measurement) * np.eye(1)
        filters.append(one)
    theirs = filterpy.MMAEFilterBank(filters, [1 / 3] * 3, dim_x=1, H=np.eye(1))
    found = [z[0]]
    for sample in z[1:]:
        theirs.predict()
        theirs.update(sample)
        found.append(float(np.ravel(theirs.x)[0]))
    np.testing.assert_allclose(ours, found, rtol=1e-9)


def test_the_probability_goes_to_the_tuning_of_the_data():
    level, measurements = readings(walk=0.1 * np.exp(1.5))
    bank = MultipleModel(KalmanFilter(Level()), ("process", "measurement"), FACTORS, stay=100.0)
    estimate, state = bank.run_from(None, measurements)
    assert state.weights.argmax() == 1
    assert state.weights[1] > 0.9
    plain = KalmanFilter(Level()).run(measurements).pose["level"]
    assert np.abs(estimate.pose["level"][:, 0] - level).mean() < 0.9 * np.abs(plain[:, 0] - level).mean()


def test_stepping_equals_running_also_side_by_side():
    _, measurements = readings(length=30)
    both = {"tank/level": np.stack([measurements["tank/level"], measurements["tank/level"] ** 2], axis=1)}
    bank = bank_of(KalmanFilter(Level()), levels=(-0.5, 0.5))
    assert len(bank.factors) == 4
    run = bank.run(both).pose["level"]
    np.testing.assert_array_equal(run_by_steps(bank, both).pose["level"], run)
    np.testing.assert_allclose(bank.run(measurements).pose["level"], run[:, 0], rtol=1e-12)


def test_wrong_arguments_are_explained():
    kalman = KalmanFilter(Level())
    with pytest.raises(ValueError, match="gains must be among"):
        MultipleModel(kalman, ("belief",), ((0.0,),))
    with pytest.raises(ValueError, match="factors must hold rows of 1"):
        MultipleModel(kalman, ("process",), ())
    with pytest.raises(ValueError, match="stay must be positive seconds"):
        dataclasses.replace(MultipleModel(kalman, ("process",), ((0.0,),)), stay=0.0)
