"""Estimates as tables: one row per sample, angles in degrees, everything else in SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import rotation
from .backend import to_numpy

if TYPE_CHECKING:
    import pandas

ORIENTATIONS = ("orientation", "relative_orientation")
"""Quantities that are the sensor's rotation, the better known first."""
UP = "up"
AXES = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
ANGLES = ("roll", "pitch", "yaw")
SMALL_TURN = 1e-4
"""rad: step of the difference quotient from rotation vectors to angles."""


def part_of(error_parts: Mapping[str, tuple[int, int]], name: str) -> tuple[int, int] | None:
    """Where the error of a quantity is in the error state, if anywhere; both orientations share theirs."""
    names = ORIENTATIONS if name in ORIENTATIONS else (name,)
    return next((error_parts[each] for each in names if each in error_parts), None)


@dataclass(frozen=True)
class SequenceTable:
    """An estimate of one sequence, ready to be a table.

    Attributes:
        pose: quantity → ``(T, size)``.
        time: ``(T,)`` s, or None.
        covariance: ``(T, e, e)``, or None.
        nis: ``(T,)``, or None.
        kinds: quantity → (kind, unit), where known.
        error_parts: quantity → (start, stop) in the error state, where known.
    """

    pose: Mapping[str, Any]
    time: Any = None
    covariance: Any = None
    nis: Any = None
    kinds: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    error_parts: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def frame(self) -> pandas.DataFrame:
        """The estimate as a data frame.

        Columns: ``time`` (s; the sample number if no time is known), ``roll``, ``pitch``, ``yaw`` (deg, Z-Y-X angles
        of sensor to world: yaw about the vertical first), ``qw`` … ``qz`` (sensor to world), ``std_roll`` … (deg,
        where the covariance is that of a known error), every other quantity by its name and components (angles in deg,
        ``std_`` before the name for its standard deviation), ``nis``. A method without heading has no ``yaw``;
        that of ``relative_orientation`` starts at zero and drifts. ``frame.attrs["units"]`` holds the unit of every
        column.

        Raises:
            ValueError: the estimate has batch axes, or is that of a single sample.
        """
        import pandas

        pose = {name: np.asarray(to_numpy(values), dtype=float) for name, values in self.pose.items()}
        shapes = {name: values.shape for name, values in pose.items()}
        if not pose or any(len(shape) != 2 for shape in shapes.values()):
            raise ValueError(f"a table needs an estimate of one sequence, arrays (T, size); got {shapes}")
        units = {"time": "1" if self.time is None else "s"}
        length = next(iter(shapes.values()))[0]
        data: dict[str, np.ndarray] = {"time": np.arange(length) if self.time is None else to_numpy(self.time)}
        for columns in (attitude_columns(pose), self.std_columns(pose)):
            data |= columns
            units |= {name: "1" if name in QUATERNION else "deg" for name in columns}
        for name, values in pose.items():
            if name in ORIENTATIONS:
                continue
            kind, unit = self.kinds.get(name, ("vector", ""))
            covariance = None if name == UP else self.covariance_of(name)
            tables = [quantity_columns(name, values, kind)]
            if covariance is not None:
                spread = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
                tables.append(quantity_columns(f"std_{name}", spread, kind))
            for columns in tables:
                data |= columns
                units |= dict.fromkeys(columns, "deg" if kind == "angle" else unit)
        if self.nis is not None:
            data["nis"] = np.asarray(to_numpy(self.nis))
            units["nis"] = "1"
        frame = pandas.DataFrame(data)
        frame.attrs["units"] = units
        return frame

    def covariance_of(self, name: str) -> np.ndarray | None:
        """Covariance ``(T, n, n)`` of the error of a quantity, or None; both orientations share theirs."""
        part = part_of(self.error_parts, name)
        if part is None or self.covariance is None:
            return None
        start, stop = part
        return np.asarray(to_numpy(self.covariance))[:, start:stop, start:stop]

    def std_columns(self, pose: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Standard deviations of the angles in degrees, to first order; very large where an angle is undefined."""
        found = next((name for name in (*ORIENTATIONS, UP) if name in pose), None)
        covariance = None if found is None else self.covariance_of(found)
        if found is None or covariance is None:
            return {}
        moved: Callable[[np.ndarray], list[np.ndarray]]
        if found == UP:
            moved = lambda delta: list(rotation.roll_pitch(pose[UP] + delta))  # noqa: E731
        else:
            moved = lambda delta: list(rotation.to_euler_zyx(rotation.multiply(rotation.exp(delta), pose[found])))[::-1]  # noqa: E731
        # Columns of the Jacobian of the angles, from central differences.
        steps = [np.broadcast_to(SMALL_TURN * unit, (len(pose[found]), 3)) for unit in np.eye(3)]
        J = np.stack([rotation.wrap(np.array(moved(d)) - np.array(moved(-d))) for d in steps], axis=-1)
        variance = np.einsum("atj,tjk,atk->at", J, covariance, J) / (2.0 * SMALL_TURN) ** 2
        return {f"std_{name}": np.degrees(np.sqrt(row)) for name, row in zip(ANGLES, variance, strict=False)}


def quantity_columns(name: str, values: np.ndarray, kind: str = "vector") -> dict[str, np.ndarray]:
    """Columns of one quantity ``(T, size)``; angles in degrees."""
    size = values.shape[1]
    if kind == "rotation":
        endings: tuple[str, ...] = tuple(f"_{part}" for part in QUATERNION)
    elif size == 1:
        endings = ("",)
    elif size == 3 and kind != "angle":
        endings = tuple(f"_{axis}" for axis in AXES)
    else:
        endings = tuple(f"_{i}" for i in range(1, size + 1))
    scale = float(np.degrees(1.0)) if kind == "angle" else 1.0
    return {f"{name}{ending}": scale * values[:, i] for i, ending in enumerate(endings)}


def attitude_columns(pose: Mapping[str, np.ndarray], before: str = "") -> dict[str, np.ndarray]:
    """Angles in degrees and the quaternion; roll and pitch alone where only the vertical is known.

    Args:
        pose: quantity → ``(T, size)``.
        before: put before the names of the columns.
    """
    found = next((name for name in ORIENTATIONS if name in pose), None)
    columns: dict[str, np.ndarray] = {}
    if found is not None:
        yaw, pitch, roll = rotation.to_euler_zyx(pose[found])
        columns = dict(zip(ANGLES, np.degrees([roll, pitch, yaw]), strict=True))
        columns |= {name: pose[found][:, i] for i, name in enumerate(QUATERNION)}
    elif UP in pose:
        columns = dict(zip(ANGLES, np.degrees(rotation.roll_pitch(pose[UP])), strict=False))
    return {f"{before}{name}": values for name, values in columns.items()}
