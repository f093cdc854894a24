"""What a human rider knows of the bicycle: the Kalman filter and predictor across the delay of the senses.

State ``(12,)``, to the right positive: roll, steer, roll rate, steer rate, heading error, offset, arm torque, its rate,
roll moment and steer torque of disturbances, lean of the trunk to the bicycle, its rate. Inputs: the torque that the
brain commands, the turning rate of the path, and the lean that the rider intends besides levelling the shoulders. The
eyes lag Ns control steps behind, balance and arms Nf. At each step the filter takes what all senses told about the time
Ns steps ago; then, from there to Nf steps ago, what the fast ones told since; then the model predicts to the present.
All of it is linear, so that the last two stages become matrices on the filter's state and on the inputs and readings
that are remembered.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..frame.parameters import BicycleParameters
from ..frame.whipple import whipple_model
from .human_steering import CHANNELS, STATES, InternalModel
from .pilot import PilotParameters
from .regulator import preview_regulator, riccati, sampled

FAST = 3
"""number of fast senses"""
STEER_DISTURBANCE, STEER_DISTURBANCE_TIME = 1.5, 0.5
"""N·m, s: standard deviation and time constant of the steer torque that the internal model does not explain"""
HEADING_DRIFT, OFFSET_DRIFT = math.radians(0.3), 0.01
"""rad/√s, m/√s: growth of heading and offset that it does not explain (tyres slip, the road slopes)"""
TRUNK_DRIFT = 0.3
"""rad/s/√s: growth of the trunk's rate that it does not explain"""
USUAL_TORQUE = 1.0
"""N·m: for the noise of muscles that the internal model expects"""
SMOOTH = 1e-4
"""cost of a squared N·m/s of arm torque"""


class TrunkModel(NamedTuple):
    """A trunk on an elastic joint above the saddle: what leans to the side when the bicycle moves below it."""

    mass: float
    """kg"""
    arm: float
    """m: centre of mass from the joint"""
    height: float
    """m: centre of mass above the ground"""
    ahead: float
    """m: centre of mass ahead of the rear contact"""
    flexion: float
    """rad: forward"""
    inertia: float
    """kg·m² about its axis of lean through the centre of mass"""
    stiffness: float
    """N·m/rad"""
    damping: float
    """N·m·s/rad"""
    support: float
    """N·m/rad: moment by which the hands prop an intended lean"""
    bar_inertia: float
    """kg·m²: of the arms about the steering axis"""
    bar_damping: float
    """N·m·s/rad: of the arms' joints about the steering axis"""
    levelling: float
    """1: share of the roll that the intended lean compensates"""


RIGID = TrunkModel(0.0, 0.3, 1.0, 0.3, 0.0, 1.0, 900.0, 90.0, 0.0, 0.0, 0.0, 0.0)
"""No trunk besides what is rigid on the bicycle: a joint without mass."""


def delays(pilot: PilotParameters, step: float) -> tuple[int, int]:
    """Control steps (of ``step`` s) by which the eyes, and balance and arms, lag behind; at least one."""
    slow, fast = (max(1, round(delay / step)) for delay in (pilot.visual_delay, pilot.vestibular_delay))
    return slow, fast


def sensing_noise(pilot: PilotParameters, step: float) -> np.ndarray:
    """Standard deviation ``(6,)`` of a reading of each sense, in the order of :data:`CHANNELS`."""
    means = (
        pilot.roll_rate_noise,
        pilot.steer_noise,
        pilot.steer_rate_noise,
        pilot.roll_noise,
        pilot.heading_noise,
        pilot.offset_noise,
    )
    return np.array(means) / math.sqrt(step)


def command_noise(pilot: PilotParameters, step: float) -> float:
    """Standard deviation of a command for one of the torque that muscles of second order make of it."""
    return math.sqrt(4.0 * pilot.muscle_damping / (pilot.muscle_frequency * step))


