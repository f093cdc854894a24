"""Chapter 4 and appendix B of the thesis: calibration of simulated devices."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ....envs.data.calibration.data import AXES, RateTableData
from ....envs.hand.calibration_runs import (
    ACCELEROMETER_MOUNTINGS,
    accelerometer_runs,
    gyroscope_runs,
    magnetometer_run,
    random_calibration,
)
from ....filters.arrays.array import CONTROLLER, recorded_channel
from ....filters.arrays.calibration.magnetometer import align_magnetometer, fit_ellipsoid
from ....filters.arrays.calibration.rate_table import AxisCalibration, calibrate_accelerometer, calibrate_gyroscope
from ..claims import Claim
from ..kit import Study
from ..report import Report

OVER_DEVICES = "mean, smallest … largest over the devices"
PRINTED_ROTATION = ((0.6629, 0.7487, 0.0071), (-0.0044, -0.0056, 1.0000), (-0.7487, 0.6629, 0.0004))
"""(B.4)"""


def calibrated(seed: int, hold: float) -> dict[str, Any]:
    """A controller with drawn scales and offsets, calibrated on the rate table, ``hold`` s at each rate: errors."""
    truth = random_calibration(CONTROLLER, seed)
    runs = accelerometer_runs(CONTROLLER, truth, seed, hold=hold)
    channel = truth.channels[recorded_channel(CONTROLLER).name]
    scale, offset = np.diag(np.array(channel.matrix)), np.array(channel.offset)
    found: dict[str, Any] = {"scale": [], "offset": [], "residual": [], "largest": []}
    for index, axis in enumerate(CONTROLLER.e):
        one = calibrate_accelerometer(runs.raw[:, index], runs.rate, runs.mounting, upward(axis))
        found["scale"].append(one.scale / scale[index] - 1.0)
        found["offset"].append(one.offset - offset[index])
        found["residual"].append(one.residual)
        found["largest"].append(one.largest)
    turns = gyroscope_runs(truth, seed, hold=hold)
    gyroscope = truth.channels["imu/gyr"]
    found |= {"gyroscope scale": [], "gyroscope offset": [], "gyroscope largest": []}
    for index, (_, _, one) in enumerate(gyroscope_fits(turns)):
        found["gyroscope scale"].append(one.scale / gyroscope.matrix[index][index] - 1.0)
        found["gyroscope offset"].append(float(np.degrees(one.offset - gyroscope.offset[index])))
        found["gyroscope largest"].append(float(np.degrees(one.largest)))
    return found | _magnetometer(seed, truth)


def upward(axis: np.ndarray) -> dict[str, float]:
    """Mounting on the rate table → vertical component of a sensitive axis ``(3,)`` of the device."""
    return {f"{up} up, out {out}": float(AXES[up] @ axis) for up, out in ACCELEROMETER_MOUNTINGS}


def gyroscope_fits(turns: RateTableData) -> Iterator[tuple[np.ndarray, np.ndarray, AxisCalibration]]:
    """Raw readings, rate (rad/s) and fit of each axis of a gyroscope, from the runs in which it was upright."""
    for index, name in enumerate("xyz"):
        along = np.char.startswith(turns.mounting, f"+{name} up")
        raw, rate = turns.raw[along, index], turns.rate[along]
        yield raw, rate, calibrate_gyroscope(raw, rate)


def _magnetometer(seed: int, truth: Any) -> dict[str, float]:
    run = magnetometer_run(truth, seed)
    ellipsoid = fit_ellipsoid(run.raw)
    unit = (run.raw - ellipsoid.centre) @ ellipsoid.root
    assert run.orientation is not None
    alignment = align_magnetometer(unit / np.linalg.norm(unit, axis=1, keepdims=True), run.orientation)
    channel = truth.channels["imu/mag"]
    centre = -np.linalg.solve(np.array(channel.matrix), np.array(channel.offset))
    return {
        "magnetometer centre": float(np.linalg.norm(ellipsoid.centre - centre)),
        "magnetometer residual": float(np.degrees(alignment.residual)),
    }


ROWS: tuple[tuple[str, str | None, str, float, str], ...] = (
    ("accelerometer, error of the scale", None, "scale", 1e4, "10⁻⁴"),
    ("accelerometer, error of the offset", None, "offset", 1e3, "10⁻³ m/s²"),
    ("accelerometer, largest residual of the fit", "±0.7", "largest", 1.0, "m/s²"),
    ("gyroscope, error of the scale", None, "gyroscope scale", 1e4, "10⁻⁴"),
    ("gyroscope, error of the offset", None, "gyroscope offset", 1.0, "°/s"),
    ("gyroscope, largest residual of the fit", "±2.8", "gyroscope largest", 1.0, "°/s"),
    ("magnetometer, centre of the ellipsoid, of 300 counts", None, "magnetometer centre", 1.0, "counts"),
    ("magnetometer, residual of the alignment", None, "magnetometer residual", 1.0, "°"),
)
"""Quantity, what the thesis gives (errors of its fits, in the text), key of :func:`calibrated`, factor, unit"""


def calibration(study: Study, report: Report) -> None:
    """What the procedure of chapter 4 finds of devices whose truth is known, and the rotation of appendix B."""
    seeds, hold = (2, 2.0) if study.quick else (5, 10.0)
    found = study.map("calibration", calibrated, [(study.seed_of("calibration", i), hold) for i in range(seeds)])

    def largest(key: str) -> np.ndarray:
        return np.array([np.abs(one[key]).max() for one in found])

    report.compare(
        "Chapter 4: calibration of simulated devices",
        [
            {"quantity": quantity, "published": published, "values": (factor * largest(key)).tolist(), "unit": unit}
            for quantity, published, key, factor, unit in ROWS
        ],
        f"{seeds} devices, the largest error of each over its axes. Printed are residuals of the thesis' own fits; its "
        "tables 4.1 and 4.2 list the scales and offsets of its sensors, which have no counterpart here.",
        interval=OVER_DEVICES,
    )
    determinant = float(np.linalg.det(np.array(PRINTED_ROTATION)))
    scale = max(largest("scale").max(), largest("gyroscope scale").max())
    found_claims = [
        Claim.less(
            "Scales of accelerometers and gyroscopes are found to a tenth of a per cent", float(scale), 1e-3, ""
        ),
        *(
            Claim.less(
                f"Noise explains less than half of the thesis' residual of the {sensor}",
                float(largest(key).max()),
                residual,
                unit,
                factor=0.5,
            )
            for sensor, key, residual, unit in (
                ("accelerometer", "largest", 0.7, "m/s²"),
                ("gyroscope", "gyroscope largest", 2.8, "°/s"),
            )
        ),
        Claim("Appendix B: (B.4) is a rotation", f"determinant {determinant:.3f}", determinant > 0.0),
        Claim.within("Appendix B: (B.4) is a mirror, and nothing else", determinant, -1.01, -0.99),
    ]
    note = "`poise calibrate` refuses a fit with a negative determinant: one of the two frames is then left-handed."
    report.claims("Chapter 4 and appendix B: what holds here", found_claims, note)
