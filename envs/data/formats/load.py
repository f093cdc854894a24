"""Read recordings of real sensors; the format is told by the content of the file, not by its name."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ....filters.support.files import as_path
from ....filters.support.names import unknown
from ..calibration.records import CalibrationRecord, apply_calibration, as_record
from ..reference_clock import measured
from ..storage import FORMAT, HDF5_SIGNATURE, is_trajectory_file
from ..trajectory import Trajectory, load_trajectory
from .benchmarks import euroc_root, is_archive, is_repoimu, load_archive, load_euroc, load_phone, load_repoimu
from .broad import is_broad, load_broad
from .described import complete, load_described, mapping_of, with_checked_orientation
from .dot import is_dot, is_xsens, load_dot, load_xsens
from .draft import explanation
from .folders import is_folder_of_streams, is_member, load_member
from .mapping import RecordingMap, apply_map, make_map, read_map
from .tables.arrays import MATLAB, PARQUET, is_json, read_table
from .tables.cells import SENSOR
from .tables.head import Head
from .tables.rows import widened
from .tables.text import table_of


@dataclass(frozen=True)
class RecordingFormat:
    """A format that can be read.

    Attributes:
        name: for messages.
        recognises: whether a file or a folder is of this format; must not raise.
        load: path → trajectories, one a sensor.
    """

    name: str
    recognises: Callable[[Head], bool]
    load: Callable[[Path], list[Trajectory]]


def load_own(path: Path) -> list[Trajectory]:
    """Read a trajectory file of this package."""
    return [load_trajectory(path)]


def load_map(path: Path) -> list[Trajectory]:
    """Read the table that a mapping beside it describes; drafts are made by ``poise inspect --write-map``."""
    data, mapping = read_map(path)
    return mapped(data, mapping)


def is_described(head: Head) -> bool:
    """Whether a table names its columns and their units."""
    arrays = head.content.startswith((PARQUET, HDF5_SIGNATURE, MATLAB))
    if not head.text and not arrays:
        return False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            whole = arrays or is_json(head.text)
            table = read_table(head.path) if whole else widened(table_of(head.text, head.path.name))
            if any(SENSOR.search(name) and name not in table.labels for name in table.texts):
                # The first rows may be of one sensor only.
                table = read_table(head.path)
            return complete(table, mapping_of(table))
    except (ValueError, ImportError):
        return False


def load_any_described(path: Path) -> list[Trajectory]:
    """Read a table whose header names columns and units; several sensors, quaternions as onboard orientation."""
    table = read_table(path)
    header = " ".join((*table.preamble, *list(table.arrays)[:3]))
    makers = {"Test Name": "APDM Moveo", "Shimmer": "Shimmer Consensys", "Accelerometer X": "x-io"}
    name = next((maker for word, maker in makers.items() if word in header), "table with units")
    return load_described(path, table, name)


def is_map(head: Head) -> bool:
    """Whether a file is a mapping in TOML."""
    return head.path.suffix.lower() == ".toml" and "[columns]" in head.text


FORMATS: tuple[RecordingFormat, ...] = (
    RecordingFormat(f"{FORMAT} (HDF5)", lambda head: is_trajectory_file(head.content, head.path), load_own),
    RecordingFormat("BROAD (MATLAB or HDF5)", is_broad, load_broad),
    RecordingFormat("Movella/Xsens DOT export (CSV)", is_dot, load_dot),
    RecordingFormat("Xsens MT Manager export (text)", is_xsens, load_xsens),
    RecordingFormat("RepoIMU (CSV)", is_repoimu, load_repoimu),
    RecordingFormat("EuRoC (folder)", lambda head: euroc_root(head.path) is not None, load_euroc),
    RecordingFormat("x-io x-IMU3, NGIMU (folder)", is_member, load_member),
    RecordingFormat("phone: phyphox, Sensor Logger, SensLogs (folder)", is_folder_of_streams, load_phone),
    RecordingFormat("NumPy archive of t, gyr, acc (npz)", is_archive, load_archive),
    RecordingFormat("mapping (TOML)", is_map, load_map),
    RecordingFormat(
        "table with units in its header: x-io Fusion, APDM Moveo, Shimmer Consensys, …",
        is_described,
        load_any_described,
    ),
)


def load_recording(
    path: str | Path,
    calibration: CalibrationRecord | str | Path | None = None,
    *,
    sensor: str | None = None,
    columns: Mapping[str, str | Sequence[str | int]] | None = None,
    units: Mapping[str, str] | None = None,
    signs: Mapping[str, float | Sequence[float]] | None = None,
    rate: float | None = None,
    time: str | int | None = None,
    reference: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
) -> Trajectory:
    """Read a recording of one sensor.

    The format is recognised by the content: see ``docs/recordings.md`` for the list. With ``columns`` any table is read
    (text, NumPy ``.npy`` and ``.npz``, MATLAB, HDF5, Parquet); a TOML file beside the data says the same.

    Args:
        path: the file, or the folder of a device that writes a file a stream.
        calibration: record (or its file) that turns raw readings into SI units, see ``poise calibrate``; None where
            the readings are calibrated.
        sensor: which one, of a file with several; by default the first, with a warning.
        columns: channel (``gyr``, ``acc``, ``mag``; ``chest/gyr`` where there are several sensors) → three names or
            numbers of columns, or the name of an array.
        units: channel → unit (``deg/s``, ``g``, …), and ``time`` → ``s``, ``ms``, ``us`` or ``ns``. By default what the
            header says, else SI.
        signs: channel → −1, or a sign for each axis.
        rate: nominal sampling rate in Hz; needed where there is no time.
        time: column of the time.
        reference: orientation in the file: ``columns`` (quaternion, matrix or roll, pitch, yaw) and, where they differ
            from the default, ``order`` (``wxyz``), ``conjugate`` (False), ``frame`` (``enu``), ``role`` (``truth``, or
            ``onboard`` for the device's own estimate), ``sensor``, ``position``.

    Returns:
        The recording in SI units, with the channels ``imu/gyr``, ``imu/acc`` and so on; the truth ``orientation`` and
        ``position`` if it brings a reference, and the channel ``imu/onboard_orientation`` if the device estimated one.
        ``metadata["reference_clock_offset"]`` is how far the reference runs ahead of the gyroscope, s.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is empty, truncated, of another format, or has contents that contradict its format; the
            message names the file and what is accepted. Or an argument is none of those above.
    """
    path = as_path(path, "path of a recording")
    if not isinstance(sensor, str | None):
        raise ValueError(f"sensor must be the name of one, got {sensor!r}")
    if path.is_dir() and recognise(path) is None:
        raise FileNotFoundError(
            f"no recording at {path}: it is a folder; poise.load_recordings reads all that are in it"
        )
    given = {"columns": columns, "units": units, "signs": signs, "rate": rate, "time": time, "reference": reference}
    trajectories = load_recordings(
        path, calibration, **{name: value for name, value in given.items() if value is not None}
    )
    named = {str(one.metadata.get("sensor", "imu")): one for one in trajectories}
    if sensor is not None:
        chosen = [one for name, one in named.items() if name.lower() == sensor.lower()]
        if not chosen:
            raise ValueError(f"{path}: {unknown('sensor', sensor, named)}")
        return chosen[0]
    if len(trajectories) > 1:
        warnings.warn(
            f"{path} holds several sensors ({', '.join(named)}); this is the first: name another with sensor=…, or "
            "read all with poise.load_recordings",
            stacklevel=2,
        )
    return trajectories[0]


def load_recordings(
    path: str | Path, calibration: CalibrationRecord | str | Path | None = None, **mapping: Any
) -> list[Trajectory]:
    """Read all sensors of a file, or all recordings of a folder.

    Args:
        path: a file or folder.
        calibration: see :func:`load_recording`.
        mapping: ``columns`` and so on, see :func:`load_recording`.

    Returns:
        A trajectory for every sensor; for a folder that is not a recording itself, those of all recordings in it.

    Raises:
        FileNotFoundError: there is no such path.
        ValueError: see :func:`load_recording`.
    """
    path = as_path(path, "path of a recording")
    if calibration is not None:
        calibration = as_record(calibration)
    if not path.exists():
        raise FileNotFoundError(f"no recording at {path}: there is no such file")
    if not path.is_dir() and not path.is_char_device() and not path.is_file():
        raise ValueError(f"{path} is neither a file nor a folder")
    if mapping:
        trajectories = with_path(path, lambda: mapped(path, chosen_map(path, mapping)))
    else:
        known = recognise(path)
        if known is None and path.is_dir():
            files = find_recordings(path)
            if not files:
                raise FileNotFoundError(f"no recording at {path}: it is a folder without recordings")
            return all_of(path, files, calibration)
        if known is None:
            raise ValueError(unknown_file(path))
        trajectories = with_path(path, lambda: known.load(path))
    if calibration is not None:
        return [apply_calibration(one, calibration) for one in trajectories]
    return trajectories


def all_of(folder: Path, files: list[Path], calibration: CalibrationRecord | str | Path | None) -> list[Trajectory]:
    """Trajectories of the files of a folder; those that cannot be read are named in warnings."""
    trajectories: list[Trajectory] = []
    for file in files:
        try:
            trajectories += load_recordings(file, calibration)
        except ValueError as reason:
            warnings.warn(f"passed over: {reason}", stacklevel=3)
    if not trajectories:
        raise ValueError(f"none of the {len(files)} recordings in {folder} can be read")
    return trajectories


def chosen_map(path: Path, given: Mapping[str, Any]) -> RecordingMap:
    """The mapping of arguments; without columns those that the names of the table tell."""
    arguments = dict(given)
    if "columns" not in arguments:
        drafted = mapping_of(read_table(path))
        known = {name.rpartition("/")[2] for name in drafted.columns}
        if not drafted.columns or not {"gyr", "acc"} & set(arguments.get("units", ())) <= known:
            raise ValueError(explanation(path))
        arguments["columns"] = {name.removeprefix("imu/"): list(names) for name, names in drafted.columns.items()}
        arguments.setdefault("time", drafted.time)
        if arguments["time"] is None and drafted.rate is not None:
            arguments.setdefault("rate", drafted.rate)
        made = make_map(**arguments)
        units = {name.removeprefix("imu/"): unit for name, unit in drafted.units.items()} | dict(made.units)
        return replace(made, units=units, reference=made.reference or drafted.reference)
    return make_map(**arguments)


def mapped(path: Path, mapping: RecordingMap) -> list[Trajectory]:
    """Trajectories of a mapping, with checked onboard orientations and measured reference clocks."""
    if path.is_dir():
        raise ValueError("it is a folder; a mapping describes one file")
    if not any(name.rpartition("/")[2] in ("gyr", "acc") for name in mapping.columns):
        raise ValueError(f"columns must name 'gyr' or 'acc', got {list(mapping.columns)}")
    return [measured(with_checked_orientation(one)) for one in apply_map(read_table(path), mapping, path)]


def with_path(path: Path, load: Callable[[], list[Trajectory]]) -> list[Trajectory]:
    """What ``load`` returns; its errors name the path."""
    try:
        return load()
    except ValueError as reason:
        text = str(reason)
        raise ValueError(text if text.startswith(str(path)) else f"{path}: {text}") from reason


def unknown_file(path: Path) -> str:
    """What is said about a file of no known format."""
    if is_folder_of_streams(Head(path.parent)):
        return f"{path} is one stream of a device that writes a file a sensor: load its folder, {path.parent}"
    accepted = ", ".join(known.name for known in FORMATS)
    if path.stat().st_size == 0:
        return f"{path} is empty. Known formats: {accepted}"
    return f"{path} is of no known format, or truncated: {explanation(path)}. Known formats: {accepted}"


def recognise(path: Path) -> RecordingFormat | None:
    """The format of a file or folder, or None."""
    head = Head(path)
    return next((known for known in FORMATS if known.recognises(head)), None)


def recording_files(paths: Iterable[Path]) -> list[Path]:
    """Files as they are, folders as the recordings in them; see :func:`find_recordings`."""
    return [file for path in paths for file in (find_recordings(path) if path.is_dir() else [path])]


def find_recordings(folder: str | Path) -> list[Path]:
    """Recordings in ``folder``, at any depth: files and folders that :func:`load_recording` recognises, sorted.

    A folder that is a recording is one path, its files are none. A file that a mapping beside it names is read through
    the mapping.

    Raises:
        FileNotFoundError: there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"no folder of recordings at {folder}")
    known = recognise(folder)
    if known is not None:
        return [folder]
    found: list[Path] = []
    mapped_files: set[Path] = set()
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            # A link may lead upwards.
            found += [] if path.is_symlink() else find_recordings(path)
        elif path.is_file() and recognise(path) is not None:
            found.append(path)
            if is_map(Head(path)):
                mapped_files |= data_of(path)
    return sorted(path for path in found if path not in mapped_files)


def data_of(path: Path) -> set[Path]:
    """The file that a mapping names, if it names one."""
    try:
        return {read_map(path)[0]}
    except ValueError:
        return set()
