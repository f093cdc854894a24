"""Forces of the force/inertial filter: readings of the seat's sensors, and loads that the rider's motion requires.

Frames are those of :mod:`.force_inertial.kinematics` (z down); loads are those of the rider on seat and handlebar.

**Measured load.** The load cells give the centre of pressure. (10) shifts the load of the six-axis sensor there, and
(11) and (12) shift it on to the trunk's pivot P. The centre of pressure then cancels: the moment about P is that of the
six-axis sensor for any reading of the load cells. (This does not hold with the published sign of (12), where R_z x_C
counts twice.) Missing load cells and their noise therefore have no effect.

**Required load.** Newton–Euler for everything on the seat, about P, with f = a − g of each part:

    N = h_h u × m_h f_H + d/dt (I_t u × u̇ + I_a ω_u u) + r_c × m_c f_c

The first term is the paper's (9) and (19): a point mass m_h at h_h up the trunk's axis u. The second is the rotational
inertia of a trunk with moments I_t across and I_a along its axis. The third is the remaining mass, which rotates with
the bicycle: pelvis, legs, and the part of the arms at the grips. With m_c = I_t = I_a = 0 this is the paper's model.

**Pedals** have no sensor. Their vertical force is the remainder in Newton's law, F_p = −Σ m f − R_h − F_h along z of
the bicycle. Legs at rest push down and back on the pedals, at the crank axle when averaged over a revolution. Force
beyond that propels the bicycle and acts further ahead (:func:`pedal_moment`). ``pedal_share`` = 0 removes the pedals,
as in the paper.
"""

from __future__ import annotations

from typing import NamedTuple

from ...analysis.forward_mode import Scalar, atan2, cos, sin
from .kinematics import Accelerations, Angles, Rates, Travel, Triple, axis_motion, point_acceleration, trunk_axis
from .parameters import ForceInertialParameters


class Needed(NamedTuple):
    """Load that seat and hands must provide."""

    tau_phi_h: Scalar
    """moment about x through the pivot, N·m"""
    tau_theta: Scalar
    """moment about the trunk's pitch axis y', N·m"""
    force: Triple
    """Σ m f of trunk and carried mass, axes of R, N"""


def _turned(arm: Triple, force: Triple, s_h: Scalar, c_h: Scalar) -> tuple[Scalar, Scalar]:
    """Moment ``arm × force`` about x and about y' = (0, c_h, s_h)."""
    (x, y, z), (f_x, f_y, f_z) = arm, force
    return y * f_z - z * f_y, c_h * (z * f_x - x * f_z) + s_h * (x * f_y - y * f_x)


def needed_load(
    angles: Angles,
    rate: Rates,
    acceleration: Accelerations,
    axial_rate: Scalar,
    travel: Travel,
    rider: ForceInertialParameters,
) -> Needed:
    """Moments about the trunk's pivot, and the force, that a motion requires.

    Args:
        angles: of trunk and bicycle.
        rate: theirs; with zero rates and accelerations this is the static model.
        acceleration: theirs.
        axial_rate: of the trunk about its own axis, rad/s.
        travel: of the rear contact.
        rider: masses and the place of the pivot.
    """
    # the trunk's centre of mass, h_h up the trunk from the pivot: its specific force, times m_h
    l_s, h_s, gravity = rider.pivot_forward, rider.pivot_height, rider.gravity
    s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
    u = trunk_axis(angles)
    first, second = axis_motion(angles, rate, acceleration)
    base = point_acceleration(l_s, h_s, angles.phi_b, rate, acceleration, travel)
    a_x, a_y, a_z = (a + rider.trunk_height * b for a, b in zip(base, second, strict=True))
    force = (rider.trunk_mass * a_x, rider.trunk_mass * a_y, rider.trunk_mass * (a_z - gravity))
    # (9): h_h u × force; I_t u × ü has the same arm u
    along_u = tuple(rider.trunk_height * f + rider.trunk_across * b for f, b in zip(force, second, strict=True))
    tau_x, tau_y = _turned(u, (along_u[0], along_u[1], along_u[2]), s_h, c_h)
    # the spin's angular momentum I_a ω_a u: its derivative is I_a (ω_a u̇ + ω̇_a u)
    tau_x = tau_x + rider.trunk_along * (axial_rate * first[0] + acceleration.axial * u[0])
    # u itself is perpendicular to y'
    tau_y = tau_y + rider.trunk_along * axial_rate * (c_h * first[1] + s_h * first[2])
    s_b, c_b = sin(angles.phi_b), cos(angles.phi_b)
    # the carried mass rotates with the bicycle: the moment of its specific force about the pivot
    forward, up = rider.carried_forward, rider.carried_up
    c_x, c_y, c_z = point_acceleration(l_s + forward, h_s + up, angles.phi_b, rate, acceleration, travel)
    load = (rider.carried_mass * c_x, rider.carried_mass * c_y, rider.carried_mass * (c_z - gravity))
    more_x, more_y = _turned((forward, up * s_b, -up * c_b), load, s_h, c_h)
    return Needed(tau_x + more_x, tau_y + more_y, (force[0] + load[0], force[1] + load[1], force[2] + load[2]))


