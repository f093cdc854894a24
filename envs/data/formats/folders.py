"""Folders with a file a sensor, each with a clock of its own: phones (phyphox, Sensor Logger, SensLogs) and x-io.

phyphox and SensLogs on Android report +g on an axis that points up, in m/s². Apple's devices report −1 g, in g, where
an app writes what the system says (Sensor Logger, SensLogs on iOS). Files without gravity are not used alone. SensLogs:
T. Michel, P. Genevès, H. Fourati, N. Layaïda, "On attitude estimation with smartphones", PerCom 2017. x-io: NGIMU User
Manual and x-IMU3 User Manual, CSV files.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from ..trajectory import Trajectory
from .described import with_checked_orientation
from .mapping import unit_quaternions
from .tables.arrays import read_table
from .tables.head import Head
from .tables.names import AXES, groups, time_column, time_unit, words
from .tables.stamps import Stamps, as_seconds
from .tables.streams import Stream, joined
from .tables.table import Table, factor

SUFFIXES = (".csv", ".txt", ".tsv")
PREFERRED = {
    "gyr": ("gyroscope calibrated", "gyroscope", "gyroscope uncalibrated", "gyro", "angular velocity"),
    "acc": (
        "total acceleration",
        "accelerometer calibrated",
        "accelerometer",
        "accelerometer uncalibrated",
        "acceleration",
    ),
    "mag": ("magnetometer calibrated", "magnetometer", "magnetometer uncalibrated", "magnetic field"),
    "orientation": ("rotation vector", "orientation", "attitude", "quaternion"),
    "gravity": ("gravity",),
}
"""Kind → names of files, the preferred ones first."""
X_IO = ("inertial", "sensors")
"""Files of x-io's devices that hold gyroscope and accelerometer together."""
GRAVITY_IN = (0.65, 1.5)
"""Typical magnitude, in g, of an accelerometer that measures gravity."""


@dataclass(frozen=True)
class File:
    """One file of a folder: its table, its stamps, and what it measures."""

    path: Path
    table: Table
    stamps: Stamps


def stem_words(path: Path) -> str:
    """Words of a file's name: ``GyroscopeUncalibrated.csv`` → gyroscope uncalibrated."""
    metawear = re.search(r"_([A-Za-z]+)_[\d.]+Hz", path.stem)
    if metawear:
        return metawear[1].lower()
    return " ".join(word for word in words(path.stem) if not word.isdigit())


def is_folder_of_streams(head: Head) -> bool:
    """Whether a folder holds a gyroscope and an accelerometer in files of their own, or those of an x-io device."""
    stems = {stem_words(path) for name, path in head.names.items() if name.endswith(SUFFIXES)}
    if stems & set(X_IO):
        return True
    return all(stems & set(PREFERRED[kind]) for kind in ("gyr", "acc"))


def is_member(head: Head) -> bool:
    """Whether a file is gyroscope and accelerometer of an x-io device, with other streams beside it."""
    return not head.folder and stem_words(head.path) in X_IO and "Gyroscope X" in head.text


def load_member(path: Path) -> list[Trajectory]:
    """Read the folder of an x-IMU3 or NGIMU, with its quaternion as onboard orientation."""
    return load_streams(path.parent, {stem_words(path): path})


def load_streams(folder: Path, chosen: dict[str, Path] | None = None) -> list[Trajectory]:
    """Read a folder.

    Raises:
        ValueError: a file is unreadable, or gyroscope and accelerometer share no time.
    """
    files = {stem_words(path): path for path in sorted(folder.iterdir()) if path.suffix.lower() in SUFFIXES}
    files |= chosen or {}
    x_io = next((files[stem] for stem in X_IO if stem in files), None)
    streams, details = x_io_streams(x_io, files) if x_io else phone_streams(files)
    time, measurements = joined(streams)
    name = folder.name if not x_io or x_io.stem.lower() in X_IO else x_io.stem
    details |= {"name": name, "units": {"imu/gyr": "rad/s", "imu/acc": "m/s²", "imu/mag": "µT"}}
    trajectory = with_checked_orientation(Trajectory(time - time[0], measurements, metadata=details))
    return [trajectory.replace(metadata=trajectory.metadata | {"clock_start": float(time[0])})]


def opened(path: Path) -> File:
    """A file with its stamps."""
    try:
        table = read_table(path)
        name = time_column(table) if table.named else "0"
        if name is None:
            raise ValueError(f"no column is a time; {table.seen()}")
        if "time" in table and "seconds_elapsed" in table:
            name = "time"
        unit = time_unit(table, name) or ("ns" if name == "time" and "seconds_elapsed" in table else "")
        return File(path, table, as_seconds(table.column(name), unit, name))
    except ValueError as reason:
        raise ValueError(f"{path.name}: {reason}") from None


def vector(file: File, wanted: str = "") -> tuple[np.ndarray, str]:
    """Three axes ``(N, 3)`` of a file and their unit, by name, or columns 1 to 3 of a file without names."""
    table = file.table
    if not table.named:
        return table.matrix(["1", "2", "3"]), ""
    for group in groups(table):
        if group.kind == wanted:
            return table.matrix(group.columns), group.unit
    found: dict[int, str] = {}
    for name in table.arrays:
        axis = next((word for word in reversed(words(name)) if word in AXES), None)
        if axis is not None:
            found.setdefault(AXES[axis], name)
    if set(found) != {0, 1, 2}:
        raise ValueError(f"{file.path.name}: no columns x, y, z; {table.seen()}")
    columns = [found[axis] for axis in range(3)]
    return table.matrix(columns), table.unit(columns)


