"""A trajectory: what the sensors said, what was true, and how both came about.

Simulated episodes and recordings are the same thing here, so that everything that reads one reads the other.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...filters.core import rotation

DERIVED_FROM_ORIENTATION = {"up": rotation.up_in_body, "relative_orientation": lambda orientation: orientation}
"""Truth that an orientation contains: quantity name → function of the quaternions ``(T, 4)``."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A sequence of measurements with the truth, where it is known.

    Attributes:
        time: ``(T,)`` s, strictly increasing.
        measurements: channel name (``place/kind``) → ``(T, size)``; NaN where a channel brought no sample.
        truth: quantity name → ``(T, size)``; NaN where unknown; may be empty.
        mask: ``(T,)`` bool, the ticks that are scored; all of them by default.
        metadata: JSON-able description: name, environment, sensors, seed, version, rate, source, licence, …

    Raises:
        ValueError: an argument has the wrong shape or type, time does not increase, there is no tick or no channel,
            a value is infinite, or the metadata are not JSON-able.
    """

    time: np.ndarray
    measurements: dict[str, np.ndarray]
    truth: dict[str, np.ndarray] = field(default_factory=dict)
    mask: np.ndarray = field(default=None)  # type: ignore[arg-type]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = real_array("time", self.time)
        if time.ndim != 1 or len(time) == 0:
            raise ValueError(f"time must have shape (T,) with at least one tick, got {time.shape}")
        if not np.isfinite(time).all():
            raise ValueError(
                f"time must be finite, got {time[~np.isfinite(time)][0]} at tick {first(~np.isfinite(time))}"
            )
        backwards = np.diff(time) <= 0.0
        if backwards.any():
            tick = first(backwards) + 1
            raise ValueError(f"time must increase strictly, got {time[tick]} s at tick {tick} after {time[tick - 1]} s")
        measurements = columns("measurements", self.measurements, len(time))
        if not measurements:
            raise ValueError("measurements must hold at least one channel, got none")
        mask = np.ones(len(time), bool) if self.mask is None else np.asarray(self.mask)
        if mask.dtype != bool or mask.shape != time.shape:
            raise ValueError(f"mask must be bool of shape ({len(time)},), got {mask.dtype} of shape {mask.shape}")
        values = {
            "time": time,
            "measurements": measurements,
            "truth": columns("truth", self.truth, len(time)),
            "mask": mask,
            "metadata": check_metadata(self.metadata),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def name(self) -> str:
        """``metadata["name"]``, or ``"trajectory"``."""
        return str(self.metadata.get("name", "trajectory"))

    @property
    def dt(self) -> float:
        """Sampling interval, s: the median; of a single tick ``1 / metadata["rate"]``.

        Raises:
            ValueError: there is a single tick, and the metadata name no rate.
        """
        if len(self.time) > 1:
            return float(np.median(np.diff(self.time)))
        if "rate" not in self.metadata:
            raise ValueError(f"{self.name} has a single tick and no rate in its metadata: its interval is unknown")
        return 1.0 / float(self.metadata["rate"])

    @property
    def uniform(self) -> bool:
        """Whether every interval is within 1 % of ``dt``, as estimators suppose."""
        return bool(np.all(np.abs(np.diff(self.time) / self.dt - 1.0) < 0.01)) if len(self) > 1 else True

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names that :meth:`truth_of` answers."""
        derived = [name for name in DERIVED_FROM_ORIENTATION if "orientation" in self.truth and name not in self.truth]
        return (*self.truth, *derived)

    def truth_of(self, quantity: str) -> np.ndarray:
        """The truth ``(T, size)`` of a quantity, derived from the orientation where only that is known.

        Raises:
            ValueError: the trajectory does not know it.
        """
        if quantity in self.truth:
            return self.truth[quantity]
        if quantity not in self.quantities:
            raise ValueError(f"{self.name} knows no {quantity!r}; known are {list(self.quantities)}")
        return DERIVED_FROM_ORIENTATION[quantity](self.truth["orientation"])

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, ticks: slice) -> Trajectory:
        """The part ``trajectory[a:b]``; time is not shifted."""
        if not isinstance(ticks, slice) or ticks.step not in (None, 1):
            raise ValueError(f"a trajectory is cut by [a:b] in steps of one, got [{ticks}]; resample to thin it out")
        if len(self.time[ticks]) == 0:
            raise ValueError(f"{ticks} leaves no tick of the {len(self)} of {self.name}")
        return self.replace(
            time=self.time[ticks],
            measurements={name: values[ticks] for name, values in self.measurements.items()},
            truth={name: values[ticks] for name, values in self.truth.items()},
            mask=self.mask[ticks],
        )

    def replace(self, **changes: Any) -> Trajectory:
        """A copy with some attributes changed."""
        return dataclasses.replace(self, **changes)

    def resampled(self, rate: float, sampling: Literal["interval", "instant"] = "interval") -> Trajectory:
        """The same motion at another rate in Hz, see :func:`~poise.envs.data.resampling.resample`."""
        from .resampling import resample

        return resample(self, rate, sampling)

    def save(self, path: str | Path) -> Path:
        """Write the trajectory to an HDF5 file, see :func:`~poise.envs.data.storage.save_trajectory`."""
        from .storage import save_trajectory

        return save_trajectory(self, path)


def first(flags: np.ndarray) -> int:
    """Index of the first True."""
    return int(np.flatnonzero(flags)[0])


def real_array(name: str, values: Any) -> np.ndarray:
    """``values`` as a float64 array; a ValueError that names them if they are no real numbers."""
    try:
        array = np.asarray(values)
    except ValueError as reason:
        raise ValueError(f"{name} must be an array of real numbers: {reason}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} must be an array of real numbers, got dtype {array.dtype}")
    return array.astype(float, copy=False)


def columns(argument: str, arrays: Mapping[str, Any], length: int) -> dict[str, np.ndarray]:
    """Check a mapping name → ``(length, size)``."""
    if not isinstance(arrays, Mapping):
        raise ValueError(f"{argument} must be a mapping from name to array, got {type(arrays).__name__}")
    checked = {}
    for name, values in arrays.items():
        if not isinstance(name, str) or not name.strip("/"):
            raise ValueError(f"{argument} must have names as keys, got {name!r}")
        array = real_array(f"{argument}[{name!r}]", values)
        if array.ndim != 2 or array.shape[0] != length or array.shape[1] == 0:
            raise ValueError(f"{argument}[{name!r}] must have shape ({length}, size), got {array.shape}")
        if np.isinf(array).any():
            tick = first(np.isinf(array).any(axis=1))
            raise ValueError(
                f"{argument}[{name!r}] must be finite, or NaN where unknown; it is infinite at tick {tick}"
            )
        checked[name] = array
    return checked


def check_metadata(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Metadata as JSON would give them back, so that a saved trajectory equals itself."""
    try:
        plain = json.loads(json.dumps(metadata))
    except (TypeError, ValueError) as reason:
        raise ValueError(f"metadata must be JSON-able: {reason}") from None
    if not isinstance(plain, dict):
        raise ValueError(f"metadata must be a mapping, got {type(metadata).__name__}")
    return plain
