"""Registry of the accelerometer arrays of the thesis; :mod:`.arrays.geometry` defines what an array is.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; sections 2.3 (OCTA), 3.1 (planar controller), 4.1 and 4.2 (controller).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ..core.quantity import ACCELEROMETER, Channel
from .geometry import AccelerometerArray, PlanarArray


def controller(half_length: float = 0.12) -> AccelerometerArray:
    """The controller with a triaxial accelerometer at either end, ``half_length`` m from its middle along y.

    The thesis gives 0.12 m (section 4.1) and 0.15 m (section 4.2, and half of the length of 0.3 m). The rank is 6, so a
    gyroscope is needed.
    """
    e = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, 1))
    r = (*((0, half_length, 0),) * 3, *((0, -half_length, 0),) * 3)
    return AccelerometerArray(r, e, "controller")


def planar_controller(half_length: float = 0.15) -> PlanarArray:
    """The planar controller: a biaxial accelerometer at either end, ``half_length`` m from its middle along y."""
    r = (*((0, half_length),) * 2, *((0, -half_length),) * 2)
    return PlanarArray(r, ((1, 0), (0, 1)) * 2, "planar")


def recorded_channel(array: AccelerometerArray) -> Channel:
    """Channel of the readings in recordings: ``imu/acc`` for one triaxial accelerometer, else that of the array.

    A triaxial accelerometer has three axes along x, y, z at one point, within the tolerances of a chip (5° and 2 cm).
    One with calibrated axes therefore still counts.
    """
    if array.dimension != 3 or array.size != 3:
        return array.channel
    together = np.ptp(array.r, axis=0).max() < 0.02
    return ACCELEROMETER if together and np.diag(array.e).min() > math.cos(math.radians(5.0)) else array.channel


OCTA = AccelerometerArray(
    positions=(
        *((0.197, 0.001, 0.006),) * 2,
        *((-0.045, -0.039, -0.030),) * 2,
        *((0.112, -0.033, -0.121),) * 2,
        *((0.067, 0.0, 0.126),) * 2,
        *((0.073, 0.090, -0.028),) * 2,
        *((0.112, -0.164, 0.004),) * 2,
    ),
    axes=(
        *((1, 0, 0), (0, 0, -1)),
        *((-1, 0, 0), (0, 1, 0)),
        *((0, 0, -1), (0, 1, 0)),
        *((0, 0, 1), (1, 0, 0)),
        *((0, 1, 0), (1, 0, 0)),
        *((0, -1, 0), (0, 0, -1)),
    ),
    name="octa",
)
"""OCTA: twelve uniaxial accelerometers, six biaxial chips. A is square and regular: no redundancy, no residual."""

CONTROLLER = controller()
"""Two triaxial accelerometers 0.24 m apart."""

PLANAR = planar_controller()
"""Two biaxial accelerometers 0.3 m apart, AᵀA = diag(2, 2, 2r², 2r²)."""

TRIAXIAL = AccelerometerArray(((0, 0, 0),) * 3, ((1, 0, 0), (0, 1, 0), (0, 0, 1)), "triaxial")
"""The accelerometer of one IMU."""

ARRAYS: Mapping[str, AccelerometerArray] = MappingProxyType(
    {array.name: array for array in (OCTA, CONTROLLER, PLANAR, TRIAXIAL)}
)
"""Name → array."""
