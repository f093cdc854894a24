"""Forces of feet and hands: pedalling, steering, and what keeps the rider over the saddle.

A push on one pedal, a lean or a brake would tip the rider off the saddle. The saddle carries a small moment; the hands
carry the rest: that of the pushing side pulls, the other one presses, along the steering axis, so that they do not
steer; both together pull against being tipped backwards. All forces are in bicycle axes.

The constants are round figures of this project, found in rides of all preset riders: with them the pelvis tips by no
more than 3 degrees, but for moments on the ramp and over bumps, and no force is beyond what people reach.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from .posture import Posture
from .saddle import SeatContact, upper_body

Force = tuple[float, float, float]

AROUND = 0.2
"""a foot pushes down with the cosine of the crank angle, where that is positive, and along its circle with this"""
MEAN_STROKE = 2.0 * (0.25 + AROUND)
"""mean of both feet's turning force over a turn"""
LARGEST_PEDAL_FORCE = 400.0
"""N downwards: more would lift the rider off the saddle"""
SHIFT_ACROSS, SHIFT_ALONG = 0.02, 0.03
"""m by which the centre of pressure shifts on the saddle before the hands carry all of a further moment"""
LARGEST_DIFFERENCE, STRONGEST_PULL, MOST_PRESS = 150.0, 250.0, 200.0
"""N of a hand: against the other one, pulling and pressing besides its load"""
HOLD_ROLL, HOLD_ROLL_RATE = 500.0, 40.0
"""N·m/rad and N·m·s/rad of the hands against the tip of the pelvis to the side"""
HOLD_PITCH, HOLD_PITCH_RATE = 1000.0, 60.0
"""likewise forwards and backwards"""
DRAW, DRAW_RATE, LARGEST_DRAW = 5e3, 300.0, 150.0
"""N/m, N·s/m and N of each leg that draws the pelvis back to the saddle"""


class Reach(NamedTuple):
    """Where hands and feet of one rider act, from the saddle point, and what they carry."""

    grip: Force
    """m: left hand"""
    lumbar: float
    """m: height of the lumbar joint"""
    steer_axis: tuple[float, float]
    """x and z of the unit vector upwards along it"""
    axle: tuple[float, float]
    """m: x and z of the crank's axle"""
    crank: float
    """m"""
    pedal: float
    """m to the side"""
    trunk_moment: float
    """N·m: weight of the trunk times its centre's distance from the lumbar joint"""
    pushed_back: float
    """m: moment that tips the rider backwards per force that drives rider and bicycle"""


def reach_of(posture: Posture, gravity: float) -> Reach:
    """Distances of a person on a bicycle; ``gravity`` in m/s²."""
    bicycle, trunk = posture.bicycle, posture.trunk()
    assert bicycle.drive is not None
    mass = posture.body.mass + sum(part.mass for part in bicycle.parts)
    saddle, drive, axis = np.array(bicycle.saddle), bicycle.drive, bicycle.steer_axis
    x, y, z = (np.array(bicycle.grip) - saddle).tolist()
    axle = (np.array(drive.axle) - saddle).tolist()
    return Reach(
        (x, y, z),
        float(posture.lumbar[2] - saddle[2]),
        (float(axis[0]), float(axis[2])),
        (axle[0], axle[2]),
        drive.crank_length,
        drive.pedal_offset,
        gravity * trunk.mass * float(trunk.centre[2]),
        sum(part.mass * float(part.centre[2] - saddle[2]) for part in upper_body(posture)) / mass,
    )


@jit
def pedal_push(push: float, around: float, phase: float, draw: float) -> Force:
    """Force of a foot on its pedal by the leg's muscles, N.

    Args:
        push: N downwards at most.
        around: N along the pedal's circle, forwards.
        phase: rad, 0 with the pedal in front.
        draw: N upwards, see :func:`held_down`.
    """
    return -around * math.sin(phase), 0.0, draw - around * math.cos(phase) - push * max(0.0, math.cos(phase))


