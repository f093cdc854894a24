"""Arrays of accelerometers from names, JSON files, plain data and the metadata of recordings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..core.model import Equations
from .array import ARRAYS, AccelerometerArray, PlanarArray


def read_array(described: Mapping[str, Any]) -> AccelerometerArray:
    """An array from ``positions``, ``axes`` and optionally ``name`` and ``reference``; planar if rows have 2 numbers.

    Raises:
        ValueError: a key is missing or unknown, or the constructor rejects a value.
    """
    unknown = sorted(set(described) - {"name", "positions", "axes", "reference"})
    missing = sorted({"positions", "axes"} - set(described))
    if unknown or missing:
        raise ValueError(f"an array has positions and axes (and name, reference); missing {missing}, unknown {unknown}")
    tables = {}
    for name in ("positions", "axes", "reference"):
        try:
            rows = [described.get(name, [])] if name == "reference" else described[name]
            tables[name] = tuple(tuple(float(number) for number in row) for row in rows)
        except (TypeError, ValueError):
            raise ValueError(
                f"{name} of an array must be a list of numbers (a row for each sensor), got {rows}"
            ) from None
    kind = PlanarArray if all(len(row) == 2 for row in tables["positions"]) else AccelerometerArray
    return kind(tables["positions"], tables["axes"], str(described.get("name", "array")), tables["reference"][0])


class ArrayEquations(Equations):
    """Equations with a field ``array`` that a recording's device can determine."""

    @classmethod
    def parameters_from(cls, metadata: Mapping[str, Any]) -> dict[str, Any]:
        """The array of ``metadata["device"]``, and whether it has a gyroscope, where the equations have that field."""
        device = metadata.get("device")
        # recordings of one IMU may have the name of their sensor here
        if not isinstance(device, Mapping) or device.get("array") is None:
            return {}
        parameters: dict[str, Any] = {"array": read_array(device["array"])}
        if "gyroscope" in device and any(field.name == "gyroscope" for field in fields(cls)):
            parameters["gyroscope"] = bool(device["gyroscope"])
        return parameters


def load_array(source: str | Path) -> AccelerometerArray:
    """The array with a name of :data:`ARRAYS`, or from a JSON file as for :func:`read_array`, or a calibration record.

    Raises:
        ValueError: neither a known name nor a file, or a file that does not describe an array.
    """
    if str(source) in ARRAYS:
        return ARRAYS[str(source)]
    path = Path(source)
    if not path.is_file():
        raise ValueError(f"array must be one of {', '.join(ARRAYS)} or a JSON file, got {str(source)!r}")
    try:
        described = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not JSON: {error}") from None
    if not isinstance(described, dict):
        raise ValueError(f"{path} must hold one object with positions and axes")
    if described.get("format") == "poise-calibration":
        details = described.get("details")
        parts = details.values() if isinstance(details, dict) else ()
        found = [part["array"] for part in parts if isinstance(part, dict) and isinstance(part.get("array"), dict)]
        if not found:
            raise ValueError(f"{path} is a calibration record without accelerometers and contains no array")
        return read_array(found[0])
    return read_array({"name": path.stem} | described)


UNITS = {"P": "m/s²", "T": "rad/s²", "C": "rad²/s²"}
"""Units of the entries of z, by block."""


def describe_array(array: AccelerometerArray, deviation: float = 1.0) -> list[dict[str, Any]]:
    """Quantities that the readings of an array determine: one row for each entry of z.

    Args:
        array: the array.
        deviation: σ_a of one accelerometer, m/s².

    Returns:
        Rows with ``quantity``, ``determined``, ``deviation`` (standard deviation of the estimate; None where the
        quantity is not determined) and ``unit``.
    """
    unit_of = [UNITS[block] for block, part in array.blocks.items() for _ in range(part.stop - part.start)]
    columns = zip(array.components, array.determined, array.noise_gains, unit_of, strict=True)
    return [
        {
            "quantity": name,
            "determined": bool(known),
            "deviation": float(deviation * gain) if known else None,
            "unit": unit,
        }
        for name, known, gain, unit in columns
    ]
