"""Calibration records: what turns raw readings of a device into SI units, kept as JSON and applied to trajectories."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from ....filters.support.files import as_path, write_json
from ..trajectory import Trajectory

FORMAT = "poise-calibration"
FORMAT_VERSION = 1
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ChannelCalibration:
    """Calibrated reading = matrix · raw reading + offset.

    Raises:
        ValueError: a matrix that is not square and regular, or an offset of another size, or numbers not finite.
    """

    matrix: Matrix
    """``(n, n)``"""
    offset: tuple[float, ...]
    """``(n,)`` in ``unit``"""
    unit: str
    """of the calibrated reading"""

    def __post_init__(self) -> None:
        matrix, offset = np.array(self.matrix, dtype=float), np.array(self.offset, dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or offset.shape != matrix.shape[:1]:
            raise ValueError(
                f"a calibration needs a square matrix and as many offsets, got {matrix.shape} and {offset.shape}"
            )
        if not (np.isfinite(matrix).all() and np.isfinite(offset).all()) or np.linalg.matrix_rank(matrix) < len(matrix):
            raise ValueError("the matrix of a calibration must be finite and regular")
        object.__setattr__(self, "matrix", tuple(map(tuple, matrix.tolist())))
        object.__setattr__(self, "offset", tuple(offset.tolist()))

    @classmethod
    def scaled(cls, scale: Any, offset: Any, unit: str) -> Self:
        """One scale and one offset an axis."""
        return cls(tuple(map(tuple, np.diag(np.asarray(scale, dtype=float)).tolist())), tuple(offset), unit)

    def apply(self, raw: np.ndarray) -> np.ndarray:
        """Calibrated readings ``(..., n)``; an axis that is NaN does not spoil others that do not depend on it."""
        matrix = np.array(self.matrix)
        if (matrix == np.diag(np.diag(matrix))).all():
            return raw * np.diag(matrix) + np.array(self.offset)
        return raw @ matrix.T + np.array(self.offset)

    def undo(self, calibrated: np.ndarray) -> np.ndarray:
        """Raw readings ``(..., n)``, not rounded."""
        return np.linalg.solve(np.array(self.matrix), (calibrated - np.array(self.offset))[..., None])[..., 0]


@dataclass(frozen=True)
class CalibrationRecord:
    """Calibrations by channel, and how they were found."""

    channels: Mapping[str, ChannelCalibration]
    details: Mapping[str, Any] = field(default_factory=dict)
    """JSON-able: residuals, positions, numbers of samples, … for the reader"""

    def merged(self, other: CalibrationRecord) -> CalibrationRecord:
        """Both records in one; of a channel in both, the calibration of ``other``."""
        return CalibrationRecord({**self.channels, **other.channels}, {**self.details, **other.details})

    def describe(self) -> dict[str, Any]:
        """Everything, for JSON."""
        channels = {
            name: {"matrix": [list(row) for row in one.matrix], "offset": list(one.offset), "unit": one.unit}
            for name, one in self.channels.items()
        }
        return {"format": FORMAT, "version": FORMAT_VERSION, "channels": channels, "details": dict(self.details)}

    def save(self, path: str | Path) -> Path:
        """Write the record as JSON; an earlier one in its place is lost only when the new one is complete."""
        return write_json(path, self.describe(), indent=1)


def load_calibration(path: str | Path) -> CalibrationRecord:
    """Read a record that :meth:`CalibrationRecord.save` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not a calibration record, or of a newer version.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no calibration record at {path}")
    try:
        described = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as reason:
        raise ValueError(f"{path} is not a calibration record: {reason}") from None
    if not isinstance(described, dict) or described.get("format") != FORMAT:
        raise ValueError(f"{path} is not a calibration record: its format is not {FORMAT!r}")
    version, details = described.get("version"), described.get("details", {})
    if not isinstance(version, int) or version > FORMAT_VERSION:
        raise ValueError(f"{path} has version {version!r}, this package reads up to {FORMAT_VERSION}")
    if not isinstance(details, dict):
        raise ValueError(f"{path} holds an unusable calibration: details must be an object, got {details!r}")
    try:
        channels = {
            name: ChannelCalibration(one["matrix"], one["offset"], one["unit"])
            for name, one in described["channels"].items()
        }
    except (KeyError, TypeError, AttributeError, ValueError) as reason:
        raise ValueError(f"{path} holds an unusable calibration: {reason}") from None
    return CalibrationRecord(channels, details)


def as_record(calibration: CalibrationRecord | str | Path) -> CalibrationRecord:
    """The record of a file, or the record itself."""
    if isinstance(calibration, CalibrationRecord):
        return calibration
    return load_calibration(as_path(calibration, "calibration"))


def apply_calibration(trajectory: Trajectory, calibration: CalibrationRecord | str | Path) -> Trajectory:
    """Turn the raw readings of a trajectory into calibrated ones.

    Args:
        trajectory: with raw readings in the channels that the record names; others stay as they are.
        calibration: record, or its file.

    Raises:
        ValueError: a channel of the record is missing or has another width, or was calibrated before.
    """
    record = as_record(calibration)
    done = trajectory.metadata.get("calibrated", [])
    return _changed(trajectory, record, done, "apply", [*done, *record.channels])


def undo_calibration(
    trajectory: Trajectory, calibration: CalibrationRecord | str | Path, *, rounded: bool = True
) -> Trajectory:
    """Turn calibrated readings into the raw ones that a device of this calibration reports.

    Args:
        trajectory: with calibrated readings.
        calibration: record, or its file.
        rounded: to whole counts.

    Raises:
        ValueError: a channel of the record is missing or has another width.
    """
    record = as_record(calibration)
    kept = [name for name in trajectory.metadata.get("calibrated", []) if name not in record.channels]
    raw = _changed(trajectory, record, [], "undo", kept)
    if not rounded:
        return raw
    counts = {name: np.rint(raw.measurements[name]) for name in record.channels}
    return raw.replace(measurements=raw.measurements | counts)


def _changed(
    trajectory: Trajectory, record: CalibrationRecord, done: list[str], how: str, calibrated: list[str]
) -> Trajectory:
    measurements = dict(trajectory.measurements)
    for name, one in record.channels.items():
        if name not in measurements:
            raise ValueError(
                f"{trajectory.name} lacks the channel {name!r} of the calibration; it has {[*measurements]}"
            )
        if name in done:
            raise ValueError(f"channel {name!r} of {trajectory.name} is calibrated already")
        size = measurements[name].shape[1]
        if size != len(one.offset):
            raise ValueError(
                f"channel {name!r} of {trajectory.name} has {size} axes, the calibration {len(one.offset)}"
            )
        measurements[name] = getattr(one, how)(measurements[name])
    return trajectory.replace(measurements=measurements, metadata=trajectory.metadata | {"calibrated": calibrated})
