"""The general reader: from the columns of a table to trajectories, as a mapping says.

The same mapping comes from arguments of :func:`poise.load_recording`, from a TOML file beside the data, and from the
readers of formats whose columns have fixed names.
"""

from __future__ import annotations

import re
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....filters.core import rotation
from ....filters.support.names import unknown
from ....filters.support.parameters import check_parameters
from ..ranges import full_scale
from ..trajectory import Trajectory
from .tables.packed import plain_stem
from .tables.row_times import row_times, with_times
from .tables.rows import by_device
from .tables.table import UNITS, Table, factor

Columns = str | Sequence[str | int]
SIZES = {"gyr": 3, "acc": 3, "mag": 3}
SI = {"gyr": "rad/s", "acc": "m/s²", "mag": "µT", "onboard_orientation": "1"}
REFERENCE_KEYS = ("columns", "order", "conjugate", "frame", "role", "position", "sensor", "unit")
FRAMES = {
    "enu": (1.0, 0.0, 0.0, 0.0),
    "nwu": (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)),
    "ned": (0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0),
    "y-up": (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0),
}
"""World axes of a reference → quaternion to east, north, up."""
CODES = (99.0, 888.0, 999.0, 8888.0, 9999.0, 32767.0, 32768.0, 65535.0, 99999.0, 999999.0, 9999999.0)
"""Magnitudes that loggers write where there is no value."""


@dataclass(frozen=True)
class Reference:
    """An orientation in the file, the truth or the estimate of the device.

    Raises:
        ValueError: an unknown order, frame or role.
    """

    columns: Columns
    """four (quaternion), nine (matrix, row by row) or three columns (roll, pitch, yaw)"""
    order: str = "wxyz"
    """of the quaternion's columns, ``wxyz`` or ``xyzw``"""
    conjugate: bool = False
    """whether it turns the world into the sensor"""
    frame: str = "enu"
    """axes of its world: one of FRAMES"""
    role: str = "truth"
    """``truth`` or ``onboard``"""
    position: Columns | None = None
    """three columns in m"""
    sensor: str | None = None
    """whose it is; None: that of the only sensor"""
    unit: str = "deg"
    """of angles"""

    def __post_init__(self) -> None:
        names = ("conjugate", "sensor", "unit")
        try:
            check_parameters(Reference, {name: getattr(self, name) for name in names})
        except ValueError as reason:
            raise ValueError(f"reference: {reason}") from None
        choices = {"order": ("wxyz", "xyzw"), "frame": FRAMES, "role": ("truth", "onboard")}
        for name, known in choices.items():
            if getattr(self, name) not in known:
                raise ValueError(f"reference: {unknown(name, getattr(self, name), known)}")

    def orientation(self, table: Table) -> np.ndarray:
        """Quaternions ``(N, 4)`` w, x, y, z, sensor to east, north, up; NaN where they are of no length."""
        values = table.matrix(as_columns(self.columns))
        if values.shape[1] == 4:
            q = rotation.from_xyzw(values) if self.order == "xyzw" else values
        elif values.shape[1] == 9:
            q = rotation.from_matrix(values.reshape(-1, 3, 3))
        elif values.shape[1] == 3:
            scale = factor("angle", self.unit)
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            if scale == 1.0 and largest > 2.5 * np.pi:
                raise ValueError(f"reference: unit must be 'deg', got {self.unit!r}: angles reach {largest:g}")
            if scale != 1.0 and 0.5 < largest < 1.001 * np.pi:
                warnings.warn(
                    f"reference: angles in {self.unit} reach {largest:g} only; are they in rad (unit='rad')?",
                    stacklevel=5,
                )
            roll, pitch, yaw = (values * scale).T
            q = rotation.from_euler_zyx(yaw, pitch, roll)
        else:
            raise ValueError(f"reference columns must be four, nine or three, got {values.shape[1]}")
        q = unit_quaternions(q, f"reference {self.columns}")
        q = rotation.conjugate(q) if self.conjugate else q
        return rotation.multiply(np.array(FRAMES[self.frame]), q) if self.frame != "enu" else q


