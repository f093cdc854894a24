"""Heading from a magnetometer: what the magnetic filters share.

Only the horizontal part of the field is used, and only its direction: the unit of the magnetometer does not matter, and
an error of the field never reaches the inclination directly. Magnetic north lies ``declination`` radians east of
geographic north (+y of the world).

Reference for the test of disturbances by norm and dip: D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation
estimation with bias estimation and magnetic disturbance rejection", Information Fusion 91, 2023,
doi 10.1016/j.inffus.2022.10.014, section 3.4 (here with one slowly following reference instead of candidates).
"""

from __future__ import annotations

from .backend import Array, expand, namespace
from .rotation import from_axis_angle, level, multiply, norm, rotate, wrap


def heading_error(q: Array, field: Array, declination: Array) -> Array:
    """Angle ``(..., 1)`` about the upward vertical by which ``q`` must still be turned for the field to point north.

    Args:
        q: orientation, sensor to world ``(..., 4)``.
        field: magnetometer sample in sensor coordinates ``(..., 3)``, any unit; NaN gives NaN.
        declination: of the magnetic field, rad, positive east: number or ``(...)``.
    """
    xp = namespace(q)
    world = rotate(q, field)
    return wrap(0.5 * xp.pi - expand(declination, 1) - xp.atan2(world[..., 1:2], world[..., :1]))


def turn_heading(q: Array, angle: Array) -> Array:
    """The orientation ``q`` ``(..., 4)`` turned by ``angle`` ``(..., 1)`` about the upward vertical of the world."""
    xp = namespace(q)
    zero = 0.0 * angle
    return multiply(from_axis_angle(xp.concat([zero, zero, zero + 1.0], axis=-1), angle[..., 0]), q)


def align(specific_force: Array, field: Array, declination: Array) -> Array:
    """Orientation ``(..., 4)`` at rest: inclination from the accelerometer, heading from the magnetometer."""
    q = level(specific_force)
    return turn_heading(q, heading_error(q, field, declination))


def norm_and_dip(q: Array, field: Array) -> Array:
    """Norm of the field, and its dip below the horizontal in rad, as ``(..., 2)``."""
    xp = namespace(q)
    world = rotate(q, field)
    horizontal = xp.sqrt(world[..., :1] * world[..., :1] + world[..., 1:2] * world[..., 1:2])
    return xp.concat([norm(field), -xp.atan2(world[..., 2:3], horizontal)], axis=-1)


def is_disturbed(measured: Array, reference: Array, norm_tolerance: Array, dip_tolerance: Array) -> Array:
    """Whether a field ``(..., 2)`` of :func:`norm_and_dip` is off the reference, ``(..., 1)``.

    Args:
        measured: norm and dip of the sample.
        reference: norm and dip that are expected.
        norm_tolerance: relative deviation of the norm that is still accepted.
        dip_tolerance: deviation of the dip that is still accepted, rad.
    """
    xp = namespace(measured, reference)
    deviation = xp.abs(measured - reference)
    return xp.logical_or(
        xp.greater(deviation[..., :1], expand(norm_tolerance, 1) * reference[..., :1]),
        xp.greater(deviation[..., 1:], expand(dip_tolerance, 1)),
    )


def follow(reference: Array, measured: Array, dt: Array, time: Array) -> Array:
    """The reference ``(..., 2)`` after one sample: a first-order lag of ``time`` seconds; unchanged by NaN."""
    xp = namespace(reference)
    share = expand(dt / (dt + time), 1)
    moved = reference + share * (measured - reference)
    return xp.where(xp.isfinite(moved), moved, reference)
