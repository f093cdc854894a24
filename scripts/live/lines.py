"""Samples as lines of text, comma-separated values or one JSON object a line."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from ...envs.data.formats.tables.cells import is_number
from ...envs.data.formats.tables.names import groups, time_column
from ...envs.data.formats.tables.table import Table, factor, split_unit, units_row
from ...filters.core.quantity import Channel
from ...filters.support.names import unknown

LineFormat = Literal["auto", "csv", "json"]
LONGEST_LINE = 65536
"""Characters; what is longer is not a sample."""
AXES = "xyz"
USUAL = {
    6: ("gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z"),
    7: ("time", "gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z"),
    9: ("gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z", "mag_x", "mag_y", "mag_z"),
    10: ("time", "gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z", "mag_x", "mag_y", "mag_z"),
}
"""Number of values in a line without names → what they are taken for."""
IGNORED = "-"
"""Name of a column that is not read."""


class BadLineError(ValueError):
    """A line is not a sample; the message says why."""


class Sample(NamedTuple):
    """One sample of a stream.

    Attributes:
        time: s, or None where the lines have no time.
        measurement: channel → ``(size,)`` in SI units (magnetometer µT); NaN where a value is empty.
    """

    time: float | None
    measurement: dict[str, np.ndarray]


@dataclass(frozen=True)
class Layout:
    """Which column of a line is what.

    Attributes:
        time: column of the time; None: there is none.
        second: seconds in a unit of the time.
        channels: channel → its columns and the factor to SI units.
    """

    time: str | None
    second: float
    channels: Mapping[str, tuple[tuple[str, ...], float]]

    def sample(self, values: Mapping[str, float]) -> Sample:
        """The sample of a line's values; a column that is missing is NaN.

        Raises:
            BadLineError: the time is missing or not finite.
        """
        seconds = None
        if self.time is not None:
            seconds = self.second * values.get(self.time, math.nan)
            if not math.isfinite(seconds):
                raise BadLineError(f"column {self.time!r} holds no time")
        return Sample(
            seconds,
            {
                name: scale * np.array([values.get(column, math.nan) for column in columns])
                for name, (columns, scale) in self.channels.items()
            },
        )


def layout_of(names: Sequence[str], units: Mapping[str, str], channels: Sequence[Channel] = ()) -> Layout:
    """What columns mean by their names.

    A channel that an estimator needs is found by its own name (``wheel/speed``, ``trunk_imu/gyr_x``). Names of inertial
    sensors are understood as in files of recordings (``Gyro X (deg/s)``).

    Args:
        names: of the columns, units in brackets.
        units: kind → unit (see :func:`check_units`), which takes precedence over those of the names.
        channels: what the estimators need.

    Raises:
        ValueError: an unknown unit, two columns of one name, or no column of a sensor.
    """
    split = [split_unit(name) for name in names]
    plain = [name for name, _ in split if name != IGNORED]
    if len(set(plain)) < len(plain):
        raise ValueError(f"columns must have different names, got {', '.join(names)}")
    said = {name: unit for name, unit in split if unit}
    table = Table({name: np.zeros(2) for name in plain}, units=said)
    time = time_column(table)
    found: dict[str, tuple[tuple[str, ...], float]] = {}
    for group in groups(table):
        if group.kind in ("gyr", "acc", "mag"):
            unit = units.get(group.kind) or group.unit
            scale = factor(group.kind, unit) if unit else 1.0
            found.setdefault(f"{group.sensor or 'imu'}/{group.kind}", (tuple(group.columns), scale))
    for channel in channels:
        wanted = (
            [channel.name]
            if channel.size == 1
            else [f"{channel.name}_{AXES[i : i + 1] or i}" for i in range(channel.size)]
        )
        if set(wanted) <= set(plain):
            unit = units.get(channel.kind) or said.get(wanted[0], "")
            scale = factor(channel.kind, unit) if unit and channel.kind in ("gyr", "acc", "mag") else 1.0
            found[channel.name] = (tuple(wanted), scale)
    if not found:
        raise ValueError(
            f"no columns of a sensor in {', '.join(names)}; name them by --columns, such as time gyr_x gyr_y gyr_z "
            f"acc_x acc_y acc_z, and what is not read by {IGNORED}"
        )
    unit = units.get("time") or (said.get(time, "") if time else "")
    return Layout(time, factor("time", unit) if unit else 1.0, found)


def check_units(units: Mapping[str, str]) -> None:
    """Check units by kind (``gyr``, ``acc``, ``mag``, ``time``).

    Raises:
        ValueError: an unknown kind or unit; the message lists those that there are.
    """
    for kind, unit in units.items():
        if kind not in ("gyr", "acc", "mag", "time"):
            raise ValueError(f"units: {unknown('kind', kind, ['gyr', 'acc', 'mag', 'time'])}")
        factor(kind, unit)


@dataclass
class LineReader:
    """Turns lines into samples; the first line decides on format and columns where they are not given.

    Attributes:
        columns: names of the values of a line; by default those of a header, of a JSON object, or :data:`USUAL`.
        units: see :func:`layout_of`.
        channels: what the estimators need.
        kind: ``csv``, ``json``, or ``auto`` by the first line.
    """

    columns: Sequence[str] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    channels: Sequence[Channel] = ()
    kind: LineFormat = "auto"
    layout: Layout | None = None

    def __post_init__(self) -> None:
        check_units(self.units)
        self._names: tuple[str, ...] = tuple(split_unit(name)[0] for name in self.columns)
        if self.columns:
            self.layout = layout_of(self.columns, self.units, self.channels)

    def read(self, line: str) -> Sample | None:
        """The sample of a line; None for an empty line, a comment (``#``) or a header.

        Raises:
            BadLineError: it is not a sample, or its columns are not understood.
        """
        if len(line) > LONGEST_LINE:
            raise BadLineError(f"it has {len(line)} characters")
        text = line.strip().lstrip("\ufeff")
        if not text or text.startswith("#"):
            return None
        if self.kind == "auto":
            self.kind = "json" if text.startswith("{") else "csv"
        values = self._json(text) if self.kind == "json" else self._csv(text)
        if values is None:
            return None
        if self.layout is None:
            self._understand(self._names or tuple(values))
            assert self.layout is not None
        sample = self.layout.sample(values)
        if not any(np.isfinite(array).any() for array in sample.measurement.values()):
            raise BadLineError("it holds no value of a sensor")
        return sample

    def _understand(self, names: Sequence[str]) -> None:
        try:
            self.layout = layout_of(names, self.units, self.channels)
        except ValueError as reason:
            raise BadLineError(str(reason)) from None

    def _csv(self, text: str) -> dict[str, float] | None:
        cells = [cell.strip() for cell in (text.split(",") if "," in text else text.replace(";", " ").split())]
        try:
            numbers = [float(cell) if cell else math.nan for cell in cells]
        except ValueError:
            if units_row(cells):
                return None
            if self._names:
                wrong = next(cell for cell in cells if cell and not is_number(cell))
                raise BadLineError(f"{wrong[:40]!r} is not a number") from None
            self._understand(cells)
            self._names = tuple(split_unit(cell)[0] for cell in cells)
            return None
        if not self._names:
            if len(numbers) not in USUAL:
                raise BadLineError(
                    f"lines of {len(numbers)} values without names: name them by --columns; understood without are "
                    f"{', '.join(map(str, USUAL))} values (time, gyr, acc, mag)"
                )
            self._names = USUAL[len(numbers)]
        if len(numbers) != len(self._names):
            raise BadLineError(f"it has {len(numbers)} values instead of {len(self._names)}")
        return {name: number for name, number in zip(self._names, numbers, strict=True) if name != IGNORED}

    def _json(self, text: str) -> dict[str, float]:
        try:
            content = json.loads(text)
        except ValueError as reason:
            raise BadLineError(f"it is not JSON: {reason}") from None
        if not isinstance(content, dict):
            raise BadLineError("it is not a JSON object")
        values: dict[str, float] = {}
        for key, value in content.items():
            entries = value if isinstance(value, list) else [value]
            names = [f"{key}_{AXES[i : i + 1] or i}" for i in range(len(entries))] if isinstance(value, list) else [key]
            for name, entry in zip(names, entries, strict=True):
                if entry is None:
                    values[name] = math.nan
                elif isinstance(entry, int | float) and not isinstance(entry, bool):
                    values[name] = float(entry)
                elif self.layout is not None and name in self._needed:
                    raise BadLineError(f"{name} is {entry!r:.40}, not a number")
        return values

    @property
    def _needed(self) -> set[str]:
        assert self.layout is not None
        return {column for columns, _ in self.layout.channels.values() for column in columns} | {self.layout.time or ""}
