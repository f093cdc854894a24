"""Front end of a network that corrects any Kalman filter: its estimate, covariance and innovations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.model import parameters_of
from ....filters.core.quantity import Channel, Estimate, Measurement, Quantity
from ....filters.core.sampling import FilterState, GapWatch
from ..gains.gain_shares import filter_of, with_changed_numbers
from .front_end import IntervalSums, Seen, check_interval, interval_sums

LONGEST_GAP = 0.5
"""s without any input after which the filter stands alone: the network was trained on lost samples, not on longer gaps.
After 2 s of them its roll had a NEES of 15, and after 10 s was wrong by 19° where the filter has 5°."""


class FeatureState(NamedTuple):
    """Memory of :class:`FilterFeatures`.

    Attributes:
        filter: of the filter.
        sums: of what is averaged, over the interval.
        since: ``(*batch,)`` samples since a gap (:class:`.GapWatch`).
    """

    filter: FilterState
    sums: IntervalSums
    since: np.ndarray


@dataclass(frozen=True)
class FilterFeatures:
    """Features of a Kalman filter's run, each the mean over an interval.

    In this order: the filter's outputs (angles as sine and cosine, which have means where angles wrap), the logarithms
    of the standard deviations of its error state, its whitened innovations, the channels of the sensors, and parameters
    that the metadata of a recording determine, such as the standard deviation of what the geometry is off by. Networks
    learn the scale of each feature from the training data.

    Attributes:
        kalman: the filter; the head corrects its outputs.
        interval: s between updates of the network.
        channels_seen: names of the channels that are features; None for all of the filter.
        parameters_seen: names of parameters that are features (:func:`.parameters_of`), relative to their defaults.

    Raises:
        ValueError: sampling slower than the network, or a channel or parameter that the filter does not have.
    """

    kalman: KalmanFilter
    interval: float = 0.04
    channels_seen: tuple[str, ...] | None = None
    parameters_seen: tuple[str, ...] = ()

    kind: ClassVar[str] = "filter-features"

    def __post_init__(self) -> None:
        check_interval(self.kalman.dt, self.interval)
        object.__setattr__(self, "kalman", replace(self.kalman, keep_covariance=True))
        names = [channel.name for channel in self.kalman.channels]
        unknown = sorted(set(self.channels_seen or ()) - set(names))
        if unknown:
            raise ValueError(f"channels_seen must be channels of the filter, {names}, got {unknown}")
        unknown = sorted(name for name in self.parameters_seen if not self._usual.get(name, 0.0) > 0.0)
        if unknown:
            raise ValueError(f"parameters_seen must be positive parameters of the filter, got {unknown}")

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.kalman.dt

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those of the filter."""
        return self.kalman.channels

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Those of the filter."""
        return self.kalman.outputs

    @property
    def size(self) -> int:
        """Number of features."""
        widths = (2 * q.size if q.kind == "angle" else q.size for q in self.kalman.outputs)
        model, told = self.kalman.model, len(self.parameters_seen)
        return sum(widths) + model.error_size + model.residual_size + sum(c.size for c in self._shown) + told

    @property
    def _shown(self) -> list[Channel]:
        return [c for c in self.kalman.channels if self.channels_seen is None or c.name in self.channels_seen]

    def with_dt(self, dt: float) -> Self:
        """See :class:`.front_end.FrontEnd`."""
        return replace(self, kalman=self.kalman.with_dt(dt))

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """The filter configured for rider and bicycle, where the metadata describe them."""
        model = self.kalman.model.configured(metadata)
        return replace(self, kalman=replace(self.kalman, model=model))

    def describe(self) -> dict[str, Any]:
        """See :class:`.front_end.FrontEnd`."""
        seen = None if self.channels_seen is None else list(self.channels_seen)
        told = {"parameters_seen": list(self.parameters_seen)} if self.parameters_seen else {}
        filter = with_changed_numbers(self.kalman.model)
        return {"kind": self.kind, "filter": filter, "interval": self.interval, "channels_seen": seen, **told}

    @classmethod
    def read(cls, described: Mapping[str, Any], dt: float) -> Self:
        """The inverse of :meth:`describe`."""
        seen = described.get("channels_seen")
        channels, told = None if seen is None else tuple(seen), tuple(described.get("parameters_seen", ()))
        return cls(filter_of(described["filter"], dt), float(described["interval"]), channels, told)

    def init(self, measurement: Measurement) -> FeatureState:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        state = self.kalman.init(arrays)
        batch = state.x.shape[:-1]
        return FeatureState(state, IntervalSums.empty(batch, self.size), self._gaps.start(batch))

    def step(self, state: FeatureState, measurement: Measurement) -> tuple[FeatureState, Seen]:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        inner, estimate = self.kalman.step(state.filter, arrays)
        after, now, due = state.sums.add(self._values(estimate, arrays), self.dt, self.interval)
        since = self._gaps.advance(state.since, inner.age)
        return FeatureState(inner, after, since), self._seen(estimate, now, due, since)

    def run(self, measurements: Mapping[str, Any]) -> Seen:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        estimate = self.kalman.run(arrays)
        sums = interval_sums(self._values(estimate, arrays), self.dt, self.interval)
        return self._seen(estimate, *sums, self._gaps.run(arrays))

    def _values(self, estimate: Estimate, arrays: Mapping[str, Any]) -> np.ndarray:
        """What is averaged ``(..., M)``."""
        assert estimate.covariance is not None
        parts = []
        for quantity in self.kalman.outputs:
            value = np.asarray(estimate.pose[quantity.name])
            parts += [np.sin(value), np.cos(value)] if quantity.kind == "angle" else [value]
        variances = np.diagonal(np.asarray(estimate.covariance), axis1=-2, axis2=-1)
        parts.append(0.5 * np.log(np.maximum(variances, 1e-16)))
        parts.append(np.clip(np.asarray(estimate.innovation), -10.0, 10.0))
        parts += [np.asarray(arrays[channel.name], dtype=float) for channel in self._shown]
        parts.append(np.broadcast_to(self._told, (*variances.shape[:-1], len(self._told))))
        return np.concatenate(parts, axis=-1)

    def _seen(self, estimate: Estimate, found: IntervalSums, due: np.ndarray, since: np.ndarray) -> Seen:
        features = np.where(due[..., None] > 0.0, found.sums / np.maximum(found.known, 1.0), 0.0)
        base = {quantity.name: np.asarray(estimate.pose[quantity.name]) for quantity in self.kalman.outputs}
        every = np.diagonal(np.asarray(estimate.covariance), axis1=-2, axis2=-1)
        parts = self.kalman.model.error_parts
        variances = {name: every[..., slice(*parts[name])] for name in base if name in parts}
        return Seen(features, due, base, features[..., :0], self._gaps.bears(since), variances)

    @cached_property
    def _told(self) -> np.ndarray:
        """What :attr:`parameters_seen` are here."""
        own = parameters_of(self.kalman.model)
        return np.array([own[name] / self._usual[name] for name in self.parameters_seen])

    @cached_property
    def _usual(self) -> Mapping[str, float]:
        return parameters_of(type(self.kalman.model)())

    @cached_property
    def _gaps(self) -> GapWatch:
        return GapWatch(self.kalman.model, LONGEST_GAP, every=True)


def standardisation(features: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation ``(F,)`` of features ``(E, N, F)`` where the mask ``(E, N)`` says so.

    A feature that hardly varies tells nothing: its deviation is infinite, which removes it.
    """
    chosen = features[mask].astype(float)
    if not len(chosen):
        return np.zeros(features.shape[-1]), np.ones(features.shape[-1])
    mean, deviation = chosen.mean(axis=0), chosen.std(axis=0)
    return mean, np.where(deviation > 1e-3 * (1.0 + np.abs(mean)), deviation, math.inf)
