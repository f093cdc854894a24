"""The head on its neck: it lags behind the trunk like a mass on a damped spring, and looks around.

The neck bends about the lowest cervical joint and turns about the head's long axis. Each of its angles e (pitch, then
yaw, then roll, from the levelled head) is what the rider intends, g, and a deviation d::

    d'' = −w' − m (c × a) / I − 2 ζ ω d' − ω² d − 2 ζᵥ ω (w + d') − κ ω² (s + d)

with the trunk's rate w and tilt s from upright about the axis, and the acceleration a of the neck's joint (gravity is
held by muscles). The upper spine, which bends where the trunk of this simulator is rigid, and the neck's muscles keep a
share of that acceleration from the head, which is drawn for each rider between none and all: no published value was
found. The first terms are inertia and the passive neck, the last two the reflexes that steady the head in space
(vestibulocollic) with what the rider does on purpose. Yaw has no upright: its s leaks away within :data:`LEAK`, so that
the head follows turns of the path. The mass of the head belongs to the trunk, so the head does not act back on the
ride.

Source: G. C. Y. Peng, T. C. Hain, B. W. Peterson, A dynamical model for reflex activated head movements in the
horizontal plane, Biol. Cybern. 75 (1996): the passive head and neck answer turns of the trunk with a second-order peak
of 5.2 dB at 2.1 Hz; with reflexes, which fits people, it is 1.1 dB at 2.9 Hz. ω, ζ, κ and ζᵥ have exactly these peaks.
Below 2 Hz the head then turns less than the trunk, as people told to keep it steady. All axes are taken alike.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from ....filters.compile.cache import jit
from ....filters.core import rotation
from ...sensors.ideal import BodyState, Mounting, mounted
from .body_motion import rows_at
from .posture import Posture

FREQUENCY, DAMPING = 2.0 * math.pi * 2.298, 0.343
"""ω in rad/s and ζ of the passive neck"""
STEADYING, STEADY_DAMPING = 0.821, 0.110
"""κ and ζᵥ: stiffness and damping against space, relative to the passive neck"""
LEAK = 0.5
"""s, assumed: in the tightest circle of 23 deg/s the head then lags by 5 deg"""
AXES = np.eye(3)


class HeadState(NamedTuple):
    """Where the head is after a sample.

    Attributes:
        time: s.
        velocity: ``(3,)`` m/s of the neck's joint, world axes.
        rate: ``(3,)`` rad/s of the trunk, levelled axes.
        yaw: rad that the trunk is felt to have turned.
        values: ``(6,)`` deviations in roll, pitch, yaw (rad), then their rates (rad/s).
    """

    time: float
    velocity: np.ndarray
    rate: np.ndarray
    yaw: float
    values: np.ndarray


@jit
def _deviations(step, pushed, force, values):  # type: ignore[no-untyped-def]
    """Deviations and rates ``(n, 6)`` after n intervals of constant force; ``step`` ``(2, 2)``, ``pushed`` ``(2,)``."""
    found = np.empty((force.shape[0], 6))
    for index in range(force.shape[0]):
        new = found[index]
        for axis in range(3):
            for row in range(2):
                moved = step[row, 0] * values[axis] + step[row, 1] * values[3 + axis]
                new[3 * row + axis] = moved + pushed[row] * force[index, axis]
        values = new
    return found


@jit
def _felt(turned, keep, yaw):  # type: ignore[no-untyped-def]
    """Leaking sum ``(n + 1,)`` of the yaw (rad) that each interval adds, from ``yaw`` on."""
    found = np.empty(len(turned) + 1)
    found[0] = yaw
    for index in range(len(turned)):
        found[index + 1] = keep * found[index] + turned[index]
    return found


class HeadMotion:
    """The head of one rider, carried from sample to sample above the trunk.

    Args:
        posture: the person on the bicycle; the head is level where the trunk is at rest.
        gaze: ``(n, 2)`` intended yaw and pitch over time, a table of :mod:`.body_motion`, rad.
        rate: samples per second, Hz.
        steadied: share of the acceleration of the neck's joint that does not reach the head, 0 to 1.
    """

    def __init__(self, posture: Posture, gaze: np.ndarray, rate: float, steadied: float = 0.0) -> None:
        self._gaze, self._rate = gaze, rate
        level = rotation.conjugate(posture.trunk_orientation())
        self._neck = Mounting(posture.neck, tuple(level.tolist()))
        head = posture.body.segment("head")
        above = np.array(posture.head_centre)
        moments = np.array(head.moments) + head.mass * (above @ above - above**2)
        self._pull = (1.0 - steadied) * head.mass * above, moments
        stiff, damp = FREQUENCY**2 * (1.0 + STEADYING), 2.0 * FREQUENCY * (DAMPING + STEADY_DAMPING)
        self._stiff, self._damp = stiff, damp
        block = expm(np.array([[0.0, 1.0, 0.0], [-stiff, -damp, 1.0], [0.0, 0.0, 0.0]]) / rate)
        self._step, self._pushed = np.ascontiguousarray(block[:2, :2]), np.ascontiguousarray(block[:2, 2])
        self.state: HeadState | None = None

    def carry(self, trunk: BodyState) -> BodyState:
        """Motion of the head at the next n samples.

        Args:
            trunk: motion of the trunk ``(n, …)`` with accelerations; time in s since the start of the rider's motion.

        Returns:
            The head: origin in the neck's joint, x where the nose points, z up through the crown.
        """
        neck = mounted(trunk, self._neck)
        assert neck.acceleration is not None
        assert neck.angular_acceleration is not None
        time, level = np.asarray(trunk.time), neck.orientation
        rate = rotation.rotate_back(level, neck.angular_velocity)
        last = self.state
        if last is None:
            # at rest against the trunk before the first sample
            held = np.concatenate([-STEADYING / (1.0 + STEADYING) * tilted(level[0])[:2], np.zeros(4)])
            last = HeadState(float(time[0]) - 1.0 / self._rate, neck.velocity[0], rate[0], 0.0, held)
        dt = np.diff(np.concatenate([[last.time], time]))[:, None]
        rates = np.concatenate([last.rate[None], rate])
        mean = 0.5 * (rates[1:] + rates[:-1])
        yaw = _felt(mean[:, 2] * dt[:, 0], math.exp(-1.0 / (LEAK * self._rate)), last.yaw)
        tilt = np.concatenate([tilted(level), yaw[1:, None]], axis=1)
        velocity = np.concatenate([last.velocity[None], neck.velocity])
        shaken = rotation.rotate_back(level, np.diff(velocity, axis=0) / dt)
        weight, moments = self._pull
        force = -np.diff(rates, axis=0) / dt - rotation.cross(weight, shaken) / moments
        force = force - 2.0 * STEADY_DAMPING * FREQUENCY * mean - STEADYING * FREQUENCY**2 * tilt
        values = _deviations(self._step, self._pushed, np.ascontiguousarray(force), last.values)
        self.state = HeadState(float(time[-1]), neck.velocity[-1], rate[-1], float(yaw[-1]), values[-1])
        deviation, speed = values[:, :3], values[:, 3:]
        pull = force - self._damp * speed - self._stiff * deviation
        looked = [np.stack([0.0 * time, each[:, 1], each[:, 0]], axis=1) for each in rows_at(self._gaze, time)]
        return turned(neck, *(own + intended for own, intended in zip((deviation, speed, pull), looked, strict=True)))


def tilted(orientation: np.ndarray) -> np.ndarray:
    """Roll and pitch ``(..., 2)`` of a frame from upright, rad."""
    x, y, z = np.moveaxis(rotation.up_in_body(orientation), -1, 0)
    return np.stack([np.arctan2(y, z), -np.arcsin(np.clip(x, -1.0, 1.0))], axis=-1)


def turned(neck: BodyState, angles: np.ndarray, rates: np.ndarray, accelerations: np.ndarray) -> BodyState:
    """A frame turned by pitch, then yaw, then roll from the axes of the neck, about their common origin.

    Args:
        neck: its motion ``(n, …)``.
        angles: ``(n, 3)`` roll, pitch, yaw, rad.
        rates: their first derivatives, rad/s.
        accelerations: their second derivatives, rad/s².
    """
    pitch, yaw, roll = (rotation.exp(angles[:, each, None] * AXES[each]) for each in (1, 2, 0))
    # from the last turn back to the first: rate and its derivative in the axes before each turn
    turning, spin = rates[:, :1] * AXES[0], accelerations[:, :1] * AXES[0]
    for turn, axis in ((yaw, 2), (pitch, 1)):
        turning, spin = rotation.rotate(turn, turning), rotation.rotate(turn, spin)
        own = rates[:, axis, None] * AXES[axis]
        spin = spin + accelerations[:, axis, None] * AXES[axis] + rotation.cross(own, turning)
        turning = turning + own
    level, omega = neck.orientation, neck.angular_velocity
    turning, spin = rotation.rotate(level, turning), rotation.rotate(level, spin)
    return neck._replace(
        orientation=rotation.multiply(level, rotation.multiply(pitch, rotation.multiply(yaw, roll))),
        angular_velocity=omega + turning,
        angular_acceleration=neck.angular_acceleration + spin + rotation.cross(omega, turning),
    )