def lean_matrices(bicycle: BicycleParameters, trunk: TrunkModel, gravity: float, speed: float) -> list[np.ndarray]:
    """Mass, damping and stiffness ``(3, 3)`` over roll, steer and lean, right positive, at a speed (m/s).

    The first two rows and columns are Whipple's, of the rider with an upright trunk. The third follows from the lateral
    acceleration of the trunk's centre, which rolls, leans and is carried around by the yawing frame.
    """
    model = whipple_model(bicycle, gravity)
    m, arm, w = trunk.mass, trunk.arm, bicycle.wheelbase
    yaw = math.cos(bicycle.steer_axis_tilt) / w
    M, C, K = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    M[:2, :2], C[:2, :2], K[:2, :2] = model.M, speed * model.C1, model.stiffness(speed)
    M[1, 1] += trunk.bar_inertia
    M[0, 2] = M[2, 0] = m * arm * trunk.height + trunk.inertia * math.cos(trunk.flexion) * (m > 0.0)
    M[1, 2] = M[2, 1] = m * arm * trunk.ahead * bicycle.trail * yaw
    M[2, 2] = m * arm**2 + trunk.inertia
    C[1, 1] += trunk.bar_damping
    C[2, 1] = m * arm * speed * (bicycle.trail + trunk.ahead) * yaw
    C[2, 2] = trunk.damping
    K[0, 2] = K[2, 0] = -m * gravity * arm
    K[2, 1] = m * arm * speed**2 * yaw
    K[2, 2] = trunk.stiffness - m * gravity * arm * math.cos(trunk.flexion)
    return [M, C, K]


def steering_reaction(bicycle: BicycleParameters, trunk: TrunkModel) -> float:
    """Moment that leans the trunk to the left, per steer torque to the right: the bar turns the trunk back."""
    return math.sin(bicycle.steer_axis_tilt + trunk.flexion) * (trunk.mass > 0.0)


def rider_model(
    bicycle: BicycleParameters, pilot: PilotParameters, trunk: TrunkModel, gravity: float, speed: float
) -> tuple[np.ndarray, np.ndarray]:
    """Continuous model ``(12, 12)`` and inputs ``(12, 3)`` at a speed, m/s."""
    mass, damping, stiffness = lean_matrices(bicycle, trunk, gravity, speed)
    inverse = np.linalg.inv(mass)
    A, B = np.zeros((STATES, STATES)), np.zeros((STATES, 3))
    places, rates = [0, 1, 10], [2, 3, 11]
    A[places, rates] = 1.0
    A[np.ix_(rates, places)], A[np.ix_(rates, rates)] = -inverse @ stiffness, -inverse @ damping
    # heading and offset
    yaw = math.cos(bicycle.steer_axis_tilt) / bicycle.wheelbase
    A[4, 1], A[4, 3], A[5, 4], B[4, 1] = speed * yaw, bicycle.trail * yaw, speed, 1.0
    # muscles of second order turn the bar; those of the trunk lean
    w = pilot.muscle_frequency
    hands = inverse @ (0.0, 1.0, -steering_reaction(bicycle, trunk))
    A[rates, 6], B[rates, 2] = hands, (trunk.stiffness - trunk.support) * inverse[:, 2]
    A[rates, 3] -= pilot.arm_damping * hands
    A[rates, 0] -= trunk.levelling * B[rates, 2]
    A[6, 7], A[7, 6], A[7, 7], B[7, 0] = 1.0, -w * w, -2.0 * pilot.muscle_damping * w, w * w
    # disturbances that fade
    A[np.ix_(rates, [8, 9])] = inverse[:, :2]
    A[8, 8], A[9, 9] = -1.0 / pilot.sway_time, -1.0 / STEER_DISTURBANCE_TIME
    return A, B


