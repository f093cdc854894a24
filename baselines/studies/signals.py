"""Closed functions of time that synthetic motions are made of, their derivatives, and coloured noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Function = Callable[[np.ndarray], np.ndarray]
"""Of times ``(...)`` in s."""
STEP = 1e-3
"""s, of numerical derivatives: of fourth order, so exact to about 1e-9 where a motion is slower than a few Hz"""


@dataclass(frozen=True)
class Waves:
    """A sum of sines on a straight line."""

    offset: float = 0.0
    slope: float = 0.0
    """per s"""
    terms: tuple[tuple[float, float, float], ...] = ()
    """amplitude, angular frequency (rad/s), phase of each sine"""

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        std: float,
        low: float,
        high: float,
        *,
        offset: float = 0.0,
        count: int = 4,
        equal: bool = False,
    ) -> Waves:
        """Sines of random frequency (``low`` to ``high``, Hz) and phase around ``offset``, with deviation ``std``.

        They are of one size if ``equal``; otherwise a Dirichlet draw divides the variance among them. Drawn are
        frequencies, phases and shares, in this order.
        """
        rates = 2.0 * math.pi * rng.uniform(low, high, count)
        phases = rng.uniform(0.0, 2.0 * math.pi, count)
        shares = np.full(count, 1.0 / count) if equal else rng.dirichlet(np.full(count, 3.0))
        sizes = std * np.sqrt(2.0 * shares)
        return cls(offset, 0.0, tuple(zip(sizes.tolist(), rates.tolist(), phases.tolist(), strict=True)))

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Values at times."""
        value = self.offset + self.slope * t
        for size, rate, phase in self.terms:
            value = value + size * np.sin(rate * t + phase)
        return value

    def integral(self, t: np.ndarray) -> np.ndarray:
        """Integral of the values from time 0."""
        value = self.offset * t + 0.5 * self.slope * t**2
        for size, rate, phase in self.terms:
            value = value + size / rate * (np.cos(phase) - np.cos(rate * t + phase))
        return value


def derivative(function: Function, t: np.ndarray) -> np.ndarray:
    """First derivative of a function of time, central differences of fourth order."""
    h = STEP
    return (8.0 * (function(t + h) - function(t - h)) - (function(t + 2.0 * h) - function(t - 2.0 * h))) / (12.0 * h)


def second_derivative(function: Function, t: np.ndarray) -> np.ndarray:
    """Second derivative, central differences of fourth order."""
    h = STEP
    near, far = function(t + h) + function(t - h), function(t + 2.0 * h) + function(t - 2.0 * h)
    return (16.0 * near - far - 30.0 * function(t)) / (12.0 * h * h)


def gauss_markov(normal: np.ndarray, std: float, time: float, dt: float, start: float | None = None) -> np.ndarray:
    """First-order Gauss–Markov process, exactly discretised.

    Args:
        normal: ``(T, ...)`` independent standard normal numbers; the first row draws the start.
        std: stationary standard deviation.
        time: correlation time, s.
        dt: s.
        start: standard deviation of the start; None for the stationary one.
    """
    from scipy.signal import lfilter

    keep = math.exp(-dt / time)
    drive = std * math.sqrt(1.0 - keep * keep) * normal
    drive[0] = (std if start is None else start) * normal[0]
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0))
