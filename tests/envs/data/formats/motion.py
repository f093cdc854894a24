"""A simulated motion, which the tests write in the formats of devices."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation

G = 9.80665
XYZ = "XYZ"


@cache
def motion() -> Trajectory:
    """Eight seconds at 100 Hz with gyroscope, accelerometer, magnetometer and truth."""
    return simulate_hand("mixed", seed=11, duration=8.0)


def readings() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time ``(T,)``, gyr, acc, mag ``(T, 3)``, and the truth ``(T, 4)``."""
    one = motion()
    return one.time, *(one.measurements[f"imu/{kind}"] for kind in ("gyr", "acc", "mag")), one.truth["orientation"]


def write_table(
    path: Path, columns: dict[str, np.ndarray], delimiter: str = ",", above: str = "", below: str = ""
) -> Path:
    """A text table with one line of names; ``below`` stands between names and rows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    texts = [["" if value is None else repr(value) for value in column.tolist()] for column in columns.values()]
    rows = zip(*texts, strict=True)
    lines = [delimiter.join(columns), *([below] if below else []), *(delimiter.join(row) for row in rows)]
    path.write_text(above + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def axes(pattern: str, values: np.ndarray, names: str = XYZ) -> dict[str, np.ndarray]:
    """Columns of a vector: ``pattern`` with ``{}`` for the axis."""
    return {pattern.format(axis): values[:, i] for i, axis in enumerate(names)}


def same(found: np.ndarray, expected: np.ndarray, tolerance: float = 1e-6) -> None:
    """Assert that two arrays are equal where both are known."""
    np.testing.assert_allclose(found, expected, atol=tolerance, rtol=1e-6)


def angles(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Angles in rad between quaternions ``(T, 4)``."""
    return rotation.angle(rotation.multiply(rotation.conjugate(found), expected))
