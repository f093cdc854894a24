"""Data of calibration runs: tables of raw readings, as CSV files, and simulated ones.

Rate table: one row a sample at constant rate, with the columns

* ``time``: s, strictly increasing within a file;
* ``up``, ``out``: which axis of the device pointed up and which outwards from the table's axis: +x, −x … −z (``out``
  may be missing for gyroscopes);
* ``rate`` in rad/s, or ``rate_dps`` in °/s: of the table, counter-clockwise seen from above;
* every other column: raw readings, one column a sensitive axis, in the order of the channel.

Magnetometer: ``time``, three raw readings ``x``, ``y``, ``z``, and for the alignment ``qw``, ``qx``, ``qy``, ``qz``:
the reference attitude, device to world.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....filters.core.rotation import cross

AXES = {
    sign + name: np.array([float(sign + "1") if index == place else 0.0 for place in range(3)])
    for index, name in enumerate("xyz")
    for sign in ("+", "-")
}
"""Name → axis of the device."""
QUATERNION = ("qw", "qx", "qy", "qz")


@dataclass(frozen=True)
class RateTableData:
    """Raw readings on a rate table.

    Attributes:
        time: ``(T,)`` s; where files are joined it may start again.
        up: ``(T,)`` axis of the device that pointed up.
        out: ``(T,)`` axis that pointed outwards; empty text where unknown.
        rate: ``(T,)`` rad/s.
        raw: ``(T, n)``.

    Raises:
        ValueError: lengths that differ, an unknown axis, ``out`` along ``up``, or no row.
    """

    time: np.ndarray
    up: np.ndarray
    out: np.ndarray
    rate: np.ndarray
    raw: np.ndarray

    def __post_init__(self) -> None:
        length = len(self.time)
        if length == 0:
            raise ValueError("a run on the rate table must have rows, got none")
        if self.raw.ndim != 2 or any(len(column) != length for column in (self.up, self.out, self.rate, self.raw)):
            raise ValueError("time, up, out, rate and raw must have as many rows")
        for name, allowed in (("up", set(AXES)), ("out", {*AXES, ""})):
            unknown = sorted(set(getattr(self, name).tolist()) - allowed)
            if unknown:
                raise ValueError(f"{name} must name an axis of the device ({', '.join(AXES)}), got {unknown[0]!r}")
        for up, out in set(zip(self.up.tolist(), self.out.tolist(), strict=True)):
            if out and up[1] == out[1]:
                raise ValueError(f"out must be another axis than up, got {out!r} and {up!r}")

    @property
    def mounting(self) -> np.ndarray:
        """``(T,)`` name of the way in which the device was mounted."""
        return np.char.add(np.char.add(self.up.astype(str), " up, out "), self.out.astype(str))

    def joined(self, other: RateTableData) -> RateTableData:
        """The rows of both.

        Raises:
            ValueError: another number of sensitive axes.
        """
        if self.raw.shape[1] != other.raw.shape[1]:
            raise ValueError(f"runs must have as many axes, got {self.raw.shape[1]} and {other.raw.shape[1]}")
        names = ("time", "up", "out", "rate", "raw")
        return RateTableData(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    def save(self, path: str | Path) -> Path:
        """Write a CSV file that :func:`read_rate_table` reads."""
        import pandas

        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {"time": self.time, "up": self.up, "out": self.out, "rate": self.rate}
        columns |= {f"raw_{index + 1}": column for index, column in enumerate(self.raw.T)}
        pandas.DataFrame(columns).to_csv(path, index=False)
        return path


@dataclass(frozen=True)
class MagnetometerData:
    """Raw readings of a magnetometer ``(T, 3)`` with times ``(T,)``, s, and reference attitudes ``(T, 4)`` or None."""

    time: np.ndarray
    raw: np.ndarray
    orientation: np.ndarray | None = None

    def save(self, path: str | Path) -> Path:
        """Write a CSV file that :func:`read_magnetometer` reads."""
        import pandas

        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {"time": self.time} | dict(zip("xyz", self.raw.T, strict=True))
        if self.orientation is not None:
            columns |= dict(zip(QUATERNION, self.orientation.T, strict=True))
        pandas.DataFrame(columns).to_csv(path, index=False)
        return path


def read_rate_table(paths: list[Path]) -> RateTableData:
    """Read CSV files of one device, see the top of this module.

    Raises:
        FileNotFoundError, ValueError: a file is missing or unusable; the message names it and the reason.
    """
    data: RateTableData | None = None
    for path in paths:
        table = read_csv(path, ("time", "up"))
        try:
            if ("rate" in table) == ("rate_dps" in table):
                raise ValueError("one of the columns rate (rad/s) and rate_dps (°/s) is needed")
            names = [name for name in table if name not in ("time", "up", "out", "rate", "rate_dps")]
            if not names:
                raise ValueError("no column of raw readings")
            rate = _numbers(table, "rate") if "rate" in table else np.deg2rad(_numbers(table, "rate_dps"))
            if not np.isfinite(rate).all():
                raise ValueError("the rate must be known in every row")
            out = table["out"] if "out" in table else np.full(len(rate), "")
            one = RateTableData(
                _times(table),
                np.array([_axis(text) for text in table["up"]]),
                np.array([_axis(text) for text in out]),
                rate,
                np.stack([_numbers(table, name) for name in names], axis=-1),
            )
            data = one if data is None else data.joined(one)
        except ValueError as reason:
            raise ValueError(f"{path}: {reason}") from None
    if data is None:
        raise ValueError("no file of rate-table runs was named")
    return data


def read_magnetometer(paths: list[Path]) -> MagnetometerData:
    """Read CSV files of one magnetometer, see the top of this module.

    Raises:
        FileNotFoundError, ValueError: a file is missing or unusable; the message names it and the reason.
    """
    parts = []
    for path in paths:
        table = read_csv(path, ("time", "x", "y", "z"))
        try:
            known = [name for name in QUATERNION if name in table]
            if known and len(known) < 4:
                raise ValueError(f"a reference attitude needs the columns {', '.join(QUATERNION)}, got {known}")
            attitude = np.stack([_numbers(table, name) for name in QUATERNION], axis=-1) if known else None
            raw = np.stack([_numbers(table, name) for name in "xyz"], axis=-1)
            parts.append(MagnetometerData(_times(table), raw, attitude))
        except ValueError as reason:
            raise ValueError(f"{path}: {reason}") from None
    if not parts:
        raise ValueError("no file of magnetometer readings was named")
    attitudes = [part.orientation for part in parts if part.orientation is not None]
    if attitudes and len(attitudes) < len(parts):
        raise ValueError("either all files or none must have a reference attitude")
    return MagnetometerData(
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.raw for part in parts]),
        np.concatenate(attitudes) if attitudes else None,
    )


def read_axes(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Directions seen in two frames ``(n, 3)`` each: columns ``bx``, ``by``, ``bz`` (body), ``ox``, ``oy``, ``oz``.

    Raises:
        FileNotFoundError, ValueError: the file is missing or unusable; the message names it and the reason.
    """
    names = [[frame + axis for axis in "xyz"] for frame in "bo"]
    table = read_csv(path, tuple(names[0] + names[1]))
    try:
        body, other = (np.stack([_numbers(table, name) for name in group], axis=-1) for group in names)
    except ValueError as reason:
        raise ValueError(f"{path}: {reason}") from None
    return body, other


