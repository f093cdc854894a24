"""Ranges of sensors: as the header of a table states (``# Gyroscope range: ±2000 deg/s``), or as readings stop at."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping

import numpy as np

from .formats.tables.table import UNITS, Table, factor, plain

STATED = re.compile(
    r"\b(?P<kind>gyr(?:o\w*?)?|angular[\s_]*(?:rate|velocity)|acc(?:el\w*?)?)[\W_]*(?:sensor[\W_]*)?"
    r"(?:full[\W_]*scale|dynamic|measurement)?[\W_]*(?:range|full[\W_]*scale|fsr)(?P<rest>(?:[\W_].*)?)$",
    re.IGNORECASE,
)
NUMBER = re.compile(r"(?P<number>\d+(?:[.,]\d+)?)\s*(?P<unit>[^\d\s:=,;()\[\]\"_]+(?:/s(?:\^?2|²)?)?)?")
USUAL = {
    "gyr": ("deg/s", (125, 245, 250, 300, 400, 450, 500, 600, 900, 1000, 1200, 2000, 4000)),
    "acc": ("g", (2, 3, 4, 6, 8, 10, 12, 16, 18, 24, 30, 32, 40, 64, 100, 200, 400)),
}
"""Kind → unit of a range without one, and the ranges that sensors have in it; other numbers are codes of settings."""
OF_CODES = (1.0, 1.14688)
"""Largest reading as a share of the range: sensors whose last code lies beyond it (70 mdps a code at ±2000 °/s)."""
EXACTLY, FULL = 0.002, 0.999
"""Tolerance of a usual range, and share of the range from which a sample is saturated."""
ALONE = 3.0
"""Times the largest reading elsewhere, from which on a value that is held is no motion, whatever the range."""
BEYOND = 1.05
"""Share of a range that readings reach at most, if it is theirs."""


def stated_ranges(table: Table) -> dict[str, float]:
    """Kind → range in SI units, of the lines before a table; the largest where several are stated."""
    found: dict[str, float] = {}
    for line in table.preamble:
        match = STATED.search(line.strip(' ,;\t"'))
        number = None if match is None else NUMBER.search(re.sub(r"(?<=\d),(?=\d{3}\b)", "", match["rest"]))
        if match is None or number is None:
            continue
        kind = "acc" if match["kind"].lower().startswith("acc") else "gyr"
        value = float(number["number"].replace(",", "."))
        words = [number["unit"] or "", *re.split(r"[\s:=,;()\[\]_±+\-\"]+", match["rest"])]
        unit = next((word for word in words if plain(word) in UNITS[kind]), None)
        usual, ranges = USUAL[kind]
        if unit is None and value not in ranges:
            continue
        found[kind] = max(found.get(kind, 0.0), value * factor(kind, unit or usual))
    return found


def full_scale(table: Table, measurements: Mapping[str, np.ndarray], name: str) -> dict[str, float]:
    """Channel → range in SI units, as ``metadata["full_scale"]`` holds it, of the ranges that a header states.

    Warns:
        UserWarning: readings lie beyond the range, which is therefore not theirs.
    """
    stated, found = stated_ranges(table), {}
    for channel, values in measurements.items():
        limit = stated.get(channel.rpartition("/")[2])
        if limit is None:
            continue
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        if largest > BEYOND * limit:
            warnings.warn(
                f"{name}: the header states a range of {limit:.4g} for {channel}, whose readings reach {largest:.4g}; "
                "the range is not used. Is the unit right?",
                stacklevel=4,
            )
        else:
            found[channel] = limit
    return found


def at_range(values: np.ndarray, limit: float) -> np.ndarray:
    """Samples ``(...)`` bool of ``(..., size)`` of which an axis is at the end of a range."""
    return np.asarray((np.abs(values) >= FULL * limit).any(axis=-1))


def reached_range(kind: str, values: np.ndarray) -> float | None:
    """The range of a sensor, where its readings show it: the largest is held, and is a usual range or stands alone.

    Args:
        kind: ``gyr`` or ``acc``.
        values: ``(T, 3)`` rad/s or m/s², NaN where missing.
    """
    size = np.nan_to_num(np.abs(values))
    largest = float(size.max(initial=0.0))
    full = size >= FULL * largest
    held = full[1:] & full[:-1] & (values[1:] == values[:-1])
    if largest == 0.0 or not held.any():
        return None
    unit, ranges = USUAL[kind]
    usual = np.outer(OF_CODES, ranges).ravel() * factor(kind, unit)
    alone = largest > ALONE * float(size[~full.any(axis=1)].max(initial=0.0)) and not full.all(axis=0).any()
    return largest if alone or np.min(np.abs(usual / largest - 1.0)) < EXACTLY else None
