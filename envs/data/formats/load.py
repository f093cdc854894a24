"""Read recordings of real sensors; the format is told by the content of the file, not by its name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from ..calibration.records import CalibrationRecord, apply_calibration
from ..storage import FORMAT, is_trajectory_file
from ..trajectory import Trajectory, load_trajectory
from .broad import is_broad, load_broad
from .dot import is_dot, load_dot

HEAD_LENGTH = 4096
"""Bytes of a file that the recognisers see."""


@dataclass(frozen=True)
class RecordingFormat:
    """A file format that can be read.

    Attributes:
        name: for messages.
        recognises: whether a file, given by its first bytes and its path, is of this format; must not raise.
        load: path → trajectory.
    """

    name: str
    recognises: Callable[[bytes, Path], bool]
    load: Callable[[Path], Trajectory]


FORMATS: tuple[RecordingFormat, ...] = (
    RecordingFormat(f"{FORMAT} (HDF5)", is_trajectory_file, load_trajectory),
    RecordingFormat("BROAD (MATLAB or HDF5)", is_broad, load_broad),
    RecordingFormat("Movella/Xsens DOT export (CSV)", is_dot, load_dot),
)


def load_recording(path: str | Path, calibration: CalibrationRecord | str | Path | None = None) -> Trajectory:
    """Read a recording.

    Accepted are trajectories saved by this package, trials of BROAD (MATLAB 5, MATLAB 7.3 and HDF5 files), and CSV
    exports of Movella/Xsens DOT sensors.

    Args:
        path: the file; its extension does not matter.
        calibration: record (or its file) that turns raw readings into SI units, see ``poise calibrate``; None where
            the readings are calibrated.

    Returns:
        The recording in SI units, with the truth ``orientation`` and ``position`` if it brings an optical reference.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is empty, truncated, of another format, or has contents that contradict its format; the
            message names the file and what is accepted. Or the calibration does not fit its channels.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(
            f"no recording at {path}: {'it is a folder' if path.is_dir() else 'there is no such file'}"
        )
    recording_format = recognise(path)
    if recording_format is None:
        accepted = ", ".join(known.name for known in FORMATS)
        state = "is empty" if path.stat().st_size == 0 else "is of no known format, or truncated"
        raise ValueError(f"{path} {state}; accepted are {accepted}")
    trajectory = recording_format.load(path)
    return trajectory if calibration is None else apply_calibration(trajectory, calibration)


def recognise(path: Path) -> RecordingFormat | None:
    """The format of a file, or None."""
    with path.open("rb") as file:
        head = file.read(HEAD_LENGTH)
    return next((known for known in FORMATS if known.recognises(head, path)), None)


def recording_files(paths: Iterable[Path]) -> list[Path]:
    """Files as they are, folders as the recordings below them; see :func:`find_recordings`."""
    return [file for path in paths for file in (find_recordings(path) if path.is_dir() else [path])]


def find_recordings(folder: str | Path) -> list[Path]:
    """Files below ``folder``, at any depth, whose format :func:`load_recording` recognises, sorted.

    Raises:
        FileNotFoundError: there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"no folder of recordings at {folder}")
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return sorted(path for path in files if recognise(path) is not None)
