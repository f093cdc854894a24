"""The memory of a recursion, and what it does with samples: split channels, hold the last one, wait for the first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .backend import Array, constant, expand, is_torch, namespace, to_numpy
from .held_inputs import longest_gap
from .model import E, Equations, Gain, parameters_of, with_parameters
from .monitor import MEMORY, places_of
from .quantity import Channel, Measurement

Gains = Mapping[str, Any]
"""Gain name → log factor: a number or ``(*batch,)``; over a sequence also ``(T,)`` or ``(T, *batch)``."""


class FilterState(NamedTuple):
    """All memory of a filter or observer; arrays only, so copying them is saving it.

    Attributes:
        x: ``(*batch, n)`` state; zeros before the start.
        covariance: ``(*batch, e, e)`` of the error state; e is 0 for an observer.
        held: ``(*batch, d)`` last finite sample of every channel element, NaN if there was none.
        age: ``(*batch, channels)`` s since the last complete sample of each channel.
        monitor: ``(*batch, w)`` memory of :func:`.monitor.watch`; w is 0 without a monitor.
        started: ``(*batch,)`` bool.
    """

    x: Array
    covariance: Array
    held: Array
    age: Array
    monitor: Array
    started: Array


def split(sample: Array, channels: tuple[Channel, ...]) -> dict[str, Array]:
    """The channels of a concatenated sample ``(..., d)``."""
    parts, start = {}, 0
    for channel in channels:
        parts[channel.name] = sample[..., start : start + channel.size]
        start += channel.size
    return parts


def join(measurement: Measurement, channels: tuple[Channel, ...]) -> Array:
    """The samples of all channels, concatenated to ``(..., d)``."""
    arrays = [measurement[channel.name] for channel in channels]
    return namespace(*arrays).concat(arrays, axis=-1) if len(arrays) > 1 else arrays[0]


def hold(sample: Array, held: Array) -> Array:
    """The sample, with the last one where it is missing (NaN where there was none yet)."""
    xp = namespace(sample, held)
    return xp.where(xp.isfinite(sample), sample, held)


def latest(known: np.ndarray) -> np.ndarray:
    """Index of the last known row at or before each of the rows ``(T, ...)``, −1 before the first."""
    rows = np.arange(len(known)).reshape(-1, *(1,) * (known.ndim - 1))
    return np.maximum.accumulate(np.where(known, rows, -1), axis=0)


def last_readings(samples: np.ndarray) -> np.ndarray:
    """The last finite value of every element of samples ``(T, d)`` so far, NaN before the first."""
    index = latest(np.isfinite(samples))
    return np.where(index >= 0, np.take_along_axis(samples, np.maximum(index, 0), axis=0), np.nan)


def aged(age: Array, sample: Array, channels: tuple[Channel, ...], dt: Array) -> Array:
    """Seconds ``(*batch, channels)`` since each channel's last complete sample, after a time step."""
    xp = namespace(sample)
    parts = split(sample, channels).values()
    there = xp.stack([xp.all(xp.isfinite(part), axis=-1) for part in parts], axis=-1)
    return xp.where(there, xp.zeros_like(age), age + expand(dt, 1))


@dataclass(frozen=True)
class GapWatch:
    """Tells the samples in which an estimate still bears a gap of its model's inputs; NumPy only.

    What was learned from small errors is neither accurate nor sure while a large one is corrected.

    Attributes:
        model: the equations.
        longest: s for which inputs may be missing.
        every: whether all of them must be missing, or any.
        recovery: s after a gap in which its error is corrected.
    """

    model: Any
    longest: float
    every: bool = False
    recovery: float = 1.0

    def start(self, batch: tuple[int, ...]) -> np.ndarray:
        """Samples ``(*batch,)`` since a gap, before any: infinite."""
        return np.full(batch, np.inf)

    def advance(self, since: np.ndarray, age: np.ndarray) -> np.ndarray:
        """The same a sample later, with the ages ``(*batch, channels)`` in s of all channels then."""
        return np.where(self._is_gap(age), 0.0, since + 1.0)

    def run(self, measurements: Measurement) -> np.ndarray:
        """The same after each sample of ``(T, *batch, size)``; equal to advancing."""
        channels = [measurements[channel.name] for channel in self.model.channels]
        there = np.stack([np.isfinite(array).all(axis=-1) for array in channels], axis=-1)
        rows = np.arange(len(there)).reshape(-1, *(1,) * (there.ndim - 2))
        gap = latest(self._is_gap((rows[..., None] - latest(there)) * self.model.dt))
        return np.where(gap >= 0, rows - gap, np.inf)

    def bears(self, since: np.ndarray) -> np.ndarray:
        """Whether that is in a gap, or too soon after it."""
        return since < round(self.recovery / self.model.dt)

    def _is_gap(self, age: np.ndarray) -> np.ndarray:
        missing = age[..., self._inputs] > self.longest + 0.5 * self.model.dt
        return missing.all(axis=-1) if self.every else missing.any(axis=-1)

    @cached_property
    def _inputs(self) -> list[int]:
        return longest_gap(self.model)[1]


