"""Times of the rows of a table: stamps, counters, seconds with their fractions, or a nominal rate."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np

from .names import time_unit
from .stamps import as_seconds
from .table import DAMAGED, Table, split_unit

FRACTIONS = {"nanosec": 1, "nsecs": 1, "nsec": 1, "nanosecs": 1, "ns": 1, "usec": 10**3, "us": 10**3, "msec": 10**6}
FRACTIONS |= {"usecs": 10**3, "msecs": 10**6, "millis": 10**6, "ms": 10**6}
"""End of the name of a column that holds fractions of seconds → its unit in ns."""


def with_times(table: Table, time: str | None) -> Table:
    """The table without the few rows that have no time, with a warning: averages below a table, or damaged lines."""
    values = None if time is None else table.column(time)
    if values is None or values.dtype.kind != "f" or values.ndim != 1 or len(values) != len(table):
        return table
    known = np.isfinite(values)
    rows = int(np.flatnonzero(known)[-1]) + 1 if known.any() else len(values)
    if rows <= (1.0 - DAMAGED) * len(values) and known[:rows].all():
        # Other columns are longer: those of a faster sensor, with a time of its own.
        return table.rows(np.arange(len(values)) < rows)
    lost = int((~known).sum())
    if not 0 < lost < DAMAGED * len(values):
        return table
    first = int(np.flatnonzero(~known)[0])
    warnings.warn(f"{lost} rows without a time are left out, the first is row {first}", stacklevel=5)
    return table.rows(known)


def row_times(
    table: Table, time: str | None, rate: float | None, counter: str | None, unit: str | None
) -> tuple[np.ndarray, dict[str, Any]]:
    """Time ``(N,)`` in s from the first row, and metadata on the clock.

    Args:
        table: the rows.
        time: column of the time; None: see ``rate``.
        rate: Hz, nominal.
        counter: column that counts samples at that rate; None: there is none.
        unit: of the time; None: as the table says.
    """
    length = len(table)
    details: dict[str, Any] = {} if rate is None else {"nominal_rate": float(rate)}
    if time is not None:
        name = time
        unit = unit or time_unit(table, name)
        values = table.column(name)
        name = name if name in table else split_unit(name)[0]
        rest = fraction_column(name, table)
        if rest is not None:
            values, unit = values.astype(np.int64) * 10**9 + table.column(rest[0]).astype(np.int64) * rest[1], "ns"
        stamps = as_seconds(values, unit, name)
        return stamps.elapsed, details | {"clock_start": stamps.first}
    if rate is None:
        raise ValueError("name the column of the time (time=…) or the sampling rate in Hz (rate=…)")
    if counter is not None:
        stamps = as_seconds(table.column(counter), "s", counter)
        return stamps.elapsed / rate, details | {"clock_start": stamps.first}
    return np.arange(length) / rate, details


def fraction_column(name: str, table: Table) -> tuple[str, int] | None:
    """The column of the fraction beside one of whole seconds, and its unit in ns; None if there is none.

    Such are ROS's ``stamp.secs`` and ``stamp.nsecs``, and ``sec`` and ``msec`` of data loggers.
    """
    stem, seconds = re.sub(r"(secs?|seconds?|s)$", "", name), table.arrays.get(name)
    if table.units.get(name) == "s":
        stem = f"{name}_"  # the unit was cut off
    if stem == name or seconds is None or not np.array_equal(seconds, np.rint(seconds)):
        return None
    for end, unit in FRACTIONS.items():
        rest = table.arrays.get(stem + end)
        if rest is not None and rest.ndim == 1 and rest.min() >= 0 and rest.max() < 10**9 // unit:
            return stem + end, unit
    return None
