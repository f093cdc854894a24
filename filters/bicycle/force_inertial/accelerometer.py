"""Angular accelerations from accelerometers: (7) and (8) of the force/inertial paper, corrected and as published.

Frames and names are those of :mod:`.force_inertial.kinematics`. An accelerometer measures specific force f = a − g.
With z down this is (0, 0, −g) when level and at rest.

The corrected forms are exact. They are not the default, because gravity cancels when (8) is inserted into the torque
model (9). The predicted torque then depends on the state only through the share 1 − h_h/h of gravity, where h_h and h
are the heights of the trunk's centre of mass and of its accelerometer. For h = h_h the torque contains no information
on the pose, and for h < h_h its sign is wrong.

Errata: (5)–(8) lack the lateral acceleration v_b ψ̇ of the rear contact, have +g although z points down, the opposite
sign of every p_z, ω̇ without its y component ψ̇ φ̇_b, φ̈_b = 0, no rotation of the accelerometer's axes by φ, and a
derivative of the trunk rate that neglects the rotation of R.
"""

from __future__ import annotations

from ...analysis.forward_mode import Scalar, cos, sin
from .kinematics import Accelerations, Angles, Rates, Travel, Triple, point_acceleration
from .parameters import ForceInertialParameters


def yaw_acceleration(
    a_by: Scalar,
    phi_b: Scalar,
    rate: Rates,
    roll_acceleration: Scalar,
    travel: Travel,
    rider: ForceInertialParameters,
    published: bool = False,
) -> Scalar:
    """Equation (7), rad/s².

    Args:
        a_by: specific force along y of the bicycle's IMU, m/s².
        phi_b: roll.
        rate: of the angles.
        roll_acceleration: φ̈_b; zero in the published form.
        travel: of the rear contact.
        rider: p_x, p_z of the IMU.
        published: with the published signs and omissions.
    """
    p_x, p_z, gravity = rider.imu_forward, rider.imu_height, rider.gravity
    s_b, c_b = sin(phi_b), cos(phi_b)
    squared = rate.psi * rate.psi
    if published:
        spurious = p_x * s_b * rate.psi * rate.phi_b
        return (a_by - s_b * gravity - p_z * s_b * c_b * squared - spurious) / (p_x * c_b)
    # a_by = c_b v_b ψ̇ + p_x c_b ψ̈ + p_z φ̈_b − p_z s_b c_b ψ̇² − s_b g (6), solved for ψ̈
    kept = p_z * s_b * c_b * squared - p_z * roll_acceleration
    return (a_by + s_b * gravity - c_b * travel.speed * rate.psi + kept) / (p_x * c_b)


def accelerometer_accelerations(
    angles: Angles,
    rate: Rates,
    a_h: Triple,
    a_by: Scalar,
    roll_acceleration: Scalar,
    axial: Scalar,
    travel: Travel,
    rider: ForceInertialParameters,
    published: bool = False,
) -> Accelerations:
    """Equations (7) and (8).

    Args:
        angles: of trunk and bicycle.
        rate: theirs.
        a_h: specific force of the trunk's accelerometer, trunk axes, m/s².
        a_by: of the bicycle's along its y.
        roll_acceleration: φ̈_b, rad/s²; unused in the published form.
        axial: derivative of the trunk's rate about its axis, passed through.
        travel: of the rear contact.
        rider: positions of the IMUs and of the trunk's pivot.
        published: with the published signs and omissions.
    """
    l_s, h_s, h = rider.pivot_forward, rider.pivot_height, rider.trunk_imu_height
    s_h, c_h = sin(angles.phi_h), cos(angles.phi_h)
    s_t, c_t = sin(angles.theta), cos(angles.theta)
    s_p, c_p = sin(angles.phi), cos(angles.phi)
    # specific force of the pivot (5), (6); that of the trunk's accelerometer adds the motion of the trunk
    if published:
        roll_acceleration = 0.0 * roll_acceleration
    yaw = yaw_acceleration(a_by, angles.phi_b, rate, roll_acceleration, travel, rider, published)
    acceleration = Accelerations(0.0, 0.0, axial, roll_acceleration, yaw)
    seat_x, seat_y, seat_z = point_acceleration(l_s, h_s, angles.phi_b, rate, acceleration, travel)
    squared, cotangent = rate.psi * rate.psi, c_t / s_t
    if published:
        a_y, a_z = a_h[1], a_h[2]
        # (5) as published: no v_b ψ̇, + g, and ω̇ without its y component ψ̇ φ̇_b, which changes x and z of the seat
        turned = rate.phi_b * rate.psi
        seat_x, seat_y = seat_x + h_s * cos(angles.phi_b) * turned, seat_y - travel.speed * rate.psi
        seat_z = seat_z + rider.gravity + l_s * turned
        lean = c_h * rate.psi * rate.theta - s_h * cotangent * rate.phi_h * rate.psi
        lean = lean - cotangent * rate.phi_h * rate.theta
        pitch = (2.0 * c_t * c_t - 1.0) * c_h * rate.phi_h * rate.psi
    else:
        # the sample in axes before the spin φ
        a_y, a_z = c_p * a_h[1] - s_p * a_h[2], s_p * a_h[1] + c_p * a_h[2]
        seat_z = seat_z - rider.gravity
        lean = 2.0 * c_h * rate.psi * rate.theta - 2.0 * cotangent * rate.phi_h * rate.theta
        pitch = -2.0 * c_h * s_t * s_t * rate.phi_h * rate.psi
    # (8): acceleration of the sensor relative to the pivot over h, then Coriolis, centripetal and yaw terms
    return Accelerations(
        (a_y - c_h * seat_y - s_h * seat_z) / (s_t * h) + s_h * c_h * squared + lean - c_h * cotangent * yaw,
        (-a_z + s_t * seat_x - c_t * s_h * seat_y + c_h * c_t * seat_z) / h
        + pitch
        - s_t * c_t * c_h * c_h * squared
        + s_t * c_t * rate.phi_h * rate.phi_h
        - s_h * yaw,
        axial,
        roll_acceleration,
        yaw,
    )