def read_csv(path: Path, needed: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The columns of a CSV file as text or numbers."""
    import pandas

    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no file at {path}")
    try:
        table = pandas.read_csv(path, comment="#", skipinitialspace=True)
    except (pandas.errors.ParserError, pandas.errors.EmptyDataError, UnicodeDecodeError) as reason:
        raise ValueError(f"{path} is not a table of comma-separated values: {reason}") from None
    missing = [name for name in needed if name not in table.columns]
    if missing:
        hint = " (columns must be separated by commas)" if len(table.columns) == 1 else ""
        raise ValueError(f"{path} lacks the columns {missing}; it has {list(table.columns)}{hint}")
    if len(table) == 0:
        raise ValueError(f"{path} has no rows")
    return {str(name): table[name].to_numpy() for name in table.columns}


def _numbers(table: dict[str, np.ndarray], name: str) -> np.ndarray:
    try:
        return table[name].astype(float)
    except (ValueError, TypeError):
        raise ValueError(f"column {name!r} must hold numbers") from None


def _times(table: dict[str, np.ndarray]) -> np.ndarray:
    time = _numbers(table, "time")
    if not np.isfinite(time).all():
        raise ValueError("time must be known in every row")
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if len(backwards):
        row = int(backwards[0]) + 1
        raise ValueError(f"rows are not in order: time {time[row]:g} s in row {row + 1} follows {time[row - 1]:g} s")
    return time


def _axis(text: object) -> str:
    """``z``, ``+z`` and ``-z`` (also with a proper minus); nothing stays nothing."""
    name = "" if text != text or text is None else str(text).strip().lower().replace("−", "-")
    return f"+{name}" if name in ("x", "y", "z") else name


def mounting_matrix(up: str, out: str) -> np.ndarray:
    """Rotation matrix ``(3, 3)``, device to table (x outwards, z up)."""
    x, z = AXES[out], AXES[up]
    return np.stack([x, cross(z, x), z])
