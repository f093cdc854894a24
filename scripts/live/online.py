"""The clock of samples as they arrive: gaps become missing samples."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...envs.data.clock import check_interval, fit_clock
from ...envs.data.glitches import alike
from .lines import BadLineError, Sample

LONGEST_GAP = 5.0
"""s without samples; after a longer gap an estimator starts anew instead of predicting."""
FORWARD, BACK = 0.5, 0.01
"""Shares by which the clock follows a stamp that is late and one that is early: it runs with the latest stamps, so that
jitter, drift, and packets of samples that share a stamp are not gaps."""
FITTED = 50
"""Samples from whose stamps the sampling rate is found, or checked where it is given."""
SAME_RATE = 0.7
"""Share of the sampling interval given that the interval of the stamps has at least."""
UNCONFIRMED = 0.5
"""s; a sample whose stamp is so far ahead waits for the next one, which may show that the stamp is wrong."""
SET_BACK = 3
"""Samples in a row that lie before the last one but in order, from which on the clock counts as set back."""


class Timed(NamedTuple):
    """A sample, or the place of a missing one, on the clock of the stream."""

    time: float
    """s"""
    measurement: dict[str, np.ndarray]
    """NaN everywhere for a missing sample"""
    predicted: bool
    """whether the sample is missing"""
    restart: bool
    """whether the gap before it is too long for predictions"""


@dataclass
class StreamClock:
    """Puts samples on a uniform clock and inserts the missing ones.

    Attributes:
        dt: sampling interval, s; None: found from the first stamps.
        longest_gap: s; a longer gap is not filled.
        missing: samples inserted so far.
        repeated: samples that repeated the one before, stamp and values; they are dropped.
        restarts: gaps that were too long, and clocks that were set back.
    """

    dt: float | None = None
    longest_gap: float = LONGEST_GAP
    missing: int = 0
    repeated: int = 0
    restarts: int = 0
    _now: float = field(default=math.nan, init=False)
    _last: Sample | None = field(default=None, init=False)
    _behind: list[float] = field(default_factory=list, init=False)
    _ahead: Sample | None = field(default=None, init=False)
    _waiting: list[Sample] = field(default_factory=list, init=False)
    _early: list[float] = field(default_factory=list, init=False)
    _anew: bool = field(default=False, init=False)

    def add(self, sample: Sample) -> Iterator[Timed]:
        """The sample with the missing ones before it; the first ones come late where the rate is found from them.

        Raises:
            BadLineError: its time lies before that of the sample before it, or that one's far ahead of it.
            ValueError: the samples have no time, and there is no ``dt``; or no rate explains the first stamps, or
                another one than ``dt``.
        """
        if sample.time is None:
            if self.dt is None:
                raise ValueError("the lines have no time: name the sampling rate in Hz by --rate")
            sample = sample._replace(time=0.0 if math.isnan(self._now) else self._now + self.dt)
        assert sample.time is not None
        ahead, self._ahead = self._ahead, None
        wrong = ahead is not None and ahead.time is not None and sample.time < ahead.time
        if ahead is not None and not wrong:
            yield from self._accept(ahead)
        if self._last is not None and self._last.time is not None:
            if sample.time == self._last.time and alike(sample.measurement, self._last.measurement):
                self.repeated += 1
                return
            if sample.time < self._last.time:
                self._check_set_back(sample.time, self._last.time)
        self._behind.clear()
        if self.dt is not None and UNCONFIRMED < sample.time - self._now < math.inf and not wrong:
            self._ahead = sample
            return
        yield from self._accept(sample)
        if wrong:
            assert ahead is not None
            raise BadLineError(f"the sample before it is left out, whose time {ahead.time:.6g} s lies far ahead")

    def _check_set_back(self, time: float, last: float) -> None:
        """Start anew where the clock was set back; a single sample that lies before the last one is a bad line."""
        if self._behind and not self._behind[-1] <= time <= self._behind[-1] + self.longest_gap:
            self._behind.clear()
        self._behind.append(time)
        if len(self._behind) < SET_BACK:
            raise BadLineError(f"its time {time:.6g} s lies before {last:.6g} s of the sample before it")
        self._now = math.nan
        self._waiting.clear()
        self._anew = True
        self.restarts += 1

    def _accept(self, sample: Sample) -> Iterator[Timed]:
        assert sample.time is not None
        self._last = sample
        if self.dt is not None:
            self._check_rate(sample.time)
            yield from self._place(sample)
            return
        self._waiting.append(sample)
        if len(self._waiting) == FITTED:
            yield from self._fit()

    def _check_rate(self, time: float) -> None:
        """Compare the sampling interval that was given with the first stamps.

        Raises:
            ValueError: the stamps show another one.
        """
        assert self.dt is not None
        if len(self._early) >= FITTED:
            return
        self._early.append(time)
        if len(self._early) < FITTED:
            return
        stamps = np.array(self._early)
        counts = np.unique(stamps, return_counts=True)[1]
        if len(counts) < 2 or (np.diff(stamps) < 0.0).any():
            return
        # The samples of a packet lie before its stamp.
        mean = (stamps[-1] - stamps[0]) / (len(stamps) - counts[0])
        shortest = float(np.quantile(np.diff(np.unique(stamps)) / counts[1:], 0.1))
        found = mean if mean < SAME_RATE * self.dt else shortest
        if mean < SAME_RATE * self.dt or shortest > self.dt / SAME_RATE:
            raise ValueError(
                f"rate={1.0 / self.dt:.4g} Hz contradicts the time of the lines: the first {len(stamps)} samples are "
                f"{found:.4g} s apart, {1.0 / found:.4g} Hz; leave it out, or name the unit of the time, such as "
                "--units time=ms"
            )

    def finish(self) -> Iterator[Timed]:
        """The samples that still wait, for the sampling rate or for a later sample.

        Raises:
            ValueError: no sampling rate explains their stamps.
        """
        yield from self._fit()
        if self._ahead is not None:
            ahead, self._ahead = self._ahead, None
            yield from self._accept(ahead)

    def _fit(self) -> Iterator[Timed]:
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        stamps = np.array([sample.time for sample in waiting], float)
        if len(stamps) < 2 or stamps[-1] == stamps[0]:
            raise ValueError(f"{len(stamps)} samples at {stamps[0]:g} s give no sampling rate: add --rate in Hz")
        clock = fit_clock(stamps)
        check_interval(clock.interval, stamps)
        self.dt = clock.interval
        self._early = [math.nan] * FITTED
        for sample in waiting:
            yield from self._place(sample)

    def _place(self, sample: Sample) -> Iterator[Timed]:
        assert self.dt is not None
        assert sample.time is not None
        gap = sample.time - self._now
        restart = gap > self.longest_gap
        if math.isnan(gap) or restart:
            self.restarts += restart
            self._now = sample.time
            anew, self._anew = self._anew, False
            yield Timed(sample.time, sample.measurement, False, restart or anew)
            return
        none = {name: np.full_like(values, np.nan) for name, values in sample.measurement.items()}
        for _ in range(round(gap / self.dt) - 1):
            self._now += self.dt
            self.missing += 1
            yield Timed(self._now, none, True, False)
        self._now += self.dt
        late = sample.time - self._now
        self._now += (FORWARD if late > 0.0 else BACK) * late
        yield Timed(self._now, sample.measurement, False, False)
