"""What a rider's muscles do, compiled: :func:`plan` for a control step, :func:`act` in every physics step.

Arrays of a rider with n joints (three of the trunk, four of each limb unless lumped):

* memory ``(MUSCLES + 2 n,)``: what :func:`plan` decided and :func:`act` applied, by the slices below, then n planned
  and n applied torques (N·m);
* links ``(3 + n,)`` of joints: pitch, roll and rise of the pelvis, then those of trunk and limbs; ``(5 + n,)`` of a
  rider who may stand: then those of the pelvis along and across the bicycle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from ...physics.kinematics import move_links
from ..frame.forces import bicycle_forces
from .effort import (
    AROUND,
    LARGEST_PEDAL_FORCE,
    MEAN_STROKE,
    Reach,
    hands_against,
    held_down,
    moments_of_feet,
    pedal_push,
    swung,
    trunk_support,
)
from .limb_tables import SHOULDERS_FOLLOW, abductions, legs_on_pedals
from .limbs import into_pelvis, into_trunk, tip_torques
from .rigid_limbs import push_between
from .saddle import SeatContact, press
from .style import intentions

TRUNK_STIFFNESS, TRUNK_DAMPING = 900.0, 90.0
"""N·m/rad and N·m·s/rad of the lumbar joint's muscles"""
SWIVEL_STIFFNESS, SWIVEL_DAMPING = (60.0, 120.0), (2.0, 6.0)
"""N·m/rad, N·m·s/rad of arms and of legs: hold elbows and knees in their planes"""
ABDUCTION, ROTATION = 0.6, 0.9
"""rad: beyond these the ligaments of a hip resist, so that a knee never passes behind it"""
TURNED = 0.8
"""rad of steering up to which the shoulders follow"""
LIGAMENT, LIGAMENT_DAMPING = 300.0, 0.3
"""N·m/rad, s/rad: damping grows with the depth, without a blow (K. H. Hunt, F. R. E. Crossley 1975)"""
ARMS = 2
"""limbs before the legs"""
HEAVIEST = 3.0
"""1: weight of a lumped rider's legs on the pedals over a bump at most, in parts of that at rest"""
RESTING = -1e-6
"""N: the drive that says that the legs rest while the bicycle coasts"""
KEEPING_UP = 4.0
"""N·m/(rad/s) on the crank, towards the wheel's pace"""

TARGET, SUPPORT, SWIVEL, WANTED = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 14)
"""wanted angles of the trunk (rad), torques that support it (N·m), wanted abduction and swivel of the limbs (rad)"""
HANDS, FEET, PUSHES, WEIGHTS = slice(14, 20), slice(20, 26), slice(26, 32), slice(32, 38)
HANDS_AND_FEET = slice(14, 26)
"""forces (N, bicycle axes) of left and right hand and foot, of the legs' muscles and of the legs' weight"""
SWUNG = slice(38, 40)
"""roll of the bicycle by which a standing rider swings it (rad), and its rate (rad/s)"""
MUSCLES = 40
"""where the planned torques begin"""
GRIP, HELD, HELD_RATE = 0.6, 3e4, 1.5e3
"""1, N/m and N·s/m: friction of a saddle that a rider may leave; riders who stay are held without a limit"""


