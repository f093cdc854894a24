"""VQF (package ``vqf``) with the interface of this package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..core.backend import to_numpy
from ..core.estimator import check_measurements
from ..core.quantity import GYROSCOPE, Estimate
from .wrapper import ExternalPackage


@dataclass(frozen=True)
class VQF(ExternalPackage):
    """VQF in its causal form, with bias estimation, rest detection and rejection of magnetic disturbances.

    D. Laidig, T. Seel, "VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic disturbance
    rejection", Information Fusion 91, 2023, doi 10.1016/j.inffus.2022.10.014. Its state is an explicit dictionary.
    """

    tau_acc: float = 3.0
    """s: time constant of the low-pass for the inclination"""
    tau_mag: float = 9.0
    """s: time constant of the heading correction"""

    package: ClassVar[str] = "vqf"
    gives_bias: ClassVar[bool] = True

    def _engine(self) -> Any:
        return self.load().VQF(self.dt, tauAcc=self.tau_acc, tauMag=self.tau_mag)

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample is processed like every other."""
        return self.advance(self._engine().state, sample)

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Restore the state, update with the valid samples, save the state."""
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

    def follow(self, first: np.ndarray, later: np.ndarray) -> np.ndarray:
        """One sequence by one engine, by the package's own loop where no sample is missing."""
        engine, samples = self._engine(), np.concatenate([first[None], later])
        if not np.isfinite(samples).all():
            return np.array([self._update(engine, sample) for sample in samples])
        parts = [np.ascontiguousarray(samples[:, start : start + 3]) for start in range(0, self.axes, 3)]
        result = engine.updateBatch(*parts)
        return np.concatenate([result["quat9D" if self.axes == 9 else "quat6D"], result["bias"]], axis=1)

    def smooth(self, measurements: Mapping[str, Any]) -> Estimate:
        """The package's offline form, which uses future samples too. ``(T, *batch, 3)`` in.

        The package requires complete data: missing samples are interpolated linearly, and the nearest valid sample is
        used before the first and after the last one. It provides no covariance.

        Raises:
            ValueError: a channel is missing, has a wrong shape, or has no valid sample at all.
        """
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        like = arrays[GYROSCOPE.name]
        samples = np.concatenate([to_numpy(array) for array in arrays.values()], axis=-1, dtype=float)
        sequences = np.moveaxis(samples.reshape(len(samples), -1, self.axes), 1, 0)
        outputs = np.empty((len(samples), len(sequences), 7))
        for index, sequence in enumerate(sequences):
            whole = [complete(sequence[:, start : start + 3]) for start in range(0, self.axes, 3)]
            result = self.load().offlineVQF(
                *whole, *(() if self.axes == 9 else (None,)), self.dt, {"tauAcc": self.tau_acc, "tauMag": self.tau_mag}
            )
            outputs[:, index, :4] = result["quat9D" if self.axes == 9 else "quat6D"]
            outputs[:, index, 4:] = result["bias"]
        return self._estimate(outputs.reshape((*tuple(like.shape[:-1]), 7)), like)


def complete(samples: np.ndarray) -> np.ndarray:
    """Samples ``(T, 3)`` with linear interpolation where rows are not finite.

    Raises:
        ValueError: no row is finite.
    """
    known = np.isfinite(samples).all(axis=1)
    if not known.any():
        raise ValueError("VQF needs at least one valid sample of every channel")
    time = np.arange(len(samples))
    return np.stack([np.interp(time, time[known], column[known]) for column in samples.T], axis=1)
