"""Parts that shake a hand-held or worn device: tremor, vibration, slow drift, and soft tissue under a sensor.

Each configuration has ``draw(generator, intervals)``, which gives a :class:`.Part` that acts in these intervals. A
range is drawn from log-uniformly, once an episode unless it says otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import bilinear, lfilter, lfilter_zi

from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from ....filters.support.ranges import Checked, Range, log_uniform
from ..motion import Gesture
from ..smooth import product
from .composition import Gated, Intervals, Offset, gate
from .noise import Noise


@dataclass(frozen=True)
class Tremor(Checked):
    """Physiological tremor of hand and forearm: narrow-band noise of position and attitude.

    The band is that of the hand's 8–12 Hz component (R. J. Elble, J. E. Randall, "Mechanistic components of normal hand
    tremor", Electroencephalography and Clinical Neurophysiology 44, 1978). The levels reach from a supported hand to a
    tired one; they are our choice.

    Attributes:
        acceleration: root mean square of all axes together, m/s².
        rate: root mean square of the angular rate, rad/s.
        band: Hz.
    """

    acceleration: Range = (0.01, 0.5)
    rate: Range = (0.005, 0.6)
    band: Range = (8.0, 12.0)

    def draw(self, generator: np.random.Generator, intervals: Intervals) -> Gated:
        """Draw the noise."""
        length = intervals[-1][1] - intervals[0][0]
        levels = [log_uniform(generator, each) / math.sqrt(3.0) for each in (self.acceleration, self.rate)]
        # noise drives an oscillator in the middle of the band, whose damping makes the width
        low, high = self.band
        middle, start = math.sqrt(low * high), intervals[0][0]
        damping = (high - low) / (3.0 * middle)
        position, angles = (
            Noise.draw(
                generator, length, (middle, high), level, derivative=order, steepness=4, start=start, damping=damping
            )
            for level, order in zip(levels, (2, 1), strict=True)
        )
        return Gated(intervals, 0.2, position, angles)


@dataclass(frozen=True)
class Buzz:
    """A tone of vibration whose frequency wanders a little.

    Attributes:
        intervals: when it sounds.
        frequency: mean, Hz.
        vectors: ``(6,)`` amplitude of the acceleration, m/s², and of the angular acceleration, rad/s², body axes.
        wander: phase in addition to that of the mean frequency, rad, ``(T, 1)`` once sampled.
    """

    intervals: Intervals
    frequency: float
    vectors: np.ndarray
    wander: Noise
    in_world: ClassVar[bool] = False

    def sample(self, times: np.ndarray) -> Offset:
        """The offset at ``times`` ``(T,)``, s."""
        w = 2.0 * np.pi * self.frequency
        phase, rate, change = (part[:, 0] for part in self.wander.sample(times))
        phase, rate = phase + w * times, rate + w
        sine, cosine = np.sin(phase), np.cos(phase)
        tone = (sine, rate * cosine, change * cosine - rate * rate * sine)
        opened = product(tuple(part[:, 0] for part in gate(times, self.intervals, 0.05)), tone)  # type: ignore[arg-type]
        amplitude = -self.vectors / (w * w)
        position, angles = (
            tuple(part[:, None] * amplitude[axes] for part in opened) for axes in (slice(3), slice(3, 6))
        )
        return Offset(position, angles)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Vibration(Checked):
    """A vibrating alert of a phone, or a machine that the device rests on: tones on and off.

    Vibration motors of phones turn at about 150 to 250 Hz, machines below; a sensor sees them through its bandwidth,
    and aliased where it reports instants.

    Attributes:
        frequency: Hz.
        acceleration: amplitude, m/s².
        on: length of sounding, s.
        off: length of silence, s.
        radius: of gyration of the device, m: the motor is off centre.
    """

    frequency: Range = (30.0, 250.0)
    acceleration: Range = (1.0, 20.0)
    on: Range = (0.5, 60.0)
    off: Range = (0.3, 5.0)
    radius: float = 0.3

    def draw(self, generator: np.random.Generator, intervals: Intervals) -> Buzz:
        """Draw the tone and when it sounds."""
        frequency, strength = log_uniform(generator, self.frequency), log_uniform(generator, self.acceleration)
        on, off = log_uniform(generator, self.on), log_uniform(generator, self.off)
        begin, end = intervals[0][0], intervals[-1][1]
        sounding, time = [], begin + generator.uniform(0.0, off)
        while time < end:
            stop = min(time + on * generator.uniform(0.5, 1.5), end)
            sounding += [(max(time, a), min(stop, b)) for a, b in intervals if max(time, a) < min(stop, b) - 0.01]
            time = stop + off * generator.uniform(0.5, 1.5)
        acceleration = strength * rotation.normalize(generator.standard_normal(3))
        point = self.radius * generator.uniform(-1.0, 1.0, 3)
        vectors = np.concatenate([acceleration, rotation.cross(point, acceleration) / self.radius**2])
        # the tone wanders by some per mille of its frequency, as motors do
        wander = Noise.draw(generator, end - begin, (0.1, 2.0), 0.01 * frequency, derivative=1, size=1, start=begin)
        return Buzz(tuple(sounding), frequency, vectors, wander)


@dataclass(frozen=True)
class Drift(Checked):
    """Slow wandering of the hand, faster than it looks: BROAD's trials reach 0.2 m/s below 0.2 Hz.

    Attributes:
        speed: root mean square, m/s.
        band: of the velocity, Hz.
        ramp: of the start and the end in each interval, s.
    """

    speed: Range = (0.01, 0.3)
    band: Range = (0.03, 0.15)
    ramp: float = 2.0

    def draw(self, generator: np.random.Generator, intervals: Intervals) -> Gated:
        """Draw the path."""
        start, end = intervals[0][0], intervals[-1][1]
        level = log_uniform(generator, self.speed) / math.sqrt(3.0)
        path = Noise.draw(generator, end - start, self.band, level, derivative=1, start=start)
        return Gated(((start, end),), self.ramp, path, in_world=True)


@dataclass(frozen=True)
class Wobble:
    """The displacement of a worn sensor, from :class:`SoftTissue`.

    Attributes:
        path: displacement, m, body axes.
        tilt: ``(3, 3)`` angles (yaw, pitch, roll) per displacement, rad/m.
    """

    path: Noise
    tilt: np.ndarray
    in_world: ClassVar[bool] = False

    def sample(self, times: np.ndarray) -> Offset:
        """The offset at ``times`` ``(T,)``, s."""
        position = self.path.sample(times)
        return Offset(position, tuple(part @ self.tilt.T for part in position))


@dataclass(frozen=True)
class SoftTissue(Checked):
    """Skin and strap between bone and sensor: a mass on damped springs, driven by the motion below and by gravity.

    p̈ + 2ζω ṗ + ω² p = −Rᵀ(a + g) for the displacement p in the axes of the bone; the sensor also tilts with p. It is
    solved on a grid of ``interval``; the spline through the solution is the motion, so its derivatives are exact.

    Attributes:
        frequency: ω / 2π, Hz (straps on thigh and shank: resonances of 5 to 20 Hz; our choice).
        damping: ζ.
        tilt: standard deviation of the angles per displacement, rad/m.
        interval: of the grid, s.
    """

    frequency: Range = (5.0, 20.0)
    damping: Range = (0.1, 0.5)
    tilt: float = 4.0
    interval: float = 2e-3

    def draw(self, generator: np.random.Generator, gesture: Gesture) -> Wobble:
        """Draw the tissue, and solve its motion over a gesture."""
        w = 2.0 * math.pi * log_uniform(generator, self.frequency)
        damping = log_uniform(generator, self.damping)
        # a margin on both sides for the support of the splines
        times = self.interval * np.arange(-10, math.ceil(gesture.duration / self.interval) + 10)
        motion = gesture.sample(np.clip(times, 0.0, gesture.duration))
        assert motion.acceleration is not None
        force = motion.acceleration + np.array([0.0, 0.0, STANDARD_GRAVITY])
        force = rotation.rotate_back(motion.orientation, force)
        b, a = bilinear([-1.0], [1.0, 2.0 * damping * w, w * w], fs=1.0 / self.interval)
        settled = lfilter_zi(b, a)[:, None] * force[0]
        path = lfilter(b, a, force, axis=0, zi=settled)[0]
        # coefficient j of a quintic spline lies two knots before its start
        spline = Noise(times[0] + 2.0 * self.interval, self.interval, path)
        return Wobble(spline, generator.normal(0.0, self.tilt, (3, 3)))
