r"""Rules by hand that set one gain of a filter while it runs: what a trained policy has to beat.

A rule is written as the features of a policy that hands its only feature on. The pitch rate and the innovations raise
the variance of the pseudo-measurement "the bicycle does not pitch" (:mod:`poise.filters.bicycle.platform_gyro`; the
constraint of :class:`poise.filters.bicycle.two_gyro.filter.TwoGyro`), which is right on level ground and wrong on ramps
and bumps, and says nothing of the roll where the bicycle goes straight. The innovations alone make any filter
innovation-adaptive, and the excess of the specific force that of one inertial sensor adaptive to shaking.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.quantity import ACCELEROMETER, GRAVITY, Estimate
from .time_scales import FeatureMemory, Features


@dataclass(frozen=True)
class Rule(Features):
    """A log factor λ from means over the last interval; the feature is the action that sets it.

    Attributes:
        largest: log factor of action 1, of a variance.
        reach: less the log factor of action −1.
        decay: s, time constant of the averages.
    """

    scales: tuple[float, ...] = (0.0,)
    largest: float = 1.0
    reach: float = 1.0
    decay: float = 0.5

    @property
    def names(self) -> tuple[str, ...]:
        """The only feature."""
        return ("log factor",)

    def init(self, kalman: KalmanFilter, batch: tuple[int, ...] = ()) -> FeatureMemory:
        """Empty memory."""
        return self.empty(batch, 2)

    def averaged(self, averages: np.ndarray, means: np.ndarray, duration: float) -> np.ndarray:
        """Averages over the last ``decay`` seconds."""
        return averages - math.expm1(-duration / self.decay) * (means[..., None, :] - averages)

    def observe(self, memory: FeatureMemory, kalman: KalmanFilter, action: np.ndarray) -> np.ndarray:
        """The feature and the action of the last interval: float32 ``(*batch, 1 + k)``."""
        factor = self.factor(memory.averages[..., 0, :])
        factor = np.clip(factor / np.where(factor < 0.0, self.reach, self.largest), -1.0, 1.0)
        return np.concatenate([factor[..., None], action], axis=-1).astype(np.float32)

    def factor(self, averages: np.ndarray) -> np.ndarray:
        """λ ``(*batch,)`` of the averages ``(*batch, 2)``."""
        raise NotImplementedError


@dataclass(frozen=True)
class PitchRateRule(Rule):
    """λ = 2 ln(peak / threshold) where the bicycle pitches faster than the threshold.

    The peak is that of the pitch rate's mean over the interval and decays.

    Attributes:
        channel: gyroscope whose y axis is the bicycle's.
        threshold: rad/s; chosen on simulated rides, 4 °/s.
        decay: s, time constant of the peak.
    """

    channel: str = "bicycle_imu/gyr"
    threshold: float = math.radians(4.0)
    decay: float = 1.0

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Known or not, and the pitch rate ``(T, *batch, 2)``."""
        rate = np.asarray(measurements[self.channel], dtype=float)[..., 1]
        known = np.isfinite(rate)
        return np.stack([known, np.where(known, rate, 0.0)], axis=-1), memory.previous

    def averaged(self, averages: np.ndarray, means: np.ndarray, duration: float) -> np.ndarray:
        """The peak, twice."""
        now = np.abs(means[..., 1]) / np.where(means[..., 0] > 0.0, means[..., 0], 1.0)
        peak = np.maximum(now, averages[..., 0, 1] * math.exp(-duration / self.decay))
        return np.stack([peak, peak], axis=-1)[..., None, :]

    def factor(self, averages: np.ndarray) -> np.ndarray:
        """2 ln(peak / threshold), 0 below."""
        return 2.0 * np.log(np.maximum(averages[..., 1] / self.threshold, 1.0))


