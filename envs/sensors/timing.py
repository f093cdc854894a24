"""When samples are taken and which packets arrive: delay, jitter, clock drift and bursts of loss of a device.

A sample at time step t describes what the sensor sensed some lag earlier, while the truth of the step belongs to t.
What is sensed at a time between two steps is interpolated (:mod:`poise.envs.sensors.late`).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from types import MappingProxyType
from typing import Self

import numpy as np

from ...filters.support.names import look_up
from ...filters.support.seeds import named_generator
from .noise import burst_chain, upper_quantile

LARGEST_JITTER = 3.0
"""standard deviations at which jitter is cut off"""


@dataclass(frozen=True)
class Timing:
    """Timing of the samples of a device; the defaults are perfect.

    Raises:
        ValueError: a negative or not finite number, or a clock error of 1 or more.
    """

    delay: float = 0.0
    """s: lag of every sample, filters and transmission together"""
    jitter: float = 0.0
    """s: standard deviation of a normal number, cut off at three, whose magnitude a sample lags further"""
    clock_drift: float = 0.0
    """1: standard deviation, from episode to episode, of the relative error of the device's clock, which agrees at the
    start. With a fast clock the lag grows, until a whole step has added up and a sample is lost; with a slow one it
    shrinks, until a sample would lie ahead of its time step, which then has none"""
    burst_rate: float = 0.0
    """1/s: how often a burst of lost packets begins, which hold all channels of the device"""
    burst_duration: float = 0.2
    """s: mean duration of a burst (exponential)"""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, positive = getattr(self, field.name), field.name == "burst_duration"
            most = 1.0 if field.name == "clock_drift" else math.inf
            if not ((value > 0.0 if positive else value >= 0.0) and value < most):
                wanted = "positive and finite" if positive else f"in [0, {most:g})"
                raise ValueError(f"{field.name} must be {wanted}, got {value}")

    @property
    def punctual(self) -> bool:
        """Whether every sample is taken and arrives at its time step."""
        return not (self.delay or self.jitter or self.clock_drift or self.burst_rate)

    def scaled(self, noise_scale: float) -> Self:
        """The same device with all errors of timing ``noise_scale`` times as large; 0 is punctual.

        Raises:
            ValueError: ``noise_scale`` is negative or not finite, or the clock error becomes 1 or more.
        """
        if not 0.0 <= noise_scale < math.inf:
            raise ValueError(f"noise_scale must lie in [0, inf), got {noise_scale}")
        names = ("delay", "jitter", "clock_drift", "burst_rate")
        return replace(self, **{name: noise_scale * getattr(self, name) for name in names})

    def describe(self) -> dict[str, float]:
        """All fields, for JSON."""
        return asdict(self)


PUNCTUAL = Timing()
TIMINGS: Mapping[str, Timing] = MappingProxyType(
    {
        "punctual": PUNCTUAL,
        # BROAD's gyroscopes lag their optical reference by 2.4 to 2.7 ms; the rest is assumed
        "wired": Timing(delay=0.0025, jitter=1e-4, clock_drift=2e-5),
        # assumed: a frame of a body-area radio is 10 to 30 ms, crystals are good to 50 ppm
        "wireless": Timing(delay=0.02, jitter=0.002, clock_drift=3e-5, burst_rate=0.05, burst_duration=0.15),
        # assumed: stamps that an operating system without real-time guarantees sets
        "phone": Timing(delay=0.008, jitter=0.0015, clock_drift=2e-5, burst_rate=0.01, burst_duration=0.1),
        # assumed: exposure, transfer and recognition of a marker
        "camera": Timing(delay=0.06, jitter=0.005, clock_drift=3e-5, burst_rate=0.05, burst_duration=0.3),
    }
)
"""Name → timing; all numbers but the delay of ``wired`` are assumed."""

ClockKey = tuple[str, Timing]
"""Site and timing of a device"""
Timings = str | Timing | Mapping[str, str | Timing]
"""A timing or its name; or one for each site, the part of a channel's name before the slash."""


