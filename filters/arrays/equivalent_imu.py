"""Conversion of an array to one triaxial accelerometer, for filters of a single IMU."""

from __future__ import annotations

import numpy as np

from ..core.backend import Array, constant
from ..core.matrices import times
from .array import AccelerometerArray


def array_to_imu(array: AccelerometerArray, readings: Array) -> Array:
    """Specific force at the array's reference point ``(..., 3)``, m/s², body axes, by least squares.

    An array of full rank separates it from angular acceleration and rates (ẑ = A⁺â). For an array of lower rank the
    rotation is neglected (A_P⁺â). This is exact where its contributions cancel, as in the controller, whose two
    accelerometers are placed symmetrically.

    Args:
        array: a spatial one.
        readings: ``(..., m)``, m/s²; NaN in any gives NaN.

    Raises:
        ValueError: the array is planar, or its axes do not span space.
    """
    return times(constant(force_matrix(array), readings), readings)


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
