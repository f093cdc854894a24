"""Channels of an environment, whose measurements become observations.

A channel without a new sample keeps its last valid one (zero-order hold); its flag in ``new_sample`` is then 0.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from ...filters.core.quantity import Channel
from ...filters.core.sampling import latest

NEW_SAMPLE = "new_sample"
"""Key of the flags in an observation."""


class Sensing:
    """Channels, their bounds, and the last valid sample of each.

    Args:
        channels: in the order of the flags.
        limits: channel name → largest magnitude, in the channel's unit, for all axes or ``(size,)``; larger values are
            clipped.

    Raises:
        ValueError: two channels share a name, one is called ``new_sample``, or a limit is missing, not positive or
            infinite.
    """

    def __init__(self, channels: Sequence[Channel], limits: Mapping[str, float | np.ndarray]) -> None:
        names = [channel.name for channel in channels]
        if len(set(names)) < len(names) or NEW_SAMPLE in names or not names:
            raise ValueError(f"channels must have names of their own, none of them {NEW_SAMPLE!r}, got {names}")
        boxes: dict[str, spaces.Space] = {}
        for channel in channels:
            limit = limits.get(channel.name, math.nan)
            if not np.all((np.asarray(limit) > 0.0) & (np.asarray(limit) < math.inf)):
                raise ValueError(
                    f"limits[{channel.name!r}] must be positive and finite ({channel.unit}), got {limit}: observations "
                    "need bounds (NoiseModel.full_scale)"
                )
            bound = np.full(channel.size, limit, np.float32)
            boxes[channel.name] = spaces.Box(-bound, bound, dtype=np.float32)
        boxes[NEW_SAMPLE] = spaces.MultiBinary(len(names))
        self.channels = tuple(channels)
        self.observation_space = spaces.Dict(boxes)
        self._limits = {name: np.asarray(limits[name], np.float32).astype(float) for name in names}
        self._forget()

    def _forget(self) -> None:
        """Reset: zeros represent channels without a sample so far."""
        self.held = {channel.name: np.zeros(channel.size, np.float32) for channel in self.channels}

    def reset(self, rng: np.random.Generator) -> None:
        """Begin an episode."""
        self._forget()

    def save(self) -> Any:
        """A copy of all memory."""
        return copy.deepcopy(self.held)

    def restore(self, state: Any) -> None:
        """Continue from saved memory, exactly."""
        self.held = copy.deepcopy(state)

    def describe(self) -> dict[str, Any]:
        """Everything about the sensors, for JSON."""
        raise NotImplementedError

    def observations(self, measurements: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
        """Turn consecutive measurements into observations.

        Args:
            measurements: channel name → ``(count, size)``; a channel that is missing, or in which any value of a row is
                NaN, counts as not sampled.
            count: number of rows.

        Returns:
            Channel name → float32 ``(count, size)`` within the bounds, and ``new_sample``: int8 ``(count, channels)``.
        """
        new_sample, seen = np.zeros((count, len(self.channels)), np.int8), {}
        for index, channel in enumerate(self.channels):
            values, held = measurements.get(channel.name), self.held[channel.name]
            rows = np.tile(held, (count, 1))
            if values is not None:
                limit, known = self._limits[channel.name], ~np.isnan(values).any(axis=1)
                new_sample[:, index] = known
                clipped = np.minimum(np.maximum(values, -limit), limit).astype(np.float32)
                last = latest(known)
                rows = np.where(last[:, None] >= 0, clipped[last], rows)
            seen[channel.name], self.held[channel.name] = rows, rows[-1].copy()
        return {**seen, NEW_SAMPLE: new_sample}

    def to_observation(self, measurement: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Turn one measurement, channel name → ``(size,)``, into an observation, as :meth:`observations` several."""
        rows = {name: np.asarray(values)[None] for name, values in measurement.items()}
        return {name: values[0] for name, values in self.observations(rows, 1).items()}

    def to_measurement(self, observation: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Undo :meth:`to_observation`, over any leading (batch, time) dimensions.

        Args:
            observation: channel name → ``(..., size)``, and ``new_sample`` ``(..., channels)``.

        Returns:
            Channel name → float64 ``(..., size)``; NaN where no sample is new.

        Raises:
            ValueError: a key is missing, or ``new_sample`` has not one flag a channel.
        """
        missing = [name for name in (*self._limits, NEW_SAMPLE) if name not in observation]
        if missing:
            raise ValueError(f"observation lacks {missing}; it holds {sorted(observation)}")
        new_sample = np.asarray(observation[NEW_SAMPLE])
        if new_sample.shape[-1:] != (len(self.channels),):
            raise ValueError(
                f"observation['new_sample'] must have shape (..., {len(self.channels)}), got {new_sample.shape}"
            )
        return {
            channel.name: np.where(
                new_sample[..., index, None] > 0, np.asarray(observation[channel.name], dtype=float), np.nan
            )
            for index, channel in enumerate(self.channels)
        }
