"""Exports of Movella DOT (formerly Xsens DOT) sensors and of Xsens MT Manager, in any dialect of text.

Xsens DOT User Manual, document XD0502P, sections 4.2.1–4.2.5: ``SampleTimeFine`` counts microseconds and
wraps at 2³²; ``Acc_*`` m/s², ``Gyr_*`` deg/s, ``Mag_*`` in units of the field at calibration (about 40 µT), ``dq_*``
and ``dv[*]`` are increments of one sampling interval, all in sensor axes. MT Manager User Manual (MT0216P), ASCII
export: a comment with the rate, a packet counter that wraps, ``Acc_*`` m/s², ``Gyr_*`` rad/s, ``Mag_*`` in units of the
field at calibration; ``Mat[i][j]`` and ``Quat_q*`` turn the sensor into a world whose z axis is up.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from ....filters.core import rotation
from ..trajectory import Trajectory
from .described import with_checked_orientation
from .mapping import Columns, RecordingMap, Reference, apply_map, trajectory_of
from .tables.arrays import read_table
from .tables.head import Head
from .tables.names import groups
from .tables.packed import plain_stem
from .tables.stamps import as_seconds
from .tables.table import Table
from .tables.text import table_of

DEVICE_KEYS = ("DeviceTag", "DeviceId", "OutputRate", "FilterProfile", "Measurement Mode", "SyncStatus", "Measurement")
UNITS = {"gyr": "rad/s", "acc": "m/s²", "mag": "calibration field", "onboard_orientation": "1"}
MT_UNITS = {"gyr": "rad/s", "acc": "m/s^2", "mag": "a.u."}
FINE_TICK = 1e-4
"""s per count of an MT's SampleTimeFine."""
SLOWEST_COUNT = 2000
"""Counts of SampleTimeFine between samples: a DOT at 120 Hz has 8333, an MT at 10 Hz 1000."""
LONGEST_GAP = 60.0
"""s; a longer interval between two rows is a restart of the sensor and not a drop-out."""


def axes(stem: str, names: str = "XYZ") -> list[str]:
    """Column names of a vector or quaternion: ``stem_X`` and so on."""
    return [f"{stem}_{axis}" for axis in names]


def is_dot(head: Head) -> bool:
    """Whether a file is a DOT export: the column of its clock, and a key of the device's header or µs in the clock.

    MT Manager exports have the same columns in other units.
    """
    if "sampletimefine" not in head.text.lower():
        return False
    lines = [line.lstrip('"') for line in head.text.splitlines()]
    known = any(line.startswith(DEVICE_KEYS) for line in lines)
    # The clock tells: a DOT counts microseconds, an MT tenths of milliseconds.
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            clock = table_of(head.text, head.path.name).renamed(spelled).arrays.get("SampleTimeFine")
    except ValueError:
        return known
    if clock is None or len(clock) < 3:
        return known
    return bool(np.median(np.abs(np.diff(clock))) >= SLOWEST_COUNT) or (known and "OutputRate" in head.text)


def load_dot(path: Path) -> list[Trajectory]:
    """Read an export of one DOT sensor, in any dialect, on the grid of its clock.

    The time stamps lie on the sensor's uniform grid, that of ``OutputRate`` where rows are lost or their stamps are
    irregular; lost packets are samples of NaN.

    Returns:
        The channels ``gyr`` rad/s, ``acc`` m/s² and, if it was exported, ``mag`` (arbitrary unit); ``gyr`` and ``acc``
        are made from increments if only these are there. Orientation from the sensor's own filter, no truth, is the
        channel ``onboard_orientation`` (w, x, y, z). Time starts at 0; ``metadata["clock_start"]``, µs, tells
        synchronised sensors apart.

    Raises:
        ValueError: no samples, an unreadable cell, missing columns, or a clock that runs backwards, stands still or
            was started again.
    """
    table = read_table(path).renamed(spelled)
    header = {
        key: table.value_of(key)
        for key in (*DEVICE_KEYS, "FirmwareVersion", "AppVersion", "StartTime")
        if table.value_of(key) is not None
    }
    nominal = table.rate_in_header("OutputRate")
    if "SampleTimeFine" not in table.arrays:
        raise ValueError(f"there is no column SampleTimeFine; {table.seen()}")
    stamps = as_seconds(table.column("SampleTimeFine"), "us", "SampleTimeFine")
    if len(table) == 1 and nominal is None:
        raise ValueError("a single row and no OutputRate; at least two rows are needed")
    steps = np.diff(stamps.elapsed)
    if len(steps) and (steps.max() > LONGEST_GAP or steps.max() <= 0.0):
        row = int(np.argmax(steps)) + 1
        raise ValueError(
            f"SampleTimeFine must increase by less than {LONGEST_GAP:g} s from row to row (and may wrap at 2³²), got "
            f"{table.arrays['SampleTimeFine'][row]} in row {row} after {table.arrays['SampleTimeFine'][row - 1]}"
        )
    details = {
        "name": plain_stem(path),
        "clock_start": int(stamps.first),
        "device": header,
        "format": "Movella DOT",
        "source": "Movella/Xsens DOT export",
    }
    if nominal is not None:
        details["nominal_rate"] = nominal
    # Increments need the interval, which the stamps tell before their rows lie on the grid.
    interval = Trajectory(stamps.elapsed, {"x": np.zeros((len(table), 1))}, metadata=details).dt
    measurements = {f"imu/{kind}": values for kind, values in channels(table, interval).items()}
    details["units"] = {name: UNITS[name.removeprefix("imu/")] for name in measurements}
    recorded = with_checked_orientation(trajectory_of(stamps.elapsed, measurements, {}, details))
    grid = recorded.on_grid()
    return [
        grid.replace(
            time=grid.time - grid.time[0],
            metadata=grid.metadata | {"rate": 1.0 / interval, "missing_samples": len(grid) - len(recorded)},
        )
    ]


