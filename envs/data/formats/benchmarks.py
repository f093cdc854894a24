"""Published benchmarks with reference orientations, in the layouts of their authors.

* RepoIMU: A. Szczęsna et al., "Reference Data Set for Accuracy Evaluation of Orientation Estimation Algorithms for
  Inertial Motion Capture Systems", ICCVG 2016; one CSV a trial, Vicon.
* EuRoC MAV: M. Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 35(10), 2016; a folder ``mav0``.
* Smartphones carried by pedestrians: T. Michel et al., PerCom 2017; ``android/<trial>/*.txt`` beside
  ``qualisys/<trial>.mat``.
* Archives of NumPy arrays ``t``, ``gyr``, ``acc``, ``mag``, ``quat``, ``mask`` in SI units.

References of RepoIMU and the phones are those of other bodies in other worlds: see
:func:`poise.envs.data.reference_clock.aligned`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....filters.core import rotation
from ....filters.core.estimator import real_numbers
from .. import reference_clock
from ..trajectory import Trajectory
from .folders import load_streams
from .mapping import RecordingMap, Reference, apply_map
from .tables.arrays import ZIP, load_mat, load_npz, read_table, time_first
from .tables.head import Head
from .tables.names import groups, time_column
from .tables.stamps import as_seconds
from .tables.streams import Stream, interpolated

SI_UNITS = {"gyr": "rad/s", "acc": "m/s^2"}
EUROC_TRUTH = ("state_groundtruth_estimate0", "vicon0", "mocap0")


def is_repoimu(head: Head) -> bool:
    """Whether a file is a trial of RepoIMU: its line of groups."""
    lines = head.text.lower().splitlines()[:10]
    return any("vicon orientation" in line and "imu gyroscope" in line for line in lines)


def load_repoimu(path: Path) -> list[Trajectory]:
    """Read a trial: Xsens with Vicon's orientation, aligned to the sensor, as truth."""
    table = read_table(path)
    found = {group.kind: group.columns for group in groups(table)}
    missing = {"gyr", "acc", "quaternion"} - set(found)
    if missing:
        raise ValueError(f"columns of {sorted(missing)} are missing; {table.seen()}")
    mapping = RecordingMap(
        {kind: found[kind] for kind in ("gyr", "acc", "mag") if kind in found},
        {"time": "s", "mag": "a.u.", **SI_UNITS},
        time=time_column(table),
        reference=(Reference(tuple(found["quaternion"])),),
        details={"format": "RepoIMU", "source": "RepoIMU, Szczęsna et al. 2016", "group": path.stem.split("_")[0]},
    )
    return [reference_clock.aligned(one) for one in apply_map(table, mapping, path)]


def euroc_root(path: Path) -> Path | None:
    """The folder that holds ``imu0``, given it, its parent, or the file of the IMU."""
    for folder in (path, path / "mav0", path.parent.parent):
        if (folder / "imu0" / "data.csv").is_file() and (path != folder / "imu0"):
            return folder if path.is_dir() or path == folder / "imu0" / "data.csv" else None
    return None


def load_euroc(path: Path) -> list[Trajectory]:
    """Read a sequence: ``gyr``, ``acc``; truth ``orientation``, ``position``, ``velocity`` where there is a file of it.

    The truth has stamps of its own and is interpolated to those of the IMU.
    """
    root = euroc_root(path)
    assert root is not None
    table = read_table(root / "imu0" / "data.csv")
    found = {group.kind: group.columns for group in groups(table)}
    time = time_column(table)
    if not {"gyr", "acc"} <= set(found) or time is None:
        raise ValueError(f"imu0/data.csv lacks gyroscope, accelerometer or time; {table.seen()}")
    units = {"time": table.units.get(time) or "ns", **SI_UNITS}
    name = root.parent.name if root.name == "mav0" else root.name
    mapping = RecordingMap(
        {kind: found[kind] for kind in ("gyr", "acc")},
        units,
        time=time,
        details={"name": name, "format": "EuRoC", "source": "EuRoC MAV, Burri et al. 2016"},
    )
    (recorded,) = apply_map(table, mapping, path)
    reference = next((root / each / "data.csv" for each in EUROC_TRUTH if (root / each / "data.csv").is_file()), None)
    if reference is None:
        return [recorded]
    truth = euroc_truth(reference, recorded.metadata["clock_start"], recorded.time)
    known = np.isfinite(truth["orientation"]).all(axis=1)
    if not known.any():
        raise ValueError(f"the stamps of {reference.parent.name} share no time with those of imu0")
    return [reference_clock.measured(recorded.replace(truth=truth, mask=known))]