def filled(sample: Array) -> Array:
    """The sample, with zeros where nothing is known."""
    xp = namespace(sample)
    return xp.where(xp.isfinite(sample), sample, xp.zeros_like(sample))


def zeros(like: Array, *shape: int) -> Array:
    """New zeros ``(*batch, *shape)`` for samples ``like`` ``(*batch, d)``."""
    xp, batch = namespace(like), tuple(like.shape[:-1])
    zero = xp.reshape(xp.zeros_like(like[..., :1]), (*batch, *(1,) * len(shape)))
    array = xp.broadcast_to(zero, (*batch, *shape))
    return array.clone() if is_torch(like) else np.array(array)


def empty_state(model: Equations, like: Array) -> FilterState:
    """Memory before the first sample, of the batch shape and kind of samples ``like`` ``(*batch, d)``."""
    e = model.error_size
    held = zeros(like, like.shape[-1]) + namespace(like).nan
    memory = zeros(like, 0 if places_of(model) is None else MEMORY)
    age, started = zeros(like, len(model.channels)), zeros(like) > 0.5
    started = started if is_torch(like) else np.array(started)
    return FilterState(zeros(like, model.state_size), zeros(like, e, e), held, age, memory, started)


def check_batch(arrays: Measurement, started: Array) -> None:
    """Refuse a state that belongs to another batch shape than the samples.

    Raises:
        ValueError: names both shapes.
    """
    batch = tuple(next(iter(arrays.values())).shape[:-1])
    if batch != tuple(started.shape):
        raise ValueError(f"the state is of batch shape {tuple(started.shape)}, the samples are of {batch}")


def check_gains(known: Mapping[str, Gain], gains: Gains | None, owner: str) -> None:
    """Refuse gains that a model does not have.

    Raises:
        ValueError: names the unknown gains and those that exist.
    """
    unknown = sorted(set(gains or {}) - set(known))
    if unknown:
        raise ValueError(f"unknown gains {unknown}; {owner} has {sorted(known)}")


def gains_over_time(gains: Gains | None, length: int) -> dict[str, Any]:
    """Gains as arrays with a time axis of ``length``.

    Raises:
        ValueError: a gain's first axis is neither absent nor ``length`` long.
    """
    table = {}
    for name, factor in (gains or {}).items():
        array = factor if is_torch(factor) else np.asarray(factor, dtype=float)
        if array.ndim == 0:
            array = namespace(array).broadcast_to(array, (length,))
        elif array.shape[0] != length:
            raise ValueError(f"gain {name!r} must be a number or have {length} samples first, got shape {array.shape}")
        table[name] = array
    return table


def scaled(model: E, gains: Gains | None, like: Array) -> E:
    """The model with its named constants multiplied by ``exp(power * log factor)``.

    Args:
        model: the published tuning.
        gains: name → log factor, number or ``(*batch,)``.
        like: an array of the kind in which the factors are wanted.
    """
    if not gains:
        return model
    values = {}
    base = parameters_of(model)
    xp = namespace(like)
    for name, factor in gains.items():
        gain = model.gains[name]
        log_factor = factor if is_torch(factor) else constant(to_numpy(factor), like)
        value = base[gain.parameter] * xp.exp(gain.power * log_factor)
        values[gain.parameter] = xp.where(value > gain.maximum, gain.maximum + 0.0 * value, value)
    return with_parameters(model, values)
