"""One control step of a human pilot, compiled: senses, filter and prediction, command, arms."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from .preview import PREVIEW_BINS
from .steering import (
    DRIVE,
    LOWEST_SPEED,
    OFFSET_INTEGRAL,
    TORQUE,
    ahead,
    drive,
    follow,
    look_ahead,
    moving_of,
    piloted_of,
    turning,
)

STATES = 12
"""size of the state of the internal model"""
ATTENTIVE = 1.4
"""m/s: below, at walking pace, riders attend to balance alone, and the noise of their senses falls with the speed. In
the optimal control model noise is the inverse of the attention (Kleinman et al. 1970); the speed is a choice of this
project"""
CHANNELS = (2, 1, 3, 0, 4, 5)
"""state that each sense reads: roll rate, steer, steer rate (fast); roll, heading, offset (visual)"""


class Human(NamedTuple):
    """Numbers of a human pilot."""

    reaction: float
    """1: moment that leans the trunk to the left, per steer torque to the right"""
    muscles: float
    """N·m/rad: of the trunk's muscles, less what the hands prop"""
    levelling: float
    """1: share of the roll that the intended lean compensates"""
    largest_torque: float
    """N·m"""
    arm_damping: float
    """N·m·s/rad"""
    muscle_sigma: float
    """1: standard deviation of a command for one of the torque"""
    tremor: float
    """N·m"""
    motor_noise: float
    """1"""
    sigma: np.ndarray
    """(6,) standard deviations of the readings"""
    arms: np.ndarray
    """(2, 3) torque and its rate after a step: of both before it, and of the command"""
    still: np.ndarray
    """(3, 3) stiffness over roll, steer and lean at rest, N·m/rad"""
    moving: np.ndarray
    """(3, 3) what a squared speed adds, N·m/rad/(m/s)²"""


@jit
def human_of(numbers, sigma, arms, stiffness):  # type: ignore[no-untyped-def]
    """:class:`Human` of its numbers ``(8,)``, as :func:`.piloted_of`; both matrices ``(2, 3, 3)``."""
    n = numbers
    return Human(n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], sigma, arms, stiffness[0], stiffness[1])


class InternalModel(NamedTuple):
    """The rider's knowledge at one speed. The eyes lag Ns control steps behind, balance and arms Nf."""

    A: np.ndarray
    """(12, 12) one control step"""
    B: np.ndarray
    """(12, 3) of command, turning rate of the path and intended lean"""
    K: np.ndarray
    """(12, 6) filter gain of all senses"""
    carry: np.ndarray
    """(12, 12) filter's state to the present"""
    inputs: np.ndarray
    """(12, 3 Ns) remembered inputs, the oldest first, to the present"""
    readings: np.ndarray
    """(12, 3 (Ns − Nf)) fast readings since the filter's time, the oldest first, to the present"""
    gains: np.ndarray
    """(13 + 3 · PREVIEW_BINS,): command per state (the integral of the offset is the last) and per change of roll,
    steer and arm torque of the steady turn ahead"""

    @property
    def columns(self) -> np.ndarray:
        """The columns ``(33 + 3 Ns + 3 (Ns − Nf), 12)`` of all matrices, one after the other."""
        return np.ascontiguousarray(np.hstack(self[:6]).T)


@jit
def add_column(total, columns, place, factor):  # type: ignore[no-untyped-def]
    """Add to ``total`` ``(12,)`` a factor times one column: all rows at once, which the processor does in parallel."""
    for row in range(STATES):
        total[row] += columns[place, row] * factor


