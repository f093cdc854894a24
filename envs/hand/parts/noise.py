"""Coloured noise with exact derivatives: a quintic spline whose coefficients are filtered random numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import convolve1d
from scipy.signal import bilinear, butter, sosfilt

from ..smooth import Jet

DEGREE = 5
"""Of the splines: four times continuously differentiable."""
KNOTS_PER_PERIOD = 10.0
"""of the upper frequency; the spline itself takes 10 % of the amplitude there"""

AT_KNOTS = (
    np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0,
    np.array([1.0, 10.0, 0.0, -10.0, -1.0]) / 24.0,
    np.array([1.0, 2.0, -6.0, 2.0, 1.0]) / 6.0,
)
"""Weights of neighbouring coefficients in the value and the derivatives at a knot, for knots a second apart"""


@dataclass(frozen=True)
class Noise:
    """Random functions of time on an interval; outside it they keep their value at its end.

    Attributes:
        start: beginning of the interval, s.
        interval: between knots, s.
        coefficients: ``(K, n)`` of the uniform B-splines; the interval holds K − 5 times ``interval``.
    """

    start: float
    interval: float
    coefficients: np.ndarray

    @cached_property
    def _splines(self) -> tuple[BSpline, BSpline, BSpline]:
        knots = self.start + self.interval * (np.arange(len(self.coefficients) + DEGREE + 1) - DEGREE)
        spline = BSpline(knots, self.coefficients, DEGREE)
        return spline, spline.derivative(), spline.derivative(2)

    @property
    def end(self) -> float:
        """End of the interval, s."""
        return self.start + self.interval * (len(self.coefficients) - DEGREE)

    @classmethod
    def draw(
        cls,
        generator: np.random.Generator,
        duration: float,
        band: tuple[float, float],
        level: float | Sequence[float],
        *,
        derivative: int = 2,
        size: int = 3,
        steepness: int = 2,
        start: float = 0.0,
        damping: float | None = None,
    ) -> Noise:
        """Draw functions whose ``derivative``-th derivative is white in a band.

        Above the band its amplitude falls as f to the power −``steepness``; below it that of the function itself is
        white.

        Args:
            generator: source of randomness.
            duration: length of the interval, s.
            band: lowest and highest frequency, Hz.
            level: root mean square of that derivative, of all functions together or of each.
            derivative: 0, 1 or 2.
            size: number n of functions.
            steepness: of the upper edge.
            start: beginning of the interval, s.
            damping: if given, the lower edge is an oscillator of this damping ratio: a rhythm where it is small.
        """
        low, high = band
        rate = KNOTS_PER_PERIOD * high
        count, warm = math.ceil(duration * rate) + DEGREE, math.ceil(max(0.5, 0.5 / (damping or 1.0)) * rate / low)
        white = generator.standard_normal((warm + count, size))
        if damping is not None:
            w = 2.0 * rate * math.tan(math.pi * low / rate)
            shape = np.concatenate(bilinear([w * w], [1.0, 2.0 * damping * w, w * w], fs=rate))[None]
        elif derivative:
            shape = butter(derivative, low, fs=rate, output="sos")
        else:
            shape = butter(1, low, "highpass", fs=rate, output="sos")
        edge = butter(steepness, high, fs=rate, output="sos")
        drawn = cls(start, 1.0 / rate, sosfilt(np.concatenate([shape, edge]), white, axis=0)[warm:])
        return drawn.scaled(np.asarray(level) / np.sqrt(np.mean(drawn._at_knots(derivative) ** 2)))

    def _at_knots(self, derivative: int) -> np.ndarray:
        """A derivative at all knots of the interval, ``(K - 4, n)``."""
        return convolve1d(self.coefficients, AT_KNOTS[derivative], axis=0)[2:-2] / self.interval**derivative

    @property
    def spread(self) -> float:
        """Root mean square of the length of the vector of functions."""
        return float(np.sqrt(np.mean(np.sum(self._at_knots(0) ** 2, axis=1))))

    def sample(self, times: np.ndarray) -> Jet:
        """The jet ``(T, n)`` at ``times`` ``(T,)``."""
        inside = np.clip(times, self.start, self.end)
        value, first, second = (spline(inside) for spline in self._splines)
        outside = inside != times
        first[outside] = second[outside] = 0.0
        return value, first, second

    def scaled(self, factor: np.ndarray | float) -> Noise:
        """The same functions times ``factor`` (a number, or one for each function)."""
        return replace(self, coefficients=self.coefficients * factor)
