"""From raw samples to the measurements of the force/inertial filter: moment about the pivot, force, static angles."""

from __future__ import annotations

from typing import NamedTuple

from ...analysis.forward_mode import Scalar, atan2, cos, sin
from ...core.backend import Array, namespace
from ...core.quantity import Measurement
from .forces import centre_of_pressure, pedal_moment, seat_load, trunk_moment
from .kinematics import Triple, down
from .parameters import ForceInertialParameters


class Readings(NamedTuple):
    """Readings of the force sensors, axes of the bicycle with z down."""

    moment: Triple
    """N, of seat and hands on the rider about the pivot, N·m"""
    seat: Triple
    """R_h, the rider's force on the seat, N"""
    whole: Triple
    """R_h + F_h, including the hands (where they are modelled), N"""


def readings(
    parameters: ForceInertialParameters, z: Measurement, steer: Scalar, hands: str, published: bool = False
) -> Readings:
    """Equations (10)–(12) and the centre of pressure below (10).

    Args:
        parameters: positions of the sensors.
        z: samples; missing ones are NaN, and so are quantities that require them. Load cells may be missing: the centre
            of pressure cancels, and the saddle point may replace it.
        steer: angle of the handlebar to the right, rad; the grips move with it.
        hands: ``each`` hand at its grip, ``sum`` for the two terms of (12), or ``none``.
        published: the published sign in (12).
    """
    wrench, cells = z["seat/wrench"], z["seat/load_cells"]
    xp = namespace(wrench)
    known = xp.all(xp.isfinite(cells), axis=-1)
    filled = [xp.where(known, cells[..., k], 1.0 + 0.0 * parameters.cells_long) for k in range(3)]
    # the channel holds front, rear left, rear right
    x_C, y_C = centre_of_pressure((filled[0], filled[2], filled[1]), parameters)
    centre = (xp.where(known, x_C, 0.0 * x_C), xp.where(known, y_C, 0.0 * y_C))
    R, M = seat_load((down(wrench[..., :3]), down(wrench[..., 3:])), parameters, centre)
    N = trunk_moment(R, M, centre, parameters, published)
    left, right = down(z["handlebar/force"][..., :3]), down(z["handlebar/force"][..., 3:])
    both = (left[0] + right[0], left[1] + right[1], left[2] + right[2])
    forward, up, half = parameters.grip_forward, parameters.grip_up, parameters.grip_half_width
    if hands == "sum":
        N = (N[0], N[1] + both[0] * up + both[2] * forward, N[2])
    elif hands == "each":
        # −(d_x ± half s, ∓half c, −d_z) × F of the left and the right hand
        shift, side = half * sin(steer), half * cos(steer)
        apart = (left[0] - right[0], left[1] - right[1], left[2] - right[2])
        N = (
            N[0] - up * both[1] + side * apart[2],
            N[1] + up * both[0] + forward * both[2] + shift * apart[2],
            N[2] - forward * both[1] - shift * apart[1] - side * apart[0],
        )
    whole = R if hands == "none" else (R[0] + both[0], R[1] + both[1], R[2] + both[2])
    return Readings(N, R, whole)


def steering(parameters: ForceInertialParameters, speed: Array, yaw: Scalar) -> Scalar:
    """Angle of the handlebar to the right, rad, for which the wheels roll along a path.

    Its yaw rate to the right is in rad/s, the speed in m/s, at least 0.3 m/s.
    """
    xp = namespace(speed)
    slow = xp.less(speed, 0.3)
    speed = xp.where(slow, 0.3 + 0.0 * speed, speed)
    return atan2(parameters.wheelbase * yaw, speed) / cos(parameters.caster)


def static_angles(
    parameters: ForceInertialParameters, read: Readings, lateral: Array
) -> tuple[Array, Array, Array, Array]:
    """Angles φ_h, θ, φ, φ_b for which a trunk at rest in a steady turn requires the measured forces.

    ``lateral`` is v_b ψ̇, m/s²; zero for rest.
    """
    xp = namespace(lateral)
    gravity, scale = parameters.gravity, parameters.trunk_mass * parameters.trunk_height
    mass = parameters.trunk_mass + parameters.carried_mass
    # roll from the direction of the seat force (13) and of the apparent vertical atan(v_b ψ̇ / g)
    squared = lateral * lateral + gravity * gravity
    phi_b = xp.atan2(read.whole[1], read.whole[2] + 0.0 * lateral) + xp.atan2(lateral, gravity + 0.0 * lateral)
    s_b, c_b = sin(phi_b), cos(phi_b)
    # the carried mass in the bicycle's axes, and the pedals, which carry the remaining load
    f_y, f_z = c_b * lateral - s_b * gravity, -s_b * lateral - c_b * gravity
    carried, forward, up = parameters.carried_mass, parameters.carried_forward, parameters.carried_up
    down = -1.0 * (read.whole[2] + mass * f_z)
    pedals = parameters.pedal_share * pedal_moment(down, parameters)
    N_x = read.moment[0] - carried * up * f_y
    N_y = read.moment[1] + pedals + carried * forward * f_z
    N_z = read.moment[2] - carried * forward * f_y
    # the trunk's moment in R
    M_y, M_z = c_b * N_y - s_b * N_z, s_b * N_y + c_b * N_z
    # u across f = (0, lateral, −gravity): f × N / (m_h h_h f²)
    cross = (lateral * M_z + gravity * M_y, -gravity * N_x, -lateral * N_x)
    across = [part / (scale * squared) for part in cross]
    # the component of the unit vector u along f follows from its length; too large a moment is limited
    length = across[0] * across[0] + across[1] * across[1] + across[2] * across[2]
    one = 1.0 + 0.0 * length
    too_far = xp.greater(length, 0.95)
    shrink = xp.where(too_far, xp.sqrt(0.95 / xp.where(too_far, length, one)), one)
    x, y, z = (shrink * part for part in across)
    along = xp.sqrt((1.0 - x * x - y * y - z * z) / squared)
    y, z = y + along * lateral, z - along * gravity
    phi_h, theta = xp.atan2(y, -z), xp.atan2(xp.sqrt(y * y + z * z), x)
    c_theta = cos(theta)
    # level shoulders, with a small term that keeps φ small for an upright trunk
    phi = xp.atan2(-sin(phi_h) * c_theta, cos(phi_h) * c_theta * c_theta + 0.01)
    return phi_h, theta, phi, phi_b
