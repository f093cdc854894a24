"""A Kalman filter with gains that change while it runs; shared by environments and adaptive estimators."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..core.estimator import check_measurements
from ..core.kalman import KalmanFilter
from ..core.quantity import Estimate
from ..core.sampling import FilterState
from .gains import GainRange, filter_name, gain_ranges, log_gains
from .named_features import features_of
from .time_scales import FeatureMemory, Features


class TunedState(NamedTuple):
    """Complete state of a tuned filter; arrays only, so a copy of them saves it.

    Attributes:
        filter: state of the filter.
        memory: state of the features.
        action: ``(*batch, k)`` in force since the last decision.
    """

    filter: FilterState
    memory: FeatureMemory
    action: np.ndarray


@dataclass(frozen=True)
class TunedFilter:
    """A filter with the actions that change its gains and the features that are observed.

    Attributes:
        kalman: the filter in its published tuning.
        ranges: of the actions, in order.
        features: observed features, and the interval between decisions.
        smoothing: s; the gains follow the actions with this time constant, 0: at once. Noise of single decisions, such
            as that of an agent's exploration, then changes them little.
    """

    kalman: KalmanFilter
    ranges: tuple[GainRange, ...]
    features: Features
    smoothing: float = 0.0

    @classmethod
    def of(
        cls,
        kalman: KalmanFilter,
        gains: tuple[str, ...] | None = None,
        features: Features | None = None,
        smoothing: float = 0.0,
    ) -> TunedFilter:
        """A tuned filter with the ranges of :func:`poise.filters.adaptation.gains.gain_ranges`."""
        return cls(kalman, gain_ranges(kalman, gains), features or features_of(kalman), smoothing)

    @property
    def name(self) -> str:
        """Name of the filter."""
        return filter_name(self.kalman)

    @property
    def actions(self) -> int:
        """Number k of tunable gains."""
        return len(self.ranges)

    @property
    def observation_size(self) -> int:
        """Length of an observation."""
        return self.features.size(self.actions)

    @property
    def interval_samples(self) -> int:
        """Number of samples between decisions."""
        return self.features.interval_samples(self.kalman.dt)

    def with_dt(self, dt: float) -> TunedFilter:
        """The same for another sampling interval; the time between decisions is kept, rounded to samples."""
        return replace(self, kalman=self.kalman.with_dt(dt))

    def init(self, measurement: Mapping[str, Any]) -> TunedState:
        """Initial state with the batch shape of ``measurement``; the action is neutral.

        Raises:
            ValueError: the filter reads no gyroscope, or a channel is missing.
        """
        state = self.kalman.init(measurement)
        batch = tuple(state.x.shape[:-1])
        return TunedState(state, self.features.init(self.kalman, batch), np.zeros((*batch, self.actions)))

    def observe(self, state: TunedState) -> np.ndarray:
        """Observation ``(*batch, n)``, float32 in [−1, 1], at a decision."""
        return self.features.observe(state.memory, self.kalman, state.action)

    def gains(self, action: np.ndarray) -> dict[str, np.ndarray]:
        """Log gains of an action; see :func:`poise.filters.adaptation.gains.log_gains`."""
        return log_gains(self.kalman.model, self.ranges, action)

    def decide(self, state: TunedState, action: np.ndarray) -> TunedState:
        """Apply an action ``(*batch, k)``; values beyond [−1, 1] are clipped. The state holds it smoothed."""
        bounded = np.minimum(np.maximum(np.asarray(action, dtype=float), -1.0), 1.0)
        if self.smoothing:
            share = -math.expm1(-self.interval_samples * self.kalman.dt / self.smoothing)
            bounded = state.action + share * (bounded - state.action)
        return state._replace(action=np.broadcast_to(bounded, state.action.shape))

    def advance(self, state: TunedState, measurements: Mapping[str, Any]) -> tuple[Estimate, TunedState]:
        """Process samples ``(T, *batch, size)`` of one interval, not beyond its end, with the current action."""
        measurements = check_measurements(self.kalman.channels, measurements, time_axis=True)
        length = len(next(iter(measurements.values())))
        gains = {
            name: np.broadcast_to(factor, (length, *factor.shape)) for name, factor in self.gains(state.action).items()
        }
        estimate, after = self.kalman.run_from(state.filter, measurements, gains)
        memory = self.features.update(state.memory, self.kalman, measurements, estimate)
        return estimate, TunedState(after, memory, state.action)
