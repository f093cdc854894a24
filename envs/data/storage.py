"""Trajectories on disk: one HDF5 file each, written whole or not at all.

Layout, version 1: attributes ``format`` and ``format_version``; datasets ``time``, ``mask``, ``metadata`` (JSON text),
``measurements/<place>/<kind>`` and ``truth/<quantity>``, all with a checksum.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...filters.support.files import replacing
from .trajectory import Trajectory

if TYPE_CHECKING:
    import h5py

FORMAT = "poise-trajectory"
FORMAT_VERSION = 1
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_trajectory_file(head: bytes, path: Path) -> bool:
    """Whether a file, given by its first bytes and its path, was written by :func:`save_trajectory`."""
    if not head.startswith(HDF5_SIGNATURE):
        return False
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return file.attrs.get("format") == FORMAT
    except OSError:
        # The root of a truncated file cannot be read, but its text is still there to tell where it comes from.
        return FORMAT.encode() in head


def save_trajectory(trajectory: Trajectory, path: str | Path) -> Path:
    """Write a trajectory; a file that was there before stays whole until the new one is complete.

    Args:
        trajectory: what to write.
        path: the file, by custom ``*.h5``; missing folders are made.

    Returns:
        The path.

    Raises:
        ValueError: a name cannot be stored, such as channels ``a`` and ``a/b`` together.
        OSError: the folder cannot be written.
    """
    import h5py

    with replacing(path) as part, h5py.File(part, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.create_dataset("metadata", data=json.dumps(trajectory.metadata, ensure_ascii=False))
        write(file, "time", trajectory.time)
        write(file, "mask", trajectory.mask)
        for folder in ("measurements", "truth"):
            group = file.create_group(folder, track_order=True)
            for name, values in getattr(trajectory, folder).items():
                write(group, name, values)
    return Path(path)


def write(group: h5py.Group, name: str, values: np.ndarray) -> None:
    """Write one array, compressed and with a checksum."""
    try:
        group.create_dataset(name, data=values, compression="gzip", shuffle=True, fletcher32=True, track_order=False)
    except (ValueError, TypeError) as reason:
        raise ValueError(f"cannot store {name!r} in {group.name}: {reason}") from None


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that :func:`save_trajectory` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is another kind of file, of a newer version, truncated or damaged.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no trajectory file at {path}")
    return read_hdf5(path, read_trajectory)


def read_hdf5(path: Path, read: Any) -> Trajectory:
    """Open an HDF5 file and return ``read(file, path)``; every way to be unreadable becomes a ValueError."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return read(file, path)
    except ValueError as reason:
        raise ValueError(f"{path}: {reason}") from reason
    except (OSError, KeyError, RuntimeError) as reason:
        raise ValueError(f"{path} is not a readable HDF5 file; it may be truncated or damaged: {reason}") from reason


def read_trajectory(file: h5py.File, path: Path) -> Trajectory:
    """Read an open file in poise's own layout."""
    if file.attrs.get("format") != FORMAT:
        raise ValueError(f"not a {FORMAT} file: its format attribute is {file.attrs.get('format')!r}")
    version = int(file.attrs["format_version"])
    if version > FORMAT_VERSION:
        raise ValueError(f"format version {version} is newer than {FORMAT_VERSION}, which this release reads")
    missing = [name for name in ("time", "mask", "metadata", "measurements", "truth") if name not in file]
    if missing:
        raise ValueError(f"the file lacks {missing}")
    return Trajectory(
        time=file["time"][:],
        measurements=arrays_below(file["measurements"]),
        truth=arrays_below(file["truth"]),
        mask=file["mask"][:],
        metadata=json.loads(file["metadata"].asstr()[()]),
    )


def arrays_below(group: h5py.Group) -> dict[str, np.ndarray]:
    """Every dataset below a group, by its path there: ``imu/gyr``."""
    found: dict[str, np.ndarray] = {}

    def visit(name: str, item: Any) -> None:
        if hasattr(item, "dtype"):
            found[name] = item[:]

    group.visititems(visit)
    return found
