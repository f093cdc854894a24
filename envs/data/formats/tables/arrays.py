"""Tables out of array files: NumPy (without pickles), MATLAB, HDF5 of others, and Parquet."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...storage import HDF5_SIGNATURE, LARGEST, LARGEST_RATIO, objects, read_hdf5
from .cells import labels_of, numeric
from .head import decode, is_text
from .packed import OPENERS, ZIP, content_of, is_archive_of_arrays
from .rows import widened
from .table import Table, split_unit
from .text import read_text

if TYPE_CHECKING:
    import pandas

NPY, PARQUET, MATLAB = b"\x93NUMPY", b"PAR1", b"MATLAB"


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


def other_kind(head: bytes) -> str | None:
    """What a file of another kind is, and what to do; None of unknown ones."""
    explanation = next((text for start, text in OTHERS.items() if head.startswith(start)), None)
    return explanation or next((text for (at, sign), text in INSIDE.items() if head[at:].startswith(sign)), None)


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
    other = other_kind(head)
    if other is not None:
        raise ValueError(f"it {other}")
    if is_text(head):
        if head.lstrip()[:1] == b"<":
            raise ValueError("it is XML; save its samples as a table, such as CSV, one row a sample")
        if head.lstrip()[:1] in (b"{", b"["):
            return widened(read_json(path))
        return widened(read_text(path))
    raise ValueError("it is empty" if not head else "it is neither a text nor a NumPy, MATLAB, HDF5 or Parquet file")


def as_table(arrays: dict[str, Any], kind: str) -> Table:
    """Numeric arrays of one or two dimensions and at least two rows, time along the first."""
    found: dict[str, np.ndarray] = {}
    for name, values in arrays.items():
        array = np.ma.filled(np.ma.asarray(values).astype(float), np.nan) if np.ma.isMaskedArray(values) else values
        array = np.asarray(array)
        if array.dtype.names:
            found |= {field: np.ravel(array[field]) for field in array.dtype.names}
            continue
        array = array.reshape(-1) if array.ndim == 2 and 1 in array.shape else array
        if array.dtype.kind not in "fiub" or array.ndim not in (1, 2) or array.size == 0:
            continue
        found[name] = time_first(array)
    if len(found) == 1 and next(iter(found.values())).ndim == 2:
        # A single array of all columns: they go by their numbers.
        matrix = next(iter(found.values()))
        return Table({str(column): matrix[:, column] for column in range(matrix.shape[1])}, kind=kind, named=False)
    if not found:
        raise ValueError(f"the {kind} holds no numeric array")
    return as_named(found, kind)


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
        return {name: array for name, array in (arrays | whole).items() if array.dtype.kind in "fiubUc"}
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
        elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
            # An array of structures.
            for number, inner in enumerate(np.ravel(np.asarray(value, dtype=object))):
                visit(f"{prefix}{number + 1}", inner)
        elif isinstance(value, np.ndarray | int | float):
            flat[prefix] = np.asarray(value)

    visit("", fields)
    return flat


def hdf5_arrays(file: Any, path: Path) -> dict[str, np.ndarray]:
    """All numeric datasets by their paths; those of MATLAB 7.3 transposed."""
    found = {}
    for name, item in objects(file):
        if hasattr(item, "dtype") and item.dtype.kind in "fiub" and not name.startswith("#refs#"):
            unit = item.attrs.get("units", item.attrs.get("Units", item.attrs.get("unit", "")))
            unit = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
            found[f"{name} ({unit})" if unit else name] = item[()].T if "MATLAB_class" in item.attrs else item[()]
    return found


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


def table_of_frame(frame: pandas.DataFrame, kind: str) -> Table:
    """A table of a frame; texts are left out, dates become ns."""
    import pandas

    arrays: dict[str, np.ndarray] = {}
    labels: dict[str, np.ndarray] = {}
    for name, column in frame.items():
        if column.dtype.kind == "m":
            values: np.ndarray | None = column.to_numpy("timedelta64[ns]").astype(np.int64)
        elif column.dtype.kind == "M":
            values = pandas.to_datetime(column, utc=True).to_numpy("datetime64[ns]").astype(np.int64)
        elif column.map(np.ndim).any():
            rows = [list(each) if isinstance(each, list | tuple | np.ndarray) else [] for each in column]
            if {len(row) for row in rows} == {3} and all(isinstance(one, int | float) for row in rows for one in row):
                arrays |= {f"{name}_{axis}": np.array(rows, dtype=float)[:, i] for i, axis in enumerate("xyz")}
            continue
        else:
            values, _ = numeric(column)
        found = labels_of(str(name), column, values)
        labels |= {str(name): found} if found is not None else {}
        if values is not None:
            arrays[f"{name} (ns)" if column.dtype.kind in "mM" else str(name)] = values
    return replace(as_named(arrays, kind), labels=labels)


def as_named(arrays: dict[str, np.ndarray], kind: str) -> Table:
    """A table of arrays whose names may end with a unit."""
    parts = [split_unit(name) for name in arrays]
    units = {name: unit for name, unit in parts if unit}
    return Table({name: values for (name, _), values in zip(parts, arrays.values(), strict=True)}, units, kind=kind)


def columns_or_records(text: str) -> Any:
    """The records of a JSON object that has one list of them, or lists of equal length for columns; else None."""
    import json

    try:
        whole = json.loads(text)
    except (ValueError, RecursionError):
        return None
    lists = {name: one for name, one in whole.items() if isinstance(one, list)} if isinstance(whole, dict) else {}
    if len(lists) == 1:
        return next(iter(lists.values()))
    flat = lists and all(isinstance(one, int | float | str | None) for each in lists.values() for one in each)
    if not flat or len({len(each) for each in lists.values()}) != 1:
        return None
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]


def read_json(path: Path) -> Table:
    """A list of records, or a record a line, of numbers and of records of numbers."""
    import json

    import pandas

    text = decode(content_of(path)).strip()
    try:
        records = json.loads(text) if text.startswith("[") else [json.loads(line) for line in text.splitlines()]
    except (ValueError, RecursionError):
        records = None
    if text.startswith("{") and (records is None or len(records) == 1):
        records = columns_or_records(text)
    alike = isinstance(records, list) and len(records) > 1 and all(isinstance(one, dict) for one in records)
    if not alike:
        raise ValueError(
            "it is JSON, but no list of records; save its samples as a table, such as CSV, one row a sample"
        )
    return table_of_frame(pandas.json_normalize(records, max_level=3), "JSON records")
