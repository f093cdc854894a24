"""One triaxial accelerometer out of an array."""

from __future__ import annotations

import numpy as np
import pytest

from poise.filters.arrays.array import CONTROLLER, OCTA, PLANAR, TRIAXIAL, AccelerometerArray
from poise.filters.arrays.equivalent_imu import array_to_imu, force_matrix


@pytest.mark.parametrize("array", [OCTA, CONTROLLER, TRIAXIAL], ids=lambda array: array.name)
def test_turning_does_not_reach_the_force(array: AccelerometerArray) -> None:
    rng = np.random.default_rng(1)
    force, alpha, rate = rng.normal(0.0, 10.0, (3, 50, 3))
    readings = array.readings(force, alpha, rate)
    np.testing.assert_allclose(array_to_imu(array, readings), force, atol=1e-10)


def test_the_noise_of_octa_is_that_of_its_geometry() -> None:
    np.testing.assert_allclose(np.linalg.norm(force_matrix(OCTA), axis=1), OCTA.noise_gains[:3], rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(force_matrix(CONTROLLER), axis=1), np.sqrt(0.5))


def test_what_cannot_tell_a_force_is_refused() -> None:
    with pytest.raises(ValueError, match="planar array 'planar'"):
        array_to_imu(PLANAR, np.zeros(4))
    flat = AccelerometerArray([[0, 0, 0]] * 3, [[1, 0, 0], [0, 1, 0], [1, 0, 0]], "flat")
    with pytest.raises(ValueError, match="must span space"):
        force_matrix(flat)
