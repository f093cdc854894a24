"""From the data of calibration runs to calibration records, one channel each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..filters import rotation
from ..filters.accelerometer_array.array import AccelerometerArray
from ..filters.accelerometer_array.calibration_magnetometer import align_magnetometer, fit_ellipsoid
from ..filters.accelerometer_array.calibration_rate_table import (
    AxisCalibration,
    calibrate_accelerometer,
    calibrate_gyroscope,
)
from .calibration import CalibrationRecord, ChannelCalibration
from .calibration_data import AXES, MagnetometerData, RateTableData
from .sensors import STANDARD_GRAVITY


def spatial_axes(array: AccelerometerArray) -> np.ndarray:
    """Sensitive axes ``(m, 3)``; those of a planar array lie in x and y."""
    return np.pad(array.e, ((0, 0), (0, 3 - array.dimension)))


def accelerometer_channel(array: AccelerometerArray) -> str:
    """Name of the channel: ``imu/acc`` for a triaxial accelerometer, else ``array/acc``."""
    return "imu/acc" if array.name == "triaxial" else array.channel.name


def accelerometer_record(
    data: RateTableData,
    array: AccelerometerArray,
    channel: str | None = None,
    *,
    gravity: float = STANDARD_GRAVITY,
    saturation: float | None = None,
) -> CalibrationRecord:
    """Calibrate every accelerometer of an array.

    Args:
        data: runs on a rate table.
        array: the nominal directions of the sensitive axes.
        channel: name for the record; None for that of the array.
        gravity: m/s².
        saturation: magnitude of raw readings that are discarded.

    Raises:
        ValueError: another number of columns than accelerometers, or poses that do not determine one of them.
    """
    if data.raw.shape[1] != array.size:
        raise ValueError(
            f"array {array.name!r} has {array.size} accelerometers, but the runs have {data.raw.shape[1]} columns of "
            "raw readings"
        )
    found, rows = [], []
    for number, axis in enumerate(spatial_axes(array)):
        upward = {
            name: float(AXES[up] @ axis) for name, up in set(zip(data.mounting.tolist(), data.up.tolist(), strict=True))
        }
        try:
            one = calibrate_accelerometer(
                data.raw[:, number], data.rate, data.mounting, upward, gravity=gravity, saturation=saturation
            )
        except ValueError as reason:
            raise ValueError(f"accelerometer {number + 1} of {array.name!r}: {reason}") from None
        found.append(one)
        rows.append(_described(one) | {"positions": dict(one.positions), "along": along(one, data, axis)})
    name = channel or accelerometer_channel(array)
    return _record(name, found, "m/s²", {"array": array.describe(), "gravity": gravity, "axes": rows})


def along(one: AxisCalibration, data: RateTableData, axis: np.ndarray) -> float | None:
    """eᵀr from the device's origin, m: mountings whose origin lies at one distance d outwards have ρ = eᵀr + d eᵀo.

    None where they do not tell the two apart (only one direction).
    """
    names = dict(zip(data.mounting.tolist(), data.out.tolist(), strict=True))
    rows = [[1.0, float(AXES[names[name]] @ axis)] for name in one.positions if names[name]]
    values = [value for name, value in one.positions.items() if names[name]]
    if not rows:
        return None
    columns = np.array(rows)
    if not columns[:, 1].any():
        return float(np.mean(values))
    if np.linalg.matrix_rank(columns) < 2:
        return None
    return float(np.linalg.lstsq(columns, np.array(values), rcond=None)[0][0])


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
        ValueError: readings that are no ellipsoid, or attitudes that do not suffice.
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
