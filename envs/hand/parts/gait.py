"""Gait: steps with jitter, and what sways, swings and strikes with them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from ..smooth import Jet, product
from .composition import Intervals, Offset, gate
from .noise import Noise

MARGIN = 3.0
"""Time before and after a motion over which steps are drawn, s: the spline of the phase needs some."""


@dataclass(frozen=True)
class Steps:
    """When the feet strike, and the phase of the gait in between.

    Attributes:
        strikes: ``(N,)`` increasing, s; every other one is of the same foot.
    """

    strikes: np.ndarray

    @classmethod
    def draw(cls, generator: np.random.Generator, duration: float, frequency: float, jitter: float) -> Steps:
        """Draw steps of a mean length of 1 / ``frequency``; ``jitter`` is their standard deviation, relative."""
        count = int((duration + 2.0 * MARGIN) * frequency * (1.0 + 3.0 * jitter)) + 8
        lengths = (1.0 + jitter * np.clip(generator.standard_normal(count), -2.5, 2.5)) / frequency
        return cls(np.cumsum(lengths) - MARGIN)

    @cached_property
    def _phase(self) -> tuple[BSpline, BSpline, BSpline]:
        spline = make_interp_spline(self.strikes, np.arange(len(self.strikes), dtype=float), 5)
        return spline, spline.derivative(), spline.derivative(2)

    def phase(self, times: np.ndarray) -> Jet:
        """Steps made until ``times``, a smooth function that is whole at every strike: a jet ``(T,)``."""
        value, first, second = (spline(times) for spline in self._phase)
        return value, first, second


@dataclass(frozen=True)
class Swing:
    """A displacement and a turn that repeat with every stride (two steps), with an amplitude that varies slowly.

    Attributes:
        steps: phase of the gait.
        cosine, sine: ``(K, 6)`` coefficients of the first K harmonics of the stride: m in body axes (three), and yaw,
            pitch, roll in rad (three).
        amplitude: relative change of the amplitude, ``(T, 1)`` once sampled.
        intervals: when one walks.
        ramp: rise and fall, s.
    """

    steps: Steps
    cosine: np.ndarray
    sine: np.ndarray
    amplitude: Noise
    intervals: Intervals
    ramp: float = 1.0
    in_world: ClassVar[bool] = False

    def sample(self, times: np.ndarray) -> Offset:
        """The offset at ``times`` ``(T,)``, s."""
        phase, rate, change = (part[:, None] for part in self.steps.phase(times))
        k = np.pi * np.arange(1, len(self.cosine) + 1)
        c, s = np.cos(k * phase), np.sin(k * phase)
        value = c @ self.cosine + s @ self.sine
        slope = (k * c) @ self.sine - (k * s) @ self.cosine
        curvature = -(k * k * c) @ self.cosine - (k * k * s) @ self.sine
        wave = (value, rate * slope, change * slope + rate * rate * curvature)
        strength, faster, fastest = self.amplitude.sample(times)
        wave = product((1.0 + strength, faster, fastest), wave)
        wave = product(gate(times, self.intervals, self.ramp), wave)
        position, angles = (tuple(part[:, axes] for part in wave) for axes in (slice(3), slice(3, 6)))
        return Offset(position, angles)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Path:
    """Where a walker goes: a curve in the plane whose speed and direction vary, standing still between the walks.

    Attributes:
        curve: ``(T, 2)`` once sampled, m east and north.
        heading: direction of walking, counter-clockwise from east, ``(T, 1)`` once sampled, rad.
    """

    curve: Noise
    heading: Noise

    INTERVAL: ClassVar[float] = 0.2
    """Between knots of the curve, s."""

    @classmethod
    def draw(
        cls, generator: np.random.Generator, duration: float, speed: float, turning: float, intervals: Intervals
    ) -> Path:
        """Draw a path of ``duration`` s: mean speed (m/s) and root mean square of the turning (rad/s) while walking."""
        times = cls.INTERVAL * np.arange(-2, int(np.ceil((duration + MARGIN) / cls.INTERVAL)) + 5)
        # standing, one neither goes nor turns; the spline moves three knots before its coefficients do
        margin = 3.0 * cls.INTERVAL
        walks = gate(times, tuple((start + margin, end - margin) for start, end in intervals), 1.0)[0][:, 0]
        rate = Noise.draw(generator, times[-1], (0.05, 0.5), turning, derivative=0, size=1).sample(times)[0][:, 0]
        along = Noise.draw(generator, times[-1], (0.02, 0.2), 0.1, derivative=0, size=1).sample(times)[0][:, 0]
        heading = generator.uniform(-np.pi, np.pi) + np.cumsum(walks * rate) * cls.INTERVAL
        step = (speed * walks * (1.0 + along) * cls.INTERVAL)[:, None]
        curve = np.cumsum(step * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        start = times[0] + 2.0 * cls.INTERVAL
        return cls(Noise(start, cls.INTERVAL, curve), Noise(start, cls.INTERVAL, heading[:, None]))
