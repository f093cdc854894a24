"""An estimator fed with samples as they arrive: gaps become predictions, and the time of every step is measured."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np

from ...envs.data.clock import fit_clock
from ...filters.core.estimator import Estimator, check_measurements
from ...filters.core.quantity import Estimate
from .lines import BadLineError, Sample

LONGEST_GAP = 5.0
"""s without samples; after a longer gap an estimator starts anew instead of predicting."""
FORWARD, BACK = 0.5, 0.01
"""Shares by which the clock follows a stamp that is late and one that is early: it runs with the latest stamps, so that
jitter, drift, and packets of samples that share a stamp are not gaps."""
FITTED = 50
"""Samples from whose stamps the sampling rate is found, where it is not given."""


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
        restarts: gaps that were too long.
    """

    dt: float | None = None
    longest_gap: float = LONGEST_GAP
    missing: int = 0
    restarts: int = 0
    _now: float = field(default=math.nan, init=False)
    _last: float = field(default=math.nan, init=False)
    _waiting: list[Sample] = field(default_factory=list, init=False)

    def add(self, sample: Sample) -> Iterator[Timed]:
        """The sample with the missing ones before it; the first ones come late where the rate is found from them.

        Raises:
            BadLineError: its time lies before that of the sample before it.
            ValueError: the samples have no time, and there is no ``dt``; or no rate explains the first stamps.
        """
        if sample.time is None:
            if self.dt is None:
                raise ValueError("the lines have no time: name the sampling rate in Hz by --rate")
            sample = sample._replace(time=0.0 if math.isnan(self._now) else self._now + self.dt)
        assert sample.time is not None
        if sample.time < self._last:
            raise BadLineError(f"its time {sample.time:.6g} s lies before {self._last:.6g} s of the sample before it")
        self._last = sample.time
        if self.dt is not None:
            yield from self._place(sample)
            return
        self._waiting.append(sample)
        if len(self._waiting) == FITTED:
            yield from self.finish()

    def finish(self) -> Iterator[Timed]:
        """The samples that still wait for the sampling rate.

        Raises:
            ValueError: no sampling rate explains their stamps.
        """
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        stamps = np.array([sample.time for sample in waiting], float)
        if len(stamps) < 2 or stamps[-1] == stamps[0]:
            raise ValueError(f"{len(stamps)} samples at {stamps[0]:g} s give no sampling rate: add --rate in Hz")
        self.dt = fit_clock(stamps).interval
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
            yield Timed(sample.time, sample.measurement, False, restart)
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


@dataclass
class OnlineEstimator:
    """An estimator with its state, and how long its steps took.

    Attributes:
        estimator: at the sampling interval of the stream.
        seconds: of every step.
    """

    estimator: Estimator[Any]
    seconds: array[float] = field(default_factory=lambda: array("d"))
    _state: Any = field(default=None, init=False)

    def warm_up(self) -> Self:
        """Compute an estimate of a resting sensor, so that compiled code is loaded before the first sample comes."""
        rest = {each.name: np.full(each.size, 1.0) for each in self.estimator.channels}
        state = self.estimator.init(rest)
        self.estimator.step(state, rest)
        return self

    def step(self, sample: Timed) -> Estimate:
        """The estimate after a sample.

        Raises:
            ValueError: the sample lacks a channel of the estimator.
        """
        start = time.perf_counter()
        if self._state is None or sample.restart:
            measurement = check_measurements(self.estimator.channels, sample.measurement, time_axis=False)
            self._state = self.estimator.init(measurement)
        self._state, estimate = self.estimator.step(self._state, sample.measurement)
        self.seconds.append(time.perf_counter() - start)
        return estimate

    def latency(self) -> dict[str, float]:
        """Median, 95 % and largest time of a step, µs."""
        taken = 1e6 * np.array(self.seconds)
        if not len(taken):
            return {"samples": 0}
        median, high = np.quantile(taken, [0.5, 0.95])
        return {
            "samples": len(self.seconds),
            "median (µs)": float(median),
            "95 % (µs)": float(high),
            "largest (µs)": float(taken.max()),
        }
