"""Angular rate of a shaken array without a gyroscope: the comparison of chapter 2 of the thesis, on simulated OCTAs.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval. Motions are those of ``gesture="shaking"``, readings those of the environment's device ``octa``; functions return
rows that JSON can hold, for :class:`~poise.baselines.studies.kit.Study`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.devices import ArrayPreset, array_preset, per_sample
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.rate import ANGULAR_RATE, ArrayRate
from ....filters.core import metrics
from ....filters.core.estimator import run
from ....filters.core.observer import Observer

RATE = 100.0
"""Hz"""
DURATION = 100.0
"""s of a run, as in the thesis"""

PRINTED = {
    "weighted": (0.4195, 0.6350, 0.6781, 0.6456, 0.6714, 0.6274),
    "parsa": (2.7579, 2.3780, 3.1036, 4.3302, 5.5671, 4.8877),
    "polynomial-roots": (1.3577, 3.2347, 2.9325, 3.7612, 5.1620, 4.8051),
}
"""Table 2.1, rad/s: six runs of a real OCTA that is shaken by hand"""


@dataclass(frozen=True)
class Way:
    """One way of estimating: a name for tables, and the parameters of :class:`.ArrayRate`."""

    name: str
    method: str
    variant: str = "sound"
    bias_noise: float = 0.0

    def observer(self, noise: float) -> Observer:
        """The estimator, told the white noise of the accelerometers (m/s²)."""
        return Observer(
            ArrayRate(
                dt=1.0 / RATE,
                method=self.method,  # type: ignore[arg-type]
                variant=self.variant,  # type: ignore[arg-type]
                bias_noise=self.bias_noise,
                accelerometer_noise=noise,
            )
        )


WAYS = (
    Way("time integration", "time-integration"),
    Way("polynomial roots", "polynomial-roots"),
    Way("Parsa", "parsa"),
    Way("weighted, as printed", "weighted", "printed"),
    Way("weighted, corrected", "weighted", "corrected"),
    Way("weighted, sound", "weighted"),
    Way("weighted, sound, with biases", "weighted", bias_noise=0.1),
)
"""What is compared; the last one is the default of the filter ``array-rate``."""

NOISE_OF_FILTER = 0.1
"""m/s²: what the filter that knows biases takes for white; without biases it does not matter"""


def _white(deviation: float, bias: float = 0.0, axes: float = 0.0, positions: float = 0.0) -> ArrayPreset:
    gyroscope = array_preset("array-data-sheet").gyroscope
    accelerometer = per_sample(deviation, 1000.0, turn_on_bias=bias)
    name = f"white {deviation:g}" + (f", bias {bias:g}, {axes:g}°, {1e3 * positions:g} mm" if bias else "")
    return ArrayPreset(name, name, gyroscope, accelerometer, axis_error=math.radians(axes), position_error=positions)


ERRORS: dict[str, ArrayPreset] = {
    preset.name: preset
    for preset in (
        _white(0.022),
        _white(0.1),
        _white(0.3),
        _white(0.05, 0.1, 0.5, 1e-3),
        _white(0.05, 0.3, 1.0, 2e-3),
    )
}
"""Name → errors of the readings: white noise and biases in m/s², angles of the axes, positions. The first is the data
sheet's; the fourth what a calibration may leave (the environment's preset ``array-calibrated``)."""

CALIBRATED = list(ERRORS)[3]
"""Errors with which Table 2.1 is compared"""
SPEEDS = (0.0, 1.0, 3.0, 6.0, math.inf)
"""rad/s: borders of the ranges of |ω| in which weights are averaged"""


def shaken(seed: int, errors: str, duration: float = DURATION) -> Trajectory:
    """An OCTA that is shaken by hand, from rest."""
    return simulate_hand("shaking", seed, ERRORS[errors], RATE, duration, device="octa", magnetometer=False)


def rate_errors(seed: int, errors: str, duration: float = DURATION) -> list[dict[str, Any]]:
    """Root mean square of |ω̂ − ω| of every way on one motion, rad/s (2.57), and the mean weights by |ω|.

    Returns:
        A row for each of :data:`WAYS`: ``way``, ``errors``, ``seed``, ``rms``; ``weights`` (None unless weighted).
    """
    trajectory, rows = shaken(seed, errors, duration), []
    truth = trajectory.truth["angular_rate"]
    for way in WAYS:
        pose = run(way.observer(NOISE_OF_FILTER), trajectory.measurements).pose
        error = metrics.error(ANGULAR_RATE, pose[ANGULAR_RATE.name], truth)
        weights = pose.get("array-rate/weights")
        rows.append(
            {
                "way": way.name,
                "errors": errors,
                "seed": seed,
                "rms": float(metrics.rms(error)),
                "weights": None if weights is None else weights_by_speed(weights, truth),
            }
        )
    return rows


def weights_by_speed(weights: np.ndarray, truth: np.ndarray) -> list[float | None]:
    """Mean of all weights ``(T, 3)`` where |ω| lies in each range of :data:`SPEEDS`; None where it never does."""
    speed = np.linalg.norm(truth, axis=-1)
    means: list[float | None] = []
    for low, high in pairwise(SPEEDS):
        inside = (speed >= low) & (speed < high)
        means.append(float(weights[inside].mean()) if inside.any() else None)
    return means


def rate_table(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Smallest, mean and largest error over the seeds (rad/s), a row for each kind of errors and each way."""
    rows = list(rows)
    table = []
    for errors in ERRORS:
        for way in WAYS:
            found = [row["rms"] for row in rows if row["errors"] == errors and row["way"] == way.name]
            if found:
                least, mean, largest = min(found), float(np.mean(found)), max(found)
                table.append({"errors": errors, "method": way.name, "mean": mean, "least": least, "largest": largest})
    return table


