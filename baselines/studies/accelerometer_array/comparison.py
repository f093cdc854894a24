"""Orientation filters of several works on the same motions: gestures with a controller, and recordings of an IMU.

Every estimator starts from its first samples and keeps its default constants, but that the two that have the noise of
each sample among their constants (``array-orientation``, ``marins``) are told that of the simulated sensors. Filters
that know of one accelerometer get the array's by least squares
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

RATE = 100.0
"""Hz of the simulated gestures"""
ESTIMATORS = ("external-acceleration", "mekf-9", "bounded-motion-9", "vqf-9", "imufusion-9", "ahrs-madgwick-9")
"""Names that are compared besides the two of the thesis; those of packages that are not installed are left out"""
GESTURES = ("slow", "fast", "severe", "pointing", "shaking")
SENSORS = ("array-calibrated", "paper-array")
"""Errors of the simulated controller: calibrated chips with residual biases, and the white noise of the thesis"""
METRICS = ("total", "inclination", "heading")


def held(gesture: str, sensors: str, seed: int, duration: float) -> Trajectory:
    """A controller in a hand, with the channel ``imu/acc`` of the equivalent IMU beside ``array/acc``."""
    device = DEVICES["controller"]
    trajectory = simulate_hand(gesture, seed, array_preset(sensors), RATE, duration, device=device)
    force = array_to_imu(device.array, trajectory.measurements["array/acc"])
    return trajectory.replace(measurements={**trajectory.measurements, "imu/acc": force})


def contenders(array: str, noise: Mapping[str, Any]) -> dict[str, Any]:
    """Label → name or estimator, those of the thesis first.

    Args:
        array: ``controller`` or ``triaxial``.
        noise: ``array_deviation``, ``gyroscope_deviation``, ``magnetometer_deviation``; what is absent stays default.
    """
    model = ArrayOrientation(array=array, **noise)
    printed = ArrayOrientation(array=array, exact_rotation=False, orthonormalise=False, **noise)
    gyroscope: dict[str, Any] = {name: value for name, value in noise.items() if name == "gyroscope_deviation"}
    found: dict[str, Any] = {
        "array-orientation": KalmanFilter(model, keep_covariance=False),
        "array-orientation, first order": KalmanFilter(printed, keep_covariance=False),
        "marins, σ_q = 0.5": KalmanFilter(Marins(**gyroscope), keep_covariance=False),
        "marins, σ_q = 0.01": KalmanFilter(Marins(quaternion_deviation=0.01, **gyroscope), keep_covariance=False),
    }
    return found | {name: name for name in ESTIMATORS}


def noise_of(sensors: str) -> dict[str, float]:
    """Standard deviations of one sample at :data:`RATE`, as the filters want them; the field is taken for 50 µT."""
    preset, root = array_preset(sensors), math.sqrt(RATE)
    assert preset.magnetometer is not None
    return {
        "array_deviation": float(preset.accelerometer.white_noise) * root,
        "gyroscope_deviation": float(preset.gyroscope.white_noise) * root,
        "magnetometer_deviation": float(preset.magnetometer.white_noise) * root / 50.0,
    }


def gesture_errors(gesture: str, sensors: str, seed: int, duration: float) -> list[dict[str, Any]]:
    """Errors of every estimator on one gesture, degrees rms.

    Returns:
        A row for each: ``estimator``, ``gesture``, ``sensors``, ``seed``, and the metrics it has.
    """
    trajectory = held(gesture, sensors, seed, duration)
    rows = scores(trajectory, contenders("controller", noise_of(sensors)))
    return [{"gesture": gesture, "sensors": sensors, "seed": seed, **row} for row in rows]


def recording_errors(path: Path, seconds: float | None) -> list[dict[str, Any]]:
    """Errors of every estimator on a recording with a magnetometer and a truth.

    Args:
        path: file.
        seconds: how much of the motion is taken, with the rest before it; None: all.

    Returns:
        A row for each estimator; none if the recording lacks what is needed.
    """
    trajectory = load_recording(path)
    if seconds is not None:
        begin = int(np.argmax(trajectory.mask))
        trajectory = trajectory[: begin + max(2, round(seconds / trajectory.dt))]
    if "imu/mag" not in trajectory.measurements or "orientation" not in trajectory.truth:
        return []
    return [{"recording": trajectory.name, **row} for row in scores(trajectory, contenders("triaxial", {}))]


def scores(trajectory: Trajectory, estimators: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Root mean square errors of orientation (of ``up`` where there is none), degrees, a row for each estimator."""
    frame = evaluate(estimators, [trajectory])
    rows = []
    for name in estimators:
        own = frame[(frame["estimator"] == name) & frame["metric"].isin(METRICS)]
        values: dict[str, float] = {}
        for quantity in ("up", "orientation"):
            for row in own[own["quantity"] == quantity].itertuples():
                values[str(row.metric)] = float(row.value)
        if values:
            rows.append({"estimator": name} | {metric: values.get(metric) for metric in METRICS})
    return rows


def recordings_of(paths: tuple[Path, ...]) -> list[Path]:
    """The BROAD trials among recordings: other files have no truth."""
    return [path for path in recording_files(paths) if path.suffix in (".mat", ".hdf5")]