@dataclass(frozen=True)
class InnovationRule(Rule):
    """λ ← λ + ln(average NIS / m): the variance grows until the innovations are as large as the filter expects.

    After R. K. Mehra, "Approaches to adaptive filtering", IEEE Trans. Automatic Control 17(5), 1972, on the NIS.

    Attributes:
        smallest: log factor below which λ does not fall.
    """

    smallest: float = 0.0

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Number of measured rows, and NIS ``(T, *batch, 2)``."""
        rows = np.asarray(estimate.innovation) != 0.0
        return np.stack([rows.sum(axis=-1), np.asarray(estimate.nis)], axis=-1), memory.previous

    def averaged(self, averages: np.ndarray, means: np.ndarray, duration: float) -> np.ndarray:
        """The average of NIS / m (1 at the start), less 1, and λ."""
        share = -math.expm1(-duration / self.decay)
        measured = means[..., 0] > 0.0
        ratio = means[..., 1] / np.where(measured, means[..., 0], 1.0) - 1.0
        average = averages[..., 0, 0] + np.where(measured, share * (ratio - averages[..., 0, 0]), 0.0)
        factor = averages[..., 0, 1] + np.where(measured, np.log(np.maximum(1.0 + average, 1e-6)), 0.0)
        return np.stack([average, np.clip(factor, self.smallest, self.largest)], axis=-1)[..., None, :]

    def factor(self, averages: np.ndarray) -> np.ndarray:
        """λ."""
        return averages[..., 1]


@dataclass(frozen=True)
class TurningRule(Rule):
    r"""λ = 4 ln(v / (θ (|ω_z| + ω_0))), with v the variance of the pitch rate and ω_z the mean yaw rate.

    The pseudo-measurement sees the roll as far as the bicycle turns: tan φ = ω_y / ω_z. The pitch rate enters its
    derivative by φ as well, and so drives the roll away from zero in proportion to v − ω_z²: straight ahead on rough
    ground to ±90°, however small the gain. The variance is that of the samples, shaking included. Before the first of
    them nothing is believed.

    Attributes:
        channel: gyroscope whose y and z axes are the bicycle's.
        scale: θ, rad/s; with the others chosen on simulated rides.
        least_rate: ω_0, rad/s.
        smallest: log factor below which λ does not fall.
    """

    channel: str = "bicycle_imu/gyr"
    scale: float = math.radians(2.0)
    least_rate: float = math.radians(1.0)
    smallest: float = -2.0

    def init(self, kalman: KalmanFilter, batch: tuple[int, ...] = ()) -> FeatureMemory:
        """Empty memory."""
        return self.empty(batch, 4)

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Known or not, pitch rate, its square, yaw rate ``(T, *batch, 4)``."""
        rate = np.asarray(measurements[self.channel], dtype=float)[..., 1:3]
        known = np.isfinite(rate).all(axis=-1)
        y, z = np.moveaxis(np.where(known[..., None], rate, 0.0), -1, 0)
        return np.stack([known, y, y * y, z], axis=-1), memory.previous

    def factor(self, averages: np.ndarray) -> np.ndarray:
        """λ; 0 before the first sample."""
        there = averages[..., 0] > 0.0
        mean, square, turning = np.moveaxis(
            averages[..., 1:] / np.where(there, averages[..., 0], 1.0)[..., None], -1, 0
        )
        ratio = (square - mean * mean) / (self.scale * (np.abs(turning) + self.least_rate))
        return np.where(there, np.maximum(4.0 * np.log(np.maximum(ratio, 1e-8)), self.smallest), 0.0)


@dataclass(frozen=True)
class AccelerationRule(Rule):
    """λ = 2 ln(rms / reference) of the excess ‖f‖ − g of the specific force: what shakes is not gravity.

    Attributes:
        channel: accelerometer.
        reference: m/s²; excess at which the published variance holds.
        gravity: m/s².
        smallest: log factor below which λ does not fall.
    """

    channel: str = ACCELEROMETER.name
    reference: float = 1.0
    decay: float = 4.0
    gravity: float = GRAVITY
    smallest: float = -math.inf

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Known or not, and squared excess ``(T, *batch, 2)``."""
        force = np.asarray(measurements[self.channel], dtype=float)
        excess = np.sqrt(np.sum(force * force, axis=-1)) - self.gravity
        known = np.isfinite(excess)
        return np.stack([known, np.where(known, excess, 0.0) ** 2], axis=-1), memory.previous

    def factor(self, averages: np.ndarray) -> np.ndarray:
        """2 ln(rms / reference); 0 before the first sample."""
        known, square = averages[..., 0], averages[..., 1]
        there = known > 0.0
        ratio = square / np.where(there, known, 1.0) / self.reference**2
        return np.where(there, np.maximum(np.log(np.maximum(ratio, 1e-8)), self.smallest), 0.0)


RULES: dict[str, Rule] = {
    "pitch-rate": PitchRateRule(),
    "innovation": InnovationRule(),
    "turning": TurningRule(),
    "acceleration": AccelerationRule(),
}
"""Name → rule, with constants chosen on simulated motion and rides."""
