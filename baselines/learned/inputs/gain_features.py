"""What a network sees that sets the gains of a filter: statistics of innovations and sensors over several time scales.

They are the observations of gain policies (:mod:`poise.filters.adaptation`), of a filter in its published tuning that
runs beside the filter whose gains the network sets: the same filter, or one that sees more in its innovations. What the
network sees then does not depend on what it says: features of a whole sequence are known before the network runs, and
no feedback can make the two unstable. The size of the gyroscope bias is a feature of its own where that filter
estimates one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ....filters.adaptation.named_features import features_of
from ....filters.adaptation.time_scales import FeatureMemory, Features
from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import GRAVITY, GYROSCOPE_BIAS, UP, Channel, Estimate, Measurement
from ....filters.core.sampling import FilterState
from ..gains.gain_shares import described_filter, filter_of
from .front_end import Seen, check_interval

TYPICAL_BIAS, SMALLEST_BIAS = math.radians(0.5), math.radians(0.02)
"""rad/s: size of a gyroscope bias that maps to 0, and added to all, so that a vanishing one is no outlier"""


class ObservedState(NamedTuple):
    """Memory of :class:`GainFeatures`: of the filter in its published tuning, and of the statistics."""

    filter: FilterState
    memory: FeatureMemory


@dataclass(frozen=True)
class GainFeatures:
    """Statistics of a filter's innovations and sensors; for one inertial sensor they do not depend on its mounting.

    Attributes:
        kalman: the filter in its published tuning; its gains are what a network sets.
        observed: the filter whose innovations are seen, of the same channels; None: the same.
        interval: s between updates of the network, rounded to samples.

    Raises:
        ValueError: sampling slower than the network, or an observed filter of other channels.
    """

    kalman: KalmanFilter
    observed: KalmanFilter | None = None
    interval: float = 0.04

    kind: ClassVar[str] = "gain-features"

    def __post_init__(self) -> None:
        check_interval(self.kalman.dt, self.interval)
        object.__setattr__(self, "kalman", replace(self.kalman, keep_covariance=False))
        if self.observed is not None:
            if self.observed.channels != self.kalman.channels:
                names = [channel.name for channel in self.kalman.channels]
                raise ValueError(f"observed must read {names}, got a filter of {list(self.observed.channels)}")
            watched = replace(self.observed, keep_covariance=False).with_dt(self.kalman.dt)
            object.__setattr__(self, "observed", watched)

    @property
    def _watched(self) -> KalmanFilter:
        return self.kalman if self.observed is None else self.observed

    @cached_property
    def features(self) -> Features:
        """The statistics."""
        return features_of(self._watched, self.interval)

    @property
    def _biased(self) -> bool:
        return any(quantity.name == GYROSCOPE_BIAS.name for quantity in self._watched.outputs)

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.kalman.dt

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those of the filter."""
        return self.kalman.channels

    @property
    def size(self) -> int:
        """Number of features."""
        return self.features.size(0) + self._biased

    def with_dt(self, dt: float) -> Self:
        """See :class:`.front_end.FrontEnd`."""
        return replace(self, kalman=self.kalman.with_dt(dt))

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """The filters configured for rider and bicycle, where the metadata describe them."""

        def own(kalman: KalmanFilter) -> KalmanFilter:
            return replace(kalman, model=kalman.model.configured(metadata))

        return replace(self, kalman=own(self.kalman), observed=None if self.observed is None else own(self.observed))

    def describe(self) -> dict[str, Any]:
        """See :class:`.front_end.FrontEnd`."""
        observed = None if self.observed is None else described_filter(self.observed)
        named = {"filter": described_filter(self.kalman), "observed": observed}
        return {"kind": self.kind, **named, "interval": self.interval}

    @classmethod
    def read(cls, described: Mapping[str, Any], dt: float) -> Self:
        """The inverse of :meth:`describe`."""
        observed = described["observed"]
        seen = None if observed is None else filter_of(observed, dt)
        return cls(filter_of(described["filter"], dt), seen, float(described["interval"]))

    def init(self, measurement: Measurement) -> ObservedState:
        """See :class:`.front_end.FrontEnd`."""
        state = self._watched.init(measurement)
        return ObservedState(state, self.features.init(self._watched, tuple(state.x.shape[:-1])))

    def step(self, state: ObservedState, measurement: Measurement) -> tuple[ObservedState, Seen]:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        samples = {name: np.asarray(array)[None] for name, array in arrays.items()}
        estimate, inner = self._watched.run_from(state.filter, samples)
        memory = self.features.update(state.memory, self._watched, samples, self._told(estimate, samples))
        due = np.full(memory.decisions.shape, float(memory.samples == 0))
        return ObservedState(inner, memory), self._seen(self._looked_at(memory, estimate, -1), due)

    def run(self, measurements: Mapping[str, Any]) -> Seen:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        arrays = {name: np.asarray(array) for name, array in arrays.items()}
        estimate = self._watched.run(arrays)
        length, batch = estimate.nis.shape[0], estimate.nis.shape[1:]  # type: ignore[union-attr]
        memory, whole = self.features.init(self._watched, batch), self.features.interval_samples(self.dt)
        moments, _ = self.features.moments(memory, self._watched, arrays, self._told(estimate, arrays))
        count = length // whole
        means = moments[: count * whole].reshape(count, whole, *moments.shape[1:]).sum(axis=1) / whole
        averages = np.empty((count, *memory.averages.shape))
        last = memory.averages
        for index in range(count):
            last = averages[index] = self.features.averaged(last, means[index], whole * self.dt)
        past = np.arange(1, count + 1).reshape(-1, *(1,) * len(batch))
        ends = memory._replace(averages=averages, decisions=np.broadcast_to(past, (count, *batch)))
        features, due = np.zeros((length, *batch, self.size)), np.zeros((length, *batch))
        ended = slice(whole - 1, count * whole, whole)
        features[ended], due[ended] = self._looked_at(ends, estimate, ended), 1.0
        return self._seen(features, due)

    def _looked_at(self, memory: FeatureMemory, estimate: Estimate, samples: Any) -> np.ndarray:
        """Features of memories at the ends of intervals, which are these samples of the estimate."""
        none = np.zeros((*memory.decisions.shape, 0))
        features = self.features.observe(memory, self._watched, none).astype(float)
        if not self._biased:
            return features
        bias = np.nan_to_num(np.asarray(estimate.pose[GYROSCOPE_BIAS.name])[samples])
        size = np.log10(np.sqrt(np.sum(bias * bias, axis=-1, keepdims=True)) + SMALLEST_BIAS)
        return np.concatenate([features, np.tanh(size - math.log10(TYPICAL_BIAS))], axis=-1)

    def _told(self, estimate: Estimate, arrays: Mapping[str, np.ndarray]) -> Estimate:
        """The estimate with the external acceleration that follows from an inclination."""
        pose, model = estimate.pose, self._watched.model
        if UP.name not in pose or "external_acceleration" in pose or "imu/acc" not in arrays:
            return estimate
        force = arrays["imu/acc"] - getattr(model, "gravity", GRAVITY) * np.asarray(pose[UP.name])
        return estimate._replace(pose={**pose, "external_acceleration": force})

    def _seen(self, features: np.ndarray, due: np.ndarray) -> Seen:
        return Seen(features, due, {}, features[..., :0])
