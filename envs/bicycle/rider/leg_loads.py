"""Weight and inertia of a pedalling leg that hip and pedal carry, by virtual work over a turn of the crank.

The hip is free to bend and to turn and the knee to bend. The virtual work of the leg's weight and inertia and of the
pedal's force vanishes along these three joints: Jᵀ f = Σ (∂x/∂q)ᵀ m (a + g) + (∂θ/∂q)ᵀ dL/dt.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ..frame.parameters import Mass
from .limbs import forward, reach_to
from .posture import CRANKS, KNEE_OUT, Posture

FREE = (0, 2, 3)
"""joints of the leg without torque: flexion and turn of the hip, the knee; abduction holds its swivel"""
STEP = 1e-5
"""rad for derivatives"""


class _Leg(NamedTuple):
    tip: np.ndarray
    """(n, 3) of the pedal from the hip, m"""
    centres: np.ndarray
    """(n, 2, 3) of thigh and shank, m"""
    turns: np.ndarray
    """(n, 2, 4)"""


def _pose(posture: Posture, angles: np.ndarray) -> _Leg:
    thigh, shank = (segment.centre for segment in _segments(posture))
    leg, tip = forward(posture.leg, angles)
    thigh, shank = rotation.rotate(leg.upper, thigh), leg.hinge + rotation.rotate(leg.lower, shank)
    return _Leg(tip, np.stack([thigh, shank], axis=-2), np.stack([leg.upper, leg.lower], axis=-2))


def _derivative(values: np.ndarray, order: int = 1) -> np.ndarray:
    """Derivative over the crank's angle along axis 0 of a function that repeats, through its Fourier series."""
    count = len(values)
    harmonics = (1j * np.arange(count // 2 + 1)) ** order
    harmonics[-1] = 0.0
    spectrum = np.fft.rfft(values, axis=0) * harmonics.reshape(-1, *(1,) * (values.ndim - 1))
    return np.fft.irfft(spectrum, count, axis=0)


def _on_pedal(posture: Posture, angles: np.ndarray, forces: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Force ``(n, 3)`` of the pedal on the leg that gives both segments these rates of momentum.

    Args:
        posture: the person.
        angles: ``(n, 4)`` of the leg.
        forces: ``(n, 2, 3)`` rate of change of momentum, and weight, of thigh and shank, N.
        moments: ``(n, 2, 3)`` rate of change of angular momentum, N·m.
    """
    jacobian, load = [], []
    for joint in FREE:
        more, less = (_pose(posture, angles + sign * STEP * np.eye(4)[joint]) for sign in (1.0, -1.0))
        turned = rotation.log(rotation.multiply(more.turns, rotation.conjugate(less.turns)))
        work = (more.centres - less.centres) * forces + turned * moments
        jacobian.append((more.tip - less.tip) / (2.0 * STEP))
        load.append(work.sum(axis=(-2, -1)) / (2.0 * STEP))
    return np.linalg.solve(np.stack(jacobian, axis=1), np.stack(load, axis=1)[..., None])[..., 0]


def _angles(posture: Posture) -> np.ndarray:
    return reach_to(posture.leg, posture.leg_target("left", CRANKS), KNEE_OUT).angles


def weight_on_pedal(posture: Posture, gravity: float) -> np.ndarray:
    """Force ``(n, 3)`` of the left leg's own weight on its pedal at the angles :data:`.CRANKS`, N, bicycle axes."""
    weights = np.zeros((len(CRANKS), 2, 3))
    weights[..., 2] = [gravity * segment.mass for segment in _segments(posture)]
    # what the leg does to the pedal is the opposite
    return -_on_pedal(posture, _angles(posture), weights, np.zeros_like(weights))


def leg_swing(posture: Posture) -> np.ndarray:
    """What the rider's body feels because the left leg swings, at the angles :data:`.CRANKS`.

    The pedal's reaction to the leg's inertia less the rate of change of the leg's own momentum.

    Returns:
        ``(n, 5)`` per (rad/s)² of a steadily turning crank: force upwards, N; moment about the saddle point, N·m, that
        tips to the right; force of the pedal on the leg that swings it, N.
    """
    angles, pose, rates = _turn(posture)
    forces, moments = _momentum_rates(posture, pose, rates)
    pedal = _on_pedal(posture, angles, forces, moments)
    hip = posture.hip - posture.bicycle.saddle
    tip = rotation.cross(hip + pose.tip, pedal) - (rotation.cross(hip + pose.centres, forces) + moments).sum(axis=1)
    felt = np.column_stack([pedal[:, 2] - forces[..., 2].sum(axis=1), tip[:, 0], pedal])
    return np.concatenate([felt, felt[:1]])


def legs_at_crank(posture: Posture) -> float:
    """Moment of inertia (kg·m²) of both legs that the crank turns, mean over a turn."""
    _, pose, rates = _turn(posture)
    energy = np.zeros(len(rates))
    for part, segment in enumerate(_segments(posture)):
        speed, rate = _derivative(pose.centres[:, part]), rates[:, part]
        energy += segment.mass * (speed**2).sum(axis=1)
        energy += (_spin(pose.turns[:, part], rate, segment.tensor) * rate).sum(axis=1)
    return 2.0 * float(energy.mean())


def _segments(posture: Posture) -> list[Mass]:
    return [posture.segments()[part] for part in ("thigh", "shank")]


def _turn(posture: Posture) -> tuple[np.ndarray, _Leg, np.ndarray]:
    """Angles ``(n, 4)`` and pose of the left leg over a turn, and rates ``(n, 2, 3)`` of its parts per crank rate."""
    angles = _angles(posture)[:-1]
    pose, rates = _pose(posture, angles), []
    for part in (0, 1):
        # ω from q' = ½ ω q, with a quaternion that never changes sign
        q = pose.turns[:, part]
        q = q * np.cumprod(np.concatenate([[1.0], np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)]))[:, None]
        rates.append(2.0 * rotation.multiply(_derivative(q), rotation.conjugate(q))[:, 1:])
    return angles, pose, np.stack(rates, axis=1)


def _momentum_rates(posture: Posture, pose: _Leg, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rates of change of momentum and angular momentum ``(n, 2, 3)`` of both segments per squared crank rate."""
    segments = _segments(posture)
    forces = np.stack([m.mass * _derivative(pose.centres[:, part], 2) for part, m in enumerate(segments)], axis=1)
    spins = [_spin(pose.turns[:, part], rates[:, part], m.tensor) for part, m in enumerate(segments)]
    return forces, np.stack([_derivative(spin) for spin in spins], axis=1)


def _spin(turn: np.ndarray, rate: np.ndarray, tensor: np.ndarray) -> np.ndarray:
    """Angular momentum R I Rᵀ ω ``(n, 3)`` per crank rate."""
    return rotation.rotate(turn, rotation.rotate_back(turn, rate) @ tensor)
