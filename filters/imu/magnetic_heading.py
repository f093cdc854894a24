"""Heading from a magnetometer: what the nine-axis filters share.

Only the direction of the horizontal field component is used. The unit of the magnetometer therefore does not matter,
and an error of the field does not affect the inclination directly. Magnetic north lies ``declination`` radians east of
geographic north (+y of the world).

Disturbances are detected by norm and dip as in D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation
estimation with bias estimation and magnetic disturbance rejection", Information Fusion 91, 2023,
doi 10.1016/j.inffus.2022.10.014, section 3.4, here with one slowly adapting reference instead of candidates.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..core.backend import Array, constant, expand, namespace
from ..core.model import Model
from ..core.quantity import Measurement
from ..core.rotation import conjugate, from_axis_angle, level, multiply, norm, rotate, wrap


def heading_error(q: Array, field: Array, declination: Array) -> Array:
    """Angle ``(..., 1)`` about the vertical by which ``q`` must be rotated for the field to point north.

    Args:
        q: orientation, sensor to world ``(..., 4)``.
        field: magnetometer sample in sensor coordinates ``(..., 3)``, any unit; NaN gives NaN.
        declination: of the magnetic field, rad, positive east: number or ``(...)``.
    """
    xp = namespace(q)
    world = rotate(q, field)
    return wrap(0.5 * xp.pi - expand(declination, 1) - xp.atan2(world[..., 1:2], world[..., :1]))


def turn_heading(q: Array, angle: Array) -> Array:
    """The orientation ``q`` ``(..., 4)`` rotated by ``angle`` ``(..., 1)`` about the vertical (up) of the world."""
    xp = namespace(q)
    zero = 0.0 * angle
    return multiply(from_axis_angle(xp.concat([zero, zero, zero + 1.0], axis=-1), angle[..., 0]), q)


def heading_between(q: Array, other: Array) -> Array:
    """Heading of an orientation ``(..., 4)`` less that of another, ``(..., 1)`` rad: that of ``q ⊗ other⁻¹``."""
    turn = multiply(q, conjugate(other))
    return wrap(2.0 * namespace(turn).atan2(turn[..., 3:], turn[..., :1]))


def align(specific_force: Array, field: Array, declination: Array) -> Array:
    """Orientation ``(..., 4)`` at rest: inclination from the accelerometer, heading from the magnetometer."""
    q = level(specific_force)
    return turn_heading(q, heading_error(q, field, declination))


def field_direction(declination: Array, dip: Array, like: Array) -> Array:
    """Unit vector of a magnetic field in the world (east, north, up), ``(..., 3)``.

    Args:
        declination: rad, positive east: number or ``(...)``.
        dip: below the horizontal, rad: number or ``(...)``.
        like: an array ``(..., n)`` with the desired batch shape.
    """
    xp, zero = namespace(like), 0.0 * like[..., :1]
    east, below = zero + expand(declination, 1), zero + expand(dip, 1)
    return xp.concat([xp.cos(below) * xp.sin(east), xp.cos(below) * xp.cos(east), -xp.sin(below)], axis=-1)


def norm_and_dip(q: Array, field: Array) -> Array:
    """Norm of the field, and its dip below the horizontal in rad, as ``(..., 2)``."""
    xp = namespace(q)
    world = rotate(q, field)
    horizontal = xp.sqrt(world[..., :1] * world[..., :1] + world[..., 1:2] * world[..., 1:2])
    return xp.concat([norm(field), -xp.atan2(world[..., 2:3], horizontal)], axis=-1)


def is_disturbed(measured: Array, reference: Array, norm_tolerance: Array, dip_tolerance: Array) -> Array:
    """Whether a field ``(..., 2)`` of :func:`norm_and_dip` deviates from the reference, ``(..., 1)``.

    Args:
        measured: norm and dip of the sample.
        reference: expected norm and dip.
        norm_tolerance: largest accepted relative deviation of the norm.
        dip_tolerance: largest accepted deviation of the dip, rad.
    """
    xp = namespace(measured, reference)
    deviation = xp.abs(measured - reference)
    return xp.logical_or(
        xp.greater(deviation[..., :1], expand(norm_tolerance, 1) * reference[..., :1]),
        xp.greater(deviation[..., 1:], expand(dip_tolerance, 1)),
    )


def follow(reference: Array, measured: Array, dt: Array, time: Array) -> Array:
    """The reference ``(..., 2)`` after one sample: a first-order lag of ``time`` seconds."""
    return reference + expand(dt / (dt + time), 1) * (measured - reference)


def known(sample: Array) -> tuple[Array, Array]:
    """A sample ``(..., 3)`` with ones where it is missing, and whether it is valid ``(..., 1)``.

    Results from a missing sample are discarded later, but a NaN in them would make gradients NaN.
    """
    xp = namespace(sample)
    there = xp.all(xp.isfinite(sample), axis=-1)[..., None]
    return xp.where(there, sample, xp.ones_like(sample)), there


LARGEST_NORM = 10.0
"""Norm of a sample, in expected ones, as which a larger one counts for the expectation."""


@dataclass(frozen=True)
class MagneticHeading(Model):
    """Mix-in that adds the heading to a six-axis model; it must be the first base class.

    The other base has the orientation in the first four elements of its state and the rotation error in world axes in
    the first three of its error, and passes on the elements after its own. The mix-in appends two elements to the state
    (expected norm and dip of the field) and one row to the residual (heading error). The filter starts at the first
    sample at which the magnetometer, too, has had a valid one.

    The row has no entry for the inclination. Heading and gyroscope bias are correlated, so the bias about the vertical
    is estimated. An undetected disturbance of the field therefore affects the bias and, slowly, the inclination.

    A sample whose norm or dip deviates too far from the expected one is rejected. The expected values follow all
    samples, rejected ones more slowly.
    """

    magnetometer_noise: float = 0.1
    """σ_m, rad/√Hz: density of the error of the magnetic heading"""
    heading_prior: float = 0.1
    """rad"""
    declination: float = 0.0
    """of the magnetic field, rad, positive east; with 0 the heading refers to magnetic north"""
    norm_tolerance: float = 0.1
    """relative deviation from the expected norm beyond which a sample is rejected; 1e3: never"""
    dip_tolerance: float = 0.175
    """rad: the same for the dip (10°)"""
    field_time: float = 20.0
    """s: time constant with which the expected norm and dip follow accepted samples"""
    new_field_time: float = 100.0
    """s: the same for rejected samples, so that the field of a new place is eventually accepted"""

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """The prior of the six-axis model, rotated to magnetic north."""
        x, P = super().prior(z)
        q, field = x[..., :4], z["imu/mag"]
        q = turn_heading(q, heading_error(q, field, self.declination))
        size = self.error_size
        heading = constant([[float(i == j == 2) for j in range(size)] for i in range(size)], P)
        P = P * (1.0 - heading) + expand(self.heading_prior**2, 2) * heading
        return namespace(x).concat([q, x[..., 4:], norm_and_dip(q, field)], axis=-1), P

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """The rows of the six-axis model, and the heading error unless the field is disturbed."""
        xp = namespace(x)
        r, H, R = super().residual(x, z)
        q, (field, there) = x[..., :4], known(z["imu/mag"])
        angle = heading_error(q, field, self.declination)
        disturbed = is_disturbed(norm_and_dip(q, field), x[..., -2:], self.norm_tolerance, self.dip_tolerance)
        angle = xp.where(xp.logical_and(there, xp.logical_not(disturbed)), angle, xp.nan + 0.0 * angle)
        zero = 0.0 * x[..., :1, None]
        row = zero + constant([[float(j == 2) for j in range(self.error_size)]], x)
        column = zero + constant([[0.0] for _ in range(self.residual_size - 1)], x)
        variance = zero + expand(self.magnetometer_noise**2 / self.dt, 2)
        lower = xp.concat([column.mT, variance], axis=-1)
        R = xp.concat([xp.concat([R, column], axis=-1), lower], axis=-2)
        return xp.concat([r, angle], axis=-1), xp.concat([H, row], axis=-2), R

    def finish(self, x: Array, z: Measurement) -> Array:
        """Let the expected field follow the measured one."""
        x = super().finish(x, z)
        xp, expected = namespace(x), x[..., -2:]
        field, there = known(z["imu/mag"])
        measured = norm_and_dip(x[..., :4], field)
        disturbed = is_disturbed(measured, expected, self.norm_tolerance, self.dip_tolerance)
        # One absurd sample must not move what is expected for minutes.
        bounded = xp.minimum(measured[..., :1], LARGEST_NORM * expected[..., :1])
        measured = xp.concat([bounded, measured[..., 1:]], axis=-1)
        near = follow(expected, measured, self.dt, self.field_time)
        followed = xp.where(disturbed, follow(expected, measured, self.dt, self.new_field_time), near)
        return xp.concat([x[..., :-2], xp.where(there, followed, expected)], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """The outputs of the six-axis model, with the orientation in the world."""
        pose = super().pose(x)
        pose["orientation"] = pose.pop("relative_orientation")
        return pose
