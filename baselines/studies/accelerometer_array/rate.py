"""Chapter 2 of the thesis: angular rate of a shaken array without a gyroscope, on simulated OCTAs.

Motions are those of ``gesture="shaking"``, readings those of the environment's device ``octa``.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.devices import ArrayPreset, array_preset, per_sample
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.rate import ANGULAR_RATE, ArrayRate
from ....filters.core import metrics
from ....filters.core.estimator import run
from ....filters.core.recursion import Observer
from ...plots import BLUE, TRUTH_COLOR, time_figure
from ..claims import Claim
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from ..ride_study import ZERO
from .tables import Row, grouped, mean_of, results_of, values_of

RATE = 100.0
"""Hz"""
DURATION = 100.0
"""s of a run, as in the thesis"""

PUBLISHED = {
    "weighted": (0.4195, 0.6350, 0.6781, 0.6456, 0.6714, 0.6274),
    "Parsa": (2.7579, 2.3780, 3.1036, 4.3302, 5.5671, 4.8877),
    "polynomial roots": (1.3577, 3.2347, 2.9325, 3.7612, 5.1620, 4.8051),
}
"""Table 2.1, rad/s: six runs of a real OCTA that is shaken by hand"""

DEFAULT, WITH_BIASES = "weighted, J at ω_TI", "weighted, J at ω_TI, with biases"
METHODS: dict[str, dict[str, Any]] = {
    "time integration": {"method": "time-integration"},
    "polynomial roots": {"method": "polynomial-roots"},
    "Parsa": {"method": "parsa"},
    "weighted, as published": {"method": "weighted", "variant": "published"},
    "weighted, corrected": {"method": "weighted", "variant": "corrected"},
    DEFAULT: {"method": "weighted"},
    WITH_BIASES: {"method": "weighted", "bias_noise": 0.1},
}
"""Name in tables → parameters of :class:`.ArrayRate`; the last one is the default of the filter ``array-rate``"""
ROWS_OF_TABLE_2_1 = {DEFAULT: "weighted", WITH_BIASES: None, "Parsa": "Parsa", "polynomial roots": "polynomial roots"}
"""Method → row of Table 2.1; None where the thesis has none"""


def white(std: float, bias: float = 0.0, axes: float = 0.0, positions: float = 0.0) -> ArrayPreset:
    """Errors of readings: white noise and biases in m/s², angles of the axes in deg, positions in m."""
    gyroscope = array_preset("array-data-sheet").gyroscope
    accelerometer = per_sample(std, 1000.0, turn_on_bias=bias)
    name = f"white {std:g}" + (f", bias {bias:g}, {axes:g}°, {1e3 * positions:g} mm" if bias else "")
    return ArrayPreset(name, name, gyroscope, accelerometer, axis_error=math.radians(axes), position_error=positions)


ERRORS: dict[str, ArrayPreset] = {
    preset.name: preset
    for preset in (white(0.022), white(0.1), white(0.3), white(0.05, 0.1, 0.5, 1e-3), white(0.05, 0.3, 1.0, 2e-3))
}
"""Name → errors of the readings. The first is the data sheet's; the fourth what a calibration may leave (the
environment's preset ``array-calibrated``)."""
DATA_SHEET, CALIBRATED = next(iter(ERRORS)), list(ERRORS)[3]
"""White noise alone, and the errors with which Table 2.1 is compared"""
SPEEDS = {"below 1 rad/s": 0.0, "1 to 3": 1.0, "3 to 6": 3.0, "above 6": 6.0}
"""Column → smallest |ω|, rad/s, of the range in which weights are averaged"""


MOVING = 2.0
"""rad/s from which on the direction of a rate is judged"""


def estimator(method: str) -> Observer:
    """The estimator of that name; only the one with biases uses the white noise of 0.1 m/s²."""
    return Observer(ArrayRate(dt=1.0 / RATE, **{"bias_noise": 0.0, "accelerometer_noise": 0.1} | METHODS[method]))


