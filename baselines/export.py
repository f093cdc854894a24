"""Estimates in files: tables for any program, orientations for OpenSim."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..envs.data.resampling import between, neighbours
from ..filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, Estimate
from ..filters.support.files import replacing, write_text
from ..filters.support.optional import extra

if TYPE_CHECKING:
    import pandas


def write_estimates(estimates: Mapping[str, Estimate], path: str | Path) -> Path:
    """Write the tables of :meth:`Estimate.to_frame` of one or several sensors.

    ========== =====================================================================================================
    ``.csv``   one row per sample; several sensors below each other, named in the first column ``sensor``
    .parquet   the same (needs the package pyarrow)
    ``.h5``    one group per sensor, one data set per column, its unit in the attribute ``unit``
    ``.npz``   one array per column, ``sensor/column`` for several sensors
    ``.sto``   orientations for OpenSim (OpenSense): one column ``w,x,y,z`` per sensor, sensor to a world with z up,
               on one uniform time axis that all sensors cover
    ========== =====================================================================================================

    Args:
        estimates: sensor → estimate of a whole recording, with its time (from :func:`poise.run`).
        path: file to write; its ending decides the format.

    Warns:
        UserWarning: a ``.sto`` of several sensors whose headings have no common origin.

    Raises:
        ValueError: an unknown ending, no estimate, or for ``.sto`` one without orientation or time.
        ImportError: pyarrow is not installed.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITERS:
        raise ValueError(f"output must end in one of {', '.join(WRITERS)}, got {path.name!r}")
    if not estimates:
        raise ValueError("there is no estimate to write")
    WRITERS[path.suffix.lower()](estimates, path)
    return path


def stacked(estimates: Mapping[str, Estimate]) -> pandas.DataFrame:
    """All sensors below each other; the column ``sensor`` only if there are several."""
    import pandas

    frames = {sensor: estimate.to_frame() for sensor, estimate in estimates.items()}
    if len(frames) == 1:
        return next(iter(frames.values()))
    for sensor, frame in frames.items():
        frame.insert(0, "sensor", sensor)
        frame.attrs = {}
    return pandas.concat(frames.values(), ignore_index=True)


def write_csv(estimates: Mapping[str, Estimate], path: Path) -> None:
    """A text table."""
    write_text(path, stacked(estimates).to_csv(index=False, lineterminator="\n"))


def write_parquet(estimates: Mapping[str, Estimate], path: Path) -> None:
    """A Parquet table."""
    with extra("parquet"):
        importlib.import_module("pyarrow")
    frame = stacked(estimates)
    with replacing(path) as temporary:
        frame.to_parquet(temporary, index=False)


def write_hdf5(estimates: Mapping[str, Estimate], path: Path) -> None:
    """One group per sensor, one data set per column."""
    import h5py

    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        for sensor, estimate in estimates.items():
            frame = estimate.to_frame()
            for column in frame:
                data = file.create_dataset(f"{sensor}/{column}", data=frame[column].to_numpy())
                data.attrs["unit"] = frame.attrs["units"][column]


def write_npz(estimates: Mapping[str, Estimate], path: Path) -> None:
    """One array per column."""
    frames = {f"{sensor}/" if len(estimates) > 1 else "": one.to_frame() for sensor, one in estimates.items()}
    arrays = {f"{before}{column}": frame[column].to_numpy() for before, frame in frames.items() for column in frame}
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def write_sto(estimates: Mapping[str, Estimate], path: Path) -> None:
    """Orientations as OpenSim's ``Storage`` of quaternions; the format that OpenSense's inverse kinematics reads."""
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for sensor, estimate in estimates.items():
        names = [name for name in (ORIENTATION.name, RELATIVE_ORIENTATION.name) if name in estimate.pose]
        if not names or estimate.time is None:
            lacking = "no time" if names else "no orientation, only an inclination"
            raise ValueError(f".sto needs orientations over time; the estimate of {sensor!r} has {lacking}")
        known = np.isfinite(estimate.pose[names[0]]).all(axis=1)
        if known.sum() < 2:
            raise ValueError(f".sto needs orientations over time; the estimate of {sensor!r} has {known.sum()}")
        found[sensor] = np.asarray(estimate.time)[known], np.asarray(estimate.pose[names[0]])[known]
    own = [sensor for sensor, estimate in estimates.items() if ORIENTATION.name not in estimate.pose]
    if own and len(estimates) > 1:
        warnings.warn(
            f"the heading of {', '.join(own)} counts from its own start, since no magnetometer was used: angles "
            "between the sensors about the vertical mean nothing; an estimator such as mekf-9 gives a common heading",
            stacklevel=4,
        )
    start = max(time[0] for time, _ in found.values())
    stop = min(time[-1] for time, _ in found.values())
    if start >= stop:
        raise ValueError("the recordings of the sensors do not overlap in time; cut or shift them to one clock")
    interval = float(np.median(np.diff(next(iter(found.values()))[0])))
    grid = start + interval * np.arange(int((stop - start) / interval + 1e-6) + 1)
    columns = []
    for time, orientation in found.values():
        left, right, weight = neighbours(time, grid)
        columns.append(between("orientation", orientation[left], orientation[right], weight))
    labels = [sensor.replace("/", "_").replace(" ", "_") for sensor in found]
    head = [f"DataRate={1.0 / interval:.6f}", "DataType=Quaternion", "version=3", "OpenSimVersion=4.5", "endheader"]
    lines = [*head, "\t".join(["time", *labels])]
    for t, row in zip(grid, np.stack(columns, axis=1), strict=True):
        lines.append("\t".join([f"{t:.9g}", *(",".join(f"{value:.9f}" for value in q) for q in row)]))
    write_text(path, "\n".join(lines) + "\n")


WRITERS: dict[str, Callable[[Mapping[str, Estimate], Path], None]] = {
    ".csv": write_csv,
    ".parquet": write_parquet,
    ".h5": write_hdf5,
    ".npz": write_npz,
    ".sto": write_sto,
}
"""Ending → writer."""
