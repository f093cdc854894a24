"""What all observations of a gain policy share: moments of streams, averaged over several time scales.

Moments of the samples of an interval are summed. At its end, where a decision is due, their means m enter

    average ← average + (1 − exp(−interval / τ)) (m − average)

for each time scale τ. One memory holds a batch of sequences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.quantity import Estimate

START_TIME = 20.0
"""s: time constant of the feature for the time since the start."""


class FeatureMemory(NamedTuple):
    """State of the features; arrays only.

    Attributes:
        averages: ``(*batch, scales, moments)`` running means.
        sums: ``(*batch, moments)`` over the samples of the current interval.
        previous: ``(*batch, streams, width)`` last sample of every stream; NaN if there was none.
        samples: ``()`` int, samples of the current interval so far; at 0 a decision is due.
        decisions: ``(*batch,)`` int, number of completed intervals.
    """

    averages: np.ndarray
    sums: np.ndarray
    previous: np.ndarray
    samples: np.ndarray
    decisions: np.ndarray


@dataclass(frozen=True)
class Features:
    """Statistics over several time scales, computed while a filter runs.

    Attributes:
        interval: time between decisions, s; rounded to samples of the filter, at least one.
        scales: time constants of the running means, s; 0 for the last interval alone.

    Raises:
        ValueError: the interval is not positive, or there is no scale, or a negative one.
    """

    interval: float = 0.1
    scales: tuple[float, ...] = (0.0, 0.3, 1.0, 4.0, 16.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.interval < math.inf:
            raise ValueError(f"interval must be positive seconds, got {self.interval}")
        if not self.scales or not all(0.0 <= scale < math.inf for scale in self.scales):
            raise ValueError(f"scales must be times in seconds, 0 or more, got {self.scales}")

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every feature, in order; the actions of the last interval follow them."""
        raise NotImplementedError

    def init(self, kalman: KalmanFilter, batch: tuple[int, ...] = ()) -> FeatureMemory:
        """Empty memory for sequences of shape ``batch``.

        Raises:
            ValueError: the filter has not the channels that the features need.
        """
        raise NotImplementedError

    def empty(self, batch: tuple[int, ...], moments: int, previous: tuple[int, int] = (0, 0)) -> FeatureMemory:
        """Memory before the first sample, of so many moments and of previous values of that shape."""
        averages, sums = np.zeros((*batch, len(self.scales), moments)), np.zeros((*batch, moments))
        return FeatureMemory(averages, sums, np.full((*batch, *previous), np.nan), np.array(0), np.zeros(batch, int))

    def observe(self, memory: FeatureMemory, kalman: KalmanFilter, action: np.ndarray) -> np.ndarray:
        """Features at the end of an interval and its action ``(*batch, k)``: float32 ``(*batch, size)`` in [−1, 1]."""
        raise NotImplementedError

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Moments ``(T, *batch, moments)`` of the samples, and the last one of every stream."""
        raise NotImplementedError

    def averaged(self, averages: np.ndarray, means: np.ndarray, duration: float) -> np.ndarray:
        """Averages ``(*batch, scales, moments)`` after an interval of ``duration`` s, means ``(*batch, moments)``."""
        rate = np.array([1.0 if scale == 0.0 else -math.expm1(-duration / scale) for scale in self.scales])
        return averages + rate[:, None] * (means[..., None, :] - averages)

    def size(self, actions: int) -> int:
        """Length of :meth:`observe` for that many actions."""
        return len(self.names) + actions

    def interval_samples(self, dt: float) -> int:
        """Samples of an interval at a sampling interval of ``dt`` seconds."""
        return max(1, round(self.interval / dt))

    def age(self, memory: FeatureMemory, dt: float) -> np.ndarray:
        """Time since the start ``(*batch, 1)`` in units of :data:`START_TIME`."""
        return (memory.decisions * (self.interval_samples(dt) * dt / START_TIME))[..., None]

    def update(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> FeatureMemory:
        """Update with the samples that a filter has just processed.

        Args:
            memory: from :meth:`init` or the previous update; it is not changed.
            kalman: the filter.
            measurements: channel → ``(T, *batch, size)``.
            estimate: of the filter, ``(T, *batch, …)``.

        Raises:
            ValueError: the samples reach beyond the end of the interval.
        """
        moments, previous = self.moments(memory, kalman, measurements, estimate)
        taken = int(memory.samples) + len(moments)
        whole = self.interval_samples(kalman.dt)
        if taken > whole:
            beyond = f"{len(moments)} samples after {memory.samples}"
            raise ValueError(f"{beyond} reach beyond the interval of {whole} samples")
        # The first axis is summed row by row, so that single samples and blocks give the same sums.
        sums = np.concatenate([memory.sums[None], moments]).sum(axis=0)
        if taken < whole:
            return memory._replace(sums=sums, previous=previous, samples=np.array(taken))
        averages = self.averaged(memory.averages, sums / whole, whole * kalman.dt)
        return FeatureMemory(averages, np.zeros_like(sums), previous, np.array(0), memory.decisions + 1)
