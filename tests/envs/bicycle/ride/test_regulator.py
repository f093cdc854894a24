"""The Riccati equation against SciPy, for the models of pilots."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE, RigidPart
from poise.envs.bicycle.frame.whipple import whipple_model
from poise.envs.bicycle.ride.regulator import exponential, lateral_model, riccati, sampled

LOADED = MOUNTAIN_BIKE.with_load(RigidPart(70.0, (0.33, 0.0, 1.12), (6.0, 6.5, 1.5, 0.3)))


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0, 7.0])
def test_riccati_solution_is_that_of_scipy(speed):
    A, B = sampled(*lateral_model(whipple_model(LOADED), LOADED, speed), 0.004)
    cost, effort = 0.004 * np.diag([20.0, 5.0, 2.0, 0.2, 4.0, 1.0, 0.3]), np.array([[2e-4]])
    found, wanted = riccati(A, B, cost, effort), solve_discrete_are(A, B, cost, effort)
    np.testing.assert_allclose(found, wanted, rtol=1e-7, atol=1e-9 * np.abs(wanted).max())
    gain = np.linalg.solve(effort + B.T @ found @ B, B.T @ found @ A)
    assert np.abs(np.linalg.eigvals(A - B @ gain)).max() < 1.0


def test_a_system_that_no_input_stabilises_is_refused():
    with pytest.raises(ValueError, match="no stabilising solution"):
        riccati(np.diag([1.5, 0.5]), np.array([[0.0], [1.0]]), np.eye(2), np.eye(1))


def test_the_exponential_is_scipy_s():
    rng = np.random.default_rng(0)
    for size, scale in ((3, 0.01), (8, 1.0), (14, 5.0)):
        matrix = scale * rng.normal(size=(size, size))
        expected = expm(matrix)
        np.testing.assert_allclose(exponential(matrix), expected, rtol=1e-11, atol=1e-13 * np.abs(expected).max())
    np.testing.assert_array_equal(exponential(np.zeros((2, 2))), np.eye(2))


def test_a_regulator_is_the_same_whatever_the_number_of_threads():
    code = (
        "import hashlib, numpy as np\n"
        "from poise.envs.bicycle.ride.regulator import riccati, sampled\n"
        "rng, found = np.random.default_rng(0), hashlib.sha256()\n"
        "for _ in range(50):\n"
        "    A, B = sampled(rng.normal(size=(13, 13)), rng.normal(size=(13, 1)), 0.01)\n"
        "    found.update(A.tobytes() + B.tobytes() + riccati(A, B, np.eye(13), np.eye(1)).tobytes())\n"
        "print(found.hexdigest())\n"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads),
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    }
    assert len(found) == 1
