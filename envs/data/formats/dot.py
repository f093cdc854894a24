"""CSV exports of Movella DOT (formerly Xsens DOT) sensors.

Xsens DOT User Manual, document XD0502P, sections 4.2.1–4.2.5: ``SampleTimeFine`` counts microseconds and
wraps at 2³²; ``Acc_*`` m/s², ``Gyr_*`` deg/s, ``Mag_*`` in units of the field at calibration (about 40 µT), ``dq_*``
and ``dv[*]`` are increments of one sampling interval, all in sensor axes.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....filters.core import rotation
from ..trajectory import Trajectory

if TYPE_CHECKING:
    import pandas

CLOCK_PERIOD = 2**32
"""µs after which the clock of the sensor starts again."""
LONGEST_GAP = 60_000_000
"""µs; more between two rows is no drop-out but a sensor that was started again."""
HEADER_LINES = 40
"""The table of an export starts within so many lines."""
DEVICE_KEYS = ("DeviceTag", "DeviceId", "OutputRate", "FilterProfile", "Measurement Mode", "SyncStatus")


def axes(*stems: str, names: str = "XYZ") -> tuple[str, ...]:
    """Column names of vectors or quaternions: ``stem_X`` and so on."""
    return tuple(f"{stem}_{axis}" for stem in stems for axis in names)


VELOCITY_INCREMENT = ("dv[1]", "dv[2]", "dv[3]")


def is_dot(head: bytes, path: Path) -> bool:
    """Whether a file is a DOT export: text, a key of the device's header, and the column of its clock.

    The header matters: the older MTw exports have the same columns in other units.
    """
    text = head.decode("utf-8", errors="replace")
    return "SampleTimeFine" in text and any(line.startswith(DEVICE_KEYS) for line in text.splitlines())


def load_dot(path: Path, place: str = "imu") -> Trajectory:
    """Read an export of one DOT sensor.

    The ticks lie on the sensor's uniform grid; packets that were lost are ticks of NaN.

    Args:
        path: the file.
        place: name of the sensor, the first part of its channels' names.

    Returns:
        The channels ``gyr`` rad/s, ``acc`` m/s² and, if it was exported, ``mag`` (arbitrary unit); ``gyr`` and ``acc``
        are made from increments if only these are there. Orientation from the sensor's own filter, no truth, is the
        channel ``onboard_orientation`` (w, x, y, z). Time starts at 0; ``metadata["clock_start"]``, µs, tells
        synchronised sensors apart.

    Raises:
        ValueError: no samples, a truncated or unreadable row, missing columns, or a clock that runs
            backwards, stands still or jumps.
    """
    header, first_row = read_header(path)
    table = read_table(path, first_row)
    clock = table["SampleTimeFine"].to_numpy(dtype=float)
    try:
        ticks, interval = grid(clock)
        nominal = output_rate(header)
        if nominal is not None and len(ticks) > 1 and abs(interval * 1e-6 * nominal - 1.0) > 0.05:
            raise ValueError(f"rows are {interval:.0f} µs apart, but the header says OutputRate {nominal:g} Hz")
    except ValueError as reason:
        raise ValueError(f"{path}: {reason}") from None
    if len(ticks) == 1:
        if nominal is None:
            raise ValueError(f"{path}: a single row and no OutputRate; at least two rows are needed")
        interval = 1e6 / nominal
    measurements, units = channels(table, interval * 1e-6, path)
    spread = {
        f"{place}/{kind}": np.full((ticks[-1] + 1, values.shape[1]), np.nan) for kind, values in measurements.items()
    }
    for kind, values in measurements.items():
        spread[f"{place}/{kind}"][ticks] = values
    return Trajectory(
        time=np.arange(ticks[-1] + 1) * (interval * 1e-6),
        measurements=spread,
        metadata={
            "name": path.stem,
            "rate": 1e6 / interval,
            "units": {f"{place}/{kind}": unit for kind, unit in units.items()},
            "clock_start": int(clock[0]),
            "missing_ticks": int(ticks[-1] + 1 - len(ticks)),
            "device": header,
            "format": "Movella DOT",
            "source": "Movella/Xsens DOT export",
        },
    )


def read_header(path: Path) -> tuple[dict[str, str], int]:
    """Key-value lines before the table, and the number of the line with the column names."""
    header: dict[str, str] = {}
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in zip(range(HEADER_LINES), file, strict=False):
            if "SampleTimeFine" in line:
                return header, number
            key, comma, value = line.strip().partition(",")
            if comma and key.endswith(":"):
                header[key.rstrip(":")] = value.strip().rstrip(",")
    raise ValueError(f"{path}: no line with the column SampleTimeFine among the first {HEADER_LINES}")


def read_table(path: Path, first_row: int) -> pandas.DataFrame:
    """The table, every column a number; a ValueError names the row that is not."""
    import pandas

    try:
        table = pandas.read_csv(
            path, skiprows=first_row, index_col=False, skipinitialspace=True, encoding_errors="replace"
        )
    except (pandas.errors.ParserError, pandas.errors.EmptyDataError) as reason:
        raise ValueError(f"{path} is not a readable DOT export: {reason}") from reason
    table.columns = [str(name).strip() for name in table.columns]
    # Rows that end in a comma make a last column without name or content.
    table = table[[name for name in table.columns if not name.startswith("Unnamed")]]
    if len(table) == 0:
        raise ValueError(f"{path}: the recording has no samples")
    table = table.apply(pandas.to_numeric, errors="coerce")
    for name in wanted_columns(table):
        unreadable = ~np.isfinite(table[name].to_numpy(dtype=float))
        if unreadable.any():
            row = int(np.flatnonzero(unreadable)[0])
            where = "the last row; the file seems truncated" if row == len(table) - 1 else f"row {row} of the table"
            raise ValueError(f"{path}: column {name} holds no finite number in {where}")
    return table


def wanted_columns(table: pandas.DataFrame) -> list[str]:
    """Columns that are read, of those that are there."""
    known = (
        "SampleTimeFine",
        *axes("Acc", "Gyr", "Mag", "Euler"),
        *axes("Quat", "dq", names="WXYZ"),
        *VELOCITY_INCREMENT,
    )
    return [name for name in table.columns if name in known]


def output_rate(header: dict[str, str]) -> float | None:
    """Sampling rate in Hz as the header has it (``60Hz``), or None."""
    text = header.get("OutputRate", "").lower().replace("hz", "").strip()
    try:
        return float(text)
    except ValueError:
        return None


def grid(clock: np.ndarray) -> tuple[np.ndarray, float]:
    """Place rows on a uniform grid.

    Args:
        clock: ``(N,)`` µs, wrapping at 2³².

    Returns:
        Tick ``(N,)`` of every row, the first is 0, and the interval in µs (NaN for a single row).

    Raises:
        ValueError: the clock stands still, runs backwards, jumps, or is so irregular that two rows share a tick.
    """
    steps = np.mod(np.diff(clock), CLOCK_PERIOD)
    if len(steps) == 0:
        return np.zeros(1, dtype=int), float("nan")
    bad = (steps == 0) | (steps > LONGEST_GAP)
    if bad.any():
        row = int(np.flatnonzero(bad)[0]) + 1
        raise ValueError(
            f"SampleTimeFine must increase by less than {LONGEST_GAP} µs from row to row (and may wrap at 2³²), "
            f"got {clock[row]:.0f} in row {row} after {clock[row - 1]:.0f}"
        )
    # Counted from row to row: over the whole recording the rounding of the interval to 1 µs would add up.
    increments = np.rint(steps / np.median(steps)).astype(int)
    if (increments == 0).any():
        row = int(np.flatnonzero(increments == 0)[0]) + 1
        raise ValueError(f"SampleTimeFine is irregular: row {row} follows after {steps[row - 1]:.0f} µs")
    return np.concatenate([[0], np.cumsum(increments)]), float(steps.sum() / increments.sum())


def channels(table: pandas.DataFrame, dt: float, path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Arrays ``(N, size)`` and units by kind, in SI."""

    def values(names: tuple[str, ...]) -> Any:
        return table[list(names)].to_numpy(dtype=float) if set(names) <= set(table.columns) else None

    found = {"gyr": values(axes("Gyr")), "acc": values(axes("Acc")), "mag": values(axes("Mag"))}
    turn, velocity = values(axes("dq", names="WXYZ")), values(VELOCITY_INCREMENT)
    if found["gyr"] is not None:
        found["gyr"] = np.radians(found["gyr"])
    elif turn is not None:
        found["gyr"] = rotation.log(rotation.normalize(turn)) / dt
    if found["acc"] is None and velocity is not None:
        found["acc"] = velocity / dt
    missing = [kind for kind in ("gyr", "acc") if found[kind] is None]
    if missing:
        raise ValueError(
            f"{path}: a gyroscope (Gyr_X … or dq_W …) and an accelerometer (Acc_X … or dv[1] …) are needed, without "
            f"gravity removed; the columns are {list(table.columns)}"
        )
    quaternion, euler = values(axes("Quat", names="WXYZ")), values(axes("Euler"))
    if quaternion is not None:
        found["onboard_orientation"] = rotation.normalize(quaternion)
    elif euler is not None:
        roll, pitch, yaw = np.radians(euler).T
        found["onboard_orientation"] = rotation.from_euler_zyx(yaw, pitch, roll)
    units = {"gyr": "rad/s", "acc": "m/s²", "mag": "calibration field", "onboard_orientation": "1"}
    present = {kind: array for kind, array in found.items() if array is not None}
    return present, {kind: units[kind] for kind in present}
