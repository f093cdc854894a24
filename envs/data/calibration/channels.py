"""From the data of calibration runs to calibration records, one channel each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....filters.arrays.array import AccelerometerArray, recorded_channel
from ....filters.arrays.calibration.magnetometer import align_magnetometer, fit_ellipsoid
from ....filters.arrays.calibration.rate_table import (
    AxisCalibration,
    calibrate_accelerometer,
    calibrate_direction,
    calibrate_gyroscope,
)
from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from .data import AXES, MagnetometerData, RateTableData
from .records import CalibrationRecord, ChannelCalibration


def accelerometer_record(
    data: RateTableData,
    array: AccelerometerArray,
    channel: str | None = None,
    *,
    gravity: float = STANDARD_GRAVITY,
    saturation: float | None = None,
    estimate_axes: bool = False,
) -> CalibrationRecord:
    """Calibrate every accelerometer of an array.

    The details hold the ``array`` with which filters should be made: the nominal one, or with ``estimate_axes`` one
    with the axes found, and positions shifted along them.

    Args:
        data: runs on a rate table.
        array: the nominal directions of the sensitive axes.
        channel: name for the record; None for that of the array.
        gravity: m/s².
        saturation: magnitude of raw readings that are discarded.
        estimate_axes: find the directions of the sensitive axes too; needs mountings with upward directions that span
            space, one of them opposite to another.

    Raises:
        ValueError: another number of columns than accelerometers, or poses that do not determine one of them.
    """
    if data.raw.shape[1] != array.size:
        raise ValueError(
            f"array {array.name!r} has {array.size} accelerometers, but the runs have {data.raw.shape[1]} columns of "
            "raw readings"
        )
    found, rows = [], []
    up_of = {name: AXES[up] for name, up in zip(data.mounting.tolist(), data.up.tolist(), strict=True)}
    positions, axes = array.spatial.r.copy(), array.spatial.e.copy()
    for number, axis in enumerate(axes):
        columns = (data.raw[:, number], data.rate, data.mounting)
        try:
            if estimate_axes:
                one = calibrate_direction(*columns, up_of, gravity=gravity, saturation=saturation)
                axis = np.array(one.axis)
            else:
                upward = {name: float(up @ axis) for name, up in up_of.items()}
                one = calibrate_accelerometer(*columns, upward, gravity=gravity, saturation=saturation)
        except ValueError as reason:
            raise ValueError(f"accelerometer {number + 1} of {array.name!r}: {reason}") from None
        place = along(one, data, axis, positions[number])
        turned = float(np.arctan2(np.linalg.norm(np.cross(axis, axes[number])), axis @ axes[number]))
        if estimate_axes:
            axes[number] = axis
            positions[number] += 0.0 if place is None else (place - axis @ positions[number]) * axis
        found.append(one)
        where = {"positions": dict(one.positions), "along": place, "axis": axis.tolist(), "turned": turned}
        rows.append(_described(one) | where)
    n = array.dimension
    if n == 2:
        axes = rotation.normalize(axes[:, :2])
    positions = positions[:, :n] + np.array(array.reference)
    built = type(array)(positions.tolist(), axes[:, :n].tolist(), array.name, array.reference)
    details = {"array": built.describe(), "estimated_axes": estimate_axes, "gravity": gravity, "axes": rows}
    return _record(channel or recorded_channel(array).name, found, "m/s²", details)


def along(one: AxisCalibration, data: RateTableData, axis: np.ndarray, nominal: np.ndarray) -> float | None:
    """eᵀr, m: the coordinate of a sensor along its axis, from the array's reference point.

    With u up and that point at one distance d outwards (o) a mounting gives ρ = (e − u uᵀe)ᵀr + d eᵀo. Of r only the
    part along e is determined; the rest comes from the nominal position.

    Args:
        one: with the positions ρ.
        data: which axes pointed up and outwards.
        axis: e, ``(3,)``.
        nominal: r, ``(3,)`` m.

    Returns:
        None where the mountings do not tell it from d.
    """
    names = data.mounting.tolist()
    up_of, out_of = (dict(zip(names, column.tolist(), strict=True)) for column in (data.up, data.out))
    rows, right = [], []
    for name, value in one.positions.items():
        if out_of[name]:
            level = axis - AXES[up_of[name]] * (AXES[up_of[name]] @ axis)
            rows.append([level @ level, float(AXES[out_of[name]] @ axis)])
            right.append(value - level @ nominal)
    columns = np.array(rows).reshape(-1, 2)
    if np.linalg.matrix_rank(columns, tol=1e-3) < 2:
        known = columns[:, 0] > 0.5
        if not known.any() or np.abs(columns[known, 1]).max() > 1e-3:
            return None
        return float(axis @ nominal + np.mean(np.array(right)[known]))
    shift = np.linalg.lstsq(columns, np.array(right), rcond=None)[0][0]
    return float(axis @ nominal + shift)


def gyroscope_record(
    data: RateTableData, channel: str = "imu/gyr", *, saturation: float | None = None
) -> CalibrationRecord:
    """Calibrate the axes x, y, z of a gyroscope, each from the runs in which it stood upright.

    Args:
        data: runs on a rate table.
        channel: name for the record.
        saturation: magnitude of raw readings that are discarded.

    Raises:
        ValueError: another number of columns than three, or an axis that is not determined.
    """
    if data.raw.shape[1] != 3:
        raise ValueError(f"a gyroscope has 3 axes, but the runs have {data.raw.shape[1]} columns of raw readings")
    found = []
    for number, name in enumerate("xyz"):
        signs = {f"+{name}": 1.0, f"-{name}": -1.0}
        upright = np.isin(data.up, [*signs])
        if not upright.any():
            raise ValueError(f"gyroscope axis {name}: no run in which it stood upright (up = +{name} or -{name})")
        rate = data.rate[upright] * np.array([signs[up] for up in data.up[upright].tolist()])
        try:
            found.append(calibrate_gyroscope(data.raw[upright, number], rate, saturation=saturation))
        except ValueError as reason:
            raise ValueError(f"gyroscope axis {name}: {reason}") from None
    return _record(channel, found, "rad/s", {"axes": [_described(one) for one in found]})


def magnetometer_record(data: MagnetometerData, channel: str = "imu/mag") -> CalibrationRecord:
    """Calibrate a magnetometer: readings become unit vectors in device axes.

    Without reference attitudes the axes stay those of the magnetometer, up to the rotation that is in its soft iron.

    Args:
        data: readings in many attitudes.
        channel: name for the record.

    Raises:
        ValueError: readings that do not lie on an ellipsoid, or attitudes that do not suffice.
    """
    ellipsoid = fit_ellipsoid(data.raw)
    matrix = ellipsoid.root
    details: dict[str, Any] = {
        "centre": ellipsoid.centre.tolist(),
        "residual": ellipsoid.residual,
        "samples": int(np.isfinite(data.raw).all(axis=1).sum()),
        "aligned": data.orientation is not None,
    }
    if data.orientation is not None:
        alignment = align_magnetometer((data.raw - ellipsoid.centre) @ ellipsoid.root.T, data.orientation)
        matrix = alignment.matrix @ ellipsoid.root
        details |= {
            "rotation": rotation.from_matrix(alignment.matrix).tolist(),
            "field": alignment.field.tolist(),
            "dip_deg": math.degrees(math.asin(-float(alignment.field[2]))),
            "alignment_residual_deg": math.degrees(alignment.residual),
        }
    one = ChannelCalibration(matrix.tolist(), (-matrix @ ellipsoid.centre).tolist(), "1")
    return CalibrationRecord({channel: one}, {channel: details})


def _record(channel: str, found: list[AxisCalibration], unit: str, details: dict[str, Any]) -> CalibrationRecord:
    for number, one in enumerate(found):
        if one.scale == 0.0:
            raise ValueError(f"axis {number + 1} of {channel} does not respond: its scale is 0")
    calibration = ChannelCalibration.scaled([one.scale for one in found], [one.offset for one in found], unit)
    return CalibrationRecord({channel: calibration}, {channel: details})


def _described(one: AxisCalibration) -> dict[str, Any]:
    return {
        "scale": one.scale,
        "offset": one.offset,
        "residual": one.residual,
        "largest": one.largest,
        "samples": one.samples,
        "discarded": one.discarded,
    }
