"""Parameters of the force/inertial filter: rider, bicycle, sensors, noises; the defaults are a typical rider's.

All positions are relative to the trunk's pivot (the lumbar joint; a point of the seat in the paper), forward and up in
the bicycle's axes, m. Shares of a body's mass come from P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment
inertia parameters", J. Biomechanics 29(9), 1996, table 4, men.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...core.quantity import DEG, GRAVITY, Channel
from ...support.parameters import check_positive
from ..geometry import ARM_MASS, RiderEquations, RiderGeometry
from .kinematics import true_angles

LEG_MASS = 0.1986
"""of the body's mass: one leg with foot"""
ARM_AT_GRIP = 0.53
"""share of an arm's weight at the grip, the rest is at the shoulder: position of the arm's centre of mass between them,
from the same table"""
THIGH_MASS, SHANK_MASS, FOOT_MASS = 0.1416, 0.0433, 0.0137
"""likewise"""
THIGH_CENTRE, SHANK_CENTRE = 0.4095, 0.4395
"""position of the centre of mass between hip and knee, knee and ankle, likewise"""
FOOT_CENTRE = 0.35
"""between ankle and pedal; assumed"""
CHANNELS = (
    Channel("bicycle_imu/gyr", 3, "rad/s"),
    Channel("bicycle_imu/acc", 3, "m/s²"),
    Channel("trunk_imu/gyr", 3, "rad/s"),
    Channel("trunk_imu/acc", 3, "m/s²"),
    Channel("seat/wrench", 6, "N, N·m"),
    Channel("seat/load_cells", 3, "N"),
    Channel("handlebar/force", 6, "N"),
    Channel("wheel/speed", 1, "m/s"),
)


@dataclass(frozen=True)
class ForceInertialParameters(RiderEquations):
    """Common parameters of filter and integration."""

    dt: float = 0.02
    """s; the paper's 50 Hz"""
    gravity: float = GRAVITY
    """m/s²"""
    imu_tilt: float = 10.0 * DEG
    """α, nose up (table I)"""
    imu_forward: float = 0.37
    """p_x, from the rear contact (table I)"""
    imu_height: float = 0.71
    """p_z, above ground (table I)"""
    pivot_forward: float = 0.2593
    """l_s, of the trunk's pivot from the rear contact (table I: 0.26 for the seat)"""
    pivot_height: float = 1.037
    """h_s, above ground (table I has 0.38, below the bicycle's IMU and centre of mass, perhaps another reference)"""
    seat_forward: float = 0.0
    """of the saddle point from the pivot: −x_V"""
    seat_below: float = 0.1545
    """of the saddle point below the pivot; zero in the paper"""
    post_length: float = 0.13
    """L_1, from the saddle point down the post to the six-axis sensor (table I)"""
    post_tilt: float = 20.0 * DEG
    """γ, backwards (table I)"""
    cells_long: float = 0.20
    """L_x, from the rear load cells to the front one (table I)"""
    cells_wide: float = 0.12
    """L_y, between the rear ones (table I)"""
    cells_behind: float = 0.043
    """L_m, from the rear ones forward to the saddle point (table I)"""
    grip_forward: float = 0.5307
    """d_x, of the hands from the pivot; not published"""
    grip_up: float = 0.003
    """d_z, likewise"""
    grip_half_width: float = 0.27
    """of each hand from the mid-plane"""
    wheelbase: float = 1.05
    """gives the steering angle from the curvature of the path; zero in the paper, where it stays straight"""
    caster: float = 0.3142
    """tilt of the steering axis, backwards"""
    trunk_mass: float = 29.835
    """m_h, kg: trunk above the pivot, head, and the part of the arms at the shoulders; not published"""
    trunk_height: float = 0.3716
    """h_h, from the pivot to its centre of mass; not published"""
    trunk_across: float = 1.016
    """I_t, moment of inertia about an axis through the centre across the trunk, kg·m²; zero in the paper"""
    trunk_along: float = 0.392
    """I_a, along the trunk, kg·m²; zero in the paper"""
    trunk_imu_height: float = 0.2729
    """h, of the trunk's IMU up the trunk from the pivot; needed by ``acceleration="accelerometer"`` only"""
    carried_mass: float = 38.166
    """m_c: remaining mass, which rotates with the bicycle, kg; zero in the paper"""
    carried_forward: float = 0.15545
    """of its centre from the pivot"""
    carried_up: float = -0.19145
    """of its centre above the pivot"""
    pedal_share: float = 1.0
    """1: the pedals carry the load that seat and hands do not; 0: no pedals, as in the paper"""
    axle_forward: float = 0.1667
    """of the crank's axle from the pivot"""
    axle_up: float = -0.757
    """of the crank's axle above the pivot: negative"""
    pedal_down: float = 138.177
    """force of both legs at rest down on the pedals, mean over a revolution, N"""
    pedal_back: float = 24.3313
    """likewise, backwards"""
    drive_forward: float = 0.3832
    """of the point of action of the driving force, from the pivot: 4/π crank lengths ahead of the axle, the mean
    moment of a half sine of tangential force over its mean vertical component"""
    bias_time: float = 1800.0
    """τ, s (table I)"""
    bias_std: float = 0.15 * DEG
    """σ of (15), rad/s; not published"""
    gyroscope_noise: float = 1.0 * DEG
    """standard deviation per sample, rad/s: also covers scale, alignment and the Euler step; not published"""
    torque_noise: float = 12.0
    """of τ̂_φh and τ̂_θ, N·m: covers unmodelled, time-correlated forces of legs and arms; not published"""
    roll_noise: float = 2.0 * DEG
    """of φ̂_b, rad; not published"""
    shoulder_noise: float = 0.1
    """of the sine of the shoulders' tilt; not published. Too small a value biases φ_h of an upright trunk"""
    ahead_share: float = 0.2
    """0: shoulders are level (17); 1: the chest faces forward with the bicycle; between: weighted mean of the two,
    since riders who lean tilt their shoulders"""
    gyroscope_filter: float = 0.04
    """s, time constant of the differentiated gyroscopes' low-pass"""
    speed_filter: float = 0.2
    """s, of the differentiated wheel speed's"""
    lean_prior: float = 10.0 * DEG
    """standard deviation of the first φ_h, rad"""
    pitch_prior: float = 10.0 * DEG
    """of θ"""
    spin_prior: float = 15.0 * DEG
    """of φ"""
    roll_prior: float = 4.0 * DEG
    """of φ_b"""
    bias_prior: float = 0.15 * DEG
    """of b, rad/s"""

    def __post_init__(self) -> None:
        """Check the parameters in denominators."""
        super().__post_init__()
        positive = ("trunk_mass", "trunk_height", "trunk_imu_height", "imu_forward", "bias_time", "cells_long")
        noises = ("torque_noise", "roll_noise", "shoulder_noise")
        or_zero = ("gyroscope_filter", "speed_filter", "carried_mass", "trunk_across", "trunk_along")
        check_positive(self, *positive, *noises, or_zero=or_zero)

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """Lengths and masses of the rider, positions of the sensors."""
        return rider_parameters(geometry)

    def truth(self, truth: Mapping[str, Any]) -> dict[str, Any]:
        """The trunk's angles in the paper's frame, from the orientations of bicycle and trunk."""
        return true_angles(truth) if {"bicycle/orientation", "trunk/orientation"} <= set(truth) else {}


