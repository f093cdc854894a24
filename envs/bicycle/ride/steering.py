"""Steering along a path and the driving force, compiled: :func:`steer_exactly` and :func:`steer_humanly`.

A pilot's memory ``(10,)``: arc length on the path (m), offset to the left of it (m), integral of the offset (m·s),
integral of the speed's error (N), target speed (m/s), its rate (m/s²), steer torque (N·m, left positive) and force at
the wheels (N) that were decided last, 1 while the legs rest, and the path's curvature a little ahead (1/m).

The model counts roll, steer and offset to the right; a bicycle's state and a path count to the left.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from ..course.path import nearest, point_at
from .preview import PREVIEW_BINS, turns_ahead

DISTANCE, OFFSET, OFFSET_INTEGRAL, SPEED_INTEGRAL, TARGET, ACCELERATION, TORQUE, DRIVE, COASTING, AHEAD = range(10)
"""places in a pilot's memory"""
MEMORY = 10
PREVIEW = 0.3
"""s: lead of the rider's lean into turns"""
LOWEST_SPEED = 0.3
"""m/s: gains are held below"""
REACTION = 0.2
"""s, time constant of a rider's pedalling or braking"""


class Piloted(NamedTuple):
    """Numbers of a bicycle with its rider, and of the settings of its pilot.

    Compiled functions take the numbers as an array and the matrices as another one, which costs less at every call
    than many numbers do, and put them together with :func:`piloted_of`.
    """

    period: float
    """s of control"""
    wheelbase: float
    """m"""
    tilt: float
    """1: cosine of the steering axis' tilt"""
    mass: float
    """kg, of all"""
    weight: float
    """N"""
    rolling: float
    """1: rolling resistance"""
    drag: float
    """kg/m: half the density of air times the drag area"""
    largest_torque: float
    """N·m"""
    speed_gain: float
    """N/(m/s)"""
    speed_integral: float
    """N/m"""
    largest_drive: float
    """N"""
    largest_power: float
    """W"""
    largest_brake: float
    """N"""
    lateral_acceleration: float
    """m/s²"""
    forward_acceleration: float
    """m/s²"""
    braking: float
    """m/s²"""
    still: np.ndarray
    """(2, 2) stiffness of Whipple's model at rest, N·m/rad"""
    moving: np.ndarray
    """(2, 2) what a squared speed adds, N·m/rad/(m/s)²"""


@jit
def piloted_of(numbers, stiffness):  # type: ignore[no-untyped-def]
    """:class:`Piloted` of its numbers ``(16,)`` and of both matrices ``(2, 2, 2)``."""
    n = numbers
    return Piloted(
        n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14], n[15],
        stiffness[0], stiffness[1],
    )  # fmt: skip


class Moving(NamedTuple):
    """What a pilot reads of a bicycle; names, units and signs of :class:`.BicycleState`."""

    x: float
    y: float
    roll: float
    pitch: float
    yaw: float
    roll_rate: float
    speed: float
    steer: float
    steer_rate: float


@jit
def moving_of(seen):  # type: ignore[no-untyped-def]
    """:class:`Moving` of :attr:`.BicycleState.numbers`."""
    return Moving(seen[0], seen[1], seen[3], seen[4], seen[5], seen[6], seen[9], seen[10], seen[11])


@jit
def follow(points, now, memory):  # type: ignore[no-untyped-def]
    """Curvature of the path at the bicycle (1/m), and offset (m) and heading (rad) from it, limited, left positive."""
    memory[DISTANCE], memory[OFFSET] = nearest(points, memory[DISTANCE], now.x, now.y)
    _, _, heading, curvature = point_at(points, memory[DISTANCE])
    heading = now.yaw - heading
    heading -= 2.0 * math.pi * np.round(heading / (2.0 * math.pi))
    # beyond a metre or half a radian off the path, limit the correction
    return curvature, max(-1.0, min(1.0, memory[OFFSET])), max(-0.5, min(0.5, heading))


@jit
def turning(piloted, curvature, offset):  # type: ignore[no-untyped-def]
    """Steering angle (rad, left positive) of the turn to ride, at an offset (m, left positive) from the path."""
    # beside the path a turn about the same middle has another radius
    curvature /= max(0.5, 1.0 - curvature * offset)
    return math.atan(piloted.wheelbase * curvature) / piloted.tilt