def euroc_truth(path: Path, origin: int, time: np.ndarray) -> dict[str, np.ndarray]:
    """Truth of a file at times in s from an origin in ns."""
    table = read_table(path)
    names = list(table.arrays)
    stamp = time_column(table) or names[0]
    quaternion = next((group.columns for group in groups(table) if group.kind == "quaternion"), None)
    if quaternion is None:
        raise ValueError(f"{path.parent.name}/data.csv has no quaternion; {table.seen()}")
    seconds = as_seconds(table.column(stamp), table.units.get(stamp) or "ns", stamp).since(origin)
    values = {"orientation": rotation.normalize(table.matrix(quaternion))}
    for quantity, letter in (("position", "p"), ("velocity", "v")):
        own = [name for name in names if name.lower().startswith(letter)]
        columns = [name for axis in "xyz" for name in own if name.lower().endswith(axis)]
        if len(columns) == 3:
            values[quantity] = table.matrix(columns)
    return {name: interpolated(Stream(seconds, array), time, name) for name, array in values.items()}


def load_phone(folder: Path) -> list[Trajectory]:
    """Read the folder of a phone, with the orientation of Qualisys if the file of the benchmark is beside it."""
    (recorded,) = load_streams(folder)
    reference = folder.parent.parent / "qualisys" / f"{folder.name}.mat"
    if not reference.is_file():
        return [recorded]
    fields = load_mat(reference)
    rotations = next((value for name, value in fields.items() if name.endswith("RigidBodies/Rotations")), None)
    rate = next((value for name, value in fields.items() if name.endswith("FrameRate")), None)
    if rotations is None or rate is None:
        raise ValueError(f"{reference.name} lacks RigidBodies.Rotations or FrameRate")
    matrices = np.asarray(rotations, dtype=float)
    # Bodies × 9 × frames, a matrix column by column.
    matrices = (matrices if matrices.ndim == 2 else matrices[0]).T.reshape(-1, 3, 3).transpose(0, 2, 1)
    orientation = rotation.from_matrix(np.where(np.isfinite(matrices), matrices, np.nan))
    alignment = folder / "timeAlignment.txt"
    shift = float(alignment.read_text().strip()) if alignment.is_file() else 0.0
    seconds = np.arange(len(orientation)) / float(np.ravel(rate)[0])
    best: Trajectory | None = None
    # The sign of the shift and the sense of the matrices are told by the rates.
    for turned in (orientation, rotation.conjugate(orientation)):
        for start in (shift, -shift):
            truth = interpolated(Stream(seconds + start, turned), recorded.time, "orientation")
            known = np.isfinite(truth).all(axis=1)
            if known.sum() < 200:
                continue
            one = reference_clock.aligned(recorded.replace(truth={"orientation": truth}, mask=known))
            if best is None or reference_clock.rate_error(one) < reference_clock.rate_error(best):
                best = one
    if best is None:
        raise ValueError(f"{reference.name} shares no time with the phone")
    return [best.replace(metadata=best.metadata | {"source": "Michel et al. 2017", "licence": "CeCILL 2.1"})]


def is_archive(head: Head) -> bool:
    """Whether a file is an archive of arrays ``t``, ``gyr``, ``acc``."""
    if not head.content.startswith(ZIP):
        return False
    import zipfile

    try:
        with zipfile.ZipFile(head.path) as archive:
            return {"t.npy", "gyr.npy", "acc.npy"} <= set(archive.namelist())
    except zipfile.BadZipFile:
        return False


def load_archive(path: Path) -> list[Trajectory]:
    """Read an archive: ``t`` s, ``gyr`` rad/s, ``acc`` m/s², ``mag``; truth ``quat`` w, x, y, z; ``mask``."""
    arrays = load_npz(path)
    for name in arrays.keys() & {"t", "gyr", "acc", "mag", "quat", "pos"}:
        real_numbers(arrays[name], f"array {name!r}")
    time = np.ravel(arrays["t"])
    if time.dtype.kind == "i" and len(time):
        time = as_seconds(time, "", "t").elapsed
    measurements = {f"imu/{kind}": time_first(arrays[kind]) for kind in ("gyr", "acc", "mag") if kind in arrays}
    truth = {"orientation": time_first(arrays["quat"])} if "quat" in arrays else {}
    truth |= {"position": time_first(arrays["pos"])} if "pos" in arrays else {}
    mask = np.asarray(arrays["mask"], dtype=bool).ravel() if "mask" in arrays else np.ones(len(time), bool)
    details = {"name": path.stem, "format": "NumPy archive", "group": path.parent.name}
    recorded = Trajectory(np.asarray(time, dtype=float), measurements, truth, mask, details)
    return [reference_clock.measured(recorded)]