@dataclass(frozen=True)
class RecordingMap:
    """What the columns of a table mean.

    Raises:
        ValueError: a key, unit, sign or column that cannot be.
    """

    columns: Mapping[str, Columns]
    """channel (``gyr``, ``acc``, ``mag`` or anything else; with several sensors ``chest/gyr``) → its columns"""
    units: Mapping[str, str] = field(default_factory=dict)
    """kind, channel or ``time`` → unit; those that the header names by default, else SI"""
    signs: Mapping[str, float | Sequence[float]] = field(default_factory=dict)
    """kind or channel → −1 or a sign for each axis"""
    time: str | int | None = None
    """column of the time; None: rows at ``rate``"""
    rate: float | None = None
    """nominal rate, Hz"""
    reference: tuple[Reference, ...] = ()
    counter: str | None = None
    """column that counts samples (it may wrap): the grid of rows without a usable time"""
    details: Mapping[str, Any] = field(default_factory=dict)
    """metadata to add"""

    def sensors(self) -> dict[str, dict[str, Columns]]:
        """Sensor → kind → columns."""
        found: dict[str, dict[str, Columns]] = {}
        for channel, names in self.columns.items():
            sensor, _, kind = channel.rpartition("/")
            found.setdefault(sensor or "imu", {})[kind] = names
        return found

    def times(self, table: Table) -> tuple[np.ndarray, dict[str, Any]]:
        """Time ``(N,)`` in s of the rows of a table, and metadata on the clock."""
        time = None if self.time is None else str(self.time)
        return row_times(table, time, self.rate, self.counter, self.units.get("time"))


def as_columns(names: Columns) -> str | list[str]:
    """Names of columns; numbers count columns from 0."""
    if isinstance(names, str):
        return names
    if isinstance(names, int):
        return str(names)
    if not isinstance(names, list | tuple):
        raise ValueError(f"columns must be a name or a list of names or numbers of columns, got {names!r}")
    return [str(name) for name in names]


def make_map(
    columns: Mapping[str, Columns],
    units: Mapping[str, str] | None = None,
    signs: Mapping[str, Any] | None = None,
    time: str | int | None = None,
    rate: float | None = None,
    reference: Any = None,
) -> RecordingMap:
    """A mapping of plain arguments, checked.

    Raises:
        ValueError: names the argument, its value and what is accepted.
    """
    if not isinstance(columns, Mapping) or not columns:
        raise ValueError(f"columns must map channels to columns, such as gyr to [gx, gy, gz]; got {columns!r}")
    if rate is not None and (isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < np.inf):
        raise ValueError(f"rate must be a positive number of Hz, got {rate!r}")
    kinds = {channel.rpartition("/")[2] for channel in columns}
    for channel in columns:
        kind = str(channel).rpartition("/")[2]
        meant = re.fullmatch(r"(gyr|acc|mag)[a-z]*", kind.lower())
        if meant is not None and kind != meant[1]:
            raise ValueError(f"columns: the channel is called {meant[1]!r}, got {channel!r}")
    for name, given in (("units", units), ("signs", signs)):
        if given is not None and not isinstance(given, Mapping):
            raise ValueError(f"{name} must be a mapping from channel to {name[:-1]}, got {given!r}")
        for key in given or {}:
            if key not in columns and key not in kinds and key != "time":
                raise ValueError(f"{name}: {unknown('channel', key, [*columns, 'time'])}")
    references = [] if reference is None else reference if isinstance(reference, list | tuple) else [reference]
    return RecordingMap(
        dict(columns), dict(units or {}), dict(signs or {}), time, rate, tuple(as_reference(one) for one in references)
    )


def as_reference(given: Any) -> Reference:
    """A reference of a mapping with REFERENCE_KEYS."""
    if isinstance(given, Reference):
        return given
    if not isinstance(given, Mapping) or "columns" not in given:
        raise ValueError(f"reference must be a mapping with 'columns' (and {REFERENCE_KEYS[1:]}), got {given!r}")
    for key in given:
        if key not in REFERENCE_KEYS:
            raise ValueError(f"reference: {unknown('key', key, REFERENCE_KEYS)}")
    return Reference(**given)