def rider_parameters(geometry: RiderGeometry) -> dict[str, float]:
    """Lengths and masses of one rider, by the names of :class:`ForceInertialParameters`.

    Arms and legs are shares of the body's mass from a table. All mass except trunk and arms rotates with the bicycle.
    """
    pivot, mass = geometry.trunk_pivot, geometry.rider_mass
    arms, legs = 2.0 * ARM_MASS * mass, 2.0 * LEG_MASS * mass
    # arms: a point mass at the shoulders, one at the grips
    shoulders, hands = (1.0 - ARM_AT_GRIP) * arms, ARM_AT_GRIP * arms
    trunk = geometry.trunk_mass + shoulders
    centre = (geometry.trunk_mass * geometry.trunk_centre[2] + shoulders * geometry.shoulder[2]) / trunk
    apart = geometry.shoulder[2] - geometry.trunk_centre[2]
    reduced = geometry.trunk_mass * shoulders / trunk * apart * apart
    across = 0.5 * (geometry.trunk_moments[0] + geometry.trunk_moments[1]) + reduced
    along = geometry.trunk_moments[2] + shoulders * geometry.shoulder[1] ** 2
    resting = resting_legs(geometry)
    # the mass that rotates with the bicycle: pelvis at the pivot, legs, part of the arms at the grips
    pelvis = max(0.0, mass - trunk - legs - hands)
    parts = (
        (pelvis, pivot[0], pivot[2]),
        (legs, resting.forward, resting.up),
        (hands, geometry.grip[0], geometry.grip[2]),
    )
    carried = sum(part[0] for part in parts)
    axle = geometry.crank_axle[0] - pivot[0]
    return {
        "imu_tilt": geometry.bicycle_imu_tilt,
        "imu_forward": geometry.bicycle_imu[0],
        "imu_height": geometry.bicycle_imu[2],
        "pivot_forward": pivot[0],
        "pivot_height": pivot[2],
        "seat_forward": geometry.saddle[0] - pivot[0],
        "seat_below": pivot[2] - geometry.saddle[2],
        "post_length": geometry.post_length,
        "post_tilt": geometry.post_tilt,
        "cells_long": geometry.cells_long,
        "cells_wide": geometry.cells_wide,
        "cells_behind": geometry.cells_behind,
        "grip_forward": geometry.grip[0] - pivot[0],
        "grip_up": geometry.grip[2] - pivot[2],
        "grip_half_width": geometry.grip[1],
        "wheelbase": geometry.wheelbase,
        "caster": math.atan2(-geometry.steer_axis[0], geometry.steer_axis[2]),
        "trunk_mass": trunk,
        "trunk_height": centre,
        "trunk_across": across,
        "trunk_along": along,
        "trunk_imu_height": geometry.trunk_imu[2],
        "carried_mass": carried,
        "carried_forward": sum(m * x for m, x, _ in parts) / carried - pivot[0],
        "carried_up": sum(m * z for m, _, z in parts) / carried - pivot[2],
        "axle_forward": axle,
        "axle_up": geometry.crank_axle[2] - pivot[2],
        "pedal_down": resting.down,
        "pedal_back": resting.back,
        "drive_forward": axle + 4.0 / math.pi * geometry.crank_length,
    }


