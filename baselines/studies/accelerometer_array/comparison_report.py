"""Filters of several works on the same motions, as a section of the study of the accelerometer array."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..kit import Study
from ..report import Report
from .comparison import GESTURES, SENSORS, gesture_errors, recording_errors, recordings_of

QUICK_GESTURES = ("fast", "pointing")
QUICK_SECONDS = 30.0
QUICK_RECORDINGS = 2


def comparison(study: Study, report: Report) -> None:
    """Gestures with the simulated controller, and recordings with an optical truth where there are any."""
    seeds, duration = (1, 20.0) if study.quick else (max(3, study.seeds), 60.0)
    gestures, sensors = (QUICK_GESTURES, SENSORS[:1]) if study.quick else (GESTURES, SENSORS)
    jobs = [
        (gesture, kind, study.seed_of("comparison", gesture, index), duration)
        for kind in sensors
        for gesture in gestures
        for index in range(seeds)
    ]
    rows = [row for found in study.map("comparison", gesture_errors, jobs) for row in found]
    note = (
        "Degrees rms, means over the motions; the external-acceleration filter has no heading. All start from "
        "their first samples and learn the field there; only the two filters of the thesis are told the noise."
    )
    for kind in sensors:
        chosen = [row for row in rows if row["sensors"] == kind]
        for metric in ("total", "inclination"):
            report.table(
                f"Works compared: {metric} error on gestures, {kind}", pivoted(chosen, "gesture", metric), note
            )
    paths = recordings_of(study.recordings)
    if not paths:
        report.text("No recordings were given (`--recordings`, or the folder in `POISE_DATA`).")
        return
    seconds = QUICK_SECONDS if study.quick else None
    paths = paths[:QUICK_RECORDINGS] if study.quick else paths
    found = study.map("recordings", recording_errors, [(path, seconds) for path in paths])
    rows = [row for part in found for row in part]
    if not rows:
        report.text("None of the recordings has a magnetometer and an optical truth.")
        return
    for metric in ("total", "inclination"):
        report.table(
            f"Works compared: {metric} error on recordings",
            pivoted(rows, "recording", metric, short=True),
            "Degrees rms. One IMU at 286 Hz (BROAD); `array-orientation` reads its accelerometer as an array of "
            "three, with "
            "the thesis' noises. Neither it nor Marins estimates the bias of the gyroscope or tests the field for "
            "disturbances, and it takes a sample of the gyroscope for the rate at that instant.",
        )


def pivoted(rows: Iterable[dict[str, Any]], column: str, metric: str, *, short: bool = False) -> list[dict[str, Any]]:
    """One row an estimator, one column a motion (means over seeds), and the mean of all at the end.

    Args:
        rows: with ``estimator``, ``column`` and metrics.
        column: key of the motions.
        metric: which.
        short: name columns by what is before the first ``_`` (the number of a trial).
    """
    rows = [row for row in rows if row.get(metric) is not None]
    motions = list(dict.fromkeys(row[column] for row in rows))
    table = []
    for name in dict.fromkeys(row["estimator"] for row in rows):
        line: dict[str, Any] = {"estimator": name}
        for motion in motions:
            values = [row[metric] for row in rows if row["estimator"] == name and row[column] == motion]
            line[motion.split("_")[0] if short else motion] = float(np.mean(values)) if values else None
        known = [value for value in list(line.values())[1:] if value is not None]
        table.append(line | {"mean": float(np.mean(known))})
    return sorted(table, key=lambda line: line["mean"])
