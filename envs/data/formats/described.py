"""Tables that describe themselves: columns whose names say sensor, kind and axis, and whose header says the units.

This is how x-io's Fusion examples, APDM Moveo and Shimmer Consensys export, and many scripts of users. Of other tables
the same names give a draft of a mapping.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from ....filters.core import rotation
from ..plausibility.rate_consistency import rate_consistency
from ..trajectory import Trajectory
from .mapping import RecordingMap, Reference, apply_map, as_columns, finite
from .tables.names import Group, counter_column, groups, is_ros, time_column, time_unit
from .tables.table import Table, factor

RATES = (
    *(
        "Update Rate",
        "Sample Rate",
        "Sampling Rate",
        "OutputRate",
        "Output Data Rate",
        "Rate",
        "ODR",
        "fs",
        "Abtastrate",
    ),
    *("Frequency", "Sampling Frequency", "Sample Frequency", "Abtastfrequenz"),
    *("Sampling Interval", "Sample Interval", "Sampling Period", "Sample Period"),
)
"""Keys of a header for the sampling rate."""
APPS = {("gFx", "wx"): {"acc": ("gFx gFy gFz", "g"), "gyr": ("wx wy wz", "rad/s"), "mag": ("Bx By Bz", "uT")}}
"""First names of tables without units (Physics Toolbox) → kind → its columns and their unit."""
ROS_UNITS = {"gyr": "rad/s", "acc": "m/s^2"}
"""Of ``sensor_msgs/Imu``."""
SATURATED = 0.002
"""Part of samples at the largest magnitude of an axis beyond which an accelerometer is saturated."""
FITS = 12.0
"""deg; an onboard orientation whose vertical is typically this near to gravity is one of the sensor."""


def mapping_of(table: Table) -> RecordingMap:
    """The mapping that the names and the units of a table tell, as far as they do."""
    found = groups(table)
    ros = is_ros(table)
    sensors = list(dict.fromkeys(group.sensor for group in found if group.kind in ("gyr", "acc")))
    columns: dict[str, list[str]] = {}
    units: dict[str, str] = {}
    references = []
    for sensor in sensors:
        label = "imu" if len(sensors) == 1 else sensor
        for kind in ("gyr", "acc", "mag"):
            candidates = [group for group in found if group.sensor == sensor and group.kind == kind]
            if candidates:
                chosen = best_range(table, candidates)
                columns[f"{label}/{kind}"] = chosen.columns
                unit = chosen.unit or (ROS_UNITS[kind] if ros and kind in ROS_UNITS else "")
                if unit:
                    units[f"{label}/{kind}"] = unit
        onboard = [group for group in found if group.kind in ("quaternion", "matrix") and group.sensor == sensor]
        if len(sensors) == 1 and not onboard:
            onboard = [group for group in found if group.kind in ("quaternion", "matrix")]
        if onboard:
            references.append(Reference(tuple(onboard[0].columns), role="onboard", sensor=label))
    for names, kinds in APPS.items():
        if names in table:
            known = {kind: (each.split(), unit) for kind, (each, unit) in kinds.items() if each.split() in table}
            columns = {f"imu/{kind}": chosen for kind, (chosen, _) in known.items()}
            units = {f"imu/{kind}": unit for kind, (_, unit) in known.items()}
    # Names of Apple's Core Motion: g, and -1 g on an axis that points up.
    apple = any(name.startswith(("accelerometerAcceleration", "motionRotationRate")) for name in table.arrays)
    time = time_column(table)
    if time is not None and time_unit(table, time):
        units["time"] = time_unit(table, time)
    rate = table.rate_in_header(*RATES)
    return RecordingMap(
        columns,
        units,
        {"acc": -1.0} if apple else {},
        time=time,
        rate=rate,
        reference=tuple(references),
        counter=None if time else counter_column(table),
    )


def best_range(table: Table, candidates: list[Group]) -> Group:
    """Of several sensors of one kind the first (the one of low noise) that was recorded and does not saturate."""
    if len(candidates) == 1:
        return candidates[0]
    sizes = [np.abs(finite(table.matrix(group.columns))) for group in candidates]
    recorded = [(group, size) for group, size in zip(candidates, sizes, strict=True) if np.isfinite(size).any()]
    for group, size in recorded:
        largest = np.nanmax(size, axis=0, initial=0.0)
        if np.all(np.mean(size >= largest - 1e-9 * largest, axis=0) < SATURATED):
            return group
    return recorded[-1][0] if recorded else candidates[0]


def complete(table: Table, mapping: RecordingMap) -> bool:
    """Whether the mapping has a gyroscope and an accelerometer with units that are known, and a time."""
    kinds = {channel.rpartition("/")[2] for channel in mapping.columns}
    if not {"gyr", "acc"} <= kinds or (mapping.time is None and mapping.rate is None):
        return False
    for channel in mapping.columns:
        kind = channel.rpartition("/")[2]
        if kind in ("gyr", "acc") and not all(is_unit(kind, unit) for unit in units_of(table, mapping, channel)):
            return False
    return True


def is_unit(kind: str, unit: str) -> bool:
    """Whether a unit is one of a kind, or a number of such."""
    try:
        factor(kind, unit)
    except ValueError:
        return False
    return True


def units_of(table: Table, mapping: RecordingMap, channel: str) -> list[str]:
    """The unit of a channel, or those of its columns, which may differ; empty where none is named."""
    if channel in mapping.units:
        return [mapping.units[channel]]
    columns = as_columns(mapping.columns[channel])
    return [table.units.get(column, "") for column in ([columns] if isinstance(columns, str) else columns)]


def load_described(path: Path, table: Table, name: str) -> list[Trajectory]:
    """Trajectories of a table that describes itself.

    Raises:
        ValueError: a column that is needed holds no numbers, or the time runs backwards.
    """
    mapping = mapping_of(table)
    unused = columns_not_used(table, mapping)
    details = {"format": name} | ({"columns_not_used": unused} if unused else {})
    return [with_checked_orientation(one) for one in apply_map(table, replace(mapping, details=details), path)]


def columns_not_used(table: Table, mapping: RecordingMap) -> list[str]:
    """Columns of numbers that a mapping leaves out, such as forces and other sensors."""
    used = {mapping.time, mapping.counter}
    for part in (*mapping.columns.values(), *(reference.columns for reference in mapping.reference)):
        names = as_columns(part)
        used |= {names} if isinstance(names, str) else set(names)
    return [name for name in table.arrays if name not in used]


def with_checked_orientation(trajectory: Trajectory) -> Trajectory:
    """The trajectory with its onboard orientation as one of the sensor in a world whose z axis is up.

    Devices differ in what their quaternion turns into what, and in its order where the names do not tell. The
    accelerometer does: of the quaternion, its conjugate, both in a world whose z axis points down, and the same with
    the scalar last, the one whose vertical is nearest to the specific force is taken, if the one as written does not
    fit. ``metadata["onboard_orientation"]`` says which.
    """
    key = "imu/onboard_orientation"
    if key not in trajectory.measurements or "imu/acc" not in trajectory.measurements:
        return trajectory
    acc = trajectory.measurements["imu/acc"]
    flip = np.array([0.0, 1.0, 0.0, 0.0])
    variants = {}
    written = trajectory.measurements[key]
    for order, q in (("", written), ("scalar last, ", rotation.from_xyzw(written))):
        for sense, turn in (("as written", q), ("conjugate", rotation.conjugate(q))):
            variants[f"{order}{sense}"], variants[f"{order}{sense}, z down"] = turn, rotation.multiply(flip, turn)
    angles = {name: typical_angle(rotation.up_in_body(values), acc) for name, values in variants.items()}
    best = min(angles, key=lambda name: angles[name])
    # Where several fit alike, as with a sensor that lies level, what is written stands.
    chosen = best if angles["as written"] > max(FITS, 2.0 * angles[best]) else "as written"
    if chosen != "as written":
        warnings.warn(
            f"{trajectory.name}: the device's orientation is {angles['as written']:.0f}° from gravity as written and "
            f"{angles[best]:.1f}° as {chosen}, which is taken; or is the accelerometer's sign reversed?",
            stacklevel=2,
        )
    elif np.isfinite(angles[best]) and angles[chosen] > 2.0 * FITS:
        warnings.warn(
            f"{trajectory.name}: the device's orientation is typically {angles[chosen]:.0f}° from gravity in every "
            "order and sense; is it of another sensor, or in other axes?",
            stacklevel=2,
        )
    return trajectory.replace(
        measurements=trajectory.measurements | {key: variants[chosen]},
        metadata=trajectory.metadata
        | {"onboard_orientation": {"read": chosen, "angle_to_specific_force_deg": round(angles[chosen], 2)}},
    )


def typical_angle(up: np.ndarray, acc: np.ndarray) -> float:
    """Median angle in deg between verticals ``(T, 3)`` and specific force; infinite where there is none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (up * acc).sum(axis=1) / np.linalg.norm(acc, axis=1)
    known = np.isfinite(cosine)
    return float(np.degrees(np.median(np.arccos(np.clip(cosine[known], -1.0, 1.0))))) if known.any() else float("inf")


