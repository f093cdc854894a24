"""Arrays and metadata that users pass, checked and copied."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

UNIT_QUANTITIES = {"orientation": 4, "up": 3}
"""Truth of unit length, by the last part of its name, and its size."""
UNIT_TOLERANCE = 0.02


def unit_or_unknown(truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Truth that must have unit length, with NaN in rows that have not."""
    for name, values in truth.items():
        if UNIT_QUANTITIES.get(name.rsplit("/", 1)[-1].removeprefix("relative_")) != values.shape[1]:
            continue
        wrong = np.abs(np.linalg.norm(values, axis=1) - 1.0) > UNIT_TOLERANCE
        if wrong.any():
            warnings.warn(
                f"truth[{name!r}] must have unit length or be NaN; {wrong.sum()} of {len(wrong)} rows have not (the "
                f"first at sample {first(wrong)}: {values[first(wrong)].tolist()}) and count as unknown",
                stacklevel=4,
            )
            truth[name] = np.where(wrong[:, None], np.nan, values)
            truth[name].flags.writeable = False
    return truth


def first(flags: np.ndarray) -> int:
    """Index of the first True."""
    return int(np.flatnonzero(flags)[0])


def real_array(name: str, values: Any) -> np.ndarray:
    """``values`` as a read-only float64 array of our own; masked entries are NaN.

    Raises:
        ValueError: names the values if they are not real numbers.
    """
    try:
        array = np.asanyarray(values)
    except ValueError as reason:
        raise ValueError(f"{name} must be an array of real numbers: {reason}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} must be an array of real numbers, got dtype {array.dtype}")
    if not constant(array):
        array = np.array(np.ma.filled(array.astype(float), np.nan), dtype=float, subok=False)
        array.flags.writeable = False
    return array


def constant(array: np.ndarray) -> bool:
    """Whether nobody can change a float64 array, so that it need not be copied: all its owners are read-only."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable or type(owner) is not np.ndarray:
            return False
        if owner.base is None:
            return array.dtype == float
        owner = owner.base
    return False


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
            sample = first(np.isinf(array).any(axis=1))
            raise ValueError(
                f"{argument}[{name!r}] must be finite, or NaN where unknown; it is infinite at sample {sample}"
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
