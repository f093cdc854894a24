"""Trajectories on disk: one HDF5 file each, written atomically, and safe reading of other HDF5 files.

Layout, version 2: attributes ``format``, ``format_version`` and ``digest``; datasets ``time``, ``mask``, ``metadata``
(JSON text), ``measurements/<place>/<kind>`` and ``truth/<quantity>``, all with a checksum of their values. The digest
(SHA-256) covers what the checksums do not: the names of groups and datasets, shapes, types, attributes and metadata.
Version 1 had no digest and is still read.

A file may be hostile: links to other files or places, values stored outside it and sizes that no file of its length can
hold are refused before anything is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ...filters.support.files import replacing

if TYPE_CHECKING:
    import h5py

R = TypeVar("R")
FORMAT = "poise-trajectory"
FORMAT_VERSION = 2
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
LARGEST = 4 * 2**30
"""bytes; arrays of a file may take no more memory."""
LARGEST_RATIO = 1100
"""Deflate compresses at most 1032 times: arrays that take more times the memory of their file are a forgery."""
DEEPEST = 16
"""Groups within groups."""


def is_trajectory_file(head: bytes, path: Path) -> bool:
    """Whether a file, given by its first bytes and its path, was written by :func:`write_trajectory_file`."""
    if not head.startswith(HDF5_SIGNATURE):
        return False
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return file.attrs.get("format") == FORMAT
    except Exception:  # h5py raises many kinds for damaged files
        # The root of a truncated file cannot be read, but its text is still there to tell where it comes from.
        return FORMAT.encode() in head


def write_trajectory_file(
    path: Path,
    time: np.ndarray,
    mask: np.ndarray,
    groups: Mapping[str, Mapping[str, np.ndarray]],
    metadata: Mapping[str, Any],
) -> Path:
    """Write the fields of a trajectory, see :meth:`poise.envs.data.trajectory.Trajectory.save`."""
    import h5py

    with replacing(path) as part, h5py.File(part, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.create_dataset("metadata", data=json.dumps(metadata, ensure_ascii=False))
        write(file, "time", time)
        write(file, "mask", mask)
        for folder, arrays in groups.items():
            group = file.create_group(folder, track_order=True)
            for name, values in arrays.items():
                write(group, name, values)
        file.attrs["digest"] = digest(file)
    return path


def write(group: h5py.Group, name: str, values: np.ndarray) -> None:
    """Write one array, compressed and with a checksum."""
    # Groups on the way to the array keep the order of their channels too.
    *places, kind = name.strip("/").split("/")
    inner = group
    try:
        for place in places:
            inner = inner[place] if place in inner else inner.create_group(place, track_order=True)
        inner.create_dataset(kind, data=values, compression="gzip", shuffle=True, fletcher32=True)
    except (ValueError, TypeError, AttributeError) as reason:
        raise ValueError(f"cannot store {name!r} in {group.name}: {reason}") from None


def read_trajectory_file(path: Path) -> dict[str, Any]:
    """Arguments of the trajectory that :func:`write_trajectory_file` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is another kind of file, of a newer version, truncated, damaged or hostile.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no trajectory file at {path}")
    return read_hdf5(path, read_fields)


def read_hdf5(path: Path, read: Callable[[h5py.File, Path], R]) -> R:
    """Open an HDF5 file, refuse a hostile one, and return ``read(file, path)``.

    Raises:
        ValueError: whatever makes the file unreadable.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            check_contents(file, path)
            return read(file, path)
    except ValueError as reason:
        raise ValueError(f"{path}: {reason}") from reason
    except Exception as reason:  # h5py raises many kinds for damaged files
        raise ValueError(f"{path} is not a readable HDF5 file; it may be truncated or damaged: {reason}") from reason


def objects(group: h5py.Group, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Everything below a group with its path, in the file's order; links other than hard ones are refused."""
    import h5py

    if depth > DEEPEST:
        raise ValueError(f"groups are nested deeper than {DEEPEST}: {prefix}")
    for name in group:
        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{prefix + name!r} is a {type(link).__name__}: links to other places are not followed")
        item = group[name]
        yield prefix + name, item
        if isinstance(item, h5py.Group):
            yield from objects(item, f"{prefix}{name}/", depth + 1)


def check_contents(file: h5py.File, path: Path) -> None:
    """Refuse links, values stored outside the file, and sizes that it cannot hold.

    Raises:
        ValueError: names the object.
    """
    import h5py

    total, largest = 0, min(LARGEST, LARGEST_RATIO * path.stat().st_size + 2**20)
    for name, item in objects(file):
        if not isinstance(item, h5py.Dataset):
            continue
        if item.external or item.is_virtual:
            raise ValueError(f"{name!r} stores its values outside the file, which is not followed")
        total += int(np.prod(item.shape or (0,), dtype=object)) * item.dtype.itemsize
        if total > largest:
            raise ValueError(
                f"{name!r} declares the shape {item.shape}: more than the {largest / 2**20:.0f} MiB that a file of "
                f"{path.stat().st_size / 2**20:.3g} MiB may hold"
            )


def digest(file: h5py.File) -> str:
    """SHA-256 of names, shapes, types and attributes of everything in a file, and of the metadata."""
    total = hashlib.sha256()
    for name, item in (("/", file), *sorted(objects(file))):
        own = {key: str(value) for key, value in item.attrs.items() if (name, key) != ("/", "digest")}
        described = [name, str(getattr(item, "shape", "group")), str(getattr(item, "dtype", "")), sorted(own.items())]
        total.update(json.dumps(described, ensure_ascii=False).encode("utf-8", "surrogateescape"))
    total.update(file["metadata"].asstr()[()].encode())
    # The order of channels is part of a trajectory.
    total.update(json.dumps([name for name, _ in objects(file)]).encode("utf-8", "surrogateescape"))
    return total.hexdigest()


def read_fields(file: h5py.File, path: Path) -> dict[str, Any]:
    """Read an open file in poise's own layout."""
    if file.attrs.get("format") != FORMAT:
        raise ValueError(f"not a {FORMAT} file: its format attribute is {file.attrs.get('format')!r}")
    version = int(file.attrs["format_version"])
    if version > FORMAT_VERSION:
        raise ValueError(f"format version {version} is newer than {FORMAT_VERSION}, which this release reads")
    missing = [name for name in ("time", "mask", "metadata", "measurements", "truth") if name not in file]
    if missing:
        raise ValueError(f"the file lacks {missing}")
    if version >= 2 and file.attrs.get("digest") != digest(file):
        raise ValueError("names, shapes, attributes or metadata do not match their checksum: the file is damaged")
    return {
        "time": file["time"][:],
        "measurements": arrays_below(file["measurements"]),
        "truth": arrays_below(file["truth"]),
        "mask": file["mask"][:],
        "metadata": json.loads(file["metadata"].asstr()[()]),
    }


def arrays_below(group: h5py.Group) -> dict[str, np.ndarray]:
    """Every dataset below a group, by its path there: ``imu/gyr``."""
    return {name: item[:] for name, item in objects(group) if hasattr(item, "dtype")}
