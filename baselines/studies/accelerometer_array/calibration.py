"""Chapter 4 and appendix B of the thesis on the game controller, beside ours: calibration of simulated devices."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....envs.data.calibration.channels import accelerometer_channel
from ....envs.hand.calibration_runs import (
    ACCELEROMETER_MOUNTINGS,
    accelerometer_runs,
    gyroscope_runs,
    magnetometer_run,
    random_calibration,
)
from ....envs.sensors.ideal import STANDARD_GRAVITY
from ....filters.arrays.array import CONTROLLER
from ....filters.arrays.calibration.magnetometer import align_magnetometer, fit_ellipsoid
from ....filters.arrays.calibration.rate_table import calibrate_accelerometer, calibrate_gyroscope
from ..kit import Study
from ..report import Report

OVER_DEVICES = "mean, smallest … largest over the devices"
AXES = {"x": 0, "y": 1, "z": 2}
PRINTED_ROTATION = ((0.6629, 0.7487, 0.0071), (-0.0044, -0.0056, 1.0000), (-0.7487, 0.6629, 0.0004))
"""(B.4)"""


def calibrated(seed: int, hold: float) -> dict[str, Any]:
    """A controller with drawn scales and offsets on the rate table, calibrated; errors of what is found.

    Args:
        seed: of device, motion and noise.
        hold: time at each rate, s.
    """
    truth = random_calibration(CONTROLLER, seed)
    runs = accelerometer_runs(CONTROLLER, truth, seed, hold=hold)
    channel = truth.channels[accelerometer_channel(CONTROLLER)]
    scale, offset = np.diag(np.array(channel.matrix)), np.array(channel.offset)
    found: dict[str, Any] = {"scale": [], "offset": [], "residual": [], "largest": []}
    for index, axis in enumerate(CONTROLLER.e):
        upward = {}
        for up, out in ACCELEROMETER_MOUNTINGS:
            upward[f"{up} up, out {out}"] = float(axis[AXES[up[1]]] * float(up[0] + "1"))
        one = calibrate_accelerometer(runs.raw[:, index], runs.rate, runs.mounting, upward, gravity=STANDARD_GRAVITY)
        found["scale"].append(one.scale / scale[index] - 1.0)
        found["offset"].append(one.offset - offset[index])
        found["residual"].append(one.residual)
        found["largest"].append(one.largest)
    turns = gyroscope_runs(truth, seed, hold=hold)
    gyroscope = truth.channels["imu/gyr"]
    found |= {"gyroscope scale": [], "gyroscope offset": [], "gyroscope largest": []}
    for index, name in enumerate("xyz"):
        along = np.char.startswith(turns.mounting, f"+{name} up")
        one = calibrate_gyroscope(turns.raw[along, index], turns.rate[along])
        found["gyroscope scale"].append(one.scale / gyroscope.matrix[index][index] - 1.0)
        found["gyroscope offset"].append(float(np.degrees(one.offset - gyroscope.offset[index])))
        found["gyroscope largest"].append(float(np.degrees(one.largest)))
    return found | _magnetometer(seed, truth)


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


def calibration(study: Study, report: Report) -> None:
    """Tables 4.1 and 4.2: what the procedure finds of devices whose truth is known, and the mirror of appendix B."""
    seeds, hold = (2, 2.0) if study.quick else (5, 10.0)
    found = study.map("calibration", calibrated, [(study.seed_of("calibration", i), hold) for i in range(seeds)])

    def largest(key: str) -> list[float]:
        return [float(np.abs(one[key]).max()) for one in found]

    rows = [
        ("accelerometer, error of the scale", None, [1e4 * value for value in largest("scale")], "10⁻⁴"),
        ("accelerometer, error of the offset", None, [1e3 * value for value in largest("offset")], "10⁻³ m/s²"),
        ("accelerometer, error of the fit (Table 4.1)", "±0.7", largest("largest"), "m/s²"),
        ("gyroscope, error of the scale", None, [1e4 * value for value in largest("gyroscope scale")], "10⁻⁴"),
        ("gyroscope, error of the offset", None, largest("gyroscope offset"), "°/s"),
        ("gyroscope, error of the fit (Table 4.2)", "±2.8", largest("gyroscope largest"), "°/s"),
        ("magnetometer, centre of the ellipsoid, of 300 counts", None, largest("magnetometer centre"), "counts"),
        ("magnetometer, residual of the alignment", None, largest("magnetometer residual"), "°"),
    ]
    report.compare(
        "Tables 4.1 and 4.2: calibration of simulated devices",
        [
            {"quantity": quantity, "printed": printed, "values": values, "unit": unit}
            for quantity, printed, values, unit in rows
        ],
        f"{seeds} devices, the largest error of each over its axes. The scales and offsets of the thesis' own sensors "
        "cannot be simulated; that its fits leave 0.7 m/s² and 2.8 °/s, far more than noise, points to errors "
        "that a scale "
        "and an offset do not describe.",
        interval=OVER_DEVICES,
    )
    determinant = float(np.linalg.det(np.array(PRINTED_ROTATION)))
    report.text(
        f"Appendix B: the determinant of the printed rotation (B.4) is {determinant:.3f}, so it is a mirror. `poise "
        "calibrate` refuses such a fit and says that one of the two frames is left-handed."
    )
