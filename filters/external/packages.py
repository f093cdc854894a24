"""Filters of other packages behind the protocol of this one, so that they can stand in the same table.

Each wrapper hands over units, frames and axes as the package wants them and gives back sensor-to-world quaternions,
world x east, y north, z up. What holds for all: a gyroscope sample that is missing is replaced by the last one; missing
samples of accelerometer and magnetometer correct nothing; nothing is estimated before every channel has brought a
sample; batches are looped over; computation is NumPy's, whatever the arrays are. Constants are the packages' own
defaults. ``pip install poise[compare]`` brings them all.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from ..core.backend import Array, constant, to_numpy
from ..core.estimator import check_measurements, run_by_steps
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
from ..core.rotation import from_euler_zyx, multiply, normalize, up_in_body

QUARTER_TURN = np.asarray(from_euler_zyx(np.array(0.5 * np.pi), np.array(0.0), np.array(0.0)))
"""From north-west-up, the world of several packages, to east-north-up."""


class WrapperState(NamedTuple):
    """Memory of a wrapper.

    Attributes:
        memories: what the package remembers of each sequence of the batch, flattened; None before the start.
        held: ``(sequences, d)`` last finite sample of every channel element, NaN if there was none.
    """

    memories: tuple[Any, ...]
    held: np.ndarray


@dataclass(frozen=True)
class ExternalPackage:
    """What the wrappers share. Subclasses write ``begin`` and ``advance`` for one sequence."""

    dt: float = 0.01
    """sampling interval, s"""
    axes: Literal[6, 9] = 6
    """9 reads the magnetometer and gives the orientation in the world"""

    package: ClassVar[str]
    gives_bias: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Refuse other axes, wrong intervals and a package that is not there.

        Raises:
            ValueError: ``axes`` is not 6 or 9, or ``dt`` is not positive.
            ImportError: the package is not installed.
        """
        if self.axes not in (6, 9):
            raise ValueError(f"axes must be 6 or 9, got {self.axes!r}")
        if not (math.isfinite(self.dt) and self.dt > 0.0):
            raise ValueError(f"{type(self).__name__}: dt must be positive seconds, got {self.dt}")
        self._import()

    def _import(self) -> Any:
        try:
            return importlib.import_module(self.package)
        except ImportError as error:
            raise ImportError(
                f"{type(self).__name__} needs the package {self.package}: pip install {self.package}"
            ) from error

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
        return run_by_steps(self, measurements)

    def _estimate(self, output: np.ndarray, like: Array) -> Estimate:
        output = constant(output, like)
        q = output[..., :4]
        pose = {"orientation" if self.axes == 9 else "relative_orientation": q, "up": up_in_body(q)}
        if self.gives_bias:
            pose["gyroscope_bias"] = output[..., 4:]
        return Estimate({quantity.name: pose[quantity.name] for quantity in self.outputs})


@dataclass(frozen=True)
class VQF(ExternalPackage):
    """VQF in its causal form, with bias estimation, rest detection and rejection of magnetic disturbances.

    D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic disturbance
    rejection", Information Fusion 91, 2023, doi 10.1016/j.inffus.2022.10.014. Its memory is explicit: a dictionary.
    """

    tau_acc: float = 3.0
    """s: time constant of the low-pass that finds the vertical"""
    tau_mag: float = 9.0
    """s: time constant of the correction of the heading"""

    package: ClassVar[str] = "vqf"
    gives_bias: ClassVar[bool] = True

    def _engine(self) -> Any:
        return self._import().VQF(self.dt, tauAcc=self.tau_acc, tauMag=self.tau_mag)

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample is taken like every other."""
        return self.advance(self._engine().state, sample)

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Restore, update by what is there, save."""
        engine = self._engine()
        engine.state = memory
        output = self._update(engine, sample)
        return engine.state, output

    def _update(self, engine: Any, sample: np.ndarray) -> np.ndarray:
        parts = [np.ascontiguousarray(part) for part in sample.reshape(-1, 3)]
        for method, part in zip((engine.updateGyr, engine.updateAcc, engine.updateMag), parts, strict=False):
            if np.isfinite(part).all():
                method(part)
        q = engine.getQuat9D() if self.axes == 9 else engine.getQuat6D()
        return np.concatenate([q, engine.getBiasEstimate()[0]])

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """As stepping, with the package's loop over whole sequences where every sample is there."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        like = arrays[GYROSCOPE.name]
        samples = np.concatenate([to_numpy(array) for array in arrays.values()], axis=-1, dtype=float)
        if not np.isfinite(samples).all():
            return run_by_steps(self, measurements)
        length, shape = len(samples), (*tuple(like.shape[:-1]), 7)
        sequences = np.moveaxis(samples.reshape(length, -1, self.axes), 1, 0)
        outputs = np.empty((length, len(sequences), 7))
        for index, sequence in enumerate(sequences):
            parts = [np.ascontiguousarray(sequence[:, start : start + 3]) for start in range(0, self.axes, 3)]
            result = self._engine().updateBatch(*parts)
            outputs[:, index, :4] = result["quat9D" if self.axes == 9 else "quat6D"]
            outputs[:, index, 4:] = result["bias"]
        return self._estimate(outputs.reshape(shape), like)


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
        package = self._import()
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
        # The package leaves out vectors of zeros, which is how it is told that a sample is missing.
        parts = sample.reshape(-1, 3)
        parts = np.where(np.isfinite(parts).all(axis=1, keepdims=True), parts, 0.0)
        degrees, gravities = np.degrees(parts[0]), parts[1] / 9.80665
        if self.axes == 9:
            engine.update(degrees, gravities, parts[2])
        else:
            engine.update_no_magnetometer(degrees, gravities)