@lru_cache(maxsize=1024)
def internal_model(
    bicycle: BicycleParameters,
    pilot: PilotParameters,
    trunk: TrunkModel,
    costs: tuple[float, ...],
    gravity: float,
    speed: float,
    step: float,
) -> InternalModel:
    """The internal model at one speed; computed when first needed.

    Args:
        bicycle: rider included.
        pilot: senses, muscles and weights.
        trunk: what leans.
        costs: of roll, steer, roll rate, steer rate, heading, offset and its integral.
        gravity: m/s².
        speed: m/s.
        step: s between control steps.
    """
    continuous, inputs = rider_model(bicycle, pilot, trunk, gravity, speed)
    A, B = sampled(continuous, inputs, step)
    C, F = np.eye(STATES)[list(CHANNELS)], np.eye(STATES)[list(CHANNELS[:FAST])]
    R = np.diag(sensing_noise(pilot, step) ** 2)
    Q = step * np.diag(_noise(pilot, step))
    identity = np.eye(STATES)

    # steady Kalman filter at the time of the eyes
    P = riccati(A.T, C.T, Q, R)
    K = np.linalg.solve(C @ P @ C.T + R, C @ P).T
    P = (identity - K @ C) @ P

    # on to the present: first with fast readings, then by prediction; each stage maps what came before it
    slow, fast = delays(pilot, step)
    read = slow - fast
    carry, to_inputs, to_readings = identity, np.zeros((STATES, 3 * slow)), np.zeros((STATES, FAST * read))
    for index in range(slow):
        acted, heard = to_inputs[:, : 3 * index], to_readings[:, : FAST * min(index, read)]
        moved, driven = A, B
        if index < read:
            P = A @ P @ A.T + Q
            gain = np.linalg.solve(F @ P @ F.T + R[:FAST, :FAST], F @ P).T
            kept = identity - gain @ F
            P, moved, driven = kept @ P, kept @ A, kept @ B
            to_readings[:, FAST * index : FAST * (index + 1)] = gain
        carry, acted[:], heard[:] = moved @ carry, moved @ acted, moved @ heard
        to_inputs[:, 3 * index : 3 * (index + 1)] = driven
    arrays = [np.ascontiguousarray(each) for each in (A, B, K, carry, to_inputs, to_readings)]
    return InternalModel._make([*arrays, _command_gains(continuous, inputs, pilot, costs, step)])


def _noise(pilot: PilotParameters, step: float) -> np.ndarray:
    """Intensity ``(12,)`` of the process noise, per s."""
    intensity = np.zeros(STATES)
    intensity[4], intensity[5] = HEADING_DRIFT**2, OFFSET_DRIFT**2
    command = command_noise(pilot, step) * math.hypot(pilot.tremor, pilot.motor_noise * USUAL_TORQUE)
    intensity[7] = step * (pilot.muscle_frequency**2 * command) ** 2
    intensity[11] = TRUNK_DRIFT**2
    intensity[8] = 2.0 * pilot.sway**2 / pilot.sway_time
    intensity[9] = 2.0 * STEER_DISTURBANCE**2 / STEER_DISTURBANCE_TIME
    return intensity


def _command_gains(
    A: np.ndarray, B: np.ndarray, pilot: PilotParameters, costs: tuple[float, ...], step: float
) -> np.ndarray:
    """Regulator on the state and the integral of the offset, relative to those of the steady turn."""
    size = STATES + 1
    larger, column = np.zeros((size, size)), np.zeros((size, 1))
    larger[:STATES, :STATES], larger[STATES, 5] = A, 1.0
    column[:STATES, 0] = B[:, 0]
    cost = np.zeros(size)
    cost[:6], cost[7], cost[STATES] = costs[:6], SMOOTH, costs[6]
    changes = np.eye(size)[:, [0, 1, 6]]
    sampled_A, sampled_B = sampled(larger, column, step)
    gains, kernel = preview_regulator(sampled_A, sampled_B, np.diag(cost), pilot.effort, step, changes)
    return np.concatenate([gains, kernel.ravel()])