class RestingLegs(NamedTuple):
    """Both legs, averaged over a revolution of the cranks."""

    forward: float
    """of their centre of mass in the bicycle's axes, m"""
    up: float
    down: float
    """force on the pedals, N"""
    back: float


class Leg(NamedTuple):
    """One leg at crank angles ``(n,)``, in the plane forward and up ``(n, 2)``."""

    pedal: np.ndarray
    """m"""
    centre: np.ndarray
    """of the leg's mass, m"""
    push: np.ndarray
    """of the pedal on the foot that supports the leg, N"""


def resting_legs(geometry: RiderGeometry, gravity: float = GRAVITY) -> RestingLegs:
    """Statics of two legs with frictionless hinges at hips, knees and pedals, over a revolution of the cranks."""
    leg = resting_leg(geometry, np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False), gravity)
    (forward, up), (back, down) = leg.centre.mean(axis=0), 2.0 * leg.push.mean(axis=0)
    return RestingLegs(float(forward), float(up), float(down), float(back))


def resting_leg(geometry: RiderGeometry, crank: np.ndarray, gravity: float = GRAVITY) -> Leg:
    """Statics of one leg whose crank has the angles ``(n,)``, 0 in front, forward positive, rad."""
    hip, axle = np.array(geometry.hip)[[0, 2]], np.array(geometry.crank_axle)[[0, 2]]
    pedal = axle + geometry.crank_length * np.stack([np.cos(crank), -np.sin(crank)], axis=-1)
    reach = pedal - hip
    across = geometry.pedal_offset - geometry.hip[1]
    upper, lower = geometry.thigh, geometry.knee_to_pedal
    distance = np.minimum(np.sqrt(np.sum(reach**2, axis=-1) + across**2), 0.9999 * (upper + lower))
    # the knee lies forward of the line from hip to pedal
    bend = np.arccos((upper**2 + distance**2 - lower**2) / (2.0 * upper * distance))
    line = np.arctan2(reach[:, 1], reach[:, 0]) + bend
    knee = hip + upper * np.stack([np.cos(line), np.sin(line)], axis=-1)
    # shank with foot: its centre lies behind the line from knee to pedal
    length, foot, ankle = geometry.shank, geometry.ankle_to_pedal, geometry.ankle_angle
    tip = np.array([foot * math.sin(ankle), -length - foot * math.cos(ankle)])
    toe = (SHANK_CENTRE * np.array([0.0, -length]), np.array([0.0, -length]) + FOOT_CENTRE * (tip - [0.0, -length]))
    own = (SHANK_MASS * toe[0] + FOOT_MASS * toe[1]) / (SHANK_MASS + FOOT_MASS)
    held = (pedal - knee) / np.linalg.norm(pedal - knee, axis=-1, keepdims=True)
    ahead = np.stack([-held[:, 1], held[:, 0]], axis=-1)
    tip /= np.linalg.norm(tip)
    shank = knee + (own @ tip) * held + (tip[0] * own[1] - tip[1] * own[0]) * ahead
    thigh = hip + THIGH_CENTRE * (knee - hip)
    thigh_weight = gravity * THIGH_MASS * geometry.rider_mass
    shank_weight = gravity * (SHANK_MASS + FOOT_MASS) * geometry.rider_mass
    centre = (thigh_weight * thigh + shank_weight * shank) / (thigh_weight + shank_weight)
    # moments about the knee (of the shank) and about the hip (of both) vanish: the pedal's force on the leg
    arms = np.stack([pedal - knee, pedal - hip], axis=1)
    cross = np.stack([-arms[..., 1], arms[..., 0]], axis=-1)
    known = np.stack(
        [shank_weight * (shank - knee)[:, 0], thigh_weight * (thigh - hip)[:, 0] + shank_weight * (shank - hip)[:, 0]],
        axis=-1,
    )
    return Leg(pedal, centre, np.linalg.solve(cross, known[..., None])[..., 0])
