"""Power spectra of motion signals, and the numbers that are read from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....envs.data.resampling import fill_short_gaps

LONGEST_GAP = 0.1
"""s: shorter gaps of a signal are filled by lines; at longer ones it is cut"""
SEGMENT = 8.0
"""s of a segment of Welch's method: a resolution of 0.125 Hz"""
WINDOW = 20.0
"""s of a window in which sinusoids are counted: a Hann window, under which one is three lines of the periodogram"""
SINUSOIDS = 4


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral density of a signal, summed over its axes.

    Attributes:
        frequency: ``(F,)`` Hz, evenly spaced from 0.
        density: ``(F,)`` u²/Hz for a signal in u; the mean of the signal is removed.
    """

    frequency: np.ndarray
    density: np.ndarray

    @property
    def resolution(self) -> float:
        """Hz between two frequencies."""
        return float(self.frequency[1])

    def band(self, low: float = 0.0, high: float = np.inf) -> Spectrum:
        """The spectrum with no power outside ``low`` to ``high`` (Hz, both included)."""
        inside = (self.frequency >= low) & (self.frequency <= high)
        return Spectrum(self.frequency, np.where(inside, self.density, 0.0))

    def power(self, low: float = 0.0, high: float = np.inf) -> float:
        """Power between two frequencies, u²."""
        return float(self.band(low, high).density.sum() * self.resolution)

    def rms(self, low: float = 0.0, high: float = np.inf) -> float:
        """Root mean square between two frequencies, of the length of the vector, u."""
        return float(np.sqrt(self.power(low, high)))

    def share(self, low: float, high: float = np.inf) -> float:
        """Share of the power between two frequencies; NaN of a signal without power."""
        total = self.power()
        return self.power(low, high) / total if total > 0.0 else float("nan")

    def edge(self, share: float) -> float:
        """Frequency below which ``share`` of the power lies, Hz, linear between frequencies; NaN without power."""
        cumulated = np.cumsum(self.density)
        if not cumulated[-1] > 0.0:
            return float("nan")
        return float(np.interp(share * cumulated[-1], cumulated, self.frequency))

    def derivative_rms(self) -> float:
        """Root mean square of the time derivative, u/s."""
        return float(np.sqrt(np.sum((2.0 * np.pi * self.frequency) ** 2 * self.density) * self.resolution))


def spectrum(values: np.ndarray, rate: float, segment: float = SEGMENT) -> Spectrum:
    """Welch's estimate (Hann window, half overlap) over all stretches of a signal that are long enough.

    Args:
        values: ``(T, size)`` in u; NaN where missing: gaps up to :data:`LONGEST_GAP` are filled, longer ones cut.
        rate: Hz.
        segment: s of a segment; a signal shorter than that is one segment.

    Raises:
        ValueError: ``values`` or ``rate`` has another form, or no stretch is as long as a second.
    """
    from scipy.signal import welch

    values = checked(values, rate)
    stretches = list(whole_stretches(values, rate, segment))
    if not stretches:
        longest = max((len(part) for part in whole_stretches(values, rate, 1.0)), default=0)
        if longest == 0:
            raise ValueError(f"a spectrum needs a second without longer gaps than {LONGEST_GAP:g} s, values has none")
        segment = longest / rate
        stretches = list(whole_stretches(values, rate, segment))
    length = round(segment * rate)
    total, weight = np.zeros(length // 2 + 1), 0
    for part in stretches:
        density = welch(part - part.mean(axis=0), rate, nperseg=length, axis=0)[1]
        total, weight = total + len(part) * density.sum(axis=1), weight + len(part)
    return Spectrum(np.fft.rfftfreq(length, 1.0 / rate), total / weight)


def sinusoid_share(values: np.ndarray, rate: float, *, low: float = 0.1, high: float = np.inf) -> float:
    """Share of the variance that the four strongest sinusoids of each window and axis have.

    A motion made of a few sines has a share near one; broadband noise over ten hertz has about a tenth.

    Args:
        values: ``(T, size)``, NaN where missing.
        rate: Hz.
        low: Hz, lower end of the band whose variance counts.
        high: Hz, its upper end.

    Returns:
        The share of the summed variance of all axes, 0 to 1; NaN if no stretch is as long as a window, or there is no
        variance.

    Raises:
        ValueError: ``values`` or ``rate`` has another form.
    """
    values = checked(values, rate)
    length = round(WINDOW * rate)
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    inside = (frequency >= low) & (frequency <= high)
    found = total = 0.0
    for part in whole_stretches(values, rate, WINDOW):
        for start in range(0, len(part) - length + 1, length):
            piece = part[start : start + length]
            lines = np.abs(np.fft.rfft((piece - piece.mean(axis=0)) * np.hanning(length)[:, None], axis=0)) ** 2
            lines = lines[inside]
            total += lines.sum()
            for _ in range(SINUSOIDS):
                top = lines.argmax(axis=0)
                for axis, line in enumerate(top):
                    near = slice(max(0, line - 1), line + 2)
                    found += lines[near, axis].sum()
                    lines[near, axis] = 0.0
    return float(found / total) if total > 0.0 else float("nan")


def whole_stretches(values: np.ndarray, rate: float, shortest: float) -> Iterator[np.ndarray]:
    """Stretches ``(n, size)`` without missing samples that last ``shortest`` s or more, short gaps filled by lines."""
    filled = fill_short_gaps(values, LONGEST_GAP * rate)
    known = np.isfinite(filled).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    for begin, end in edges.reshape(-1, 2):
        if end - begin >= round(shortest * rate):
            yield filled[begin:end]


def checked(values: np.ndarray, rate: float) -> np.ndarray:
    """``values`` as ``(T, size)`` floats.

    Raises:
        ValueError: they are not, or ``rate`` is not a positive number.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 2:
        raise ValueError(f"values must have shape (T, size), got {values.shape}")
    if not 0.0 < rate < np.inf:
        raise ValueError(f"rate must be positive and finite (Hz), got {rate!r}")
    return values
