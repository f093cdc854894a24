"""Filters of other packages with the interface of this one, so that the same tables compare them.

Each wrapper converts units, frames and axes to those of the package, and returns sensor-to-world quaternions, world x
east, y north, z up. For all of them, a gyroscope sample that is missing is replaced by the last valid one;
where a sample of accelerometer or magnetometer is missing, its measurement update is skipped; estimates are NaN until
every channel has had a valid sample; batches are processed one sequence at a time, in NumPy for any array type.
Constants are the packages' own defaults. ``pip install 'poise[compare]'`` installs them all.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from ..core.backend import Array, constant, to_numpy
from ..core.estimator import check_measurements
from ..core.quantity import (
    ACCELEROMETER,
    GYROSCOPE,
    GYROSCOPE_BIAS,
    MAGNETOMETER,
    ORIENTATION,
    RELATIVE_ORIENTATION,
    UP,
    Channel,
    Estimate,
    Measurement,
    Quantity,
)
from ..core.rotation import from_euler_zyx, up_in_body
from ..core.sampling import last_readings
from ..support.optional import extra

QUARTER_TURN = np.asarray(from_euler_zyx(np.array(0.5 * np.pi), np.array(0.0), np.array(0.0)))
"""From north-west-up, the world frame of several packages, to east-north-up."""


class WrapperState(NamedTuple):
    """Complete state of a wrapper.

    Attributes:
        memories: state of the package for each sequence of the batch, flattened; None before the start.
        held: ``(sequences, d)`` last finite sample of every channel element, NaN if there was none.
    """

    memories: tuple[Any, ...]
    held: np.ndarray


@dataclass(frozen=True)
class ExternalPackage:
    """Base class of the wrappers; the package is loaded on first use.

    Subclasses implement ``begin`` and ``advance`` for one sequence; ``follow`` is their loop, or a faster one.
    """

    dt: float = 0.01
    """sampling interval, s"""
    axes: Literal[6, 9] = 6
    """9 uses the magnetometer and estimates the orientation in the world"""

    package: ClassVar[str]
    gives_bias: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Refuse other axes and wrong intervals.

        Raises:
            ValueError: ``axes`` is not 6 or 9, or ``dt`` is not positive.
        """
        if self.axes not in (6, 9):
            raise ValueError(f"axes must be 6 or 9, got {self.axes!r}")
        if not (math.isfinite(self.dt) and self.dt > 0.0):
            raise ValueError(f"{type(self).__name__}: dt must be positive seconds, got {self.dt}")

    def load(self) -> Any:
        """The package that is wrapped.

        Raises:
            ImportError: it is not installed; the message says how to install it.
        """
        loaded = sys.modules.get(self.package)  # asked at every sample
        if loaded is not None:
            return loaded
        with extra("compare"):
            return importlib.import_module(self.package)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What it reads."""
        return (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)[: self.axes // 3]

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """What it gives."""
        orientation = (ORIENTATION, UP) if self.axes == 9 else (UP, RELATIVE_ORIENTATION)
        return (*orientation, GYROSCOPE_BIAS) if self.gives_bias else orientation

    def with_dt(self, dt: float) -> Self:
        """The same filter for another sampling interval."""
        return replace(self, dt=float(dt))

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Memory after the first complete sample ``(d,)``, and its output ``(4 or 7,)``: quaternion, bias in rad/s."""
        raise NotImplementedError

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Memory and output after one more sample ``(d,)``; NaN is a sample that is missing (never the gyroscope's)."""
        raise NotImplementedError

    def init(self, measurement: Measurement) -> WrapperState:
        """Empty memory with the batch shape of ``measurement``."""
        self.load()
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        count = math.prod(arrays[GYROSCOPE.name].shape[:-1])
        return WrapperState((None,) * count, np.full((count, self.axes), np.nan))

    def step(self, state: WrapperState, measurement: Measurement) -> tuple[WrapperState, Estimate]:
        """Take one sample of every channel, ``(*batch, 3)``; NaN where there is none."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        like = arrays[GYROSCOPE.name]
        samples = np.concatenate([to_numpy(array) for array in arrays.values()], axis=-1, dtype=float)
        samples = samples.reshape(-1, self.axes)
        held = np.where(np.isfinite(samples), samples, state.held)
        outputs = np.full((len(samples), 7 if self.gives_bias else 4), np.nan)
        memories = list(state.memories)
        for index, memory in enumerate(memories):
            if memory is not None:
                sample = np.concatenate([held[index, :3], samples[index, 3:]])
                memories[index], outputs[index] = self.advance(memory, sample)
            elif np.isfinite(held[index]).all():
                memories[index], outputs[index] = self.begin(held[index].copy())
        shape = (*tuple(like.shape[:-1]), outputs.shape[-1])
        return WrapperState(tuple(memories), held), self._estimate(outputs.reshape(shape), like)

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, 3)`` in; equal to stepping."""
        self.load()
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        like = arrays[GYROSCOPE.name]
        samples = np.concatenate([to_numpy(array) for array in arrays.values()], axis=-1, dtype=float)
        samples = samples.reshape(len(samples), math.prod(like.shape[1:-1]), self.axes)
        outputs = np.full((*samples.shape[:2], 7 if self.gives_bias else 4), np.nan)
        for index in range(samples.shape[1]):
            held = last_readings(samples[:, index])
            complete = np.isfinite(held).all(axis=1)
            if complete.any():
                first = int(complete.argmax())
                later = np.concatenate([held[first + 1 :, :3], samples[first + 1 :, index, 3:]], axis=1)
                outputs[first:, index] = self.follow(held[first], later)
        return self._estimate(outputs.reshape((*tuple(like.shape[:-1]), outputs.shape[-1])), like)

    def follow(self, first: np.ndarray, later: np.ndarray) -> np.ndarray:
        """Outputs ``(1 + T, 4 or 7)`` of a first complete sample ``(d,)`` and of what follows, ``(T, d)``."""
        memory, output = self.begin(first)
        outputs = [output]
        for sample in later:
            memory, output = self.advance(memory, sample)
            outputs.append(output)
        return np.array(outputs)

    def _estimate(self, output: np.ndarray, like: Array) -> Estimate:
        output = constant(output, like)
        q = output[..., :4]
        pose = {"orientation" if self.axes == 9 else "relative_orientation": q, "up": up_in_body(q)}
        if self.gives_bias:
            pose["gyroscope_bias"] = output[..., 4:]
        return Estimate({quantity.name: pose[quantity.name] for quantity in self.outputs})
