"""What a network sees: samples of sensors, or what a filter makes of them, as features at fixed intervals.

A front end runs at the rate of the sensors. A network behind it is updated at the end of each interval, whose length
does not depend on that rate, so that one set of weights serves every rate that the front end takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from ....filters.core.backend import Array
from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import Channel, Measurement
from ....filters.registry import make


class Seen(NamedTuple):
    """What a front end gives for one sample, or (time axis first) for a sequence.

    Attributes:
        features: ``(..., F)`` of the interval so far.
        due: ``(...)``, 1 at the samples that end an interval, else 0.
        base: quantity → ``(..., size)``: what the head corrects, such as the estimate of a filter.
        spread: ``(..., S)`` standard deviations of the base, or S = 0 where nothing is known of them; and after them
            what else the head needs at every sample.
        alone: ``(...)`` where the base alone counts, since it bears a gap of its inputs; None: nowhere.
        variances: quantity → ``(..., size)`` of the base, for where it stands alone; of what is known.
    """

    features: Array
    due: Array
    base: dict[str, Array]
    spread: Array
    alone: Array | None = None
    variances: Mapping[str, Array] = MappingProxyType({})


class FrontEnd(Protocol):
    """Interface of front ends. They are immutable; what they remember is in the state."""

    @property
    def kind(self) -> str:
        """Name under which cards know it."""
        ...

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        ...

    @property
    def interval(self) -> float:
        """Time between updates of the network, s."""
        ...

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Required channels."""
        ...

    @property
    def size(self) -> int:
        """Number F of features."""
        ...

    def with_dt(self, dt: float) -> Self:
        """The same for another sampling interval.

        Raises:
            ValueError: it is longer than the interval of the network.
        """
        ...

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """The same for the person, vehicle or device of a recording."""
        ...

    def init(self, measurement: Measurement) -> Any:
        """State before the samples of the shape of ``measurement``."""
        ...

    def step(self, state: Any, measurement: Measurement) -> tuple[Any, Seen]:
        """Process one sample."""
        ...

    def run(self, measurements: Mapping[str, Any]) -> Seen:
        """Process a sequence ``(T, *batch, size)``; equal to stepping."""
        ...

    def describe(self) -> dict[str, Any]:
        """Kind and settings for a card; JSON-able."""
        ...


def check_interval(dt: float, interval: float) -> None:
    """Refuse sampling that is slower than the network.

    Raises:
        ValueError: names both.
    """
    if dt > interval * (1.0 + 1e-9):
        raise ValueError(f"dt must be at most {interval:g} s ({1.0 / interval:g} Hz or more), got {dt:g} s")


def interval_ends(first: int, count: int, dt: float, interval: float) -> np.ndarray:
    """Whether each of ``count`` samples from number ``first`` on is the nearest to the end of an interval."""
    numbers = np.floor((np.arange(first, first + count + 1) + 0.5) * (dt / interval) + 1e-9)
    return np.diff(numbers) > 0.0


class IntervalSums(NamedTuple):
    """Sums over the samples of an interval so far; arrays only, so a copy of them saves it.

    Attributes:
        samples: ``()`` since the start.
        sums: ``(*batch, M)`` of the known values.
        known: ``(*batch, M)`` how many those are.
    """

    samples: np.ndarray
    sums: np.ndarray
    known: np.ndarray

    @classmethod
    def empty(cls, batch: tuple[int, ...], size: int) -> Self:
        """Sums before the first sample, of ``size`` values."""
        return cls(np.array(0), np.zeros((*batch, size)), np.zeros((*batch, size)))

    def add(self, values: np.ndarray, dt: float, interval: float) -> tuple[Self, Self, np.ndarray]:
        """Add a sample ``(*batch, M)``, NaN where nothing is known.

        Returns:
            The memory for the next sample, the sums with this one, and whether it ends the interval ``(*batch,)``.
        """
        there, count = np.isfinite(values), int(self.samples)
        now = self._replace(sums=self.sums + np.where(there, values, 0.0), known=self.known + there)
        due = bool(interval_ends(count, 1, dt, interval)[0])
        after = type(self).empty(values.shape[:-1], values.shape[-1]) if due else now
        return after._replace(samples=np.array(count + 1)), now, np.full(values.shape[:-1], float(due))