def shaken(seed: int, errors: str, duration: float = DURATION) -> Trajectory:
    """An OCTA that is shaken by hand, from rest."""
    return simulate_hand("shaking", seed, ERRORS[errors], RATE, duration, device="octa", magnetometer=False)


def rate_errors(seed: int, errors: str, duration: float = DURATION) -> list[Row]:
    """Root mean square of |ω̂ − ω| of every method on one motion, rad/s (2.57), and the mean weights by |ω|.

    Returns:
        A row for each of :data:`METHODS`, and one for a rate that is always zero: ``method``, ``errors``, ``seed``,
        ``rms``; ``weights`` (None unless weighted); and what :func:`over_time` gives.
    """
    trajectory, rows = shaken(seed, errors, duration), []
    truth = trajectory.truth["angular_rate"]
    for method in METHODS:
        pose = run(estimator(method), trajectory.measurements).pose
        rms = float(metrics.rms(metrics.error(ANGULAR_RATE, pose[ANGULAR_RATE.name], truth)))
        weights = weights_by_speed(pose["array-rate/weights"], truth) if "array-rate/weights" in pose else None
        row = {"method": method, "errors": errors, "seed": seed, "rms": rms, "weights": weights}
        rows.append(row | over_time(pose[ANGULAR_RATE.name], truth))
    row = {"method": ZERO, "errors": errors, "seed": seed, "rms": float(metrics.rms(np.linalg.norm(truth, axis=-1)))}
    rows.append(row | {"weights": None} | over_time(0.0 * truth, truth))
    return rows


