"""What the force/inertial filter needs of a person and a bicycle: masses, places, resting legs.

Shares of the body come from P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J.
Biomechanics 29(9), 1996, table 4, men.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.quantity import GRAVITY
from ..geometry import ARM_MASS, RiderGeometry

LEG_MASS = 0.1986
"""of the body's mass: one leg with foot"""
ARM_AT_GRIP = 0.53
"""part of an arm's weight that hangs at the grip, the rest at the shoulder: place of the arm's centre of mass between
them, from the same table"""
THIGH_MASS, SHANK_MASS, FOOT_MASS = 0.1416, 0.0433, 0.0137
"""likewise"""
THIGH_CENTRE, SHANK_CENTRE = 0.4095, 0.4395
"""place of the centre of mass between hip and knee, knee and ankle, likewise"""
FOOT_CENTRE = 0.35
"""between ankle and pedal; assumed"""


def rider_parameters(geometry: RiderGeometry) -> dict[str, float]:
    """Lengths and masses of one rider, by the names of :class:`ForceInertialParameters`.

    Arms and legs are shares of the body's mass from a table; whatever is neither trunk nor arm turns with the bicycle.
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
    # what turns with the bicycle besides: pelvis at the pivot, legs, the arms' rest at the grips
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
    """Both legs on the mean of a turn of the cranks."""

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
    """of the pedal on the foot that holds the leg, N"""


def resting_legs(geometry: RiderGeometry, gravity: float = GRAVITY) -> RestingLegs:
    """Statics of two legs whose hips, knees and pedals are hinges without friction, over a turn of the cranks."""
    leg = resting_leg(geometry, np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False), gravity)
    (forward, up), (back, down) = leg.centre.mean(axis=0), 2.0 * leg.push.mean(axis=0)
    return RestingLegs(float(forward), float(up), float(down), float(back))


def resting_leg(geometry: RiderGeometry, crank: np.ndarray, gravity: float = GRAVITY) -> Leg:
    """Statics of one leg.

    Args:
        geometry: of the person.
        crank: ``(n,)`` angle of this leg's crank, 0 in front, forward positive, rad.
        gravity: m/s².
    """
    hip, axle = np.array(geometry.hip)[[0, 2]], np.array(geometry.crank_axle)[[0, 2]]
    pedal = axle + geometry.crank_length * np.stack([np.cos(crank), -np.sin(crank)], axis=-1)
    reach = pedal - hip
    across = geometry.pedal_offset - geometry.hip[1]
    upper, lower = geometry.thigh, geometry.knee_to_pedal
    distance = np.minimum(np.sqrt(np.sum(reach**2, axis=-1) + across**2), 0.9999 * (upper + lower))
    # the knee stands forward of the line from hip to pedal
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
        [
            shank_weight * (shank - knee)[:, 0],
            thigh_weight * (thigh - hip)[:, 0] + shank_weight * (shank - hip)[:, 0],
        ],
        axis=-1,
    )
    return Leg(pedal, centre, np.linalg.solve(cross, known[..., None])[..., 0])
