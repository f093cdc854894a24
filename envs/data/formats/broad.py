"""Trials of BROAD, the Berlin Robust Orientation Estimation Assessment Dataset.

D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD — A Benchmark for Robust Inertial Orientation Estimation", Data 6(7),
2021, https://doi.org/10.3390/data6070072; data at https://github.com/dlaidig/broad, CC BY 4.0. Every trial is there as
a MATLAB 5 file and as HDF5; MATLAB 7.3, which is HDF5 with transposed arrays, is read as well.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....filters.core import rotation
from .. import reference_clock
from ..storage import HDF5_SIGNATURE, read_hdf5
from ..trajectory import Trajectory
from .tables.head import Head

if TYPE_CHECKING:
    import h5py

WIDTHS = {"imu_gyr": 3, "imu_acc": 3, "imu_mag": 3, "opt_quat": 4, "opt_pos": 3, "movement": 1}
CHANNELS = {"imu_gyr": "imu/gyr", "imu_acc": "imu/acc", "imu_mag": "imu/mag"}
UNITS = {"imu/gyr": "rad/s", "imu/acc": "m/s²", "imu/mag": "µT"}
MATLAB_5, MATLAB_7 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
LICENCE = "CC BY 4.0"
SOURCE = "BROAD, Laidig et al. 2021, https://doi.org/10.3390/data6070072"


def is_broad(head: Head) -> bool:
    """Whether a file is a BROAD trial: MATLAB or HDF5 with one of its fields."""
    path = head.path
    if not head.content.startswith((MATLAB_5, MATLAB_7, HDF5_SIGNATURE)):
        return False
    import h5py
    import scipy.io

    try:
        if head.content.startswith(MATLAB_5):
            return any(name in WIDTHS for name, _, _ in scipy.io.whosmat(str(path)))
        with h5py.File(path, "r") as file:
            return any(name in WIDTHS for name in file)
    except Exception:  # scipy raises many kinds for damaged files
        # A damaged file is recognised, so that loading it tells what is wrong with it.
        return True


def load_broad(path: Path) -> list[Trajectory]:
    """Read a BROAD trial.

    Returns:
        Channels ``imu/gyr`` rad/s, ``imu/acc`` m/s², ``imu/mag`` µT; truth ``orientation`` (sensor to east,
        north, up) and ``position`` m, NaN where the optical system lost the body; the mask is the movement phase where
        the orientation is known.

    Raises:
        ValueError: the file is damaged, lacks a field, or has fields of other shapes.
    """
    with path.open("rb") as file:
        if file.read(len(MATLAB_5)) != MATLAB_5:
            trial = read_hdf5(path, lambda file, path: to_trajectory(hdf5_fields(file), path))
            return [reference_clock.measured(trial)]
    import scipy.io

    try:
        fields = scipy.io.loadmat(str(path), variable_names=[*WIDTHS, "sampling_rate"])
    except Exception as reason:  # scipy raises many kinds for damaged files
        raise ValueError(f"it is not a readable MATLAB file; it may be truncated or damaged: {reason}") from reason
    return [reference_clock.measured(to_trajectory(fields, path))]


def hdf5_fields(file: h5py.File) -> dict[str, np.ndarray]:
    """Fields of an open file, time first; the sampling rate may be a dataset or an attribute."""
    fields = {}
    for name in (*WIDTHS, "sampling_rate"):
        if name in file:
            values = np.asarray(file[name][()])
            fields[name] = values.T if "MATLAB_class" in file[name].attrs else values
        elif name in file.attrs:
            fields[name] = np.asarray(file.attrs[name])
    return fields


def to_trajectory(fields: Mapping[str, Any], path: Path) -> Trajectory:
    """Check the fields of a trial and build the trajectory."""
    missing = [name for name in (*WIDTHS, "sampling_rate") if name not in fields]
    if missing:
        raise ValueError(f"a BROAD trial has the fields {[*WIDTHS, 'sampling_rate']}; missing are {missing}")
    rate_field = np.asarray(fields["sampling_rate"], dtype=float)
    if rate_field.size != 1 or not 0.0 < rate_field.item() < np.inf:
        raise ValueError(f"sampling_rate must be one positive number of Hz, got {rate_field.tolist()}")
    rate = rate_field.item()
    arrays = {}
    for name, width in WIDTHS.items():
        array = np.asarray(fields[name])
        array = array.reshape(-1, 1) if width == 1 else array
        if array.ndim != 2 or array.shape[1] != width or array.dtype.kind not in "fiub":
            raise ValueError(f"{name} must be a real array of shape (T, {width}), got {array.dtype} {array.shape}")
        arrays[name] = array
    lengths = {name: len(array) for name, array in arrays.items()}
    if len(set(lengths.values())) != 1:
        raise ValueError(f"all fields must be equally long, got {lengths}")
    if lengths["imu_gyr"] == 0:
        raise ValueError("the recording has no samples")
    orientation = arrays["opt_quat"].astype(float)
    norms = rotation.norm(orientation)[:, 0]
    if np.any(np.abs(norms - 1.0) > 0.01):
        raise ValueError(
            f"opt_quat must hold unit quaternions, got lengths from {np.nanmin(norms)} to {np.nanmax(norms)}"
        )
    return Trajectory(
        time=np.arange(len(orientation)) / rate,
        measurements={channel: arrays[name] for name, channel in CHANNELS.items()},
        truth={"orientation": orientation / norms[:, None], "position": arrays["opt_pos"]},
        mask=arrays["movement"][:, 0].astype(bool) & np.isfinite(norms),
        metadata={
            "name": path.stem,
            "rate": rate,
            "units": UNITS,
            "group": group_of(path.stem),
            "format": "BROAD",
            "source": SOURCE,
            "licence": LICENCE,
        },
    )


def group_of(trial: str) -> str | None:
    """Group of a trial by its name: ``slow rotation``, …, ``fast combined``, ``disturbed``; None for other names."""
    if re.match(r"\d\d_disturbed_", trial):
        return "disturbed"
    match = re.match(r"\d\d_undisturbed_(slow|fast)_(rotation|translation|combined)", trial)
    return f"{match[1]} {match[2]}" if match else None
