"""Impacts: taps on a device, setting it down, and whatever rings after a short contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ....filters.core import rotation
from ....filters.support.ranges import Checked, Range, log_uniform, log_uniforms
from ..smooth import Jet, product, smoothstep
from .composition import Intervals, Offset

SETTLED = 5.0
"""Decay times after which the ringing of an impact is faded out."""


@dataclass(frozen=True)
class Ringing:
    """Impacts: the body is displaced within the time of contact and swings back as a damped oscillator.

    x(t) = d s(t/c) e^(−ζ 2π f t) sin(2π f t) with the smooth step s. All derivatives are exact.

    Attributes:
        times: ``(N,)`` of first contact, s.
        vectors: ``(N, 6)`` peak acceleration of the body, m/s², and peak angular acceleration, rad/s², body axes.
        contact: ``(N,)`` c, s.
        frequency: ``(N,)`` f, Hz.
        damping: ζ.
    """

    times: np.ndarray
    vectors: np.ndarray
    contact: np.ndarray
    frequency: np.ndarray
    damping: float
    in_world: ClassVar[bool] = False

    def _shape(self, since: np.ndarray, contact: float, frequency: float) -> Jet:
        """The jet ``(T,)`` of an impact with d = 1, ``since`` seconds after its first contact."""
        w, decay = 2.0 * np.pi * frequency, 2.0 * np.pi * frequency * self.damping
        pole = complex(-decay, w)
        wave = np.exp(pole * np.maximum(since, 0.0))
        ring = (wave.imag, (pole * wave).imag, (pole * pole * wave).imag)
        rise, fall = smoothstep(since, 0.0, contact), smoothstep(since, SETTLED / decay, contact)
        return product(product(rise, ring), (1.0 - fall[0], -fall[1], -fall[2]))

    def length(self, contact: float, frequency: float) -> float:
        """Time from first contact until nothing moves, s."""
        return SETTLED / (2.0 * np.pi * frequency * self.damping) + contact

    def sample(self, times: np.ndarray) -> Offset:
        """The offset at ``times`` ``(T,)``, s, which must not decrease."""
        whole = np.zeros((3, len(times), 6))
        for time, vector, contact, frequency in zip(
            self.times, self.vectors, self.contact, self.frequency, strict=True
        ):
            length = self.length(contact, frequency)
            first, last = np.searchsorted(times, time), np.searchsorted(times, time + length)
            if first == last:
                continue
            grid = np.linspace(0.0, min(length, contact + 1.0 / frequency), 200)
            peak = np.abs(self._shape(grid, contact, frequency)[2]).max()
            jet = self._shape(times[first:last] - time, contact, frequency)
            for order in range(3):
                whole[order, first:last] += jet[order][:, None] * (vector / peak)
        position, angles = (tuple(part[..., axes] for part in whole) for axes in (slice(3), slice(3, 6)))
        return Offset(position, angles)  # type: ignore[arg-type]


def random_impacts(
    generator: np.random.Generator,
    times: np.ndarray,
    peaks: np.ndarray,
    contact: Range,
    frequency: Range,
    radius: float,
) -> Ringing:
    """Impacts at given times in random directions, off centre by up to ``radius``, m, of a body as large as that.

    The angular acceleration is that of a force at a random point r on a homogeneous body: α = r × a / ρ² with the
    radius of gyration ρ = ``radius``.
    """
    count = len(times)
    direction = rotation.normalize(generator.standard_normal((count, 3)))
    point = radius * generator.uniform(-1.0, 1.0, (count, 3))
    acceleration = peaks[:, None] * direction
    vectors = np.concatenate([acceleration, rotation.cross(point, acceleration) / radius**2], axis=1)
    lengths, tones = (log_uniforms(generator, each, count) for each in (contact, frequency))
    return Ringing(times, vectors, lengths, tones, damping=float(generator.uniform(0.15, 0.5)))


@dataclass(frozen=True)
class Taps(Checked):
    """Taps on the device, at random times.

    Attributes:
        rate: mean number a second, 1/s.
        peak: of the acceleration, m/s²; a tap is drawn within a factor of two of the episode's.
        contact: time of contact, s (our choice; a finger on a housing takes 1 to 10 ms, a nail less).
        frequency: of the ringing that follows, Hz.
        radius: of gyration of the device, m.
    """

    rate: Range = (0.1, 5.0)
    peak: Range = (5.0, 400.0)
    contact: Range = (0.0005, 0.008)
    frequency: Range = (30.0, 300.0)
    radius: float = 0.3

    def draw(self, generator: np.random.Generator, intervals: Intervals) -> Ringing:
        """Draw times and strengths."""
        rate, peak = log_uniform(generator, self.rate), log_uniform(generator, self.peak)
        times = np.concatenate(
            [
                np.sort(generator.uniform(start, end, generator.poisson(rate * (end - start))))
                for start, end in intervals
            ]
        )
        peaks = peak * np.exp(generator.uniform(-math.log(2.0), math.log(2.0), len(times)))
        return random_impacts(generator, times, peaks, self.contact, self.frequency, self.radius)


@dataclass(frozen=True)
class SetDowns(Checked):
    """Impacts where a device is put down: at the end of each interval of motion, before it lies still.

    Attributes:
        peak: of the acceleration, m/s².
        contact: time of contact, s.
        frequency: of the ringing on the table, Hz.
        radius: of gyration of the device, m.
    """

    peak: Range = (1.0, 40.0)
    contact: Range = (0.003, 0.03)
    frequency: Range = (15.0, 80.0)
    radius: float = 0.3

    def draw(self, generator: np.random.Generator, intervals: Intervals) -> Ringing:
        """Draw strengths; the device touches the table when it comes to rest."""
        ends = np.array([end for _, end in intervals])
        peaks = log_uniforms(generator, self.peak, len(ends))
        return random_impacts(generator, ends, peaks, self.contact, self.frequency, self.radius)