def spelled(name: str) -> str:
    """A column's name as the manual spells it, whatever its case."""
    known = ["PacketCounter", "SampleTimeFine", *axes("Acc"), *axes("Gyr"), *axes("Mag"), *axes("Euler")]
    known += [*axes("Quat", "WXYZ"), *axes("dq", "WXYZ"), "dv[1]", "dv[2]", "dv[3]"]
    return {each.lower(): each for each in known}.get(name.lower().replace(" ", ""), name)


def channels(table: Table, dt: float) -> dict[str, np.ndarray]:
    """Arrays ``(N, size)`` by kind, in SI units."""

    def values(names: list[str]) -> np.ndarray | None:
        return table.matrix(names) if names in table else None

    gyr, acc, mag = values(axes("Gyr")), values(axes("Acc")), values(axes("Mag"))
    turn, velocity = values(axes("dq", "WXYZ")), values(["dv[1]", "dv[2]", "dv[3]"])
    found: dict[str, np.ndarray | None] = {
        "gyr": np.radians(gyr) if gyr is not None else None,
        "acc": acc if acc is not None else velocity / dt if velocity is not None else None,
        "mag": mag,
    }
    if gyr is None and turn is not None:
        found["gyr"] = rotation.log(rotation.normalize(turn)) / dt
    if found["gyr"] is None or found["acc"] is None:
        raise ValueError(
            "a gyroscope (Gyr_X … or dq_W …) and an accelerometer (Acc_X … or dv[1] …) are needed, without gravity "
            f"removed; the columns are {list(table.arrays)}"
        )
    quaternion, euler = values(axes("Quat", "WXYZ")), values(axes("Euler"))
    if quaternion is not None:
        found["onboard_orientation"] = rotation.normalize(quaternion)
    elif euler is not None:
        roll, pitch, yaw = np.radians(euler).T
        found["onboard_orientation"] = rotation.from_euler_zyx(yaw, pitch, roll)
    return {kind: array for kind, array in found.items() if array is not None}


def is_xsens(head: Head) -> bool:
    """Whether a file is an export of MT Manager: its names of columns, and its comments or its packet counter."""
    names = head.text.lower()
    if "acc_x" not in names or "gyr_x" not in names or ("packetcounter" not in names and "sampletimefine" not in names):
        return False
    return not is_dot(head)


def load_xsens(path: Path) -> list[Trajectory]:
    """Read an export of one sensor, on the grid of its packet counter.

    Raises:
        ValueError: the rate is not in the header, or a column is missing or unreadable.
    """
    table = read_table(path).renamed(spelled)
    found = {group.kind: group for group in groups(table)}
    missing = {"gyr", "acc"} - set(found)
    if missing:
        raise ValueError(f"columns of {sorted(missing)} are missing; there are {list(table.arrays)}")
    rate = table.rate_in_header("Update Rate", "Sample Rate", "Sampling Rate", "Output Rate")
    columns: dict[str, Columns] = {kind: found[kind].columns for kind in ("gyr", "acc", "mag") if kind in found}
    onboard = next((found[kind].columns for kind in ("quaternion", "matrix") if kind in found), None)
    if onboard is None and {"Roll", "Pitch", "Yaw"} <= set(table.arrays):
        onboard = ["Roll", "Pitch", "Yaw"]
    references = () if onboard is None else (Reference(tuple(onboard), role="onboard"),)
    details = {"format": "Xsens MT Manager", "source": "Xsens MT Manager text export"}
    counter = "PacketCounter" if "PacketCounter" in table.arrays else None
    if rate is not None and counter is not None:
        mapping = RecordingMap(columns, MT_UNITS, rate=rate, counter=counter, reference=references, details=details)
        return [with_checked_orientation(one).on_grid() for one in apply_map(table, mapping, path)]
    if "SampleTimeFine" not in table.arrays:
        if rate is None:
            raise ValueError("neither a comment 'Update Rate' nor a column SampleTimeFine tells the sampling rate")
        mapping = RecordingMap(columns, MT_UNITS, rate=rate, reference=references, details=details)
        return [with_checked_orientation(one) for one in apply_map(table, mapping, path)]
    mapping = RecordingMap(
        columns, MT_UNITS | {"time": "s"}, time="SampleTimeFine", rate=rate, reference=references, details=details
    )
    return [with_checked_orientation(one.replace(time=one.time * FINE_TICK)) for one in apply_map(table, mapping, path)]