@jit
def ahead(piloted, points, speed, memory, changes):  # type: ignore[no-untyped-def]
    """:func:`.turns_ahead` at a speed (m/s): the speed that will suit the path a reaction later."""
    still, moving = piloted.still, piloted.moving
    rest = -still[0, 1] / still[0, 0]
    # the roll of a steady turn per steer; its part that grows with the square of the speed
    grown = -(still[0, 1] + moving[0, 1]) / (still[0, 0] + moving[0, 0]) - rest
    turn = (-piloted.wheelbase / piloted.tilt, rest, grown)
    lateral, braking = piloted.lateral_acceleration, piloted.braking
    return turns_ahead(points, memory[DISTANCE], max(speed, LOWEST_SPEED), turn, lateral, braking, changes)


@jit
def look_ahead(points, speed, memory):  # type: ignore[no-untyped-def]
    """Keep the path's curvature :data:`PREVIEW` ahead, at a speed (m/s)."""
    _, _, _, memory[AHEAD] = point_at(points, memory[DISTANCE] + PREVIEW * speed)


@jit
def drive(piloted, now, wanted, memory):  # type: ignore[no-untyped-def]
    """Force at the wheels (N): for slope, drag and the wanted acceleration, and against the error of the speed.

    The error's integral is held while the force is at a limit.
    """
    p = piloted
    change = max(-p.braking * p.period, min(p.forward_acceleration * p.period, wanted - memory[TARGET]))
    memory[TARGET] += change
    memory[ACCELERATION] += (change / p.period - memory[ACCELERATION]) * p.period / REACTION
    error = memory[TARGET] - now.speed
    drag = p.rolling * p.weight + p.drag * now.speed**2
    known = p.mass * memory[ACCELERATION] - p.weight * math.sin(now.pitch) + drag
    integral = memory[SPEED_INTEGRAL] + p.period * p.speed_integral * error
    force = known + p.speed_gain * error + integral
    largest = min(p.largest_drive, p.largest_power / max(LOWEST_SPEED, now.speed))
    if memory[COASTING] > 0.0:
        # what is lost meanwhile is not made up for in a sprint
        memory[TARGET], largest = min(memory[TARGET], now.speed), 0.0
    if -p.largest_brake < force < largest:
        memory[SPEED_INTEGRAL] = integral
    return max(-p.largest_brake, min(largest, force))


@jit
def steer_exactly(numbers, stiffness, points, low, high, part, seen, wanted, lean, memory):  # type: ignore[no-untyped-def]
    """Decide as a pilot who knows the exact state, without delay.

    Args:
        numbers: of :func:`piloted_of`.
        stiffness: likewise.
        points: ``(n, 4)`` of the path.
        low: gains ``(7 + 2 · PREVIEW_BINS,)`` at a speed below.
        high: gains at a speed above.
        part: how far the speed lies between both, 0 to 1.
        seen: ``(15,)`` of :func:`moving_of`.
        wanted: speed, m/s.
        lean: what the rider's lean adds to the roll, rad.
        memory: of the pilot; the decision is written there.
    """
    p, now = piloted_of(numbers, stiffness), moving_of(seen)
    curvature, offset, heading = follow(points, now, memory)
    memory[OFFSET_INTEGRAL] = max(-2.0, min(2.0, memory[OFFSET_INTEGRAL] + p.period * offset))
    steer = turning(p, curvature, offset)
    squared = now.speed * now.speed
    s00, s01 = p.still[0, 0] + squared * p.moving[0, 0], p.still[0, 1] + squared * p.moving[0, 1]
    s10, s11 = p.still[1, 0] + squared * p.moving[1, 0], p.still[1, 1] + squared * p.moving[1, 1]
    roll = s01 * steer / s00
    right = s10 * roll - s11 * steer
    errors = (
        now.roll - roll + lean,
        steer - now.steer,
        now.roll_rate,
        -now.steer_rate,
        -heading,
        -offset,
        -memory[OFFSET_INTEGRAL],
    )
    for index in range(7):
        right -= ((1.0 - part) * low[index] + part * high[index]) * errors[index]
    changes = np.empty(2 * PREVIEW_BINS)
    limit = ahead(p, points, now.speed, memory, changes)
    for index in range(len(changes)):
        right -= ((1.0 - part) * low[7 + index] + part * high[7 + index]) * changes[index]
    memory[TORQUE] = max(-p.largest_torque, min(p.largest_torque, -right))
    memory[DRIVE] = drive(p, now, min(wanted, limit), memory)
    look_ahead(points, now.speed, memory)
