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
    """Memory of a package that hides its own: the samples since the start, of which the first ``length`` are its own.

    ``engine`` is the package's object, with the number of samples that it has taken; it is shared by the memories of
    one sequence and rebuilt from the samples for whoever goes on from an earlier one.
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

    The package neither shows nor copies its memory. A state is therefore the list of the samples so far; going on from
    the latest one is immediate, going back to an earlier one (or to a saved one) computes the sequence anew.
    """

    gain: float = 0.5
    """weight of accelerometer and magnetometer"""
    gyroscope_range: float = 0.0
    """rad/s: readings near it restart the filter; 0 is off"""
    acceleration_rejection: float = 0.0
    """rad: accelerometer samples further off are left out; 0 is off"""
    magnetic_rejection: float = 0.0
    """rad: magnetometer samples further off are left out; 0 is off"""
    rejection_time: float = 5.0
    """s: after which rejected samples are taken again"""

    package: ClassVar[str] = "imufusion"

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample is taken like every other."""
        return self.advance(Log([], 0, []), sample)

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Update the engine if it stands where the memory ends, else a new one from the start."""
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
        # The package skips the update of a vector of zeros, which therefore stands for a missing sample.
        parts = sample.reshape(-1, 3)
        parts = np.where(np.isfinite(parts).all(axis=1, keepdims=True), parts, 0.0)
        degrees, gravities = np.degrees(parts[0]), parts[1] / STANDARD_GRAVITY
        if self.axes == 9:
            engine.update(degrees, gravities, parts[2])
        else:
            engine.update_no_magnetometer(degrees, gravities)