@jit
def estimate(columns, state, inputs, readings, now, present):  # type: ignore[no-untyped-def]
    """One control step of filter and prediction.

    Args:
        columns: of the :class:`InternalModel` at the present speed.
        state: ``(12,)`` of the filter, Ns + 1 steps ago.
        inputs: ``(Ns + 1, 3)`` inputs since then, the oldest first.
        readings: ``(Ns + 1, 6)`` of all senses, of Ns steps ago up to the present; the visual ones count at their first
            row only, the fast ones up to Nf steps ago.
        now: ``(12,)`` state of the filter Ns steps ago, overwritten.
        present: ``(12,)`` expected state at present, overwritten.
    """
    before, delay = np.zeros(STATES), inputs.shape[0] - 1
    # the order of the columns: A, B, K, carry, inputs, readings
    for column in range(STATES):
        add_column(before, columns, column, state[column])
    for column in range(3):
        add_column(before, columns, 12 + column, inputs[0, column])
    for row in range(STATES):
        now[row] = before[row]
    for sense in range(6):
        add_column(now, columns, 15 + sense, readings[0, sense] - before[CHANNELS[sense]])
    present[:] = 0.0
    for column in range(STATES):
        add_column(present, columns, 21 + column, now[column])
    place = 33
    for step in range(delay):
        for column in range(3):
            add_column(present, columns, place + column, inputs[1 + step, column])
        place += 3
    for step in range((columns.shape[0] - place) // 3):
        for column in range(3):
            add_column(present, columns, place + column, readings[1 + step, column])
        place += 3


@jit
def steady_turn(human, speed, steer, lean):  # type: ignore[no-untyped-def]
    """Roll (rad), lean (rad) and steer torque (N·m) that hold a small steering angle with an intended lean.

    The lean is what is intended besides levelling.
    """
    K = human.still + speed * speed * human.moving
    # the torque, eliminated from the equation of the lean, adds the reaction times the equation of the steering
    reaction, muscles = human.reaction, human.muscles
    a, b, c, d = K[0, 0], K[0, 2], K[2, 0] + reaction * K[1, 0], K[2, 2] + reaction * K[1, 2]
    c += muscles * human.levelling
    first = -K[0, 1] * steer
    second = muscles * lean - (K[2, 1] + reaction * K[1, 1]) * steer
    inverse = 1.0 / (a * d - b * c)
    roll, lean = inverse * (d * first - b * second), inverse * (a * second - c * first)
    return roll, lean, K[1, 0] * roll + K[1, 1] * steer + K[1, 2] * lean


@jit
def move_up(rows):  # type: ignore[no-untyped-def]
    """Each row ``(n,)`` takes what the next one holds; the last one keeps its own."""
    for row in range(rows.shape[0] - 1):
        for column in range(rows.shape[1]):
            rows[row, column] = rows[row + 1, column]


@jit
def steer_humanly(  # type: ignore[no-untyped-def]
    numbers, stiffness, human, points, below, above, part, noise, seen, wanted, lean, memory, state, inputs, readings
):
    """Decide as a human.

    Args:
        numbers: of :func:`.piloted_of`.
        stiffness: likewise.
        human: arguments of :func:`human_of`.
        points: ``(n, 4)`` of the path.
        below: :attr:`InternalModel.columns` and gains at a speed below.
        above: at a speed above.
        part: how far the speed lies between both, 0 to 1.
        noise: ``(7,)`` standard normal numbers: six senses and the muscles.
        seen: ``(15,)`` of :func:`.moving_of`.
        wanted: speed, m/s.
        lean: of the trunk to the bicycle that the rider intends besides levelling, rad, right positive.
        memory: of the pilot; the decision is written there.
        state: ``(14,)`` of the internal model and of the arms (torque and its rate), advanced.
        inputs: ``(Ns + 1, 3)`` remembered, advanced.
        readings: ``(Ns + 1, 6)`` remembered, advanced.
    """
    piloted, now = piloted_of(numbers, stiffness), moving_of(seen)
    person = human_of(human[0], human[1], human[2], human[3])
    low, high = below[1], above[1]
    curvature, offset, heading = follow(points, now, memory)
    move_up(readings)
    felt = (now.roll_rate, -now.steer, -now.steer_rate, now.roll, -heading, -offset)
    heed = min(1.0, max(LOWEST_SPEED, now.speed) / ATTENTIVE)
    for sense in range(6):
        readings[-1, sense] = felt[sense] + heed * person.sigma[sense] * noise[sense]
    # filter and predict, between two speeds of the table
    first, second, expected, later = np.empty(STATES), np.empty(STATES), np.empty(STATES), np.empty(STATES)
    estimate(below[0], state, inputs, readings, first, expected)
    estimate(above[0], state, inputs, readings, second, later)
    for row in range(STATES):
        state[row] = (1.0 - part) * first[row] + part * second[row]
        expected[row] = (1.0 - part) * expected[row] + part * later[row]
    left, lean = turning(piloted, curvature, offset), lean + person.levelling * now.roll
    roll, trunk, torque = steady_turn(person, now.speed, -left, lean)
    # beyond a metre or half a radian off the path, limit the correction
    steer, offset, heading = expected[1], max(-1.0, min(1.0, expected[5])), max(-0.5, min(0.5, expected[4]))
    memory[OFFSET_INTEGRAL] = max(-2.0, min(2.0, memory[OFFSET_INTEGRAL] + piloted.period * offset))
    expected[0] -= roll
    expected[1] += left
    expected[6] -= torque
    expected[10] -= trunk
    expected[4], expected[5] = heading, offset
    command = torque
    for row in range(STATES):
        command -= ((1.0 - part) * low[row] + part * high[row]) * expected[row]
    command -= ((1.0 - part) * low[STATES] + part * high[STATES]) * memory[OFFSET_INTEGRAL]
    changes = np.empty(2 * PREVIEW_BINS)
    limit = ahead(piloted, points, now.speed, memory, changes)
    squared = max(now.speed, LOWEST_SPEED) ** 2
    by_roll = piloted.still[1, 0] + squared * piloted.moving[1, 0]
    by_steer = piloted.still[1, 1] + squared * piloted.moving[1, 1]
    for index in range(PREVIEW_BINS):
        to_roll, to_steer = changes[index], changes[PREVIEW_BINS + index]
        for kind, change in enumerate((to_roll, to_steer, by_roll * to_roll + by_steer * to_steer)):
            place = STATES + 1 + PREVIEW_BINS * kind + index
            command -= ((1.0 - part) * low[place] + part * high[place]) * change
    command = person.largest_torque * math.tanh(command / person.largest_torque)
    # the path turns the heading; so does what steering does beyond the linear model
    angle = -piloted.tilt * max(-1.2, min(1.2, steer))
    curvature /= max(0.5, 1.0 + curvature * offset)
    move_up(inputs)
    inputs[-1, 0] = command
    inputs[-1, 1] = now.speed * (curvature - (math.tan(angle) - angle) / piloted.wheelbase)
    inputs[-1, 2] = lean
    # the arms' torque, right positive, follows the command of muscles that are not steady
    memory[TORQUE] = -state[12] - person.arm_damping * now.steer_rate
    driven = command + person.muscle_sigma * math.hypot(person.tremor, person.motor_noise * command) * noise[6]
    arm, rate = state[12], state[13]
    for row in range(2):
        state[12 + row] = person.arms[row, 0] * arm + person.arms[row, 1] * rate + person.arms[row, 2] * driven
    memory[DRIVE] = drive(piloted, now, min(wanted, limit), memory)
    look_ahead(points, now.speed, memory)
