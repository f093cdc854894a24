r"""Pointing direction of the game controller, and a bound on the error of a tilt sensor, as in the thesis.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval, sections 5.3.1 and 5.3.2. The controller points along its y axis; world x east, y north, z up.

Errata: in (5.48) and (5.49) the entry −cos θ sin ψ must be +cos θ sin ψ, so that the matrix is a rotation
and agrees with the targets (5.50); the bound (5.63) of a tilt sensor is an arcsine.
"""

from __future__ import annotations

import numpy as np

from ...core.backend import Array, namespace
from ...core.quantity import GRAVITY
from ...core.rotation import rotate


def pointing_angles(q: Array) -> tuple[Array, Array]:
    """Pitch θ = arcsin e_z and azimuth ψ = atan2(e_x, e_y) ``(...)``, rad, of the body's y axis e in the world.

    The azimuth is measured from north (+y) towards east (+x); ``q`` ``(..., 4)`` rotates from body to world.
    """
    xp = namespace(q)
    e = rotate(q, 0.0 * q[..., 1:] + xp.asarray([0.0, 1.0, 0.0], dtype=q.dtype))
    return xp.atan2(e[..., 2], xp.sqrt(e[..., 0] ** 2 + e[..., 1] ** 2)), xp.atan2(e[..., 0], e[..., 1])


def tilt_error_bound(acceleration: Array, gravity: float = GRAVITY) -> Array:
    """Largest error ``(...)`` of the inclination, rad, if an accelerometer reading is assumed to be gravity.

    arcsin(|b̈| / g) (5.63), reached where b̈ is perpendicular to the *reading*; the published arctangent applies
    where b̈ is perpendicular to gravity. π where |b̈| exceeds g, since the error is then unbounded.

    Args:
        acceleration: b̈ ``(..., 3)``, m/s², any axes.
        gravity: g, m/s².
    """
    xp = namespace(acceleration)
    ratio = xp.sqrt(xp.sum(acceleration * acceleration, axis=-1)) / gravity
    bounded = xp.less_equal(ratio, 1.0)
    return xp.where(bounded, xp.asin(xp.where(bounded, ratio, 0.0 * ratio)), 0.0 * ratio + np.pi)
