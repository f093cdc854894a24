"""Figures 6 to 17 of the two-gyroscope paper, of one push of the fixture and of one ride of each course."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.two_gyro.truth import true_angles
from ....filters.core import rotation
from ....filters.core.quantity import DEG, Estimate
from ...plots import TRUTH_COLOR, legend_above, new_figure, time_figure
from ..report import Report
from ..ride_figures import DRAWN, SCALES, draw_angle, true_angle, with_band
from ..ride_study import RideStudy

ROLL, THETA = ("φ", "error of φ"), ("θ1", "θ2", "θ3")
PANELS: dict[str, tuple[str, ...]] = {
    "indoor_circle": (*ROLL, *THETA),
    "outdoor": (*ROLL, *THETA),
    "pitch": ("χ", "dχ/dt", *ROLL, *THETA),
    "straight": ("dψ/dt", *ROLL, *THETA),
    "slalom": ("dψ/dt", *ROLL, *THETA),
}
"""Course → panels of its figure from above: motion of the platform, angles, error of the roll"""
SMOOTHED = 0.1
"""s over which the pitch rate is averaged; the camera shake of single samples would cover the road"""


def course_figure(study: RideStudy, report: Report, path: Path, course: str, title: str) -> None:
    """One ride: what the platform did, and roll and relative angles of the methods that the study draws."""
    ride, panels = study.load(path), PANELS[course]
    truth = true_angles(ride.truth)
    estimates = {name: study.estimate(ride, study.variants[name]) for name in study.drawn}
    errors = {name: study.errors(each.pose, truth) for name, each in estimates.items()}
    motion = platform_motion(ride)
    figure, axes = time_figure(7.5, 0.6 + 1.6 * len(panels), len(panels))
    for ax, panel in zip(axes, panels, strict=True):
        if panel in motion:
            ax.plot(ride.time, motion[panel], color=TRUTH_COLOR, linewidth=0.9)
            ax.set_ylabel(f"{panel}, {'deg' if panel == 'χ' else '°/s'}")
        elif panel.startswith("error"):
            roll_errors(ax, ride.time, errors, estimates, ("Σ1", "Σ2"))
        else:
            curves = {name: error[panel] for name, error in errors.items() if panel in error}
            draw_angle(ax, ride.time, true_angle(study, truth, panel), curves, panel)
    legend_above(axes[panels.index("φ")])  # the other panels have the same curves, or fewer
    report.figure(f"ride {course}", figure, title, f"{SCALES} Thin: three standard deviations.")
    if course == "straight":
        report.figure("path", path_figure(ride), "Figure 17 (a): path of the straight ride")


def platform_motion(ride: Trajectory) -> dict[str, np.ndarray]:
    """χ (deg) and its rate, and the yaw rate (°/s, to the right, as the paper has it), each ``(T,)``."""
    yaw, pitch, _ = rotation.to_euler_zyx(ride.truth["bicycle/orientation"])
    kernel = np.ones(max(1, round(SMOOTHED / ride.dt)))
    smooth = np.convolve(-pitch, kernel / len(kernel), "same")
    return {
        "χ": -pitch / DEG,
        "dχ/dt": np.gradient(smooth, ride.dt) / DEG,
        "dψ/dt": -np.gradient(np.unwrap(yaw), ride.dt) / DEG,
    }


def roll_errors(
    ax: Any,
    time: np.ndarray,
    errors: Mapping[str, Mapping[str, np.ndarray]],
    estimates: Mapping[str, Estimate],
    methods: Sequence[str],
) -> None:
    """Errors of φ with three standard deviations; the scale is that of the last method and its band."""
    for name, color in zip(methods, (DRAWN[1], DRAWN[-1]), strict=True):
        with_band(ax, time, errors[name]["φ"], estimates[name], color, name)
    covariance = estimates[methods[-1]].covariance
    assert covariance is not None
    # without the start, where little is known yet
    late = time >= 0.1 * time[-1]
    limit = max(np.nanmax(np.abs(errors[methods[-1]]["φ"][late])), 3.0 * np.sqrt(covariance[late, 0, 0].max()) / DEG)
    ax.set(ylabel="error of φ, deg", ylim=(-1.4 * limit, 1.4 * limit))


def path_figure(ride: Trajectory) -> Any:
    """Path of the rear wheel's contact from above."""
    figure, (ax,) = new_figure(7.5, 2.6)
    east, north = (ride.truth["bicycle/position"][:, axis] for axis in (0, 1))
    ax.plot(east, north, color=TRUTH_COLOR, linewidth=1.2)
    ax.set(xlabel="east, m", ylabel="north, m")
    # a straight way is much longer than it is wide
    ax.set_aspect("equal" if np.ptp(north) > 0.2 * np.ptp(east) else "auto")
    return figure


def fixture_figure(push: Trajectory, estimates: Mapping[str, Estimate], study: RideStudy, sensor: str) -> Any:
    """Figure 6 (roll), 7 (its error) and 8 (relative angles) of one push, with Σ1 and Σ2 on the same sensor."""
    truth, methods = true_angles(push.truth, "disk"), (f"Σ1, {sensor}", f"Σ2, {sensor}")
    errors = {name: study.errors(estimates[name].pose, truth) for name in methods}
    drawn, axes = time_figure(7.5, 8.5, 5)
    rolls = {name: errors[name]["φ"] for name in methods}
    draw_angle(axes[0], push.time, true_angle(study, truth, "φ"), rolls, "φ", (DRAWN[1], DRAWN[-1]))
    roll_errors(axes[1], push.time, errors, estimates, methods)
    for ax, angle in zip(axes[2:], THETA, strict=True):
        draw_angle(ax, push.time, true_angle(study, truth, angle), {methods[1]: errors[methods[1]][angle]}, angle)
    legend_above(axes[0])
    return drawn