def over_time(found: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """``reversed``: share of samples above :data:`MOVING` whose rate points the wrong way; ``growth``: of the error.

    Growth is the RMS of the second half over that of the first.
    """
    moving = np.linalg.norm(truth, axis=-1) > MOVING
    wrong = np.sum(found * truth, axis=-1) < 0.0
    early, late = np.array_split(np.linalg.norm(found - truth, axis=-1), 2)
    return {"reversed": float(wrong[moving].mean()), "growth": float(metrics.rms(late) / metrics.rms(early))}


def weights_by_speed(weights: np.ndarray, truth: np.ndarray) -> dict[str, float | None]:
    """Mean of all weights ``(T, 3)`` where |ω| lies in each range of :data:`SPEEDS`; None where it never does."""
    speed, means = np.linalg.norm(truth, axis=-1), {}
    for column, (low, high) in zip(SPEEDS, pairwise([*SPEEDS.values(), math.inf]), strict=True):
        inside = (speed >= low) & (speed < high)
        means[column] = float(weights[inside].mean()) if inside.any() else None
    return means


def rate_table(rows: list[Row]) -> list[Row]:
    """Mean, smallest and largest error over the seeds (rad/s), a row for each kind of errors and each method."""
    columns: dict[str, tuple[str, Any]] = {"mean": ("rms", np.mean), "least": ("rms", min), "largest": ("rms", max)}
    return grouped(rows, {"errors": "errors", "method": "method"}, columns)


def weight_table(rows: list[Row]) -> list[Row]:
    """Mean weights by |ω| over the seeds, a row for each kind of errors and each weighted method."""
    weighted = [row | row["weights"] for row in rows if row["weights"] is not None]
    return grouped(weighted, {"errors": "errors", "method": "method"}, {name: (name, np.mean) for name in SPEEDS})


def rate_curves(seed: int) -> dict[str, Any]:
    """First components over ten seconds, as in Figure 2.10, with weights (2.12): name → list, for a figure."""
    trajectory, part = shaken(seed, CALIBRATED, 20.0), slice(round(10.0 * RATE), None)
    true = trajectory.truth["angular_rate"][part, 0]
    curves: dict[str, Any] = {"time": trajectory.time[part].tolist(), "true": true.tolist()}
    for method, parameters in METHODS.items():
        if "variant" not in parameters:
            pose = run(estimator(method), trajectory.measurements).pose
            curves[method] = pose[ANGULAR_RATE.name][part, 0].tolist()
            if "array-rate/weights" in pose:
                curves["weight"] = pose["array-rate/weights"][part, 0].tolist()
    return curves


def claims(rows: list[Row]) -> list[Claim]:
    """What chapter 2 says, and what one would read off the tables."""
    mean = {method: mean_of(rows, "rms", method=method, errors=CALIBRATED) for method in METHODS}
    white_only = {name: mean_of(rows, "rms", method=name, errors=DATA_SHEET) for name in METHODS if name != WITH_BIASES}
    thesis = PUBLISHED["weighted"]
    in_thesis = [one < other for one, other in zip(PUBLISHED["polynomial roots"], PUBLISHED["Parsa"], strict=True)]
    named = {row: mean[method] for method, row in ROWS_OF_TABLE_2_1.items() if row}
    by_method = {row["method"]: row for row in weight_table(rows) if row["errors"] == CALIBRATED}
    weights, as_published = by_method[DEFAULT], by_method["weighted, as published"][next(iter(SPEEDS))]
    slow, *_, fast = (weights[name] for name in SPEEDS)
    least = min(weights[name] for name in SPEEDS if weights[name] is not None)
    growth = f"{slow:.3f} below 1 rad/s, {fast:.3f} above 6 rad/s"
    published = "Table 2.1: the weighted error lies within the six published runs"
    noise = "White noise of the data sheet alone explains less than a tenth of the published error"
    jacobian = "With white noise, the Jacobian at the integrated rate (ω_TI) is better than at the polynomial roots"
    weighted = {name: value for name, value in white_only.items() if name.startswith("weighted")}
    wrong = {name: 100.0 * mean_of(rows, "reversed", method=name, errors=CALIBRATED) for name in METHODS}
    growth_of = {
        name: mean_of(rows, "growth", method=name, errors=CALIBRATED) for name in (DEFAULT, "Parsa", "polynomial roots")
    }
    integrated = mean["time integration"]
    return [
        Claim.less("Figure 2.9: integration is useless, its error exceeds 10 rad/s", 10.0, integrated, "rad/s"),
        Claim.less("Figure 2.10: polynomial roots point the wrong way at times", 0.1, wrong["polynomial roots"], "%"),
        Claim.less("Figure 2.10: the weighted method hardly does", wrong[DEFAULT], 0.1, "% of samples"),
        Claim.every("Figure 2.11: errors do not grow from the first to the second half", growth_of, 1.5, "×"),
        Claim.best("Table 2.1: the weighted method has the smallest error", "weighted", named, "rad/s"),
        better(
            rows, CALIBRATED, f"Table 2.1: polynomial roots err less than Parsa in most motions ({sum(in_thesis)} of 6)"
        ),
        *(
            better(rows, kind, f"With {kind} polynomial roots err less than Parsa in most motions")
            for kind in ERRORS
            if kind != CALIBRATED and any(row["errors"] == kind for row in rows)
        ),
        Claim.less(
            "Table 2.1: neither polynomial roots nor Parsa err by less than two thirds of what a rate of zero does",
            mean_of(rows, "rms", method=ZERO, errors=CALIBRATED),
            min(mean["polynomial roots"], mean["Parsa"]),
            "rad/s",
            factor=1.5,
        ),
        Claim.within(published, mean[DEFAULT], min(thesis), max(thesis), "rad/s"),
        Claim.less(noise, white_only[DEFAULT], float(np.mean(thesis)), "rad/s", factor=0.1),
        Claim.less("Estimating biases too lowers the error", mean[WITH_BIASES], mean[DEFAULT], "rad/s"),
        Claim.best(jacobian, DEFAULT, weighted, "rad/s"),
        Claim.within("Figure 2.12: weights are near one", least, 0.8, 1.0),
        Claim("Figure 2.13: the weight grows with the angular rate", growth, fast > slow),
        Claim.less(
            "The Jacobian at the polynomial roots, as published, makes weights at rest smaller",
            as_published,
            slow,
            "",
            names=("as published", "at ω_TI"),
        ),
    ]


def better(rows: list[Row], errors: str, statement: str) -> Claim:
    """Whether polynomial roots have the smaller error of the two other methods in more than half of the motions."""
    one, other = (values_of(rows, "rms", method=name, errors=errors) for name in ("polynomial roots", "Parsa"))
    count = sum(a < b for a, b in zip(one, other, strict=True))
    return Claim(statement, f"{count} of {len(one)}", 2 * count > len(one))


def angular_rates(study: Study, report: Report) -> None:
    """Table 2.1 and Figures 2.9 to 2.13."""
    seeds, duration = (2, 40.0) if study.quick else (10, DURATION)
    kinds = [DATA_SHEET, CALIBRATED] if study.quick else list(ERRORS)
    jobs = [(study.seed_of("shaking", index), kind, duration) for kind in kinds for index in range(seeds)]
    rows = [row for found in study.map("angular rate", rate_errors, jobs) for row in found]
    report.numbers(results_of(rows, "rms", "shaking {seed}, {errors}", ANGULAR_RATE.name, "rms", "rad/s"))
    published = {row: f"{np.mean(runs):.2f} ({min(runs):.2f} … {max(runs):.2f})" for row, runs in PUBLISHED.items()}
    report.compare(
        "Table 2.1: angular rate of a shaken OCTA",
        [
            {"method": method, "quantity": "rms of |ω̂ − ω|", "unit": "rad/s"}
            | {"published": published.get(row or "")}
            | {"values": values_of(rows, "rms", method=method, errors=CALIBRATED)}
            for method, row in ROWS_OF_TABLE_2_1.items()
        ],
        f"Published: mean and range of six runs of the real device. Ours: {seeds} simulated motions of {duration:g} s "
        f"with the errors *{CALIBRATED}* that a calibration leaves.",
        interval=OVER_MOTIONS,
    )
    report.table(
        "Angular rate by method and errors",
        rate_table(rows),
        "Rms in rad/s: mean, smallest and largest over the motions. *As published* and *corrected* evaluate the "
        "Jacobian J at the polynomial roots, *J at ω_TI* at the integrated rate. *With biases* also estimates constant "
        "errors; this is an addition to the thesis.",
    )
    report.table("Figures 2.12 and 2.13: mean weight of the integration by angular rate", weight_table(rows))
    report.claims("Chapter 2: what holds here", claims(rows))
    draw(report, study.cached("angular rate curves", rate_curves, study.seed_of("shaking", 0)))


def draw(report: Report, curves: dict[str, Any]) -> None:
    """Angular rates and weights over ten seconds."""
    figure, (top, below) = time_figure(7.5, 4.6, 2)
    time = curves["time"]
    top.plot(time, curves["true"], color=TRUTH_COLOR, linewidth=2.2, alpha=0.6, label="true")
    for name, values in curves.items():
        if name not in ("time", "true", "weight"):
            top.plot(time, values, linewidth=0.8, label=name)
    limit = 1.8 * float(np.abs(curves["true"]).max())
    top.set_ylim(-limit, limit)
    top.set_ylabel("ω_x, rad/s")
    figure.legend(*top.get_legend_handles_labels(), fontsize=7.5, ncols=3, loc="outside lower center")
    below.plot(time, curves["weight"], color=BLUE, linewidth=0.8)
    below.set_ylabel("weight w_x")
    below.set_ylim(0.0, 1.05)
    title = "Figures 2.9 to 2.12: angular rate and weights"
    report.figure("angular-rate", figure, title, f"Rates beyond {limit:.0f} rad/s are cut.")
