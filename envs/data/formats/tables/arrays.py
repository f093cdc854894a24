"""Tables out of array files: NumPy (without pickles), MATLAB, HDF5 of others, and Parquet."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...storage import HDF5_SIGNATURE, LARGEST, LARGEST_RATIO, objects, read_hdf5
from .frame import as_named, table_of_frame
from .head import decode, is_text
from .packed import OPENERS, ZIP, content_of, is_archive_of_arrays
from .records import read_json
from .rows import widened
from .table import Table
from .text import read_text

NPY, PARQUET, MATLAB = b"\x93NUMPY", b"PAR1", b"MATLAB"
MOST_NAMES = 1000
"""Texts in a list of names of columns."""


OTHERS: dict[bytes, str] = {
    b"version https://git-lfs": "is a pointer of Git LFS; fetch the file itself (git lfs pull)",
    b"\x80\x04": "is a pickle, which can run any program; save its arrays as .npz or its table as CSV or Parquet",
    b"\x80\x05": "is a pickle, which can run any program; save its arrays as .npz or its table as CSV or Parquet",
    b"ARROW1": "is an Arrow (Feather) file; save it as Parquet",
    b"\x28\xb5\x2f\xfd": "is compressed (zstd); unpack it first",
    b"7z\xbc\xaf": "is a 7z archive; unpack it first",
    b"Rar!": "is a RAR archive; unpack it first",
    b"\xd0\xcf\x11\xe0": "is an old spreadsheet (xls); save its table as CSV",
    b"%PDF": "is a PDF; export the data as CSV",
    b"SQLite format 3": "is an SQLite data base; export the table as CSV (sqlite3 -csv FILE 'select …')",
    b"#ROSBAG": "is a ROS bag; export its topic sensor_msgs/Imu as CSV (rostopic echo -b FILE -p TOPIC)",
    b"\x89MCAP": "is an MCAP file; export its topic sensor_msgs/Imu as CSV",
    b"ULog": "is a PX4 log; convert it by ulog2csv and load …_sensor_combined_0.csv",
    b"H Product:Blackbox": "is a Betaflight log; convert it by blackbox_decode",
}
"""First bytes of files of other kinds → what such a file is and how its data come out."""
INSIDE: dict[tuple[int, bytes], str] = {
    (8, b".FIT"): "is a Garmin FIT file; convert it by FitCSVTool",
    (4, b"ftyp"): "is a video (MP4); export its motion data (GPMF) as CSV",
}
"""The same further inside: place and bytes."""


def read_table(path: Path) -> Table:
    """Read the table of a file, whose kind is told by its content.

    Raises:
        ValueError: it holds no table, is damaged, or declares more than it can hold.
        ImportError: a Parquet file, and neither pyarrow nor fastparquet is installed.
    """
    with path.open("rb") as file:
        head = file.read(4096)
    if head.startswith(NPY):
        return as_table({"array": load_npy(path)}, "NumPy array")
    if head.startswith(ZIP) and is_archive_of_arrays(path):
        return as_table(load_npz(path), "NumPy archive")
    if head.startswith((ZIP, *OPENERS)):
        head = content_of(path, len(head))
        if not is_text(head):
            raise ValueError("it is packed, and no text is in it; unpack it first")
    if head.startswith(PARQUET):
        return read_parquet(path)
    if head.startswith(HDF5_SIGNATURE) or b"MATLAB 7.3" in head[:128]:
        return as_table(read_hdf5(path, hdf5_arrays), "HDF5 file")
    if head.startswith(MATLAB):
        return as_table(load_mat(path), "MATLAB file")
    # files of another kind, and what to do
    others = [text for start, text in OTHERS.items() if head.startswith(start)]
    others += [text for (at, sign), text in INSIDE.items() if head[at:].startswith(sign)]
    if others:
        raise ValueError(f"it {others[0]}")
    if is_text(head):
        if head.lstrip()[:1] == b"<":
            raise ValueError("it is XML; save its samples as a table, such as CSV, one row a sample")
        if is_json(decode(head)):
            return widened(read_json(path))
        return widened(read_text(path))
    raise ValueError("it is empty" if not head else "it is neither a text nor a NumPy, MATLAB, HDF5 or Parquet file")


def is_json(text: str) -> bool:
    """Whether a text begins as JSON does, and not with the title of a section, ``[Header]``."""
    return re.match(r"\s*(\{|\[\s*([\[{\"\d-]|$))", text) is not None


def as_table(arrays: dict[str, Any], kind: str) -> Table:
    """Numeric arrays of one or two dimensions and at least two rows, time along the first.

    Single numbers and texts are the preamble, ``fs: 100``; a list of texts names the columns of a matrix beside it.
    """
    found: dict[str, np.ndarray] = {}
    preamble: list[str] = []
    texts: list[np.ndarray] = []
    for name, values in fields_of_structures(arrays):
        array = np.ma.filled(np.ma.asarray(values).astype(float), np.nan) if np.ma.isMaskedArray(values) else values
        array = np.asarray(array)
        array = array.reshape(-1) if array.ndim == 2 and 1 in array.shape else array
        if array.dtype.kind in "Mm":
            name, array = f"{name} (ns)", array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64)
        if array.size == 1 and array.dtype.kind in "fiuU":
            preamble.append(f"{name.rpartition('/')[2]}: {array.item()}")
        if array.dtype.kind == "U" and array.ndim == 1:
            texts.append(array)
        if array.dtype.kind in "fiub" and array.ndim in (1, 2) and array.size > 1:
            found[name] = time_first(array)
    for name, matrix in [each for each in found.items() if each[1].ndim == 2]:
        heads = [each.tolist() for each in texts if len(set(each.tolist())) == matrix.shape[1] > 4]
        if heads:
            del found[name]
            found |= {str(head): matrix[:, column] for column, head in enumerate(heads[0])}
    if len(found) == 1 and next(iter(found.values())).ndim == 2:
        # A single array of all columns: they go by their numbers.
        matrix = next(iter(found.values()))
        columns = {str(column): matrix[:, column] for column in range(matrix.shape[1])}
        return Table(columns, preamble=tuple(preamble), kind=kind, named=False)
    if not found:
        raise ValueError(f"the {kind} holds no numeric array")
    return replace(as_named(found, kind), preamble=tuple(preamble))


def fields_of_structures(arrays: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Arrays by their names, those of structured ones by ``name/field``."""
    for name, values in arrays.items():
        if getattr(values, "dtype", np.dtype(float)).names:
            whole = {f"{name}/{field}".removeprefix("array/"): values[field] for field in values.dtype.names}
            for inner, part in fields_of_structures(whole):
                yield inner, part.reshape(len(part), -1) if part.ndim > 1 else part
        else:
            yield name, values


