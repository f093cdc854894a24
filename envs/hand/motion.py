"""Analytic motions that the gestures draw: segments of random motion between rests, and turns.

World: x east, y north, z up; quaternions w, x, y, z, body to world. All derivatives are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from scipy.optimize import brentq

from ...filters.core import rotation
from ..sensors.ideal import BodyState
from .smooth import Jet, Series, burst, column, product, smoothstep, smoothstep_integral, window

BURST_HALF_WIDTH = 0.6
"""Half the length of the burst that carries the peak of a trial, s."""
GRID = 0.01
"""Interval at which mean and peak of a trial are evaluated, s; 0.2 % below the true peak at 3.5 Hz."""


class Gesture(Protocol):
    """A motion of a rigid body as a function of time."""

    @property
    def duration(self) -> float:
        """Length, s."""
        ...

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, seconds from the start, each in [0, duration]."""
        ...


class RandomFunction(Protocol):
    """A smooth random function of time, for instance a :class:`.Series`."""

    def sample(self, times: np.ndarray) -> Jet:
        """The jet ``(T, n)`` at ``times`` ``(T,)``, s."""
        ...

    def scaled(self, factor: np.ndarray | float) -> Self:
        """The same function times ``factor`` (a number, or one for each component)."""
        ...


def euler_motion(angles: Jet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Attitude ``(T, 4)``, angular velocity and angular acceleration ``(T, 3)`` (world axes) of Z-Y-X angles.

    The map from angles (yaw, pitch, roll) to rates has no singularity, only its inverse has: any angles are allowed.
    """
    yaw, pitch, roll = angles[0].T
    dyaw, dpitch, droll = angles[1].T
    ddyaw, ddpitch, ddroll = angles[2].T
    sy, cy, sp, cp = np.sin(yaw), np.cos(yaw), np.sin(pitch), np.cos(pitch)
    level, dlevel = droll * cp, ddroll * cp - droll * sp * dpitch
    velocity = np.stack([level * cy - dpitch * sy, level * sy + dpitch * cy, dyaw - droll * sp], axis=-1)
    acceleration = np.stack(
        [
            (dlevel - dpitch * dyaw) * cy - (ddpitch + level * dyaw) * sy,
            (dlevel - dpitch * dyaw) * sy + (ddpitch + level * dyaw) * cy,
            ddyaw - ddroll * sp - droll * cp * dpitch,
        ],
        axis=-1,
    )
    return rotation.from_euler_zyx(yaw, pitch, roll), velocity, acceleration


def spatial_state(times: np.ndarray, position: Jet, angles: Jet, heading: np.ndarray) -> BodyState:
    """The state of a body at ``heading ⊗ Rz(yaw) Ry(pitch) Rx(roll)``.

    Args:
        times: ``(T,)`` s.
        position: jet ``(T, 3)``, m.
        angles: jet ``(T, 3)`` of yaw, pitch and roll, rad.
        heading: ``(4,)`` quaternion.
    """
    orientation, *rates = euler_motion(angles)
    turning, turning_faster = (rotation.rotate(heading, rate) for rate in rates)
    attitude = rotation.multiply(heading, orientation)
    return BodyState(times, position[0], attitude, position[1], turning, position[2], turning_faster)


@dataclass(frozen=True)
class Segment:
    """Random motion between two rests.

    Attributes:
        start: beginning, s.
        end: end, s.
        ramp: rise and fall at both ends, s.
        position: three random functions of time since ``start``, m, world.
        angles: three random functions (yaw, pitch, roll), rad.
        shift: ``(3,)`` displacement from the rest before to the rest after, m.
        turn: ``(3,)`` change of yaw, pitch and roll likewise, rad.
        bursts: (time since ``start``, strength) of bursts that raise (or lower) the amplitude of the position, s, 1.
    """

    start: float
    end: float
    ramp: float
    position: RandomFunction
    angles: RandomFunction
    shift: np.ndarray
    turn: np.ndarray
    bursts: tuple[tuple[float, float], ...] = ()

    @classmethod
    def draw(
        cls,
        generator: np.random.Generator,
        *,
        start: float,
        end: float,
        ramp: float,
        position_band: tuple[float, float],
        angle_band: tuple[float, float],
        angle_rms: float,
        turn: np.ndarray,
        position_rms: float = 1.0,
        acceleration_rms: float | None = None,
    ) -> Segment:
        """Draw the random functions.

        Args:
            generator: source of randomness.
            start: beginning, s.
            end: end, s.
            ramp: rise and fall at both ends, s.
            position_band: frequencies of the position, Hz.
            angle_band: frequencies of the angles, Hz.
            angle_rms: root mean square of each angle, rad.
            turn: ``(3,)`` change of yaw, pitch and roll from the rest before to the rest after, rad.
            position_rms: root mean square of each coordinate, m.
            acceleration_rms: if given, root mean square of each coordinate's acceleration instead, m/s².
        """
        position = Series.draw(generator, position_band, 3, slope=-1.0)
        if acceleration_rms is not None:
            position_rms = acceleration_rms / position.acceleration
        angles = Series.draw(generator, angle_band, 3, slope=-1.0)
        shift = generator.normal(0.0, 0.1, 3) * (position_rms > 0.0)
        return cls(start, end, ramp, position.scaled(position_rms), angles.scaled(angle_rms), shift, turn)

    def delayed(self, delay: float) -> Segment:
        """The same motion, ``delay`` seconds later."""
        return replace(self, start=self.start + delay, end=self.end + delay)

    def scaled(self, factor: float) -> Segment:
        """The same motion with all positions times ``factor``."""
        return replace(self, position=self.position.scaled(factor), shift=self.shift * factor)

    def with_burst(self, time: float, strength: float) -> Segment:
        """The same motion with one more burst at ``time`` seconds after the start."""
        return replace(self, bursts=(*self.bursts, (time, strength)))

    def envelope(self, times: np.ndarray) -> Jet:
        """Window and bursts of the position, ``(T, 1)``."""
        envelope = window(times, self.start, self.end, self.ramp)
        for time, strength in self.bursts:
            hill = burst(times, self.start + time, BURST_HALF_WIDTH)
            envelope = product(envelope, (1.0 + strength * hill[0], strength * hill[1], strength * hill[2]))
        return column(envelope)

    def sample(self, times: np.ndarray) -> tuple[Jet, Jet]:
        """Contribution to position and angles at ``times`` ``(T,)``: two jets ``(T, 3)``."""
        since = times - self.start
        step = column(smoothstep(times, self.start, self.end - self.start))
        wave = product(self.envelope(times), self.position.sample(since))
        swing = product(column(window(times, self.start, self.end, self.ramp)), self.angles.sample(since))
        position = tuple(a + b * self.shift for a, b in zip(wave, step, strict=True))
        angles = tuple(a + b * self.turn for a, b in zip(swing, step, strict=True))
        return position, angles


@dataclass(frozen=True)
class SegmentedGesture:
    """Rests and segments of random motion.

    The attitude is ``heading ⊗ Rz(yaw) Ry(pitch) Rx(roll) ⊗ axes`` with constant ``heading`` and ``axes``.

    Attributes:
        duration: length, s.
        heading: ``(4,)`` first factor of the attitude.
        start_angles: ``(3,)`` yaw, pitch, roll at the start, rad.
        segments: motions in the order of time, not overlapping.
        axes: ``(4,)`` last factor of the attitude; None: no rotation.
        origin: position at the start, m.
    """

    duration: float
    heading: np.ndarray
    start_angles: np.ndarray
    segments: tuple[Segment, ...] = ()
    axes: np.ndarray | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 1.2)

    def position_and_angles(self, times: np.ndarray) -> tuple[Jet, Jet]:
        """Position and Z-Y-X angles at ``times`` ``(T,)``, which must not decrease: two jets ``(T, 3)``."""
        position = (np.tile(np.asarray(self.origin), (len(times), 1)), *np.zeros((2, len(times), 3)))
        angles = (np.tile(self.start_angles, (len(times), 1)), *np.zeros((2, len(times), 3)))
        for segment in self.segments:
            first, last = np.searchsorted(times, segment.start, "right"), np.searchsorted(times, segment.end, "left")
            position[0][last:] += segment.shift
            angles[0][last:] += segment.turn
            if first < last:
                for whole, part in zip((position, angles), segment.sample(times[first:last]), strict=True):
                    for order in range(3):
                        whole[order][first:last] += part[order]
        return position, angles

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        if (np.diff(times) < 0.0).any():
            ascending, ranks = np.unique(times, return_inverse=True)
            return self.sample(ascending).at(ranks)
        state = spatial_state(times, *self.position_and_angles(times), self.heading)
        if self.axes is None:
            return state
        return state._replace(orientation=rotation.multiply(state.orientation, self.axes))


@dataclass(frozen=True)
class TurnGesture:
    """A turn about a vertical axis; parameters as in :class:`poise.envs.hand.gestures.Turn`.

    Attributes:
        duration: length, s.
        attitude: ``(4,)`` attitude at the start.
        rate: final angular rate, rad/s, counter-clockwise positive.
        radius: distance from the axis, m.
        azimuth: direction from the axis to the body at the start, rad.
        rest: time at rest, s.
        ramp: time of spinning up, s.
        origin: point of the axis at the body's height, m.
    """

    duration: float
    attitude: np.ndarray
    rate: float
    radius: float
    azimuth: float
    rest: float
    ramp: float
    origin: tuple[float, float, float] = (0.0, 0.0, 1.2)

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        speed, rise, _ = smoothstep(times, self.rest, self.ramp)
        angle = self.rate * smoothstep_integral(times, self.rest, self.ramp)
        rate, acceleration = self.rate * speed, self.rate * rise
        azimuth = self.azimuth + angle
        zero = np.zeros_like(times)
        outward = np.stack([np.cos(azimuth), np.sin(azimuth), zero], axis=-1)
        forward = np.stack([-np.sin(azimuth), np.cos(azimuth), zero], axis=-1)
        up = np.array([0.0, 0.0, 1.0])
        return BodyState(
            times,
            np.asarray(self.origin) + self.radius * outward,
            rotation.multiply(rotation.from_euler_zyx(angle, zero, zero), self.attitude),
            self.radius * rate[:, None] * forward,
            rate[:, None] * up,
            self.radius * (acceleration[:, None] * forward - rate[:, None] ** 2 * outward),
            acceleration[:, None] * up,
        )


def match_levels(segments: list[Segment], duration: float, mean: float, peak: float) -> list[Segment] | None:
    """Scale positions, and add a burst at the highest acceleration, so that mean and peak of |a| are as asked.

    Args:
        segments: motions of one trial.
        duration: length of the trial, s.
        mean: mean of the acceleration's length, rests included, m/s².
        peak: its largest value, m/s².

    Returns:
        The segments of the matched trial; None if the motion is too peaked already, so that others should be drawn.
    """
    times = np.arange(0.0, duration, GRID)
    trial = SegmentedGesture(duration, np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), tuple(segments))
    acceleration = trial.position_and_angles(times)[0][2]
    length = np.linalg.norm(acceleration, axis=1)
    if length.max() > peak / mean * length.mean():
        return None
    top = times[np.argmax(length)]
    index = next(i for i, segment in enumerate(segments) if segment.start <= top <= segment.end)
    plain, raised = segments[index], segments[index].with_burst(top - segments[index].start, 1.0)
    inside = np.flatnonzero((times > plain.start) & (times < plain.end) & (np.abs(times - top) < BURST_HALF_WIDTH))
    added = raised.sample(times[inside])[0][2] - plain.sample(times[inside])[0][2]
    outside_sum = length.sum() - length[inside].sum()

    def excess(strength: float) -> float:
        # bursts act linearly on the position, so two evaluations of the motion serve every strength
        lengths = np.linalg.norm(acceleration[inside] + strength * added, axis=1)
        return float(lengths.max() - peak / mean * (outside_sum + lengths.sum()) / len(times))

    highest = 1.0
    while excess(highest) < 0.0:
        highest *= 2.0
        if highest > 1e3:
            raise ValueError(f"a peak of {peak} m/s² cannot be reached with a mean of {mean} m/s² in these intervals")
    strength = float(brentq(excess, 0.0, highest, rtol=1e-9))
    lengths = np.linalg.norm(acceleration[inside] + strength * added, axis=1)
    factor = mean * len(times) / (outside_sum + lengths.sum())
    matched = [*segments[:index], plain.with_burst(top - plain.start, strength), *segments[index + 1 :]]
    return [segment.scaled(factor) for segment in matched]
