"""Figures 6 to 8 of the two-gyroscope paper: a pushed bicycle with a tilted, turning disk on it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.platform_gyro import PlatformGyro
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import Estimate
from ..kit import Study
from ..report import Report
from .motion import DEG
from .rides import ALONE, errors_of, summary, without_errors

CHANNELS = ["bicycle_imu/gyr", "disk/gyr", "relative/distances", "relative/orientation"]
FILTERS: dict[str, dict[str, Any]] = {
    "Σ2, distances": {},
    "Σ1, distances": {"model": "sigma1"},
    "Σ2, orientation": {"sensor": "orientation"},
    "Σ1, orientation": {"sensor": "orientation", "model": "sigma1"},
}
START = 10.0 * DEG
"""rad: standard deviation of the roll at the start, which the filters are not told"""


def estimates(ride: Trajectory, samples: dict[str, np.ndarray]) -> dict[str, Estimate]:
    """Every filter on one push."""
    found = {
        name: KalmanFilter(TwoGyro.for_disk(dt=ride.dt, roll_prior=START, **options)).run(samples)
        for name, options in FILTERS.items()
    }
    found[ALONE] = KalmanFilter(PlatformGyro(dt=ride.dt, roll_prior=START, pitch_rate_noise=0.1 * DEG)).run(samples)
    return found


def fixture(study: Study, report: Report) -> None:
    """Errors over several pushes, and one of them drawn."""
    count = 2 if study.quick else 10
    options = {"suite": CHANNELS, "duration": study.duration}
    pushes = study.episodes("poise/BicycleFixture-v0", count, name="fixture", options=options)
    rows = []
    variants = {
        "paper": {},
        "gyroscopes: no bias": {"gyroscopes": "unbiased"},
        "gyroscopes: no errors": {"gyroscopes": "exact"},
    }
    for sensors, taken in variants.items():
        found: dict[str, list[dict[str, float]]] = {}
        for push in pushes:
            truth = true_angles(push.truth, "disk")
            for name, estimate in estimates(push, without_errors(push, body="disk", **taken)).items():
                found.setdefault(name, []).append(summary(errors_of(estimate.pose, truth), push.time))
        for name, parts in found.items():
            row: dict[str, Any] = {"sensors": sensors, "filter": name}
            for key, label in (("θ1", "θ1"), ("θ2", "θ2"), ("θ3", "θ3"), ("φ", "φ"), ("end", "φ, last 20 s")):
                values = [part[key] for part in parts if key in part]
                row[label] = round(float(np.mean(values)), 2) if values else None
            rows.append(row)
    report.table(
        "Fixture (figures 6 to 8)",
        rows,
        f"Mean RMS in deg of {count} pushes from 10 s on; the filters start with roll 0 wherever the bicycle is. "
        "Claims: Σ2 follows, Σ1 starts to drift, θ does not drift. Three distances from one camera see two of three "
        "rotations at an instant, motion the third; the camera's orientation has an alignment error of its own (1°). "
        "The platform's gyroscope alone, which nothing but (5) corrects, has the smallest error of the roll: the push "
        "has no pitch at all.",
    )
    report.figure(
        "fixture", figure(pushes[0]), "Figures 6 to 8: one push", "Distances; thin: three standard deviations."
    )


def figure(push: Trajectory) -> Any:
    """Roll, its error, and relative angles."""
    from ...plots import new_figure

    truth, every = true_angles(push.truth, "disk"), estimates(push, push.measurements)
    drawn, axes = new_figure(7.5, 8.0, 4)
    colours = {"Σ2, distances": "#1f5fa8", "Σ1, distances": "#c2571a", ALONE: "#2c8c5a"}
    axes[0].plot(push.time, truth["bicycle/roll"] / DEG, color="black", linewidth=1.2, label="true")
    for name, colour in colours.items():
        axes[0].plot(push.time, every[name].pose["bicycle/roll"] / DEG, color=colour, linewidth=0.9, label=name)
        error = errors_of(every[name].pose, truth)["φ"]
        axes[1].plot(push.time, error, color=colour, linewidth=0.9, label=name)
        covariance = every[name].covariance
        assert covariance is not None
        deviation = 3.0 * np.sqrt(covariance[:, 0, 0]) / DEG
        for sign in (-1.0, 1.0):
            axes[1].plot(push.time, sign * deviation, color=colour, linewidth=0.5, alpha=0.6)
    axes[0].set(ylabel="φ, deg", title="pushed bicycle with a turning disk")
    axes[1].set(ylabel="error of φ, deg", ylim=(-15.0, 15.0))
    theta = truth["two-gyro/relative_angles"] / DEG
    found = every["Σ2, distances"].pose["two-gyro/relative_angles"] / DEG
    for index, (colour, label) in enumerate(zip(("#1f5fa8", "#c2571a", "#2c8c5a"), ("θ1", "θ2", "θ3"), strict=True)):
        ax = axes[2] if index < 2 else axes[3]
        ax.plot(push.time, theta[:, index], color="black", linewidth=1.2)
        ax.plot(push.time, found[:, index], color=colour, linewidth=0.9, label=label)
    axes[2].set(ylabel="θ1, θ2, deg")
    axes[3].set(ylabel="θ3, deg", xlabel="time, s (black: true)")
    for ax in axes:
        ax.legend(frameon=False, ncols=4, loc="upper right", fontsize=8)
    return drawn
