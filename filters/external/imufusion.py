"""Fusion of x-io Technologies (package ``imufusion``) with the interface of this package."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core.quantity import STANDARD_GRAVITY
from ..core.rotation import multiply, normalize
from .wrapper import QUARTER_TURN, ExternalPackage


class Log(NamedTuple):
    """State of a package that hides its own: the samples since the start, of which the first ``length`` count.

    ``engine`` is the package's object, with the number of samples that it has processed. The states of one sequence
    share it; it is rebuilt from the samples when an earlier state is resumed.
    """

    samples: list[np.ndarray]
    length: int
    engine: list[Any]

    def __reduce__(self) -> tuple[Any, ...]:
        """Save the samples only."""
        return Log, (self.samples[: self.length], self.length, [])


@dataclass(frozen=True)
class IMUFusion(ExternalPackage):
    """The filter of x-io Technologies' Fusion (``imufusion``), a revised Madgwick filter in single precision.

    S. O. H. Madgwick, "AHRS algorithms and calibration solutions to facilitate new applications using low-cost MEMS",
    PhD thesis, University of Bristol, 2014, chapter 7. During its first three seconds the gain falls from 10 to
    ``gain``.

    The package neither exposes nor copies its state. A state here is therefore the list of the samples so far. Resuming
    from the latest one is immediate; resuming from an earlier or a saved one recomputes the sequence.
    """

    gain: float = 0.5
    """weight of accelerometer and magnetometer"""
    gyroscope_range: float = 0.0
    """rad/s: readings near this range restart the filter; 0 is off"""
    acceleration_rejection: float = 0.0
    """rad: accelerometer samples that deviate further are rejected; 0 is off"""
    magnetic_rejection: float = 0.0
    """rad: magnetometer samples that deviate further are rejected; 0 is off"""
    rejection_time: float = 5.0
    """s: time after which rejected samples are accepted again"""

    package: ClassVar[str] = "imufusion"

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample is processed like every other."""
        return self.advance(Log([], 0, []), sample)

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Update the engine if it is at the end of this state, else a new one from the start."""
        samples, length, engine = memory
        if len(samples) != length or not engine or engine[1] != length:
            samples, engine = samples[:length], [self._engine(), 0]
            for old in samples:
                self._update(engine[0], old)
        samples.append(sample)
        self._update(engine[0], sample)
        engine[1] = length + 1
        q = normalize(np.asarray(engine[0].get_quaternion(), dtype=float))
        return Log(samples, length + 1, engine), np.asarray(multiply(QUARTER_TURN, q))

    def _engine(self) -> Any:
        package = self.load()
        settings = package.AhrsSettings(
            sample_rate=1.0 / self.dt,
            convention=package.CONVENTION_NWU,
            gain=self.gain,
            gyroscope_range=math.degrees(self.gyroscope_range),
            acceleration_rejection=math.degrees(self.acceleration_rejection),
            magnetic_rejection=math.degrees(self.magnetic_rejection),
            rejection_timeout=self.rejection_time,
        )
        return package.Ahrs().set_settings(settings)

    def _update(self, engine: Any, sample: np.ndarray) -> None:
        # The package skips the update for a vector of zeros, which therefore represents a missing sample.
        parts = sample.reshape(-1, 3)
        parts = np.where(np.isfinite(parts).all(axis=1, keepdims=True), parts, 0.0)
        degrees, gravities = np.degrees(parts[0]), parts[1] / STANDARD_GRAVITY
        if self.axes == 9:
            engine.update(degrees, gravities, parts[2])
        else:
            engine.update_no_magnetometer(degrees, gravities)
