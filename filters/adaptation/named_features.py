r"""Observation of a gain policy for filters whose sensors have known places: every number by its name.

On a bicycle the y rate of its gyroscope is the pitch rate, and one row of the measurement is the roll: a policy may
look at each. For every row of the whitened innovation w and every number v of every channel, means and mean squares run
over several time scales (:mod:`.time_scales`), without missing samples. Features are

* of a row: the logarithm of its NIS, ½ log₁₀ of the mean of w², 0 if the filter is consistent, and the mean of w;
* of a channel's number: its mean, and the logarithm of its standard deviation, in units of :data:`TYPICAL`;

compressed by tanh to [−1, 1]; 0 where there was no sample. Nothing of the truth enters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.quantity import Estimate
from .features import InnovationFeatures
from .time_scales import FeatureMemory, Features

TYPICAL = {"rad/s": 1.0, "rad": 1.0, "m/s²": 10.0, "m/s": 5.0, "m": 1.0, "N": 300.0, "N·m": 30.0, "N m": 30.0}
"""Unit of a channel → size of its numbers on a bicycle; 1 for all others"""
VARIATION = 0.1
"""standard deviation that maps to 0, in units of :data:`TYPICAL`"""
FLOOR = 1e-4
"""smallest ratio that is distinguished from zero"""


@dataclass(frozen=True)
class NamedFeatures(Features):
    """Statistics of every row of the innovation and of every number of every channel.

    Attributes:
        rows: of the innovation.
        channels: name, width and unit of each channel of the filter.
    """

    rows: int = 0
    channels: tuple[tuple[str, int, str], ...] = ()

    @classmethod
    def of(cls, kalman: KalmanFilter, interval: float = 0.1) -> Self:
        """Those of a filter."""
        channels = tuple((channel.name, channel.size, channel.unit) for channel in kalman.channels)
        return cls(interval, rows=kalman.model.residual_size, channels=channels)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of the numbers that are watched: rows of the innovation, then numbers of channels."""
        rows = [f"innovation {row}" for row in range(self.rows)]
        return (*rows, *(f"{name}[{index}]" for name, size, _ in self.channels for index in range(size)))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every feature, in order; the actions of the last interval follow them."""
        parts = [f"{number} size" for number in self.numbers] + [f"{number} mean" for number in self.numbers]
        return (*(f"{part} {scale:g} s" for scale in self.scales for part in parts), "time since start")

    def init(self, kalman: KalmanFilter, batch: tuple[int, ...] = ()) -> FeatureMemory:
        """Empty memory for sequences of shape ``batch``.

        Raises:
            ValueError: the filter has other channels or another number of rows.
        """
        if type(self).of(kalman, self.interval).numbers != self.numbers:
            raise ValueError(f"features are of the numbers {self.numbers}, the filter has other ones")
        return self.empty(batch, 3 * len(self.numbers))

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Known or not, number and square ``(T, *batch, 3 numbers)``; nothing of the last sample is needed."""
        white = np.asarray(estimate.innovation)
        # A whitened row is exactly 0 where it was not measured.
        white = np.where(white != 0.0, white, np.nan)
        sensed = [
            np.asarray(measurements[name], dtype=float) / TYPICAL.get(unit, 1.0) for name, _, unit in self.channels
        ]
        values = np.concatenate([white, *sensed], axis=-1)
        known = np.isfinite(values)
        values = np.where(known, values, 0.0)
        return np.concatenate([known, values, values * values], axis=-1), memory.previous

    def observe(self, memory: FeatureMemory, kalman: KalmanFilter, action: np.ndarray) -> np.ndarray:
        """Features and the action of the last interval: float32 ``(*batch, size)`` in [−1, 1]."""
        batch = memory.averages.shape[:-2]
        known, total, squares = np.split(memory.averages, 3, axis=-1)
        there = known > 0.0
        weight = np.where(there, known, 1.0)
        mean, square = total / weight, squares / weight
        variance = square - mean * mean
        # Of rows the NIS, of which the mean is a part; of channels the variation.
        size = np.concatenate([square[..., : self.rows], variance[..., self.rows :] / VARIATION**2], axis=-1)
        logarithm = np.where(there, 0.5 * np.log10(np.fmax(size, FLOOR**2)), 0.0)
        features = np.concatenate([logarithm, mean], axis=-1).reshape(*batch, -1)
        squashed = np.tanh(np.concatenate([features, self.age(memory, kalman.dt)], axis=-1))
        return np.concatenate([squashed, action], axis=-1).astype(np.float32)


def features_of(kalman: KalmanFilter, interval: float = 0.1) -> Features:
    """The features for a filter: invariant ones for one inertial sensor in any mounting, else every number by name.

    ``interval`` (s) is that between decisions.
    """
    if all(channel.name.startswith("imu/") for channel in kalman.channels):
        return InnovationFeatures(interval)
    return NamedFeatures.of(kalman, interval)
