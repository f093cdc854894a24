"""One triaxial accelerometer out of an array, for filters that know of nothing else."""

from __future__ import annotations

import numpy as np

from ..core.backend import Array, constant
from .array import AccelerometerArray


def array_to_imu(array: AccelerometerArray, readings: Array) -> Array:
    """Specific force at the array's reference point ``(..., 3)``, m/s², body axes, by least squares.

    An array of full rank separates it from angular acceleration and rates (ẑ = A⁺â). One of lower rank is taken as if
    it did not turn (A_P⁺â), which is right where the contributions of turning cancel, as in the controller: its two
    accelerometers sit opposite each other.

    Args:
        array: a spatial one.
        readings: ``(..., m)``, m/s²; NaN in any gives NaN.

    Raises:
        ValueError: the array is planar, or its axes do not span space.
    """
    return (constant(force_matrix(array), readings) @ readings[..., None])[..., 0]


def force_matrix(array: AccelerometerArray) -> np.ndarray:
    """The matrix ``(3, m)`` of :func:`array_to_imu`.

    Raises:
        ValueError: as there.
    """
    if array.dimension != 3:
        raise ValueError(f"array must be spatial, got the planar array {array.name!r}")
    if array.rank == array.A.shape[1]:
        return array.pseudo_inverse[:3]
    if np.linalg.matrix_rank(array.A_P) < 3:
        raise ValueError(f"axes of the array {array.name!r} must span space, got {array.axes}")
    return np.linalg.pinv(array.A_P)