def quaternion(file: File) -> np.ndarray | None:
    """Quaternions ``(N, 4)`` w, x, y, z of a file; None if it has none."""
    table = file.table
    if not table.named:
        # Android writes x, y, z, w and an accuracy; SensLogs on iOS w, x, y, z.
        android = stem_words(file.path) == "rotation vector"
        if len(table.arrays) < 5:
            return None
        values = table.matrix(["1", "2", "3", "4"])
        return rotation.from_xyzw(values) if android else values
    for group in groups(table):
        if group.kind == "quaternion":
            return table.matrix(group.columns)
    by_axis = {(words(name) or [""])[0]: name for name in table.arrays}
    by_axis |= {words(name)[-1]: name for name in table.arrays if len(words(name)) > 1 and words(name)[-1] in "wxyz"}
    return table.matrix([by_axis[axis] for axis in "wxyz"]) if set("wxyz") <= set(by_axis) else None


def x_io_streams(inertial: Path, files: dict[str, Path]) -> tuple[dict[str, Stream], dict[str, Any]]:
    """Streams of an x-IMU3 or NGIMU."""
    first = opened(inertial)
    origin = first.stamps.first
    streams = {}
    for kind in ("gyr", "acc", "mag"):
        if any(group.kind == kind for group in groups(first.table)):
            values, unit = vector(first, kind)
            streams[f"imu/{kind}"] = Stream(first.stamps.elapsed, values * (factor(kind, unit) if unit else 1.0))
    if "imu/mag" not in streams and "magnetometer" in files:
        file = opened(files["magnetometer"])
        streams["imu/mag"] = Stream(file.stamps.since(origin), vector(file)[0])
    if "quaternion" in files:
        file = opened(files["quaternion"])
        written = quaternion(file)
        if written is not None:
            # NGIMU's quaternion turns the world into the sensor, x-IMU3's the sensor into the world.
            ngimu = stem_words(inertial) == "sensors"
            values = unit_quaternions(rotation.conjugate(written) if ngimu else written)
            streams["imu/onboard_orientation"] = Stream(file.stamps.since(origin), values)
    name = "NGIMU" if stem_words(inertial) == "sensors" else "x-IMU3"
    return streams, {"format": f"x-io {name}", "source": f"x-io {name} CSV files"}


def phone_streams(files: dict[str, Path]) -> tuple[dict[str, Stream], dict[str, Any]]:
    """Streams of a phone."""
    loaded = {kind: [opened(files[name]) for name in names if name in files] for kind, names in PREFERRED.items()}
    origin = min(file.stamps.first for group in loaded.values() for file in group)
    streams: dict[str, Stream] = {}
    for kind in ("gyr", "mag"):
        for file in loaded[kind][:1]:
            values, unit = vector(file)
            streams[f"imu/{kind}"] = Stream(file.stamps.since(origin), values * (factor(kind, unit) if unit else 1.0))
    streams["imu/acc"], sign = specific_force(loaded["acc"], loaded["gravity"], origin, is_ios(files))
    for file in loaded["orientation"][:1]:
        values_or_none = quaternion(file)
        if values_or_none is not None:
            streams["imu/onboard_orientation"] = Stream(file.stamps.since(origin), unit_quaternions(values_or_none))
    app = "Sensor Logger" if any("seconds_elapsed" in file.table for file in loaded["gyr"]) else "phone"
    app = "SensLogs" if any(not file.table.named for file in loaded["gyr"]) else app
    app = "phyphox" if any("Time" in file.table for file in loaded["gyr"]) else app
    return streams, {"format": app, "source": f"{app} folder", "accelerometer_sign": sign}


def is_ios(files: dict[str, Path]) -> bool:
    """Whether the metadata of an app say that an Apple device wrote the files in its own conventions."""
    for name in ("metadata", "description"):
        if name in files:
            text = files[name].read_text(encoding="utf-8", errors="replace")
            if re.search(r"\bios\b|iphone|ipad", text, re.IGNORECASE):
                return not re.search(r"standardi[sz]ation[^\n]*\n[^\n]*true", text, re.IGNORECASE)
    return False


def specific_force(candidates: list[File], gravity: list[File], origin: float | int, ios: bool) -> tuple[Stream, int]:
    """The stream with gravity in it, in m/s² with +g on an axis that points up, and the sign it took.

    Raises:
        ValueError: gravity was removed from all of them, and there is no file of gravity to add.
    """
    sizes = []
    for file in candidates:
        values, unit = vector(file)
        typical = float(np.nanmedian(np.linalg.norm(values, axis=1)))
        # Without a unit in the header: Apple's systems report g, Android's m/s².
        in_g = (not unit and typical < 3.0) or (bool(unit) and factor("acc", unit) == STANDARD_GRAVITY)
        scale = STANDARD_GRAVITY if in_g else factor("acc", unit) if unit else 1.0
        sizes.append(typical * scale / STANDARD_GRAVITY)
        if GRAVITY_IN[0] < sizes[-1] < GRAVITY_IN[1]:
            sign = -1 if ios or (in_g and not unit) else 1
            return Stream(file.stamps.since(origin), sign * scale * values), sign
    if candidates and gravity:
        motion, down = candidates[0], gravity[0]
        values, unit = vector(motion)
        pull, _ = vector(down)
        scale = STANDARD_GRAVITY if float(np.nanmedian(np.linalg.norm(pull, axis=1))) < 3.0 else 1.0
        at = joined(
            {"imu/gyr": Stream(motion.stamps.since(origin), values), "imu/acc": Stream(down.stamps.since(origin), pull)}
        )
        sign = -1 if ios or scale != 1.0 else 1
        return Stream(at[0], sign * scale * (at[1]["imu/gyr"] + at[1]["imu/acc"])), sign
    raise ValueError(
        f"the accelerometer measures {', '.join(f'{size:.2f}' for size in sizes)} g: gravity was removed from it; "
        "export the accelerometer with gravity"
    )
