"""Smooth functions of time with exact first and second derivatives: windows, bursts, band-limited random series.

A :data:`Jet` is the triple (value, first derivative, second derivative) of a function at given times. Everything here
is at least twice continuously differentiable, so that accelerations made of it have no jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Jet = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Value and the first two time derivatives, arrays of one shape ``(T,)`` or ``(T, n)``."""


def product(a: Jet, b: Jet) -> Jet:
    """The jet of ``a · b`` (product rule), broadcasting like NumPy."""
    return a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]


def column(a: Jet) -> Jet:
    """A jet of scalars ``(T,)`` as a column ``(T, 1)`` that scales jets of vectors."""
    return a[0][:, None], a[1][:, None], a[2][:, None]


def smoothstep(times: np.ndarray, start: float, length: float) -> Jet:
    """Rise from 0 at ``start`` to 1 at ``start + length`` along 6u⁵ − 15u⁴ + 10u³ (minimum jerk)."""
    u = np.clip((times - start) / length, 0.0, 1.0)
    value = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    first = 30.0 * u * u * (1.0 - u) * (1.0 - u) / length
    second = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / length**2
    return value, first, second


def smoothstep_integral(times: np.ndarray, start: float, length: float) -> np.ndarray:
    """Integral of :func:`smoothstep` from minus infinity to ``times`` ``(T,)``, s."""
    u = np.clip((times - start) / length, 0.0, 1.0)
    inside = u**4 * (2.5 + u * (u - 3.0))
    return length * inside + np.maximum(times - start - length, 0.0)


def window(times: np.ndarray, start: float, end: float, ramp: float) -> Jet:
    """One between ``start`` and ``end``, zero outside, with rise and fall of ``ramp`` seconds inside the interval."""
    rise = smoothstep(times, start, ramp)
    fall = smoothstep(times, end - ramp, ramp)
    return product(rise, (1.0 - fall[0], -fall[1], -fall[2]))


def burst(times: np.ndarray, centre: float, half_width: float) -> Jet:
    """A single hill (1 − u²)³ of height 1 around ``centre``, zero beyond ``half_width``."""
    u = np.clip((times - centre) / half_width, -1.0, 1.0)
    rest = 1.0 - u * u
    first = -6.0 * u * rest * rest / half_width
    second = (-6.0 * rest * rest + 24.0 * u * u * rest) / half_width**2
    return rest**3, first, second


@dataclass(frozen=True)
class Series:
    """A band-limited random function: a sum of sinusoids whose coefficients are normal variates.

    Attributes:
        frequency: ``(K,)`` angular frequencies, rad/s.
        cosine: ``(K, n)`` coefficients of the cosines.
        sine: ``(K, n)`` coefficients of the sines.
    """

    frequency: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray

    @classmethod
    def draw(
        cls,
        generator: np.random.Generator,
        band: tuple[float, float],
        size: int,
        *,
        components: int = 10,
        slope: float = 0.0,
    ) -> Series:
        """Draw ``size`` independent functions of unit expected variance.

        Args:
            generator: source of randomness.
            band: lowest and highest frequency, Hz.
            size: number n of functions; they share the frequencies, not the coefficients.
            components: number K of frequencies, one in each of K equal parts of the band.
            slope: amplitudes follow frequency to this power (−1: equal power of the derivative at all frequencies).
        """
        low, high = band
        parts = (np.arange(components) + generator.random(components)) / components
        frequency = 2.0 * np.pi * (low + (high - low) * parts)
        weight = frequency**slope
        weight = weight / np.sqrt(np.sum(weight**2))
        coefficients = weight[:, None] * generator.standard_normal((2, components, size))
        return cls(frequency, coefficients[0], coefficients[1])

    @property
    def acceleration(self) -> float:
        """Root mean square of the second derivatives, the mean over all functions."""
        power = 0.5 * np.sum(self.frequency[:, None] ** 4 * (self.cosine**2 + self.sine**2))
        return float(np.sqrt(power / self.cosine.shape[1]))

    def sample(self, times: np.ndarray) -> Jet:
        """The jet ``(T, n)`` at ``times`` ``(T,)``."""
        phase = times[:, None] * self.frequency
        waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
        w = self.frequency[:, None]
        combine = np.concatenate(
            [
                np.concatenate([self.cosine, self.sine]),
                np.concatenate([w * self.sine, -w * self.cosine]),
                np.concatenate([-w * w * self.cosine, -w * w * self.sine]),
            ],
            axis=1,
        )
        n = self.cosine.shape[1]
        jets = waves @ combine
        return jets[:, :n], jets[:, n : 2 * n], jets[:, 2 * n :]

    def scaled(self, factor: np.ndarray | float) -> Series:
        """The same functions times ``factor`` (a number, or one for each function)."""
        return Series(self.frequency, self.cosine * factor, self.sine * factor)
