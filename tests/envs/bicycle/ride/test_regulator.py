"""The Riccati equation against SciPy, for the models of pilots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE, RigidPart
from poise.envs.bicycle.frame.whipple import whipple_model
from poise.envs.bicycle.ride.regulator import lateral_model, riccati, sampled

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