def time_first(array: np.ndarray) -> np.ndarray:
    """An array with time along its first axis; some programs write it along the second."""
    return array.T if array.ndim == 2 and array.shape[0] <= 9 < array.shape[1] else array


def load_npy(path: Path) -> np.ndarray:
    """One array, not pickled."""
    try:
        array = np.load(path, allow_pickle=False, mmap_mode="r")
    except (ValueError, EOFError, OSError) as reason:
        raise ValueError(f"it is not a readable NumPy array (pickled objects are not loaded): {reason}") from None
    return np.array(array)


def load_npz(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an archive, dates in whole ns; what declares more than its file can hold is not unpacked."""
    try:
        with zipfile.ZipFile(path) as archive:
            total = sum(entry.file_size for entry in archive.infolist())
            if any(entry.filename.startswith("xl/") for entry in archive.infolist()):
                raise ValueError("it is a spreadsheet; save its table as CSV")
            if total > min(LARGEST, LARGEST_RATIO * path.stat().st_size + 2**20):
                raise ValueError(f"it declares {total / 2**20:.0f} MiB, more than a file of its size can hold")
            for entry in archive.infolist():
                with archive.open(entry) as file:
                    check_declared(file, entry)
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        dates = {name: array for name, array in arrays.items() if array.dtype.kind in "Mm"}
        whole = {name: array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64) for name, array in dates.items()}
        return {name: array for name, array in (arrays | whole).items() if array.dtype.kind in "fiubUcV"}
    except (zipfile.BadZipFile, EOFError, OSError, KeyError) as reason:
        raise ValueError(f"it is not a readable NumPy archive; it may be truncated: {reason}") from None


def check_declared(file: Any, entry: zipfile.ZipInfo) -> None:
    """Refuse an array whose header declares more than its entry holds, or pickled objects."""
    if not entry.filename.endswith(".npy"):
        return
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    if dtype.hasobject:
        raise ValueError(f"{entry.filename} holds pickled objects, which are not loaded")
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize if shape else dtype.itemsize
    if size > entry.file_size:
        raise ValueError(f"{entry.filename} declares the shape {shape}, more than it holds")


def load_mat(path: Path) -> dict[str, Any]:
    """Arrays of a MATLAB 5 file; fields of structures by ``structure/field``."""
    import scipy.io

    try:
        fields = scipy.io.loadmat(str(path), simplify_cells=True)
    except Exception as reason:  # scipy raises many kinds for damaged files
        raise ValueError(f"it is not a readable MATLAB file; it may be truncated or damaged: {reason}") from None
    flat: dict[str, Any] = {}

    def visit(prefix: str, value: Any) -> None:
        if isinstance(value, dict):
            for name, inner in value.items():
                if not str(name).startswith("__"):
                    visit(f"{prefix}/{name}" if prefix else str(name), inner)
        elif isinstance(value, str) or (len(np.shape(value)) == 1 and all(isinstance(one, str) for one in value)):
            flat[prefix] = np.array(value)
        elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
            # An array of structures.
            for number, inner in enumerate(np.ravel(np.asarray(value, dtype=object))):
                visit(f"{prefix}{number + 1}", inner)
        elif isinstance(value, np.ndarray | int | float):
            flat[prefix] = np.asarray(value)

    visit("", fields)
    return flat


def hdf5_arrays(file: Any, path: Path) -> dict[str, np.ndarray]:
    """Datasets of numbers, texts and structures by their paths, those of MATLAB 7.3 transposed, and attributes."""
    found = {
        name: np.asarray(value)
        for name, value in file.attrs.items()
        if isinstance(value, str | int | float | np.number)
    }
    for name, item in objects(file):
        if not hasattr(item, "dtype") or name.startswith("#refs#"):
            continue
        if item.dtype.kind in "fiubV":
            unit = first_text(item.attrs.get("units", item.attrs.get("Units", item.attrs.get("unit", ""))))
            values = item[()].T if "MATLAB_class" in item.attrs else item[()]
            found[f"{name} ({unit})" if unit else name] = values
        elif item.dtype.kind in "SO" and item.ndim == 1 and item.size <= MOST_NAMES:
            found[name] = np.array([first_text(one) for one in item[()].tolist()])
    return found


def first_text(value: Any) -> str:
    """A text of HDF5, or the one that all of an array are; empty of others."""
    several = {each if isinstance(each, bytes | str) else "" for each in np.ravel(value).tolist()}
    one = several.pop() if len(several) == 1 else ""
    return one.decode(errors="replace") if isinstance(one, bytes) else one


def read_parquet(path: Path) -> Table:
    """A Parquet table; texts are left out, dates become ns."""
    import pandas

    try:
        frame = pandas.read_parquet(path)
    except ImportError:
        raise ImportError(f"{path} is a Parquet file: pip install pyarrow to read it") from None
    except Exception as reason:  # pyarrow raises many kinds for damaged files
        raise ValueError(f"it is not a readable Parquet file: {reason}") from None
    if frame.index.name or frame.index.dtype.kind in "mM":
        frame = frame.rename_axis(index=frame.index.name or "time").reset_index()
    return widened(table_of_frame(frame, "Parquet table"))