def interval_sums(values: np.ndarray, dt: float, interval: float) -> tuple[IntervalSums, np.ndarray]:
    """As :meth:`IntervalSums.add`, for a sequence ``(T, *batch, M)``: sums after every sample, which end one."""
    there = np.isfinite(values)
    due = interval_ends(0, len(values), dt, interval)
    sums, known = np.where(there, values, 0.0), there.astype(float)
    begin = 0
    for end in [*(np.flatnonzero(due) + 1).tolist(), len(due)]:
        for part in (sums, known):
            part[begin:end] = np.cumsum(part[begin:end], axis=0)
        begin = end
    column = due.astype(float).reshape(-1, *(1,) * (values.ndim - 2))
    return IntervalSums(np.arange(len(values)), sums, known), np.broadcast_to(column, values.shape[:-1])


@dataclass(frozen=True)
class RawChannels:
    """The channels of the sensors and nothing else: the mean over each interval, and the share of samples that came.

    Attributes:
        channels: what is read.
        scales: unit of each channel in which its numbers are of the order of one; None: 1.
        interval: s between updates of the network.
        dt: sampling interval, s.
        paper: name of the filter whose paper defines the angles that are estimated; None: they are in the truth.

    Raises:
        ValueError: no channels, another number of scales, or sampling slower than the network.
    """

    channels: tuple[Channel, ...]
    scales: tuple[float, ...] | None = None
    interval: float = 0.04
    dt: float = 0.01
    paper: str | None = None

    kind = "raw-channels"

    def __post_init__(self) -> None:
        if not self.channels:
            raise ValueError("channels must name at least one, got none")
        if self.scales is not None and len(self.scales) != len(self.channels):
            raise ValueError(f"scales must be {len(self.channels)}, one a channel, got {len(self.scales)}")
        check_interval(self.dt, self.interval)

    @cached_property
    def kalman(self) -> KalmanFilter | None:
        """The filter of the paper, which tells the true angles; it is never run."""
        found: Any = None if self.paper is None else make(self.paper)
        return found

    @property
    def size(self) -> int:
        """Two for each element of the channels."""
        return 2 * sum(channel.size for channel in self.channels)

    def with_dt(self, dt: float) -> Self:
        """See :class:`FrontEnd`."""
        return replace(self, dt=float(dt))

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """Nothing to configure."""
        return self

    def describe(self) -> dict[str, Any]:
        """See :class:`FrontEnd`."""
        channels = [[channel.name, channel.size, channel.unit] for channel in self.channels]
        scales = None if self.scales is None else list(self.scales)
        usual = {"kind": self.kind, "channels": channels, "scales": scales, "interval": self.interval}
        return usual | ({} if self.paper is None else {"paper": self.paper})

    @classmethod
    def read(cls, described: Mapping[str, Any], dt: float) -> Self:
        """The inverse of :meth:`describe`."""
        channels = tuple(Channel(str(name), int(size), str(unit)) for name, size, unit in described["channels"])
        scales = described.get("scales")
        scales = None if scales is None else tuple(scales)
        return cls(channels, scales, float(described["interval"]), dt, described.get("paper"))

    def init(self, measurement: Measurement) -> IntervalSums:
        """See :class:`FrontEnd`."""
        return IntervalSums.empty(np.shape(measurement[self.channels[0].name])[:-1], self.size // 2)

    def step(self, state: IntervalSums, measurement: Measurement) -> tuple[IntervalSums, Seen]:
        """See :class:`FrontEnd`."""
        values = self._scaled(check_measurements(self.channels, measurement, time_axis=False))
        after, now, due = state.add(values, self.dt, self.interval)
        return after, self._seen(now, due)

    def run(self, measurements: Mapping[str, Any]) -> Seen:
        """See :class:`FrontEnd`."""
        values = self._scaled(check_measurements(self.channels, measurements, time_axis=True))
        return self._seen(*interval_sums(values, self.dt, self.interval))

    def _scaled(self, arrays: Mapping[str, Array]) -> np.ndarray:
        scales = self.scales or (1.0,) * len(self.channels)
        parts = [np.asarray(arrays[c.name], dtype=float) / s for c, s in zip(self.channels, scales, strict=True)]
        return np.concatenate(parts, axis=-1)

    def _seen(self, found: IntervalSums, due: np.ndarray) -> Seen:
        length = max(1.0, round(self.interval / self.dt))
        features = np.concatenate([found.sums / np.maximum(found.known, 1.0), found.known / length], axis=-1)
        return Seen(features, due, {}, features[..., :0])