def apparent_vertical(force: Triple) -> Scalar:
    """φ_c, angle from the vertical to the load ``force`` = Σ m f, in the lateral plane of R, rad."""
    return atan2(force[1], -force[2])


def in_bicycle(force: Triple, phi_b: Scalar) -> Triple:
    """A vector of R in the axes of the bicycle."""
    # R_x(−φ_b)
    s_b, c_b = sin(phi_b), cos(phi_b)
    return force[0], c_b * force[1] + s_b * force[2], c_b * force[2] - s_b * force[1]


def pedal_moment(force: Scalar, rider: ForceInertialParameters) -> Scalar:
    """Moment about the bicycle's y of the pedals on the rider, about the pivot, N·m, for a force down on them, N."""
    resting = rider.axle_forward * rider.pedal_down - rider.axle_up * rider.pedal_back
    return resting + rider.drive_forward * (force - rider.pedal_down)


def seat_load(
    wrench: tuple[Triple, Triple], rider: ForceInertialParameters, centre: tuple[Scalar, Scalar]
) -> tuple[Triple, Triple]:
    """Equation (10): the load on the seat about a point of its plane, axes of the bicycle.

    Args:
        wrench: force (N) and moment (N·m) of the rider on the six-axis sensor, its axes (z down).
        rider: positions of the seat's rider.
        centre: of pressure x_C, y_C from the saddle point, m; zeros for the saddle point itself.

    Returns:
        R_h and M_h.
    """
    force, moment = wrench
    # R_y(γ) turns the sensor's axes into the bicycle's; then the moment is shifted from the sensor to the point
    s_g, c_g = sin(rider.post_tilt), cos(rider.post_tilt)
    R = (c_g * force[0] + s_g * force[2], force[1], c_g * force[2] - s_g * force[0])
    T = (c_g * moment[0] + s_g * moment[2], moment[1], c_g * moment[2] - s_g * moment[0])
    x = rider.post_length * s_g - centre[0]
    y = -1.0 * centre[1]
    z = rider.post_length * c_g
    return R, (T[0] + y * R[2] - z * R[1], T[1] + z * R[0] - x * R[2], T[2] + x * R[1] - y * R[0])


def centre_of_pressure(cells: Triple, rider: ForceInertialParameters) -> tuple[Scalar, Scalar]:
    """x_C ahead and y_C to the right of the saddle point, m, from the cells front, rear **right**, rear left (N)."""
    total = cells[0] + cells[1] + cells[2]
    return (
        cells[0] / total * rider.cells_long - rider.cells_behind,
        0.5 * (cells[1] - cells[2]) / total * rider.cells_wide,
    )


def trunk_moment(
    R: Triple, M: Triple, centre: tuple[Scalar, Scalar], rider: ForceInertialParameters, published: bool = False
) -> Triple:
    """Equations (11), (12) in the bicycle's axes: moment of the seat on the rider about the pivot, N·m.

    The paper's V lies in the plane of the seat; here the pivot may be above it.

    Args:
        R: load on the seat, bicycle axes, N.
        M: its moment about the centre of pressure.
        centre: of pressure from the saddle point, m.
        rider: positions of the seat's rider.
        published: −R_z(x_C − x_V) in N_y as published; the cross product gives plus.
    """
    x, y, z = centre[0] + rider.seat_forward, centre[1], rider.seat_below
    sign = -1.0 if published else 1.0
    return (
        -1.0 * M[0] - (y * R[2] - z * R[1]),
        -1.0 * M[1] - z * R[0] + sign * x * R[2],
        -1.0 * M[2] - (x * R[1] - y * R[0]),
    )