def plausible_units(table: Table, mapping: RecordingMap) -> dict[str, str]:
    """Likely units of channels without any, from their magnitudes, for a draft."""
    likely = {}
    for channel, names in mapping.columns.items():
        kind = channel.rpartition("/")[2]
        if all(units_of(table, mapping, channel)) or kind not in ("gyr", "acc"):
            continue
        with np.errstate(invalid="ignore"):
            size = np.linalg.norm(table.matrix(as_columns(names)), axis=1)
        typical = float(np.nanmedian(size)) if np.isfinite(size).any() else 0.0
        if kind == "acc":
            choices = {unit: abs(typical * factor("acc", unit) / 9.81 - 1.0) for unit in ("m/s^2", "g", "mg")}
            likely[channel] = min(choices, key=lambda unit: choices[unit])
        else:
            likely[channel] = (
                "deg/s" if float(np.nanmax(size)) > 40.0 or in_degrees(table, mapping, channel) else "rad/s"
            )
    return likely


def in_degrees(table: Table, mapping: RecordingMap, channel: str) -> bool:
    """Whether rates turn the specific force beside them as it moves if they are read as deg/s."""
    other = channel.removesuffix("gyr") + "acc"
    if other not in mapping.columns or (mapping.time is None and mapping.rate is None):
        return False
    gyr, acc = (table.matrix(as_columns(mapping.columns[name])) for name in (channel, other))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = rate_consistency(mapping.times(table)[0], gyr, acc)
    except ValueError:
        return False
    return found is not None and found.other_unit == "deg/s"