def weight_table(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mean weights by |ω| over the seeds, a row for each kind of errors and each weighted way."""
    rows = list(rows)
    labels = ["below 1 rad/s", "1 to 3", "3 to 6", "above 6"]
    table = []
    for errors in ERRORS:
        for way in WAYS:
            found = [row["weights"] for row in rows if row["errors"] == errors and row["way"] == way.name]
            found = [weights for weights in found if weights is not None]
            if found:
                means = np.nanmean(np.array(found, dtype=float), axis=0)
                table.append({"errors": errors, "method": way.name} | dict(zip(labels, means.tolist(), strict=True)))
    return table


def rankings(rows: Iterable[dict[str, Any]], errors: str = CALIBRATED) -> list[dict[str, Any]]:
    """Per seed: errors of the three methods of Table 2.1, and whether they are ranked as there (weighted first)."""
    by_seed: dict[int, dict[str, float]] = {}
    for row in rows:
        if row["errors"] == errors:
            by_seed.setdefault(row["seed"], {})[row["way"]] = row["rms"]
    table = []
    for seed, found in sorted(by_seed.items()):
        ours, thesis = found[WAYS[-1].name], found["weighted, sound"]
        others = found["Parsa"], found["polynomial roots"]
        table.append(
            {
                "seed": seed,
                "with biases": ours,
                "sound": thesis,
                "Parsa": others[0],
                "polynomial roots": others[1],
                "weighted is best": max(ours, thesis) < min(others),
            }
        )
    return table


def rate_curves(seed: int, errors: str = CALIBRATED, start: float = 10.0, length: float = 10.0) -> dict[str, Any]:
    """First components over some seconds, as in Figure 2.10, with weights (2.12): name → list, for a figure."""
    trajectory = shaken(seed, errors, start + length)
    part = slice(round(start * RATE), None)
    curves: dict[str, Any] = {
        "time": trajectory.time[part].tolist(),
        "true": trajectory.truth["angular_rate"][part, 0].tolist(),
    }
    for way in WAYS:
        if way.variant != "sound":
            continue
        pose = run(way.observer(NOISE_OF_FILTER), trajectory.measurements).pose
        curves[way.name] = pose[ANGULAR_RATE.name][part, 0].tolist()
    curves["weight"] = pose["array-rate/weights"][part, 0].tolist()
    return curves
