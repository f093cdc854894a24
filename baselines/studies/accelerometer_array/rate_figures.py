"""Figures 2.11 and 2.13 of the thesis: errors of the angular rate over time, and weights against the rate."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....filters.arrays.rate import ANGULAR_RATE
from ....filters.core.estimator import run
from ...plots import legend_above, new_figure, time_figure
from ..kit import Study
from ..report import Report
from ..ride_figures import DRAWN
from .rate import CALIBRATED, DEFAULT, DURATION, estimator, shaken

SHOWN = {"polynomial roots": DRAWN[0], "Parsa": DRAWN[1], DEFAULT: DRAWN[-1]}
"""Method → colour; the last one's predicted deviation √tr Σ is drawn too"""
EVERY = 5
"""samples from point to point"""


def error_curves(seed: int, duration: float) -> dict[str, Any]:
    """``time``; method → |ω̂ − ω| (2.56), rad/s; ``predicted``: √tr Σ; ``rate`` and ``weight`` ``(T, 3)``."""
    trajectory = shaken(seed, CALIBRATED, duration)
    truth = trajectory.truth["angular_rate"]
    curves: dict[str, Any] = {"time": trajectory.time[::EVERY].tolist()}
    for method in SHOWN:
        pose = run(estimator(method), trajectory.measurements).pose
        curves[method] = np.linalg.norm(pose[ANGULAR_RATE.name] - truth, axis=-1)[::EVERY].tolist()
    covariance = pose["angular_rate_covariance"].reshape(-1, 3, 3)
    curves["predicted"] = np.sqrt(np.trace(covariance, axis1=1, axis2=2))[::EVERY].tolist()
    curves["rate"] = np.abs(truth)[::EVERY].tolist()
    curves["weight"] = pose["array-rate/weights"][::EVERY].tolist()
    return curves


def rate_pictures(study: Study, report: Report) -> None:
    """Both figures, of one motion."""
    duration = 40.0 if study.quick else DURATION
    curves = study.cached("angular rate errors", error_curves, study.seed_of("shaking", 0), duration)
    figure, (ax,) = time_figure(7.5, 3.2)
    for method, color in SHOWN.items():
        ax.semilogy(curves["time"], np.maximum(curves[method], 1e-3), color=color, linewidth=0.8, label=method)
    ax.semilogy(curves["time"], np.maximum(curves["predicted"], 1e-3), "k", linewidth=0.8, label="√tr Σ, predicted")
    ax.set(ylabel="‖ω̂ − ω‖, rad/s")
    legend_above(ax)
    report.figure("angular-rate-errors", figure, "Figure 2.11: errors of the angular rate", "Logarithmic.")
    figure, axes = new_figure(9.0, 2.8, 1, 3)
    rate, weight = np.array(curves["rate"]), np.array(curves["weight"])
    for axis, ax in enumerate(axes):
        ax.plot(rate[:, axis], weight[:, axis], ".", color=DRAWN[-1], markersize=1.5)
        ax.set(xlabel=f"|ω_{'xyz'[axis]}|, rad/s", ylim=(0.0, 1.05))
    axes[0].set_ylabel("weight of integration")
    report.figure("weights", figure, "Figure 2.13: weight and angular rate")
