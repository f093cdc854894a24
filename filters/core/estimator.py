"""The protocol of all estimators, and :func:`run`.

Filters, networks, adaptive filters and wrapped packages have the same interface. ``init`` creates the state, and
``step`` computes a new state and an estimate from a state and a measurement. Estimators are immutable. Everything that
they remember is in the state, which is all that saving, restoring, batching and looking ahead require.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np

from .backend import Array, is_torch, namespace
from .quantity import SHORTEST, Channel, Estimate, Measurement, Quantity

S = TypeVar("S")


@runtime_checkable
class Estimator(Protocol[S]):
    """An estimator of a pose from a stream of measurements; channels that it does not need are ignored."""

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        ...

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Required channels."""
        ...

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Estimated quantities."""
        ...

    def with_dt(self, dt: float) -> Self:
        """The same estimator for samples ``dt`` seconds apart."""
        ...

    def init(self, measurement: Measurement) -> S:
        """Initial state, with the batch shape and array type of ``measurement``."""
        ...

    def step(self, state: S, measurement: Measurement) -> tuple[S, Estimate]:
        """Process one sample (arrays ``(*batch, size)``); NaN where a channel has no valid sample."""
        ...


@dataclass(frozen=True)
class Enclosing:
    """Base class of estimators that wrap another one and keep its sampling interval, channels and outputs.

    Attributes:
        filter: the other estimator.
    """

    filter: Any

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return float(self.filter.dt)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Required channels."""
        return tuple(self.filter.channels)

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Estimated quantities."""
        return tuple(self.filter.outputs)

    def with_dt(self, dt: float) -> Self:
        """The same for samples ``dt`` seconds apart."""
        return replace(self, filter=self.filter.with_dt(dt))


def check_measurements(
    channels: tuple[Channel, ...], measurements: Mapping[str, Any], *, time_axis: bool
) -> dict[str, Array]:
    """Return the needed channels as arrays of one common leading shape, NaN where there is no possible sample.

    Args:
        channels: required channels.
        measurements: channel name → ``([T,] *batch, size)``.
        time_axis: whether the first axis is time, which then must not be empty.

    Raises:
        ValueError: a channel is missing, is not an array of real numbers, has the wrong width, or another leading shape
            than the first; or there is no sample at all.
    """
    if not isinstance(measurements, Mapping):
        raise ValueError(
            f"measurements must be a mapping from channel name to array, got {type(measurements).__name__}"
        )
    missing = [channel.name for channel in channels if channel.name not in measurements]
    if missing:
        raise ValueError(f"measurements lack the channels {missing}; given are {sorted(measurements)}")
    arrays: dict[str, Array] = {}
    leading: tuple[int, ...] | None = None
    for channel in channels:
        array = measurements[channel.name]
        if not is_torch(array):
            array = real_numbers(array, f"channel {channel.name!r}")
        least = 2 if time_axis else 1
        shape = tuple(array.shape)
        if len(shape) < least or shape[-1] != channel.size:
            wanted = f"({'T, ' if time_axis else ''}..., {channel.size})"
            raise ValueError(f"channel {channel.name!r} must have shape {wanted}, got {shape}")
        if leading is None:
            leading = shape[:-1]
        elif shape[:-1] != leading:
            raise ValueError(
                f"channel {channel.name!r} must have the leading shape {leading} of {channels[0].name!r}, "
                f"got {shape[:-1]}"
            )
        arrays[channel.name] = without_impossible(channel, array)
    if time_axis and leading is not None and leading[0] == 0:
        raise ValueError("measurements are empty: at least one sample is needed")
    return arrays


def without_impossible(channel: Channel, samples: Array) -> Array:
    """The samples ``(..., size)`` with NaN for what no sensor can have measured.

    That is what lies beyond the channel's limit or is infinite; of a vector, all of it if one coordinate is missing or
    impossible; and zeros where a direction is needed, which is how some devices write that there is no sample. Next to
    nothing counts as zeros.
    """
    if samples.ndim == 1 and not is_torch(samples):  # a single sample, at every time step of a loop: without NumPy
        numbers, limit = samples.tolist(), channel.limit
        possible = all(-limit <= number <= limit for number in numbers)
        if possible and (not channel.has_direction or any(abs(number) >= SHORTEST for number in numbers)):
            return samples
    xp = namespace(samples)
    good = xp.abs(samples) <= channel.limit
    if channel.is_vector:
        good = xp.all(good, axis=-1)[..., None]
    if channel.has_direction:
        good = good & xp.any(xp.abs(samples) >= SHORTEST, axis=-1)[..., None]
    return samples if bool(xp.all(good)) else xp.where(good, samples, xp.nan)


def real_numbers(values: Any, what: str) -> np.ndarray:
    """Values as an array of floats, NaN where an array is masked.

    Raises:
        ValueError: they are not an array of real numbers; the message begins with ``what``.
    """
    try:
        array = np.asanyarray(values)
    except ValueError:
        raise ValueError(f"{what} must be an array of real numbers, got rows of different lengths") from None
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{what} must hold real numbers, got dtype {array.dtype}")
    if isinstance(array, np.ma.MaskedArray):
        return np.ma.filled(array.astype(float), np.nan)
    return np.asarray(array).astype(float, copy=False)


def stack_estimates(estimates: list[Estimate]) -> Estimate:
    """Join estimates of single samples along a new first axis, time."""

    def join(parts: list[Any]) -> Any:
        return None if parts[0] is None else namespace(parts[0]).stack(parts, axis=0)

    pose = {name: join([estimate.pose[name] for estimate in estimates]) for name in estimates[0].pose}
    return Estimate(pose, *(join([estimate[index] for estimate in estimates]) for index in (1, 2, 3)))


def run_by_steps(estimator: Estimator[Any], measurements: Mapping[str, Any]) -> Estimate:
    """Run an estimator sample by sample, as a reference for every faster ``run``.

    Args:
        estimator: the estimator.
        measurements: channel name → ``(T, *batch, size)``.
    """
    arrays = check_measurements(estimator.channels, measurements, time_axis=True)
    length = next(iter(arrays.values())).shape[0]
    state = estimator.init({name: array[0] for name, array in arrays.items()})
    estimates = []
    for t in range(length):
        state, estimate = estimator.step(state, {name: array[t] for name, array in arrays.items()})
        estimates.append(estimate)
    return stack_estimates(estimates)


def run(estimator: Estimator[Any], measurements: Mapping[str, Any]) -> Estimate:
    """Run an estimator over a whole sequence.

    Args:
        estimator: from :func:`poise.make_estimator`, or any implementation of :class:`Estimator`.
        measurements: channel name → ``(T, *batch, size)``, sampled every ``estimator.dt`` seconds; NaN where a
            channel has no valid sample (filters then only predict).

    Returns:
        The estimate of every sample, time first.

    Raises:
        ValueError: see :func:`check_measurements`.
    """
    arrays = check_measurements(estimator.channels, measurements, time_axis=True)
    own = getattr(estimator, "run", None)
    return own(arrays) if own is not None else run_by_steps(estimator, arrays)