class Build(NamedTuple):
    """Numbers of one rider on one bicycle.

    Compiled functions take :attr:`numbers` and the arrays, which costs less at every call than many numbers do, and put
    them together with :func:`build_of`.
    """

    reach: Reach
    seat: SeatContact
    flexion: float
    """rad: of the trunk at rest"""
    wheel_radius: float
    """m: rear"""
    grip_arm: float
    """m: of the hands about the steering axis"""
    hand_load: float
    """N downwards with each hand"""
    elbow_weight: float
    """N"""
    pulls: np.ndarray
    """(2, 2, 3) direction in which each hand moves when the bar turns to the left, and its change with the angle"""
    axis: np.ndarray
    """(3,) of steering, upwards"""
    limbs: np.ndarray
    """(2, 3) of arms and legs: length of the upper segment, x and z of the tip in the lower one, m"""
    table: np.ndarray
    """of :func:`.abductions`"""
    legs: np.ndarray
    """of :func:`.legs_on_pedals`"""
    middle: np.ndarray
    """(7,) trunk (rad) and swivels (rad) around which the table is linear"""

    @property
    def numbers(self) -> np.ndarray:
        """Saddle, reach, and the five numbers after them ``(28,)``."""
        r = self.reach
        reach = (*r.grip, r.lumbar, *r.steer_axis, *r.axle, r.crank, r.pedal, r.trunk_moment, r.pushed_back)
        return np.array([*self.seat, *reach, *self[2:7]])

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The other fields."""
        return self[7:]


@jit
def seat_of(n):  # type: ignore[no-untyped-def]
    """The saddle in :attr:`Build.numbers`."""
    return SeatContact(n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10])


@jit
def build_of(n, arrays):  # type: ignore[no-untyped-def]
    """:class:`Build` of its numbers and arrays."""
    grip, steer_axis, axle = (n[11], n[12], n[13]), (n[15], n[16]), (n[17], n[18])
    reach = Reach(grip, n[14], steer_axis, axle, n[19], n[20], n[21], n[22])
    pulls, axis, limbs, table, legs, middle = arrays
    return Build(reach, seat_of(n), n[23], n[24], n[25], n[26], n[27], pulls, axis, limbs, table, legs, middle)


@jit
def added(force, factor, more):  # type: ignore[no-untyped-def]
    """A force and a factor times another one, N."""
    return force[0] + factor * more[0], force[1] + factor * more[1], force[2] + factor * more[2]


@jit
def plan(  # type: ignore[no-untyped-def]
    numbers, arrays, table, habits, time, curvature, seen, foot, steer_torque, drive, chain, state, links, memory
):
    """Decide what the muscles do during the next control period.

    Args:
        numbers: of :class:`Build`.
        arrays: likewise.
        table: of :func:`.intentions`, as of the next three.
        habits: of the rider.
        time: s.
        curvature: of the path a little ahead, 1/m, left positive.
        seen: :attr:`.BicycleState.numbers`.
        foot: :attr:`.Foot.engaged`.
        steer_torque: N·m on the handlebar, left positive.
        drive: desired propulsive force at the wheel, N, without braking.
        chain: of :func:`.chain_torque`.
        state: see :mod:`poise.envs.physics.kinematics`.
        links: see above.
        memory: written.
    """
    build = build_of(numbers, arrays)
    reach, seat = build.reach, build.seat
    lying, speed, steer, crank, crank_rate, wheel_rate = seen[3], seen[9], seen[10], seen[12], seen[13], seen[14]
    ratio = chain[0]
    # change of the trunk's flexion, lean and twist, four swivels (rad), unsteady torque (N·m)
    intended = intentions(table, habits, time, curvature, lying, crank, speed, foot)
    first, rates, joints = 13, 13 + (state.shape[0] - 13) // 2, (memory.shape[0] - MUSCLES) // 2
    target = memory[TARGET]
    target[0] = build.flexion + intended[0]
    target[1] = intended[1]
    target[2] = intended[2] + SHOULDERS_FOLLOW * max(-TURNED, min(TURNED, steer))
    swivels = memory[WANTED]
    for limb in range(4):
        swivels[limb] = intended[3 + limb]
    pitch, roll, rise = state[first + links[0]], state[first + links[1]], state[first + links[2]]
    pitching, rolling, rising = state[rates + links[0]], state[rates + links[1]], state[rates + links[2]]
    # muscles also carry the legs' weight around, half of it each
    wanted = max(0.0, drive) * build.wheel_radius * ratio
    push = min(LARGEST_PEDAL_FORCE, wanted / (reach.crank * MEAN_STROKE))
    (left_weight, right_weight), lift, tip, swing = legs_on_pedals(build.legs, crank)
    left_phase, right_phase = crank, crank + math.pi
    turning = -math.sin(left_phase) * left_weight[0] - math.cos(left_phase) * left_weight[2]
    turning -= math.sin(right_phase) * right_weight[0] + math.cos(right_phase) * right_weight[2]
    # and keep the crank at the speed of the wheel, so that the chain stays nearly taut
    pace = wheel_rate / ratio if drive != RESTING else 0.0
    pace = max(-15.0, min(15.0, KEEPING_UP * (pace - crank_rate)))
    around = push * AROUND + 0.5 * (pace / reach.crank - turning)
    draw = held_down(seat, rise, rising)
    left, right = pedal_push(push, around, left_phase, draw), pedal_push(push, around, right_phase, draw)
    # the legs' own weight is part of the balance at rest; drive, brakes and slopes act on the upper body
    _, forwards = moments_of_feet(reach, crank, left, right)
    squared = crank_rate * crank_rate
    if joints > 3:
        # muscles of hips and knees swing the legs, so that pedals and chain feel only the push
        left, right = added(left, squared, swing[0]), added(right, squared, swing[1])
    pushes, weights, feet = memory[PUSHES], memory[WEIGHTS], memory[FEET]
    for axis in range(3):
        weights[axis], weights[3 + axis] = left_weight[axis], right_weight[axis]
        feet[axis], feet[3 + axis] = left[axis] + left_weight[axis], right[axis] + right_weight[axis]
    lift, tip = squared * lift, squared * tip
    rightwards, _ = moments_of_feet(reach, crank, (feet[0], feet[1], feet[2]), (feet[3], feet[4], feet[5]))
    forwards -= reach.pushed_back * drive
    rightwards += tip + reach.trunk_moment * math.sin(target[1])
    difference, common = hands_against(reach, seat, rightwards, forwards, (pitch, pitching, roll, rolling))
    # forces of the hands, and how the trunk bears them
    strength = 0.5 * (steer_torque + intended[7]) / build.grip_arm
    c, s = math.cos(steer), math.sin(steer)
    hands = memory[HANDS]
    for side in range(2):
        along = difference if side == 0 else -difference
        for axis in range(3):
            pull = c * build.pulls[side, 0, axis] + s * build.pulls[side, 1, axis]
            hands[3 * side + axis] = strength * pull + along * build.axis[axis]
        hands[3 * side + 2] += common - build.hand_load
    if joints == 3:
        left, right = swung(reach, left, right, lift, tip)
    for axis in range(3):
        pushes[axis], pushes[3 + axis] = left[axis], right[axis]
    tense(numbers, arrays, steer, seen[11], crank, state, links, memory)


@jit
def tense(numbers, arrays, steer, steer_rate, crank, state, links, memory):  # type: ignore[no-untyped-def]
    """Torques that make the forces of hands and feet in the memory and support the trunk; arguments of :func:`plan`."""
    build = build_of(numbers, arrays)
    first, joints = 13, (memory.shape[0] - MUSCLES) // 2
    hands, pushes, target, support = memory[HANDS], memory[PUSHES], memory[TARGET], memory[SUPPORT]
    left_hand, right_hand = (hands[0], hands[1], hands[2]), (hands[3], hands[4], hands[5])
    supported = trunk_support(build.reach, left_hand, right_hand, target[0], target[1])
    support[0], support[1], support[2] = supported
    if joints == 3:
        return
    if abs(steer) < TURNED:
        # the trunk's muscles turn the shoulders after the bar; else the bar would have to, through the arms
        support[2] += TRUNK_DAMPING * SHOULDERS_FOLLOW * steer_rate
    abductions(build.table, build.middle, steer, crank, target, memory[WANTED], memory[SWIVEL])
    pitch, roll = state[first + links[0]], state[first + links[1]]
    trunk = (state[first + links[3]], state[first + links[4]], state[first + links[5]])
    up, nothing = into_trunk(trunk, (0.0, 0.0, build.elbow_weight)), (0.0, 0.0, 0.0)
    torques = memory[MUSCLES : MUSCLES + joints]
    torques[:3] = 0.0
    left, right = (pushes[0], pushes[1], pushes[2]), (pushes[3], pushes[4], pushes[5])
    for limb, force in enumerate((left_hand, right_hand, left, right)):
        force = into_pelvis((pitch, roll), force)
        if limb < 2:
            force = into_trunk(trunk, force)
        place = 3 + 4 * limb
        held = links[3 + place : 7 + place]
        angles = (state[first + held[0]], state[first + held[1]], state[first + held[2]], state[first + held[3]])
        found = tip_torques(build.limbs[limb // 2], angles, force, up if limb < 2 else nothing)
        for joint in range(4):
            torques[place + joint] = found[joint]


@jit
def ligament(angle, rate, limit):  # type: ignore[no-untyped-def]
    """Torque of a joint's ligaments, N·m: zero within ± the limit (rad), never one that pulls outwards."""
    beyond = angle - max(-limit, min(limit, angle))
    if beyond == 0.0:
        return 0.0
    torque = -LIGAMENT * beyond * (1.0 + math.copysign(LIGAMENT_DAMPING, beyond) * rate)
    return min(0.0, torque) if beyond > 0.0 else max(0.0, torque)


