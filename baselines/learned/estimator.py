"""A trained network with the interface of an estimator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ...filters.core.backend import Array, is_torch, namespace
from ...filters.core.estimator import check_measurements, run_by_steps
from ...filters.core.observer import Observer
from ...filters.core.quantity import ACCELEROMETER, GYROSCOPE, UP, Channel, Estimate, Measurement, Quantity
from ...filters.core.rotation import normalize, rotate_back
from ...filters.core.sampling import FilterState, join, zeros
from ..weights_io import load_weights
from .gravity_aligned_frame import GravityAlignedFrame
from .gru import GruNetwork


class LearnedState(NamedTuple):
    """Complete state of the estimator.

    Attributes:
        frame: of the gravity-aligned frame.
        memory: ``(*batch, H)`` of the network.
        tilt: ``(*batch, 2)`` last output of the network: horizontal part of the up vector in the gravity-aligned frame.
    """

    frame: FilterState
    memory: Array
    tilt: Array


@dataclass(frozen=True, eq=False)
class LearnedEstimator:
    """Inclination from six axes, by a recurrent network behind a gravity-aligned frame.

    :class:`.GravityAlignedFrame` runs at the rate of the sensor. At fixed intervals, independent of that rate, the
    network receives the features of the interval and estimates the tilt of the frame. Between them the estimate is
    constant in the frame, where it changes slowly.

    Attributes:
        network: the weights.
        frame: the front end and the sampling interval.
        compiled: use compiled loops for NumPy data; arrays give the same to rounding.

    Raises:
        ValueError: the sampling interval is longer than that of the network.
    """

    network: GruNetwork
    frame: GravityAlignedFrame = field(default_factory=GravityAlignedFrame)
    compiled: bool = True

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP,)

    def __post_init__(self) -> None:
        if self.frame.dt > self.frame.interval * (1.0 + 1e-9):
            raise ValueError(
                f"dt must be at most {self.frame.interval:g} s ({1.0 / self.frame.interval:g} Hz or more), "
                f"got {self.frame.dt:g} s"
            )

    @classmethod
    def load(cls, path_or_name: str | Path = "gru", dt: float = 0.01) -> Self:
        """The estimator of a weights file or of shipped weights.

        Raises:
            FileNotFoundError: there are no such weights.
            ValueError: they are damaged, or are those of something else.
        """
        arrays, card = load_weights(path_or_name)
        network = GruNetwork.from_arrays(arrays)
        try:
            frame = GravityAlignedFrame(**{**card.get("front_end", {}), "dt": dt})
        except TypeError as reason:
            raise ValueError(f"{path_or_name}: the card describes another front end ({reason})") from None
        return cls(network, frame)

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.frame.dt

    def with_dt(self, dt: float) -> LearnedEstimator:
        """The same estimator for another sampling interval."""
        return replace(self, frame=self.frame.with_dt(dt))

    def init(self, measurement: Measurement) -> LearnedState:
        """Initial state with the batch shape and array type of ``measurement``, which is not processed."""
        like = join(check_measurements(self.channels, measurement, time_axis=False), self.channels)
        return LearnedState(self._observer().init(measurement), zeros(like, self.network.size), zeros(like, 2))

    def step(self, state: LearnedState, measurement: Measurement) -> tuple[LearnedState, Estimate]:
        """Process one sample of every channel, ``(*batch, 3)``; NaN where there is none."""
        frame, seen = self._observer().step(state.frame, measurement)
        features, due = seen.pose["features"], seen.pose["due"]
        memory, tilt = state.memory, state.tilt
        if bool((due == 1.0).any()):
            if self.compiled and not is_torch(features):
                memory, tilt, _ = self._advance(features[None], due[None], memory, tilt)
            else:
                xp = namespace(features)
                now = due == 1.0
                moved, leaning = self.network.step(xp.where(now, features, xp.zeros_like(features)), memory)
                memory, tilt = xp.where(now, moved, memory), xp.where(now, leaning, tilt)
        pose = {"up": upward(seen.pose["relative_orientation"], tilt)}
        return LearnedState(frame, memory, tilt), Estimate(pose)

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, 3)`` in and out; equal to stepping."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        if not self.compiled or any(is_torch(array) for array in arrays.values()):
            return run_by_steps(self, arrays)
        state = self.init({name: array[0] for name, array in arrays.items()})
        seen = self._observer().run(arrays).pose
        _, _, tilts = self._advance(seen["features"], seen["due"], state.memory, state.tilt)
        return Estimate({"up": upward(seen["relative_orientation"], tilts)})

    def _observer(self) -> Observer:
        return Observer(self.frame, compiled=self.compiled)

    def _advance(
        self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, tilt: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Memory and tilt after ``(T, *batch, …)`` samples, and the tilt of every sample."""
        length, batch = features.shape[0], features.shape[1:-1]
        memory, tilt = memory.copy(), tilt.copy()
        count = int(np.prod(batch, dtype=int))
        tilts = self.network.advance(
            np.ascontiguousarray(features).reshape(length, count, -1),
            np.ascontiguousarray(due).reshape(length, count),
            memory.reshape(count, -1),
            tilt.reshape(count, 2),
        )
        return memory, tilt, tilts.reshape(length, *batch, 2)


def upward(orientation: Array, tilt: Array) -> Array:
    """The up vector in sensor coordinates ``(..., 3)`` from the frame's attitude and the tilt in the frame."""
    xp = namespace(orientation, tilt)
    return rotate_back(orientation, normalize(xp.concat([tilt, 1.0 + 0.0 * tilt[..., :1]], axis=-1)))


def shipped(dt: float = 0.01) -> LearnedEstimator:
    """The estimator with the weights of the package, for samples ``dt`` seconds apart."""
    return LearnedEstimator.load("gru", dt)
