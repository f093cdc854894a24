"""Figures of the two-gyroscope study: angles and their errors over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...plots import TRUTH_COLOR, legend_above, new_figure
from ..report import Report
from ..ride_study import RideStudy

COLOURS = {
    "Σ2": "#1f5fa8",
    "Σ1": "#c2571a",
    "platform gyroscope alone": "#2c8c5a",
    "integration": "#b08d1a",
}


def draw_ride(report: Report, study: RideStudy, path: Path, title: str) -> None:
    """Roll, its error, pitch and relative angles of one ride; the scale is that of Σ2 and of the truth."""
    ride = study.load(path)
    truth, estimates = study.truth(ride.truth), {}
    for name in COLOURS:
        estimates[name] = study.estimate(ride, study.variants[name])
    errors = {name: study.errors(each.pose, truth) for name, each in estimates.items()}
    figure, axes = new_figure(7.5, 10.5, 5)
    shown = {0: ("φ", ("Σ2", "Σ1", "platform gyroscope alone")), 1: ("error", ("Σ2", "Σ1", "platform gyroscope alone"))}
    shown |= {2 + i: (f"θ{i + 1}", ("Σ2", "integration")) for i in range(3)}
    for row, (angle, names) in shown.items():
        ax = axes[row]
        if angle == "error":
            curves = {name: errors[name]["φ"] for name in names}
            pitch = np.degrees(truth["two-gyro/pitch"][:, 0])
            ax.plot(ride.time, pitch, color="#6d737c", linewidth=0.8, linestyle=":", label="true pitch")
            scale = np.concatenate([curves["Σ2"], pitch])
            ax.set_ylabel("error of φ, deg")
        else:
            quantity, part = study.angles[angle]
            true = np.degrees(truth[quantity][:, part])
            curves = {name: true + errors[name][angle] for name in names}
            ax.plot(ride.time, true, color=TRUTH_COLOR, linewidth=1.3, label="truth")
            scale = np.concatenate([true, curves["Σ2"]])
            ax.set_ylabel(f"{angle}, deg")
        for name, curve in curves.items():
            ax.plot(ride.time, curve, color=COLOURS[name], linewidth=0.9, label=name)
        low, high = np.nanpercentile(scale, (0.5, 99.5))
        margin = 0.5 * (high - low) + 0.5
        ax.set_ylim(low - margin, high + margin)
        legend_above(ax)
    axes[-1].set_xlabel("time, s")
    about = f"Rider {ride.metadata.get('subject')}. Scales are those of truth and Σ2; what drifts leaves the picture."
    report.figure(f"ride-{title.split(':')[0]}", figure, title, about)
