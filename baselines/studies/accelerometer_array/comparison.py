"""Orientation filters of several works on the same motions: gestures with a controller, and recordings of an IMU.

Every estimator starts from its first samples and keeps its default constants, but that the two that have the noise of
each sample among their constants (``array-orientation``, ``marins``) get that of the simulated sensors. Filters
that read one accelerometer get the array's by least squares
(:func:`~poise.filters.arrays.equivalent_imu.array_to_imu`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.formats.load import load_recording, recording_files
from ....envs.data.trajectory import Trajectory
from ....envs.hand.devices import DEVICES, array_preset
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.equivalent_imu import array_to_imu
from ....filters.arrays.spatial.orientation import ArrayOrientation
from ....filters.core.kalman import KalmanFilter
from ....filters.imu.marins import Marins
from ...evaluation import evaluate
from ..kit import Study
from ..report import Report
from .tables import Row, grouped

RATE = 100.0
"""Hz of the simulated gestures"""
ESTIMATORS = ("external-acceleration", "mekf-9", "bounded-motion-9", "vqf-9", "imufusion-9", "ahrs-madgwick-9")
"""Names that are compared besides the two of the thesis; those of packages that are not installed are left out"""
GESTURES = ("slow", "fast", "severe", "pointing", "shaking")
SENSORS = ("array-calibrated", "paper-array")
"""Errors of the simulated controller: calibrated chips with residual biases, and the white noise of the thesis"""
METRICS = ("total", "inclination", "heading")
QUICK_SECONDS, QUICK_RECORDINGS = 30.0, 2


def carried(gesture: str, sensors: str, seed: int, duration: float) -> Trajectory:
    """A controller in a hand, with the channel ``imu/acc`` of the equivalent IMU beside ``array/acc``."""
    device = DEVICES["controller"]
    trajectory = simulate_hand(gesture, seed, array_preset(sensors), RATE, duration, device=device)
    force = array_to_imu(device.array, trajectory.measurements["array/acc"])
    return trajectory.replace(measurements={**trajectory.measurements, "imu/acc": force})


def contenders(array: str, noise: Mapping[str, Any]) -> dict[str, Any]:
    """Label → name or estimator on an array, those of the thesis first; noise as :func:`noise_of` has it."""
    model = ArrayOrientation(array=array, **noise)
    published = ArrayOrientation(array=array, exact_rotation=False, orthonormalise=False, **noise)
    gyroscope: dict[str, Any] = {name: value for name, value in noise.items() if name == "gyroscope_std"}
    found: dict[str, Any] = {
        "array-orientation": KalmanFilter(model, keep_covariance=False),
        "array-orientation, first order": KalmanFilter(published, keep_covariance=False),
        "marins, σ_q = 0.5": KalmanFilter(Marins(**gyroscope), keep_covariance=False),
        "marins, σ_q = 0.01": KalmanFilter(Marins(quaternion_std=0.01, **gyroscope), keep_covariance=False),
    }
    return found | {name: name for name in ESTIMATORS}


def noise_of(sensors: str) -> dict[str, float]:
    """Standard deviations of one sample at :data:`RATE`, as the filters take them, for a field of 50 µT."""
    preset, root = array_preset(sensors), math.sqrt(RATE)
    assert preset.magnetometer is not None
    return {
        "array_std": float(preset.accelerometer.white_noise) * root,
        "gyroscope_std": float(preset.gyroscope.white_noise) * root,
        "magnetometer_std": float(preset.magnetometer.white_noise) * root / 50.0,
    }


def gesture_errors(gesture: str, sensors: str, seed: int, duration: float) -> list[Row]:
    """Errors of every estimator on one gesture, degrees rms.

    Returns:
        A row for each: ``estimator``, ``gesture``, ``sensors``, ``seed``, and the metrics it has.
    """
    trajectory = carried(gesture, sensors, seed, duration)
    rows = scores(trajectory, contenders("controller", noise_of(sensors)))
    return [{"gesture": gesture, "sensors": sensors, "seed": seed, **row} for row in rows]


def recording_errors(path: Path, seconds: float | None) -> list[Row]:
    """Errors of every estimator on a recording; no row if it lacks a magnetometer or a truth.

    ``seconds`` says how much of the motion is taken, with the rest before it; None: all.
    """
    trajectory = load_recording(path)
    if seconds is not None:
        begin = int(np.argmax(trajectory.mask))
        trajectory = trajectory[: begin + max(2, round(seconds / trajectory.dt))]
    if "imu/mag" not in trajectory.measurements or "orientation" not in trajectory.truth:
        return []
    return [{"recording": trajectory.name, **row} for row in scores(trajectory, contenders("triaxial", {}))]


def scores(trajectory: Trajectory, estimators: Mapping[str, Any]) -> list[Row]:
    """Root mean square errors of orientation (of ``up`` where there is none), degrees, a row for each estimator."""
    frame = evaluate(estimators, [trajectory])
    reasons, rows = {name: reason for name, _, reason in frame.attrs["skipped"]}, []
    for name in estimators:
        own = frame[(frame["estimator"] == name) & frame["metric"].isin(METRICS)]
        values: dict[str, float] = {}
        for quantity in ("up", "orientation"):
            for row in own[own["quantity"] == quantity].itertuples():
                values[str(row.metric)] = float(row.value)
        row = {"estimator": name, "skipped": None if values else reasons.get(name, "no estimate")}
        rows.append(row | {metric: values.get(metric) for metric in METRICS})
    return rows


def skipped(rows: list[Row]) -> str:
    """A sentence on what could not be run; empty if all could."""
    found = dict.fromkeys(f"{row['estimator']} ({row['skipped']})" for row in rows if row["skipped"])
    return f" Not run: {', '.join(found)}." if found else ""


def comparison(study: Study, report: Report) -> None:
    """Gestures with the simulated controller, and recordings with an optical truth where there are any."""
    seeds, duration = (1, 20.0) if study.quick else (max(3, study.seeds), 60.0)
    gestures, sensors = (("fast", "pointing"), SENSORS[:1]) if study.quick else (GESTURES, SENSORS)
    jobs = [
        (gesture, kind, study.seed_of("comparison", gesture, index), duration)
        for kind in sensors
        for gesture in gestures
        for index in range(seeds)
    ]
    rows = [row for found in study.map("comparison", gesture_errors, jobs) for row in found]
    note = (
        "Degrees rms, means over the motions; the external-acceleration filter has no heading. All start from their "
        "first samples and learn the field there; only the two filters of the thesis get the noise."
    )
    for kind in sensors:
        for metric in ("total", "inclination"):
            title = f"Works compared: {metric} error on gestures, {kind}"
            report.table(
                title, pivoted([row for row in rows if row["sensors"] == kind], "gesture", metric), note + skipped(rows)
            )
    # Of the files, those of BROAD have what is needed.
    paths = [path for path in recording_files(study.recordings) if path.suffix in (".mat", ".hdf5")]
    if not paths:
        report.text("No recordings were given (`--recordings`, or the folder in `POISE_DATA`).")
        return
    seconds, paths = (QUICK_SECONDS, paths[:QUICK_RECORDINGS]) if study.quick else (None, paths)
    found = study.map("recordings", recording_errors, [(path, seconds) for path in paths])
    rows = [row for part in found for row in part]
    if not rows:
        report.text("None of the recordings has a magnetometer and an optical truth.")
        return
    note = (
        "Degrees rms. One IMU at 286 Hz (BROAD); `array-orientation` reads its accelerometer as an array of three, "
        "with the thesis' noises. Neither it nor Marins estimates the bias of the gyroscope or tests the field for "
        "disturbances, and it takes a sample of the gyroscope for the rate at that instant."
    )
    for metric in ("total", "inclination"):
        report.table(
            f"Works compared: {metric} error on recordings", pivoted(rows, "recording", metric), note + skipped(rows)
        )


def pivoted(rows: list[Row], column: str, metric: str) -> list[Row]:
    """One row an estimator, the best first: one column a motion (mean over seeds), and the mean of all at the end.

    ``column`` is the key of the motions; a recording is named by what is before the first ``_``, the number of the
    trial.
    """
    rows = [row for row in rows if row.get(metric) is not None]
    means = grouped(rows, {"estimator": "estimator", column: "motion"}, {"value": (metric, np.mean)})
    lines: dict[str, Row] = {}
    for entry in means:
        line = lines.setdefault(entry["estimator"], {"estimator": entry["estimator"]})
        line[entry["motion"].split("_")[0]] = entry["value"]
    table = [line | {"mean": float(np.mean(list(line.values())[1:]))} for line in lines.values()]
    return sorted(table, key=lambda line: line["mean"])