@jit
def held_down(seat: SeatContact, rise: float, rising: float) -> float:
    """Force (N) with which each leg draws a pelvis that has left the saddle down to it.

    Args:
        seat: the saddle under the rider.
        rise: of the pelvis above its position at rest, m.
        rising: its rate, m/s.
    """
    off = rise - seat.load / seat.stiffness
    return max(0.0, min(LARGEST_DRAW, DRAW * off + DRAW_RATE * rising)) if off > 0.0 else 0.0


@jit
def swung(reach: Reach, left: Force, right: Force, lift: float, tip: float) -> tuple[Force, Force]:
    """Forces of both feet with which rigid legs have the effect of swinging ones.

    Args:
        reach: of the rider.
        left: force of the left leg's muscles, N.
        right: of the right one's.
        lift: force of the swinging legs on the rider upwards, N.
        tip: their moment to the right, N·m.
    """
    both, apart = 0.5 * lift, 0.5 * tip / reach.pedal
    return (left[0], left[1], left[2] - both - apart), (right[0], right[1], right[2] - both + apart)


@jit
def moments_of_feet(reach: Reach, crank: float, left: Force, right: Force) -> tuple[float, float]:
    """Moments (N·m) on the rider about the saddle point, to the right and forwards, of pushing on the pedals."""
    along, down = reach.crank * math.cos(crank), reach.crank * math.sin(crank)
    x, z = reach.axle
    mx = -reach.pedal * (left[2] - right[2]) + (z - down) * left[1] + (z + down) * right[1]
    my = (x + along) * left[2] + (x - along) * right[2] - (z - down) * left[0] - (z + down) * right[0]
    return mx, my


@jit
def carried(moment: float, most: float) -> float:
    """Part of a moment that the hands carry when the saddle carries no more than ``most``, N·m."""
    return moment - most * math.tanh(moment / most)


@jit
def hands_against(
    reach: Reach, seat: SeatContact, rightwards: float, forwards: float, pelvis: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Difference and common part of the hands' forces that keep the rider over the saddle.

    Args:
        reach: of the rider.
        seat: the saddle under the rider.
        rightwards: moment that tips the rider to the right, N·m.
        forwards: moment that tips the rider forwards, N·m.
        pelvis: forward tip and its rate, tip to the right and its rate; rad, rad/s.

    Returns:
        N along the steering axis: on the bar with the left hand and off it with the right one; and upwards with each.
    """
    pitch, pitching, roll, rolling = pelvis
    rightwards = carried(rightwards, SHIFT_ACROSS * seat.load) + HOLD_ROLL * roll + HOLD_ROLL_RATE * rolling
    forwards = carried(forwards, SHIFT_ALONG * seat.load) + HOLD_PITCH * pitch + HOLD_PITCH_RATE * pitching
    x, y = reach.grip[0], reach.grip[1]
    difference = rightwards / (2.0 * y * reach.steer_axis[1])
    common = -forwards / (2.0 * x)
    return (
        max(-LARGEST_DIFFERENCE, min(LARGEST_DIFFERENCE, difference)),
        max(-MOST_PRESS, min(STRONGEST_PULL, common)),
    )


@jit
def trunk_support(reach: Reach, left: Force, right: Force, flexion: float, lean: float) -> tuple[float, float, float]:
    """Torques (N·m) of the trunk's joint about y, x and z that bear the trunk's weight and the hands' reactions.

    Args:
        reach: of the rider.
        left: force of the left hand on the handlebar, N.
        right: of the right hand.
        flexion: of the trunk in the bicycle frame, rad.
        lean: likewise, to the right, rad.
    """
    x, y, z = reach.grip
    z -= reach.lumbar
    # moment about the lumbar joint that the hands exert on the handlebar
    mx = y * (left[2] - right[2]) - z * (left[1] + right[1])
    my = z * (left[0] + right[0]) - x * (left[2] + right[2])
    mz = x * (left[1] + right[1]) - y * (left[0] - right[0])
    cf, sf, cl, sl = math.cos(flexion), math.sin(flexion), math.cos(lean), math.sin(lean)
    weight = reach.trunk_moment
    return (my - weight * sf * cl, cf * mx - sf * mz - weight * sl * cf, sf * cl * mx - sl * my + cf * cl * mz)
