"""Figures 4.6 to 4.21 and Tables 4.1 and 4.2 of the thesis, on a simulated controller with the scales that it found.

The true scales and offsets of the simulated device are those of Tables 4.1 and 4.2, so that the tables say how well the
procedure of chapter 4 finds them. The thesis' ±0.7 m/s² and ±2.8 °/s are residuals of its fits (Figures 4.9 and 4.14).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....envs.data.calibration.records import CalibrationRecord, ChannelCalibration
from ....envs.hand.calibration_runs import (
    GYROSCOPE_RANGE,
    LONE_GYROSCOPE,
    accelerometer_runs,
    counts,
    gyroscope_runs,
    held_rates,
    magnetometer_run,
    random_calibration,
)
from ....envs.hand.controller_gestures import BOTH_WAYS, RateTable
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.array import CONTROLLER, recorded_channel
from ....filters.arrays.calibration.magnetometer import fit_ellipsoid
from ....filters.arrays.calibration.rate_table import calibrate_accelerometer, calibrate_gyroscope
from ....filters.core.quantity import DEG, STANDARD_GRAVITY
from ..claims import Claim
from ..kit import Study
from ..report import Report
from .calibration import gyroscope_fits, upward
from .rate_table_figures import rate_table_figures

MILLI_G = 1e-3 * STANDARD_GRAVITY
TABLE_4_1 = {
    "1 x": (4.24, 5.3061),
    "1 y": (4.17, 34.8980),
    "1 z": (4.23, 169.6327),
    "2 x": (3.63, 10.8367),
    "2 y": (4.00, 65.8776),
    "2 z": (4.24, 149.1531),
}
"""Axis of the two ADXL345 → scale factor in mg/LSB, offset in mg"""
TABLE_4_2 = {"x": (8.7700, -0.4978, 0.999994), "y": (8.8805, -0.2228, 0.999993), "z": (8.6502, -0.0655, 0.999992)}
"""Axis of the L3G4200D → scale factor in mdps/digit, offset in dps, correlation coefficient"""
NONLINEARITY = {"accelerometer": (0.005, 4.0 * STANDARD_GRAVITY), "gyroscope": (0.002, 500.0 * DEG)}
"""Sensor → share of the whole range (m/s², rad/s) by which the data sheets let readings leave a straight line"""
PLACES = (0.0, 0.2)
"""m from the axis of the table: the two places of Figure 4.15 (the thesis gives none)"""


def thesis_device(seed: int) -> CalibrationRecord:
    """A controller whose accelerometers and gyroscope have the scales and offsets of Tables 4.1 and 4.2."""
    channel = recorded_channel(CONTROLLER).name
    found = dict(random_calibration(CONTROLLER, seed).channels)
    scales, offsets = (MILLI_G * np.array([row[k] for row in TABLE_4_1.values()]) for k in (0, 1))
    found[channel] = ChannelCalibration.scaled(scales, offsets, "m/s²")
    gains, zeros = (np.array([row[k] for row in TABLE_4_2.values()]) for k in (0, 1))
    found["imu/gyr"] = ChannelCalibration.scaled(1e-3 * DEG * gains, DEG * zeros, "rad/s")
    return CalibrationRecord(found)


def bent(raw: np.ndarray, scale: float, offset: float, sensor: str) -> np.ndarray:
    """Raw readings of the same sensor if it is not linear: off by a sine of one period over its range."""
    share, span = NONLINEARITY[sensor]
    return raw + share * span / scale * np.sin(2.0 * math.pi * (scale * raw + offset) / span)


def on_the_table(truth: CalibrationRecord, rates: tuple[float, ...], place: float, seed: int, hold: float) -> Any:
    """Rate of the table (rad/s) and raw readings of the gyroscope about it, ``(2, T)``, while the rate is constant."""
    table = RateTable(rates=rates, hold=hold, offset=(place, 0.0, 0.0))
    run = simulate_hand(table, seed, device=LONE_GYROSCOPE)
    steady, rate = held_rates(table, run.time)
    raw = counts(truth.channels["imu/gyr"], run.measurements["imu/gyr"][steady], GYROSCOPE_RANGE)
    return np.stack([rate, raw[:, 2]])


def measured(seed: int, hold: float) -> dict[str, Any]:
    """Everything that the tables and figures of chapter 4 show, of one device, as lists."""
    truth = thesis_device(seed)
    runs = accelerometer_runs(CONTROLLER, truth, seed, hold=hold)
    found: dict[str, Any] = {"accelerometer": {}, "gyroscope": {}, "runs": {}}
    for index, (name, axis) in enumerate(zip(TABLE_4_1, CONTROLLER.e, strict=True)):
        vertical = upward(axis)
        one = calibrate_accelerometer(runs.raw[:, index], runs.rate, runs.mounting, vertical)
        curved = bent(runs.raw[:, index], one.scale, one.offset, "accelerometer")
        left = calibrate_accelerometer(curved, runs.rate, runs.mounting, vertical).largest
        found["accelerometer"][name] = [one.scale / MILLI_G, one.offset / MILLI_G, one.largest, left]
        if index == 0:
            # imposed acceleration in the sensor's axis: gravity less the centripetal one of the place that was found
            place = np.array([one.positions.get(mounting, 0.0) for mounting in runs.mounting])
            up = np.array([vertical[mounting] for mounting in runs.mounting])
            found["runs"] = {
                "time": runs.time.tolist(),
                "mounting": list(map(str, runs.mounting)),
                "rate": np.degrees(runs.rate).tolist(),
                "raw": runs.raw[:, index].tolist(),
                "imposed": (STANDARD_GRAVITY * up - place * runs.rate**2).tolist(),
                "fitted": [one.scale, one.offset],
            }
    turns = gyroscope_runs(truth, seed, hold=hold)
    for name, (raw, rate, one) in zip("xyz", gyroscope_fits(turns), strict=True):
        unsaturated = np.abs(one.scale * raw + one.offset - rate) < 5.0 * DEG
        correlation = float(np.corrcoef(raw[unsaturated], rate[unsaturated])[0, 1])
        left = calibrate_gyroscope(bent(raw, one.scale, one.offset, "gyroscope"), rate).largest / DEG
        found["gyroscope"][name] = [one.scale / DEG * 1e3, one.offset / DEG, correlation, one.largest / DEG, left]
        if name == "z":
            found["turns"] = {
                "time": turns.time[np.char.startswith(turns.mounting, "+z up")].tolist(),
                "rate": np.degrees(rate).tolist(),
                "raw": raw.tolist(),
                "fitted": [one.scale, one.offset],
                "kept": unsaturated.tolist(),
            }
    inside = tuple(rate for rate in BOTH_WAYS if abs(rate) < 240.0 * DEG)
    pairs = {
        "places": [on_the_table(truth, inside, place, seed + k, hold) for k, place in enumerate(PLACES)],
        "ways": [on_the_table(truth, way, 0.0, seed + 2 + k, hold) for k, way in enumerate((inside, inside[::-1]))],
    }
    found["pairs"] = {name: [np.degrees(pair[0]).tolist() for pair in both] for name, both in pairs.items()}
    found["lines"] = {name: [np.polyfit(pair[0], pair[1], 1).tolist() for pair in both] for name, both in pairs.items()}
    run = magnetometer_run(truth, seed)
    ellipsoid = fit_ellipsoid(run.raw)
    unit = (run.raw - ellipsoid.centre) @ ellipsoid.root
    found["magnetometer"] = {"raw": run.raw[::10].tolist(), "unit": unit[::10].tolist()}
    return found


def line_difference(lines: list[list[float]], largest: float = 240.0) -> float:
    """Largest difference of two best-fit lines within ± that rate (deg/s), digits."""
    rates = np.array([-largest, largest]) * DEG
    one, other = (np.polyval(line, rates) for line in lines)
    return float(np.abs(one - other).max())


def rate_table(study: Study, report: Report) -> None:
    """Tables 4.1 and 4.2, figures 4.6 to 4.21, and what holds of them."""
    hold = 2.0 if study.quick else 10.0
    found = study.cached("rate table", measured, study.seed_of("rate table", 0), hold)
    rows = [
        {"axis": axis, "scale, mg/LSB": TABLE_4_1[axis][0], "scale found": round(scale, 3)}
        | {"offset, mg": TABLE_4_1[axis][1], "offset found": round(offset, 3), "largest residual, m/s²": round(left, 3)}
        for axis, (scale, offset, left, _) in found["accelerometer"].items()
    ]
    report.table("Table 4.1: scale and offset of the accelerometers", rows, SAME)
    rows = [
        {"axis": axis, "scale, mdps/digit": TABLE_4_2[axis][0], "scale found": round(scale, 4)}
        | {"offset, dps": TABLE_4_2[axis][1], "offset found": round(offset, 4)}
        | {"correlation": TABLE_4_2[axis][2], "correlation here": round(correlation, 8), "largest residual, °/s": left}
        for axis, (scale, offset, correlation, left, _) in found["gyroscope"].items()
    ]
    report.table("Table 4.2: scale and offset of the gyroscope", rows, SAME)
    scales = {axis: abs(row[0] / TABLE_4_1[axis][0] - 1.0) for axis, row in found["accelerometer"].items()}
    offsets = {axis: abs(row[1] - TABLE_4_1[axis][1]) for axis, row in found["accelerometer"].items()}
    gains = {axis: abs(row[0] / TABLE_4_2[axis][0] - 1.0) for axis, row in found["gyroscope"].items()}
    zeros = {axis: abs(row[1] - TABLE_4_2[axis][1]) for axis, row in found["gyroscope"].items()}
    left, curved = (max(row[k] for row in found["accelerometer"].values()) for k in (2, 3))
    turning, curving = (max(row[k] for row in found["gyroscope"].values()) for k in (3, 4))
    places, ways = (line_difference(found["lines"][name]) for name in ("places", "ways"))
    report.claims(
        "Chapter 4, the thesis' device: what holds",
        [
            Claim.every("Table 4.1: every scale is found to a tenth of a per cent", scales, 1e-3, ""),
            Claim.every("Table 4.1: every offset is found within 2 mg", offsets, 2.0, "mg"),
            Claim.every("Table 4.2: every scale is found to a tenth of a per cent", gains, 1e-3, ""),
            Claim.every("Table 4.2: every offset is found within 0.02 °/s", zeros, 0.02, "°/s"),
            *(
                Claim.within(
                    f"{figure}: with the data sheet's nonlinearity the largest residual is about the published one",
                    value,
                    0.5 * published,
                    2.0 * published,
                    unit,
                )
                for figure, value, published, unit in (
                    ("Figure 4.9", curved, 0.7, "m/s²"),
                    ("Figure 4.14", curving, 2.8, "°/s"),
                )
            ),
            Claim.less("Figure 4.9: noise and digits alone leave less than half", left, 0.7, "m/s²", factor=0.5),
            Claim.less("Figure 4.9: of that the nonlinearity makes more than half", left, curved, "m/s²", factor=0.5),
            Claim.less("Figure 4.14: noise and digits alone leave less than half", turning, 2.8, "°/s", factor=0.5),
            Claim.less("Figure 4.16: the lines of two places differ by less than 40 digits", places, 40.0, "digits"),
            Claim.less("Figure 4.19: the lines back and forth differ by at most 40 digits", ways, 40.0, "digits"),
        ],
    )
    rate_table_figures(report, found)


SAME = "The device is simulated with the published values; beside them is what the procedure finds."
