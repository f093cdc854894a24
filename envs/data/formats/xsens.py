"""Text exports of Xsens MT Manager and MTw: a comment with the rate, a packet counter that wraps, columns as chosen.

MT Manager User Manual (MT0216P), ASCII export: ``Acc_*`` m/s², ``Gyr_*`` rad/s, ``Mag_*`` in units of the field at
calibration; ``Mat[i][j]`` and ``Quat_q*`` turn the sensor into a world whose z axis is up.
"""

from __future__ import annotations

from pathlib import Path

from ..trajectory import Trajectory
from .arrays import read_table
from .described import with_checked_orientation
from .dot import is_dot, spelled
from .head import Head
from .mapping import Columns, RecordingMap, Reference, apply_map
from .names import groups

UNITS = {"gyr": "rad/s", "acc": "m/s^2", "mag": "a.u."}
FINE_TICK = 1e-4
"""s per count of an MT's SampleTimeFine."""


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
        mapping = RecordingMap(columns, UNITS, rate=rate, counter=counter, reference=references, details=details)
        return [with_checked_orientation(one).on_grid() for one in apply_map(table, mapping, path)]
    if "SampleTimeFine" not in table.arrays:
        if rate is None:
            raise ValueError("neither a comment 'Update Rate' nor a column SampleTimeFine tells the sampling rate")
        mapping = RecordingMap(columns, UNITS, rate=rate, reference=references, details=details)
        return [with_checked_orientation(one) for one in apply_map(table, mapping, path)]
    mapping = RecordingMap(
        columns, UNITS | {"time": "s"}, time="SampleTimeFine", rate=rate, reference=references, details=details
    )
    return [with_checked_orientation(one.replace(time=one.time * FINE_TICK)) for one in apply_map(table, mapping, path)]
