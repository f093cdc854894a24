"""Rows of any kind → plain values, the types of JSON, or a table in Markdown."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

RESULT = ("estimator", "trajectory", "quantity", "metric", "value", "unit")
"""Columns of a table of errors, one number a row."""


def records(rows: Iterable[Any]) -> list[dict[str, Any]]:
    """Return mappings, named tuples, dataclass instances, or one pandas data frame as dictionaries."""
    if hasattr(rows, "to_dict") and not isinstance(rows, Mapping):
        rows = rows.to_dict("records")
    return [_record(row) for row in rows]


def _record(row: Any) -> dict[str, Any]:
    if isinstance(row, Mapping):
        return dict(row)
    if hasattr(row, "_asdict"):
        return dict(row._asdict())
    if dataclasses.is_dataclass(row) and not isinstance(row, type):
        return {field.name: getattr(row, field.name) for field in dataclasses.fields(row)}
    raise TypeError(f"a row is a mapping, a named tuple or a dataclass instance, not {type(row).__name__}")


def jsonable(value: Any, infinite: Callable[[float], Any] = str) -> Any:
    """Return anything in JSON's types: dataclasses by field, paths as text, arrays as lists.

    ``infinite`` gives what stands for a number that is not finite.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: jsonable(getattr(value, field.name), infinite) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): jsonable(item, infinite) for key, item in value.items()}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist(), infinite)
    if isinstance(value, set | frozenset):
        return sorted((jsonable(item, infinite) for item in value), key=str)
    if isinstance(value, list | tuple):
        return [jsonable(item, infinite) for item in value]
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else infinite(value)
    if isinstance(value, type) or callable(value):
        return f"{value.__module__}.{value.__qualname__}" if hasattr(value, "__qualname__") else repr(value)
    return str(value)


def cell(value: Any, digits: int = 3) -> str:
    """Return one entry as text: floats with ``digits`` significant digits, None and NaN as a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        number = float(value)
        if np.isnan(number):
            return "–"
        # Plain digits where they are readable: 12345 rather than 1.23e+04.
        return f"{number:.0f}" if 10**digits <= abs(number) < 1e9 else f"{number:.{digits}g}"
    return str(value)


def markdown_table(rows: Iterable[Any], columns: Sequence[str] | None = None, digits: int = 3) -> str:
    """Return rows as a Markdown table, numbers to the right.

    Args:
        rows: see :func:`records`.
        columns: which fields in which order; by default all, in order of first appearance.
        digits: significant digits of floats.
    """
    data = records(rows)
    names = columns_of(data, columns)
    lines = [names, ["---:" if is_numeric(data, name) else "---" for name in names]]
    lines += [[cell(record.get(name), digits).replace("|", "\\|") for name in names] for record in data]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def columns_of(data: Sequence[Mapping[str, Any]], columns: Sequence[str] | None) -> list[str]:
    """``columns``, or the fields of all rows in order of first appearance if None."""
    return list(columns if columns is not None else dict.fromkeys(name for record in data for name in record))


def is_numeric(data: Sequence[Mapping[str, Any]], name: str) -> bool:
    """Whether the field ``name`` is a number in every row that has it, and at least one row does."""
    present = [value for record in data if (value := record.get(name)) is not None]
    return bool(present) and all(
        isinstance(value, int | float | np.number) and not isinstance(value, bool) for value in present
    )