@jit
def act(numbers, tree, state, frames, links, holds, memory, forces):  # type: ignore[no-untyped-def]
    """Add what rider and saddle do in the next physics step to the generalised forces.

    Args:
        numbers: of :class:`Build`.
        tree: see :mod:`poise.envs.physics.kinematics`, as of the next two.
        state: now.
        frames: now.
        links: see above.
        holds: links, arms and axes of :func:`.push_between`: hands and feet of a lumped rider.
        memory: the applied torques are written.
        forces: ``(6 + …,)``, added to.
    """
    first, rates, joints = 13, 13 + (state.shape[0] - 13) // 2, (memory.shape[0] - MUSCLES) // 2
    pitch, roll, rise = state[first + links[0]], state[first + links[1]], state[first + links[2]]
    pitching, rolling, rising = state[rates + links[0]], state[rates + links[1]], state[rates + links[2]]
    seat, target, support = seat_of(numbers), memory[TARGET], memory[SUPPORT]
    applied = memory[MUSCLES + joints :]
    for joint in range(joints):
        applied[joint] = memory[MUSCLES + joint]
    # the trunk keeps its posture in the bicycle, whatever the pelvis does below it
    c, s = math.cos(target[0]), math.sin(target[0])
    below, moving = (pitch, c * roll, s * roll), (pitching, c * rolling, s * rolling)
    for axis in range(3):
        angle = state[first + links[3 + axis]] + below[axis]
        rate = state[rates + links[3 + axis]] + moving[axis]
        applied[axis] += TRUNK_STIFFNESS * (target[axis] - angle) - TRUNK_DAMPING * rate + support[axis]
    for limb in range((joints - 3) // 4):
        # abduction holds the swivel
        joint = 4 + 4 * limb
        angle, rate = state[first + links[3 + joint]], state[rates + links[3 + joint]]
        stiffness, damping = SWIVEL_STIFFNESS[limb // 2], SWIVEL_DAMPING[limb // 2]
        applied[joint] += stiffness * (memory[SWIVEL][limb] - angle) - damping * rate
        if limb >= ARMS:
            turned, turning = state[first + links[4 + joint]], state[rates + links[4 + joint]]
            applied[joint] += ligament(angle, rate, ABDUCTION)
            applied[joint + 1] += ligament(turned, turning, ROTATION)
    forwards, rightwards, force = press(seat, pitch, pitching, roll, rolling, rise, rising)
    if joints == 3:
        # saddle and pedals share the weight of rigid legs, also over a bump
        share = min(HEAVIEST, force / seat.load)
        for number in range(6):
            memory[FEET][number] = memory[PUSHES][number] + share * memory[WEIGHTS][number]
        push_between(tree, frames, holds[0], holds[1], holds[2], memory[HANDS_AND_FEET].reshape(4, 3), forces)
    for joint in range(joints):
        forces[6 + links[3 + joint]] += applied[joint]
    forces[6 + links[0]] += forwards
    forces[6 + links[1]] += rightwards
    forces[6 + links[2]] += force
    for slide in range(3 + joints, links.shape[0]):
        pull = -HELD * state[first + links[slide]] - HELD_RATE * state[rates + links[slide]]
        forces[6 + links[slide]] += max(-GRIP * force, min(GRIP * force, pull))


@jit
def act_on_bicycle(numbers, tree, state, frames, late, links, holds, memory, acting, brake, forces):  # type: ignore[no-untyped-def]
    """:func:`act` and :func:`.bicycle_forces` in one call.

    ``late``: move the frames first; ``acting``: what :func:`.bicycle_forces` takes before the brake (N).
    """
    if late:
        move_links(tree, state, frames)
    act(numbers, tree, state, frames, links, holds, memory, forces)
    parts, body, tyres, ground, time_step, chain, bristles, contacts = acting
    bicycle_forces(tree, state, frames, parts, body, tyres, ground, time_step, chain, bristles, contacts, brake, forces)
