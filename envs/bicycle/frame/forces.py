"""Everything that acts on a bicycle in one physics step, and its state as numbers, compiled.

Arrays of a bicycle:

* links ``(4,)``: numbers of rear wheel, front wheel, front assembly and crank (−1 without one);
* body ``(5,)``: ½ density of air times drag area (kg/m), weight (N), centre of mass ahead of the rear contact and above
  the ground (m), wheelbase (m);
* frame ``(12,)``: rotation matrix, row by row, from bicycle axes to the base's principal axes, and the bicycle frame's
  origin from the base's centre, bicycle axes (m).
"""

from __future__ import annotations

import math

from ....filters.compile.cache import jit
from ...physics.kinematics import add_force
from .drivetrain import chain_torque
from .tyre import tyre_force

BRAKED_SHARE = 0.7
"""1: part of the friction limit that a brake uses at most"""
BRAKE_FADE = 0.1
"""m/s at which a brake has lost a quarter of its force"""


@jit
def bicycle_forces(  # type: ignore[no-untyped-def]
    tree, state, frames, links, body, tyres, ground, time_step, chain, bristles, contacts, brake, forces
):
    """Tyre forces, air drag, chain and brakes during the next step.

    Args:
        tree: see :mod:`poise.envs.physics.kinematics`, as of the next two.
        state: now.
        frames: now.
        links: see above.
        body: see above.
        tyres: ``(2, 10)`` of :func:`.tyre_force`, rear and front.
        ground: table of the ground.
        time_step: s.
        chain: of :func:`.chain_torque`; without effect if there is no crank.
        bristles: ``(2, 2)`` of both tyres, advanced by one step.
        contacts: ``(2, 7)`` force, point and load of rear and front tyre as of :func:`.tyre_force`, overwritten. When
            called it holds those of the last step, whose loads limit the brakes.
        brake: wanted force of both brakes at the ground, N, not negative.
        forces: generalised forces of :mod:`poise.envs.physics.kinematics`, added to.
    """
    joints = 13 + (state.shape[0] - 13) // 2
    # brakes share in proportion to the load on the wheels during deceleration; each is limited before its wheel would
    # skid, and fades below walking pace, so that brakes never turn a wheel backwards
    ahead = (body[2] + brake / body[1] * body[3]) / body[4]
    if brake > 0.0:
        for number in range(2):
            share = ahead if number == 1 else 1.0 - ahead
            held = min(max(0.0, share) * brake, BRAKED_SHARE * tyres[number, 9] * contacts[number, 6])
            rim = state[joints + links[number]] * tyres[number, 0]
            forces[6 + links[number]] -= held * tyres[number, 0] * max(0.0, math.tanh(rim / BRAKE_FADE))
    for number in range(2):
        row, contact = frames[links[number] + 1], contacts[number]
        # the axle is the second column of the wheel's rotation matrix
        tyre_force(
            tyres[number], ground, time_step, (row[0], row[1], row[2]), (row[4], row[7], row[10]),
            (row[12], row[13], row[14]), (row[15], row[16], row[17]), bristles[number], contact,
        )  # fmt: skip
        if contact[6] > 0.0:
            add_force(tree, frames, links[number], contact[:3], contact[3:6], forces)
    vx, vy, vz = frames[0, 12], frames[0, 13], frames[0, 14]
    factor = -body[0] * math.sqrt(vx * vx + vy * vy + vz * vz)
    forces[0] += factor * vx
    forces[1] += factor * vy
    forces[2] += factor * vz
    if links[3] >= 0:
        rear, crank = links[0], links[3]
        pull = chain_torque(chain, state[13 + crank], state[joints + crank], state[13 + rear], state[joints + rear])
        forces[6 + rear] += pull
        forces[6 + crank] -= chain[0] * pull


@jit
def bicycle_state(frames, state, links, frame, found):  # type: ignore[no-untyped-def]
    """State of the bicycle: the numbers of :class:`.BicycleState` after its time, written into ``found`` ``(15,)``."""
    base = frames[0]
    joints = 13 + (state.shape[0] - 13) // 2
    # columns of the rotation matrix of the bicycle frame, of which Euler angles and body rates need these elements
    xx = base[3] * frame[0] + base[4] * frame[3] + base[5] * frame[6]
    yx = base[6] * frame[0] + base[7] * frame[3] + base[8] * frame[6]
    zx = base[9] * frame[0] + base[10] * frame[3] + base[11] * frame[6]
    xy = base[3] * frame[1] + base[4] * frame[4] + base[5] * frame[7]
    yy = base[6] * frame[1] + base[7] * frame[4] + base[8] * frame[7]
    zy = base[9] * frame[1] + base[10] * frame[4] + base[11] * frame[7]
    xz = base[3] * frame[2] + base[4] * frame[5] + base[5] * frame[8]
    yz = base[6] * frame[2] + base[7] * frame[5] + base[8] * frame[8]
    zz = base[9] * frame[2] + base[10] * frame[5] + base[11] * frame[8]
    ox = xx * frame[9] + xy * frame[10] + xz * frame[11]
    oy = yx * frame[9] + yy * frame[10] + yz * frame[11]
    oz = zx * frame[9] + zy * frame[10] + zz * frame[11]
    wx, wy, wz = base[15], base[16], base[17]
    vx, vy = base[12] + wy * oz - wz * oy, base[13] + wz * ox - wx * oz
    roll, yaw = math.atan2(zy, zz), math.atan2(yx, xx)
    pitch = math.asin(max(-1.0, min(1.0, -zx)))
    # body rates, then rates of the angles
    p, q, r = wx * xx + wy * yx + wz * zx, wx * xy + wy * yy + wz * zy, wx * xz + wy * yz + wz * zz
    turn = q * math.sin(roll) + r * math.cos(roll)
    found[0], found[1], found[2] = base[0] + ox, base[1] + oy, base[2] + oz
    found[3], found[4], found[5] = roll, pitch, yaw
    found[6] = p + math.tan(pitch) * turn
    found[7] = q * math.cos(roll) - r * math.sin(roll)
    found[8] = turn / math.cos(pitch)
    found[9] = vx * math.cos(yaw) + vy * math.sin(yaw)
    found[10], found[11] = state[13 + links[2]], state[joints + links[2]]
    found[12] = found[13] = 0.0
    if links[3] >= 0:
        found[12], found[13] = state[13 + links[3]], state[joints + links[3]]
    found[14] = state[joints + links[0]]
