"""Analytic motions of a hand-held controller: walk, pointing at targets, shaking, rate table.

The distributions they are drawn from are in :mod:`poise.envs.hand.controller_gestures`. World: x east, y north, z up;
quaternions w, x, y, z, body to world. All derivatives are exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...filters.core import rotation
from ..sensors.ideal import BodyState
from .motion import spatial_state
from .planar_motion import ORIGIN, planar_state
from .smooth import Jet, Series, column, product, smoothstep, smoothstep_integral


@dataclass(frozen=True)
class Knots:
    """Coordinates whose acceleration is given at equally spaced times, with a smooth passage in between.

    Between two knots the acceleration follows 3u² − 2u³; velocity and position are its integrals.

    Attributes:
        start: time of the first knot; before it nothing moves, s.
        interval: between knots, s.
        acceleration: ``(K, n)`` at the knots, the first one zero.
    """

    start: float
    interval: float
    acceleration: np.ndarray

    @cached_property
    def _integrals(self) -> tuple[np.ndarray, ...]:
        """Position, velocity and acceleration at the knots, and what the acceleration gains until the next one."""
        h, a = self.interval, np.concatenate([self.acceleration, self.acceleration[-1:]])
        rise = np.diff(a, axis=0)
        nothing = np.zeros((1, a.shape[1]))
        v = np.concatenate([nothing, np.cumsum(h * (a[:-1] + 0.5 * rise), axis=0)])
        x = np.concatenate([nothing, np.cumsum(h * v[:-1] + h * h * (0.5 * a[:-1] + 0.15 * rise), axis=0)])
        return x, v, a, rise

    def sample(self, times: np.ndarray) -> Jet:
        """Values and derivatives ``(T, n)``, zero until ``start``; from the last knot on the acceleration stays."""
        h = self.interval
        x, v, a, rise = self._integrals
        since = np.maximum((times - self.start) / h, 0.0)
        k = np.minimum(np.floor(since).astype(int), len(rise) - 1)
        u = (since - k)[:, None]
        a, v, x, rise = a[k], v[k], x[k], rise[k]
        return (
            x + h * u * v + h * h * (0.5 * u**2 * a + (u**4 / 4.0 - u**5 / 10.0) * rise),
            v + h * (u * a + (u**3 - u**4 / 2.0) * rise),
            a + (3.0 * u**2 - 2.0 * u**3) * rise,
        )


@dataclass(frozen=True)
class WalkGesture:
    """Walk of all coordinates of the pose.

    Attributes:
        duration: length, s.
        knots: of east, up and φ (planar, 3 columns), or of east, north, up, yaw, pitch and roll (6 columns).
        heading: ``(4,)`` attitude at the start (spatial).
    """

    duration: float
    knots: Knots
    heading: np.ndarray

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        jet = self.knots.sample(times)
        if jet[0].shape[1] == 3:
            value, first, second = (part[:, :2] for part in jet)
            place = (value + np.array([ORIGIN[0], ORIGIN[2]]), first, second)
            return planar_state(times, place, (jet[0][:, 2], jet[1][:, 2], jet[2][:, 2]))
        value, first, second = (part[:, :3] for part in jet)
        angles = (jet[0][:, 3:], jet[1][:, 3:], jet[2][:, 3:])
        return spatial_state(times, (value + np.array(ORIGIN), first, second), angles, self.heading)


@dataclass(frozen=True)
class PointingGesture:
    """Shortest rotations from target to target, along 6u⁵ − 15u⁴ + 10u³, while the hand translates.

    Attributes:
        duration: length, s.
        starts: ``(K,)`` beginning of each turn, s.
        length: time of a turn, s.
        attitudes: ``(K, 4)`` at the beginning of each turn.
        axes: ``(K, 3)`` unit vectors, world.
        angles: ``(K,)`` of the turns, rad.
        position: random function, m.
        targets: ``(K + 1, 3)`` unit vectors along which it points, world; along the first one from the start.
    """

    duration: float
    starts: np.ndarray
    length: float
    attitudes: np.ndarray
    axes: np.ndarray
    angles: np.ndarray
    position: Series
    targets: np.ndarray

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        k = np.maximum(np.searchsorted(self.starts, times, "right") - 1, 0)
        turn, speed, rise = smoothstep(times - self.starts[k], 0.0, self.length)
        axis, angle = self.axes[k], self.angles[k][:, None]
        orientation = rotation.multiply(rotation.exp(axis * angle * turn[:, None]), self.attitudes[k])
        begun = column(smoothstep(times, float(self.starts[0]), 1.0))
        position, velocity, acceleration = product(begun, self.position.sample(times))
        return BodyState(
            times,
            position + np.array(ORIGIN),
            orientation,
            velocity,
            axis * angle * speed[:, None],
            acceleration,
            axis * angle * rise[:, None],
        )


@dataclass(frozen=True)
class ShakingGesture:
    """Random rotation and translation with varying amplitude.

    Attributes:
        duration: length, s.
        heading: ``(4,)`` attitude at the start.
        position: random function, m.
        angles: random function of yaw, pitch and roll, rad.
        rest: time at rest, s.
        cycle: from one lull to the next, s.
        lull: amplitude in a lull, relative to the largest.
    """

    duration: float
    heading: np.ndarray
    position: Series
    angles: Series
    rest: float
    cycle: float
    lull: float

    def envelope(self, times: np.ndarray) -> Jet:
        """Amplitude, ``(T, 1)``: it rises within a second after the rest and nearly vanishes every ``cycle``."""
        w = 2.0 * math.pi / self.cycle
        depth, phase = 0.5 * (1.0 - self.lull), w * (times - self.rest)
        wave = (1.0 - depth - depth * np.cos(phase), depth * w * np.sin(phase), depth * w * w * np.cos(phase))
        return column(product(smoothstep(times, self.rest, 1.0), wave))

    def turning(self, times: np.ndarray) -> Jet:
        """Yaw, pitch and roll at ``times`` ``(T,)``: a jet ``(T, 3)``, linear in :attr:`angles`."""
        return product(self.envelope(times), self.angles.sample(times))

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        envelope = self.envelope(times)
        value, first, second = product(envelope, self.position.sample(times))
        angles = self.turning(times)
        return spatial_state(times, (value + np.array(ORIGIN), first, second), angles, self.heading)


@dataclass(frozen=True)
class RateTableGesture:
    """A table that turns about the vertical at one rate after the other; the device is fixed to it.

    Attributes:
        duration: length, s.
        starts: ``(K,)`` time at which the table begins to change to each rate, s.
        rates: ``(K,)`` rad/s, counter-clockwise seen from above.
        ramp: duration of the change, s.
        azimuth: of the table at the start, rad.
        attitude: ``(4,)`` of the device on the table.
        offset: ``(3,)`` of the device's origin from the axis, table axes (z up), m.
    """

    duration: float
    starts: np.ndarray
    rates: np.ndarray
    ramp: float
    azimuth: float
    attitude: np.ndarray
    offset: np.ndarray

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        steps = np.diff(self.rates, prepend=0.0)
        rate, change, angle = np.zeros((3, len(times)))
        for start, step in zip(self.starts, steps, strict=True):
            value, first, _ = smoothstep(times, start, self.ramp)
            rate, change = rate + step * value, change + step * first
            angle = angle + step * smoothstep_integral(times, start, self.ramp)
        zero = np.zeros(len(times))
        table = rotation.from_euler_zyx(rotation.wrap(self.azimuth + angle), zero, zero)
        arm = rotation.rotate(table, self.offset)
        up = np.array([0.0, 0.0, 1.0])
        turning, turning_faster = rate[:, None] * up, change[:, None] * up
        velocity = rotation.cross(turning, arm)
        return BodyState(
            times,
            arm + np.array(ORIGIN),
            rotation.multiply(table, self.attitude),
            velocity,
            turning,
            rotation.cross(turning_faster, arm) + rotation.cross(turning, velocity),
            turning_faster,
        )