def timing_of(timing: Timings | None, site: str) -> Timing:
    """The timing of a site; punctual where none is given.

    Raises:
        ValueError: there is none of that name; the message lists all.
    """
    if isinstance(timing, Mapping):
        timing = timing.get(site)
    if timing is None:
        return PUNCTUAL
    return timing if isinstance(timing, Timing) else look_up("timing", timing, TIMINGS)


def check_sites(timing: Timings | None, sites: set[str]) -> None:
    """Check that every site for which there is a timing exists.

    Raises:
        ValueError: with those that do not.
    """
    if isinstance(timing, Mapping) and (unknown := sorted(set(timing) - sites)):
        raise ValueError(f"timing must be of sites among {sorted(sites)}, got {unknown}")


@dataclass
class ClockState:
    """All memory of a :class:`Clock`."""

    generator: np.random.Generator
    drift: float
    """relative error of the clock in this episode"""
    latest: float
    """s: when the newest sample so far was sensed"""
    in_burst: bool


class Clock:
    """Lags and lost packets of a device during one episode.

    Args:
        timing: of the device.
        rate: time steps per second, Hz.
        generator: source of randomness, owned by the clock from now on. Clocks of one device that begin with equal
            generators have the same error, jitter and losses, each in its own measure.
    """

    def __init__(self, timing: Timing, rate: float, generator: np.random.Generator) -> None:
        self.timing, self.rate = timing, rate
        drift = timing.clock_drift * float(generator.standard_normal())
        self._state = ClockState(generator, max(drift, -0.9), -math.inf, False)
        self._burst_above = upper_quantile(timing.burst_rate / rate)
        self._recovery_above = upper_quantile(1.0 / (rate * timing.burst_duration))

    @property
    def reach(self) -> int:
        """Time steps that must be remembered: by which a sample may lag, a step of drift, and one on either side."""
        return math.ceil((self.timing.delay + LARGEST_JITTER * self.timing.jitter) * self.rate) + 3

    def advance(self, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The next time steps.

        Args:
            steps: ``(T,)``, counted from 0.

        Returns:
            Lag ``(T,)`` in s of what a sample of each step describes, and which steps ``(T,)`` have no sample:
            lost packets, and what would be sensed less than a quarter of a step after the last sample.
        """
        state, timing = self._state, self.timing
        normal = state.generator.standard_normal((len(steps), 2))
        extra = timing.jitter * np.minimum(np.abs(normal[:, 0]), LARGEST_JITTER)
        times = steps / self.rate
        lag, step = timing.delay + state.drift * times, 1.0 / self.rate
        if state.drift > 0.0:
            lag -= step * np.floor(state.drift * times / step)
        lag += step * np.ceil(np.maximum(-lag, 0.0) / step) + extra
        lost = np.zeros(len(steps), bool)
        if timing.burst_rate > 0.0:
            lost, state.in_burst = burst_chain(normal[:, 1], self._burst_above, self._recovery_above, state.in_burst)
        latest, least = state.latest, 0.25 / self.rate
        for index, time in enumerate((times - lag).tolist()):
            if time - latest < least:
                lost[index] = True
            else:
                latest = time
        state.latest = latest
        return lag, lost

    def save(self) -> ClockState:
        """A copy of all memory, the generator's included."""
        return copy.deepcopy(self._state)

    def restore(self, state: ClockState) -> None:
        """Continue from a saved state, exactly."""
        self._state = copy.deepcopy(state)


def make_clocks(keys: Iterable[ClockKey | None], rate: float, generator: np.random.Generator) -> dict[ClockKey, Clock]:
    """Clocks of an episode at ``rate`` (Hz): one for every timing at every site; None for a punctual sensor.

    They descend from the generator's seed; it is not used up.
    """
    return {
        key: Clock(key[1], rate, named_generator(generator, "clock", key[0]))
        for key in dict.fromkeys(keys)
        if key is not None
    }