def read_map(path: Path) -> tuple[Path, RecordingMap]:
    """The data file that a TOML file names (beside it), and its mapping.

    Raises:
        ValueError: it is not TOML, names no file, or has unknown keys.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as reason:
        raise ValueError(f"it is not TOML: {reason}") from None
    known = ("file", "columns", "units", "signs", "time", "rate", "reference", "name")
    for key in content:
        if key not in known:
            raise ValueError(unknown("key", key, known))
    if not isinstance(content.get("file"), str) or "columns" not in content:
        raise ValueError("a mapping names the data by 'file' and its 'columns'")
    data = path.parent / content["file"]
    if not data.resolve().is_relative_to(path.parent.resolve()):
        raise ValueError(f"file must lie beside the mapping or below it, got {content['file']!r}")
    if not data.exists():
        raise ValueError(f"there is no {data}")
    arguments = {key: content[key] for key in known if key in content and key not in ("file", "name")}
    made = make_map(**arguments)
    return data, replace(made, details={"name": content["name"]} if "name" in content else {})


def apply_map(table: Table, mapping: RecordingMap, path: Path) -> list[Trajectory]:
    """Trajectories of a table, one a sensor, each with the channels ``imu/<kind>``.

    Raises:
        ValueError: a column is missing or unreadable, or the time is.
    """
    time = None if mapping.time is None else str(mapping.time)
    table = with_times(table, time)
    parts = by_device(table, time)
    if parts:
        return [one for device, part in parts.items() for one in apply_map(part, of_device(mapping, device), path)]
    seconds, clock = mapping.times(table)
    sensors = mapping.sensors()
    for reference in mapping.reference:
        if reference.sensor is not None and reference.sensor.lower() not in [name.lower() for name in sensors]:
            raise ValueError(f"reference: {unknown('sensor', reference.sensor, sensors)}")
    trajectories = []
    for sensor, kinds in sensors.items():
        measurements, units = {}, {}
        for kind, names in kinds.items():
            measurements[f"imu/{kind}"], unit = channel(table, mapping, sensor, kind, names)
            units[f"imu/{kind}"] = unit
        truth = {}
        for reference in mapping.reference:
            if reference.sensor is not None and reference.sensor.lower() != sensor.lower():
                continue
            if reference.role == "onboard":
                measurements["imu/onboard_orientation"] = reference.orientation(table)
            else:
                truth["orientation"] = reference.orientation(table)
                if reference.position is not None:
                    truth["position"] = table.matrix(as_columns(reference.position))
        name = plain_stem(path) if len(sensors) == 1 and sensor == "imu" else f"{plain_stem(path)}-{sensor}"
        details = {"name": name, "units": units, **clock, **mapping.details}
        if len(sensors) > 1 or sensor != "imu":
            details["sensor"] = sensor
        ranges = full_scale(table, measurements, name)
        if ranges:
            details.setdefault("full_scale", ranges)
        trajectories.append(trajectory_of(seconds, measurements, truth, details))
    return trajectories


def of_device(mapping: RecordingMap, device: str) -> RecordingMap:
    """The mapping of the rows of one device of several, which becomes a sensor of that name."""
    columns = {f"{device}/{name.removeprefix('imu/')}": one for name, one in mapping.columns.items()}
    units = {name.removeprefix("imu/"): unit for name, unit in mapping.units.items()}
    references = tuple(
        replace(one, sensor=None)
        for one in mapping.reference
        if one.sensor is None or one.sensor.lower() in ("imu", device.lower())
    )
    return replace(mapping, columns=columns, units=units, reference=references)


def trajectory_of(
    seconds: np.ndarray, measurements: dict[str, np.ndarray], truth: dict[str, np.ndarray], details: dict[str, Any]
) -> Trajectory:
    """A trajectory whose mask is where the truth is known, if it is known at all.

    Rows out of order are sorted, rows that repeat the one before dropped.
    """
    backwards = int((np.diff(seconds) < 0.0).sum())
    if backwards:
        order = np.argsort(seconds, kind="stable")
        warnings.warn(f"{details['name']}: {backwards} rows are out of order in time and were sorted", stacklevel=3)
        seconds = seconds[order]
        measurements = {name: values[order] for name, values in measurements.items()}
        truth = {name: values[order] for name, values in truth.items()}
    mask = np.ones(len(seconds), bool)
    if "orientation" in truth:
        mask = np.isfinite(truth["orientation"]).all(axis=1)
    return Trajectory(seconds, measurements, truth, mask, details).without_repeats()


def channel(table: Table, mapping: RecordingMap, sensor: str, kind: str, names: Columns) -> tuple[np.ndarray, str]:
    """Values ``(N, size)`` of a channel in SI units, and the unit."""
    columns = as_columns(names)
    values = table.matrix(columns)
    if kind in SIZES and values.shape[1] != SIZES[kind]:
        raise ValueError(f"columns[{kind!r}] must be {SIZES[kind]} columns, got {values.shape[1]}: {columns}")
    values = finite(values)
    if kind in SIZES:
        values = without_codes(values, kind)
    if kind in SIZES and not isinstance(columns, str) and len(set(columns)) < len(columns):
        raise ValueError(f"columns[{kind!r}] must be different columns, got {columns}")
    given = first_of(mapping.units, sensor, kind)
    named = [given] if given or isinstance(columns, str) else [table.units.get(name, "") for name in columns]
    unit = given or (table.unit(columns) if len(set(named)) == 1 or not all(named) else named[0])
    # Axes may differ in their units.
    units = named if len(named) == values.shape[1] and not given and all(named) else [unit]
    scale = np.array([factor(kind, each) if each and kind in UNITS else 1.0 for each in units])
    given_sign = first_of(mapping.signs, sensor, kind)
    try:
        sign = np.asarray(1.0 if given_sign is None else given_sign, dtype=float)
    except (TypeError, ValueError):
        sign = np.array(np.nan)
    if not np.isin(sign, (-1.0, 1.0)).all() or sign.ndim > 1 or sign.size not in (1, values.shape[1]):
        raise ValueError(f"signs[{kind!r}] must be 1 or -1, for all axes or one an axis, got {given_sign!r}")
    return values * (scale * sign), SI.get(kind, unit or "?")


def finite(values: np.ndarray) -> np.ndarray:
    """Values with NaN for what is infinite."""
    return values if not np.isinf(values).any() else np.where(np.isfinite(values), values, np.nan)


def without_codes(values: np.ndarray, kind: str) -> np.ndarray:
    """Samples ``(N, 3)`` as written, with NaN for the codes of loggers for no value, with a warning.

    A code on all axes is one for certain; on one axis it is, if the axis has fractions otherwise.
    """
    code = np.isin(np.abs(values), CODES)
    fractions = np.isfinite(values) & (values != np.rint(values))
    found = code.all(axis=1) | (code & (fractions.mean(axis=0) > 0.5)).any(axis=1)
    if not found.any():
        return values
    warnings.warn(
        f"{kind}: {int(found.sum())} samples hold {values[code & found[:, None]][0]:g}, which loggers write for no "
        "value; they count as missing",
        stacklevel=4,
    )
    return np.where(found[:, None], np.nan, values)


def unit_quaternions(q: np.ndarray, what: str = "quaternions") -> np.ndarray:
    """Quaternions ``(N, 4)`` of unit length, NaN where they have none; whole numbers of one length are scaled.

    Warns:
        UserWarning: their usual length is not one.
    """
    length = rotation.norm(q)
    with np.errstate(invalid="ignore", divide="ignore"):
        known = length[np.isfinite(length) & (length > 0.0)]
        usual = float(np.median(known)) if len(known) else 1.0
        if not 0.9 < usual < 1.1:
            alike = float(np.mean(np.abs(known / usual - 1.0) < 0.02)) > 0.9
            remedy = "and are divided by it" if alike else "so that none of them is an orientation"
            warnings.warn(f"{what} are usually {usual:.5g} long, not 1, {remedy}", stacklevel=4)
            q, length = (q / usual, length / usual) if alike else (q, length)
        return np.where(np.abs(length - 1.0) < 0.1, q / length, np.nan)


def first_of(given: Mapping[str, Any], sensor: str, kind: str) -> Any:
    """What a channel or, failing that, its kind is given."""
    return given.get(f"{sensor}/{kind}", given.get(kind))
