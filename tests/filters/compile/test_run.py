"""Printing and running of equations; equality with the array form is in test_contracts."""

import pickle
import subprocess
import sys
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from poise.filters.compile import kernel
from poise.filters.compile import run as compiled
from poise.filters.compile.printer import print_model
from poise.filters.core.backend import constant
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model, parameters_of, structure_of
from poise.filters.core.quantity import ACCELEROMETER, GYROSCOPE, UP
from poise.filters.core.recursion import correct
from poise.filters.imu.external_acceleration import ExternalAcceleration


@pytest.fixture(scope="module")
def measurements():
    generator = np.random.default_rng(0)
    force = generator.standard_normal((50, 4, 3)) + np.array([0.0, 0.0, 9.8])
    return {"imu/gyr": generator.standard_normal((50, 4, 3)), "imu/acc": force}


def test_tunings_share_one_compiled_form(measurements):
    one = compiled.compiled_equations(ExternalAcceleration())
    assert compiled.compiled_equations(ExternalAcceleration(c_a=0.3, dt=0.02)) is one
    assert structure_of(ExternalAcceleration(mode=3)) != structure_of(ExternalAcceleration())
    for c_a in (0.0, 0.3):
        kalman = KalmanFilter(ExternalAcceleration(c_a=c_a))
        arrays = replace(kalman, compiled=False)
        np.testing.assert_allclose(
            kalman.run(measurements).pose["up"], arrays.run(measurements).pose["up"], rtol=0, atol=1e-12
        )


def test_threads_do_not_change_the_numbers(measurements, monkeypatch):
    kalman = KalmanFilter(ExternalAcceleration())
    alone = kalman.run(measurements)
    monkeypatch.setattr(compiled, "PARALLEL_WORK", 1)
    monkeypatch.setattr(compiled, "processors", lambda: 3)
    shared = kalman.run(measurements, {"measurement": np.zeros((50, 4))})
    for one, other in zip((alone.pose["up"], *alone[1:]), (shared.pose["up"], *shared[1:]), strict=True):
        np.testing.assert_array_equal(one, other)


def test_models_and_filters_survive_pickling(measurements):
    kalman = KalmanFilter(ExternalAcceleration(c_a=0.2))
    parameters_of(kalman.model)
    again = pickle.loads(pickle.dumps(kalman))
    np.testing.assert_array_equal(again.run(measurements).pose["up"], kalman.run(measurements).pose["up"])


def test_the_kernel_is_the_array_form_also_with_rows_left_out():
    generator = np.random.default_rng(1)
    for usable in ([True] * 4, [True, False, True, False], [False] * 4):
        e, m = 5, 4
        root = generator.standard_normal((e, e))
        P, H = root @ root.T, generator.standard_normal((m, e))
        noise = generator.standard_normal((m, m))
        R, r = noise @ noise.T + np.eye(m), generator.standard_normal(m)
        r[~np.array(usable)] = np.nan
        dx, expected, white = correct(P, r, H, R)
        outputs = np.empty(e), np.empty(m)
        covariance = P.copy()
        scratch = np.zeros(m, np.int64), np.empty((m, m)), np.empty((m, e)), np.empty((m, e))
        lists = np.arange(0, m * e + 1, e), np.tile(np.arange(e), m)
        nis = kernel.correct(r, H, R, covariance, *outputs, *scratch, *lists)
        np.testing.assert_allclose(covariance, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(outputs[0], dx, rtol=0, atol=1e-12)
        np.testing.assert_allclose(outputs[1], white, rtol=0, atol=1e-12)
        assert nis == pytest.approx(np.sum(white**2), abs=1e-12)
        used = np.flatnonzero(usable)
        np.testing.assert_array_equal(scratch[0], np.append(used, np.full(m - len(used), -1)))


def test_zeros_that_are_skipped_change_nothing():
    generator = np.random.default_rng(2)
    e = 6
    root = generator.standard_normal((e, e))
    P, Q = root @ root.T, np.diag(generator.random(e))
    F = np.where(generator.random((e, e)) < 0.4, generator.standard_normal((e, e)), 0.0)
    moved = P.copy()
    first = np.append(0, np.cumsum(np.count_nonzero(F, axis=1)))
    kernel.propagate(F, moved, Q, np.empty((e, e)), first, np.nonzero(F)[1])
    np.testing.assert_allclose(moved, F @ P @ F.T + Q, rtol=0, atol=1e-12)


@dataclass(frozen=True)
class Misshapen(Model):
    """A model whose prediction has a wrong shape."""

    channels: ClassVar = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar = (UP,)
    state_size: ClassVar = 3
    error_size: ClassVar = 3
    residual_size: ClassVar = 3

    def prior(self, z):
        return z["imu/acc"], constant(np.eye(3), z["imu/acc"])

    def predict(self, x, z, previous):
        return x, constant(np.eye(2), x), constant(np.eye(3), x)

    def residual(self, x, z):
        return z["imu/acc"] - x, constant(np.eye(3), x), constant(np.eye(3), x)

    def pose(self, x):
        return {"up": x}


def test_equations_of_wrong_shape_are_named():
    with pytest.raises(ValueError, match=r"Misshapen\.predict: F must have shape \(3, 3\), got \(2, 2\)"):
        print_model(Misshapen())


def test_parameters_must_be_finite_and_intervals_positive():
    with pytest.raises(ValueError, match=r"gyroscope_noise must be a finite number .*got nan"):
        ExternalAcceleration(gyroscope_noise=float("nan"))
    with pytest.raises(ValueError, match="dt must be positive"):
        ExternalAcceleration(dt=0.0)
    assert parameters_of(ExternalAcceleration(dt=1))["dt"] == 1.0


def test_importing_the_filters_compiles_nothing():
    code = "import sys, poise.filters.core.kalman, poise.filters.registry; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_state_of_another_batch_is_refused(measurements):
    kalman = KalmanFilter(ExternalAcceleration())
    single = kalman.init({name: array[0, 0] for name, array in measurements.items()})
    with pytest.raises(ValueError, match=r"state is of batch shape \(\), the samples are of \(4,\)"):
        kalman.step(single, {name: array[0] for name, array in measurements.items()})
    with pytest.raises(ValueError, match=r"state is of batch shape \(\), the samples are of \(4,\)"):
        kalman.run_from(single, measurements)
