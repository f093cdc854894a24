"""Calibrate raw sensors from CSV files (or simulated runs) and keep the result as a record that loaders apply.

accelerometer: runs on a rate table; columns time, up, out (+x … -z: the axis of the device that points up, outwards),
rate (rad/s) or rate_dps (deg/s), and one column of raw readings for each accelerometer of --array.
gyroscope: the same with three columns of raw readings; each axis upright once.
magnetometer: rotated through all attitudes; columns time, x, y, z and, to align it, qw, qx, qy, qz (reference attitude,
device to world).
frame: rotation between a tracker's frame and the device; columns bx, by, bz (axes in the device), ox, oy, oz (tracker).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import tyro

from ..output import Output
from ..targets import check_file, check_folder

if TYPE_CHECKING:
    from ...envs.data.calibration.records import CalibrationRecord


@dataclass
class Args:
    """Arguments of ``poise calibrate``."""

    sensor: tyro.conf.Positional[Literal["accelerometer", "gyroscope", "magnetometer", "frame"]]
    """what is calibrated"""
    files: tyro.conf.Positional[tuple[Path, ...]] = ()
    """CSV files of one device"""
    array: str = "triaxial"
    """accelerometers: triaxial (one IMU), octa, controller, planar, or a JSON file (`poise array --help`)"""
    channel: str | None = None
    """channel that the record calibrates; by default imu/acc (arrays: array/acc), imu/gyr, imu/mag"""
    record: Path = Path("calibration.json")
    """file of the record; existing channels of other sensors in it are kept"""
    gravity: float = 9.80665
    """local gravity, m/s²"""
    saturation: float | None = None
    """raw readings of at least this magnitude are discarded; by default those that stay at the end of the range"""
    estimate_axes: bool = False
    """accelerometers: find the directions of their axes too; needs runs with each axis up, and one upside down"""
    simulate: bool = False
    """no files: simulate the runs of a device with random scales and offsets, and compare with the truth"""
    hold: float = 3.0
    """of simulated runs: time at each rate of the table, s"""
    seed: int = 0
    """of simulated runs"""
    axis_error: float = 0.0
    """of simulated runs: standard deviation of the directions of the accelerometers' axes, deg"""
    raw: Path | None = None
    """folder for the simulated runs as CSV files, with their true record: examples of the format"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Calibrate, print, and write the record."""
    from ...envs.data.calibration.records import CalibrationRecord, load_calibration

    if args.simulate == bool(args.files):
        raise ValueError("name CSV files, or --simulate runs instead of them")
    check_file("record", args.record, args.files)
    check_folder("raw", args.raw)
    if args.raw is not None and not args.simulate:
        raise ValueError("raw is where --simulate leaves its runs: it needs --simulate")
    with Output("calibrate", args) as out:
        earlier = load_calibration(args.record) if args.record.is_file() else CalibrationRecord({})
        found, truth = (frame(args), None) if args.sensor == "frame" else calibrate(args, out)
        earlier.merged(found).save(args.record)
        show(found, truth, out)
        out.add(record=found.describe(), path=str(args.record))
        out.say(f"record: {args.record}")
    return 0


def calibrate(args: Args, out: Output) -> tuple[CalibrationRecord, CalibrationRecord | None]:
    """The record found, and the true one of simulated runs."""
    from ...envs.data.calibration import channels as channels
    from ...envs.data.calibration.data import MagnetometerData, RateTableData, read_magnetometer, read_rate_table
    from ...envs.hand import calibration_runs as runs
    from ...filters.arrays.files import load_array

    array, files = load_array(args.array), list(args.files)
    truth = runs.random_calibration(array, args.seed) if args.simulate else None
    data: RateTableData | MagnetometerData
    if args.sensor == "magnetometer":
        data = read_magnetometer(files) if truth is None else runs.magnetometer_run(truth, args.seed)
        found = channels.magnetometer_record(data, args.channel or "imu/mag")
    elif args.sensor == "gyroscope":
        data = read_rate_table(files) if truth is None else runs.gyroscope_runs(truth, args.seed, hold=args.hold)
        found = channels.gyroscope_record(data, args.channel or "imu/gyr", saturation=args.saturation)
    else:
        if truth is None:
            data = read_rate_table(files)
        else:
            built = runs.built_with(array, math.radians(args.axis_error), args.seed)
            data = runs.accelerometer_runs(built, truth, args.seed, hold=args.hold)
        found = channels.accelerometer_record(
            data,
            array,
            args.channel,
            gravity=args.gravity,
            saturation=args.saturation,
            estimate_axes=args.estimate_axes,
        )
    if truth is not None and args.raw is not None:
        data.save(args.raw / f"{args.sensor}.csv")
        truth.save(args.raw / "true-calibration.json")
        runs.nominal_calibration(array).save(args.raw / "data-sheet-calibration.json")
        out.say(f"simulated runs: {args.raw / f'{args.sensor}.csv'}")
    return found, truth


def show(found: CalibrationRecord, truth: CalibrationRecord | None, out: Output) -> None:
    """Tables of what was found."""
    if "frame" in found.details:
        details = found.details["frame"]
        out.say(f"tracker to device: {details['tracker_to_device']}, residual {details['residual_deg']:.3f}°")
    for name, calibration in found.channels.items():
        details = found.details[name]
        if "axes" not in details:
            rows: list[dict[str, Any]] = [
                {"quantity": key.replace("_", " "), "value": value}
                for key, value in details.items()
                if isinstance(value, bool | int | float)
            ]
            out.table(rows, f"{name}: ellipsoid and alignment", digits=4)
        else:
            out.table(
                [row(number, axis) for number, axis in enumerate(details["axes"], 1)], f"{name}, {calibration.unit}"
            )
        if truth is None:
            continue
        true = next((one for key, one in truth.channels.items() if key.split("/")[-1] == name.split("/")[-1]), None)
        if true is not None:
            matrix, right = np.array(calibration.matrix), np.array(true.matrix)
            out.say(
                f"against the truth: matrix {np.abs(matrix @ np.linalg.inv(right) - np.eye(len(right))).max():.1e} "
                f"(relative), offset {np.abs(np.array(calibration.offset) - np.array(true.offset)).max():.1e} "
                f"{calibration.unit}"
            )


def row(number: int, axis: dict[str, Any]) -> dict[str, Any]:
    """One sensitive axis in a table."""
    shown = {"axis": number, "scale": axis["scale"], "offset": axis["offset"]}
    if "along" in axis:
        shown["place along it (m)"] = axis["along"]
    if axis.get("turned"):
        shown["turned (deg)"] = float(np.degrees(axis["turned"]))
    return shown | {name: axis[name] for name in ("residual", "largest", "samples", "discarded")}


def frame(args: Args) -> CalibrationRecord:
    """Rotation from the tracker's frame to the device."""
    from ...envs.data.calibration.data import read_axes
    from ...envs.data.calibration.records import CalibrationRecord
    from ...filters.arrays.calibration.frame import align_axes
    from ...filters.core import rotation

    if len(args.files) != 1:
        raise ValueError(f"frame needs one CSV file (and has no simulated run), got {len(args.files)}")
    fit = align_axes(*read_axes(args.files[0]))
    quaternion = rotation.from_matrix(fit.matrix).tolist()
    details = {
        "tracker_to_device": quaternion,
        "residual_deg": float(np.degrees(fit.residual)),
        "singular_values": fit.singular_values.tolist(),
    }
    return CalibrationRecord({}, {"frame": details})
