"""Figures of chapter 5 of the thesis."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.arrays.spatial.pointing import pointing_angles
from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from ...plots import AMBER, BLUE, GREEN, GREY, PINK, SKY, TRUTH_COLOR, VERMILION, legend_above, new_figure, time_figure
from ..report import Report

LINES = (BLUE, VERMILION, GREEN, AMBER, PINK, GREY, SKY)
NUMBERS = {"controller": ("5.6 and 5.7", "5.8"), "octa": ("5.9 and 5.10", "5.11")}
"""Device → numbers of its figures: errors over time, path"""


def move_figure(trajectory: Trajectory) -> Any:
    """Where a controller points (5.3), and the profile of one move (5.4)."""
    figure, axes = new_figure(7.5, 3.2, 1, 2)
    pitch, azimuth = (np.degrees(angle) for angle in pointing_angles(trajectory.truth["orientation"]))
    axes[0].plot(azimuth, pitch, color=TRUTH_COLOR, linewidth=0.7)
    axes[0].set(xlabel="azimuth, deg", ylabel="pitch, deg", title="path")
    u = np.linspace(0.0, 1.0, 101)
    axes[1].plot(u, 6.0 * u**5 - 15.0 * u**4 + 10.0 * u**3, color=TRUTH_COLOR)
    axes[1].set(xlabel="share of the time", ylabel="share of the angle", title="a move")
    return figure


def readings_figure(trajectory: Trajectory) -> Any:
    """One reading of each sensor, with and without noise (5.5)."""
    figure, axes = time_figure(7.5, 5.0, 3)
    part = trajectory.time <= 10.0
    q, time = trajectory.truth["orientation"][part], trajectory.time[part]
    truth = {name: trajectory.truth[name][part] for name in ("external_acceleration", "angular_rate")}
    # the first accelerometer lies off the reference point; what rotation adds there is small beside gravity
    force = truth["external_acceleration"][:, 0] + STANDARD_GRAVITY * rotation.up_in_body(q)[:, 0]
    north = rotation.rotate_back(q, np.array([0.0, 1.0, 0.0]))[:, 1]
    strength = float(np.linalg.norm(trajectory.measurements["imu/mag"], axis=-1).mean())
    signals = (
        ("array/acc", 0, force, "a_x, m/s²"),
        ("imu/gyr", 0, truth["angular_rate"][:, 0], "ω_x, rad/s"),
        ("imu/mag", 1, strength * north, "m_y, µT"),
    )
    for ax, (channel, index, clean, label) in zip(axes, signals, strict=True):
        ax.plot(time, trajectory.measurements[channel][part][:, index], color=LINES[0], linewidth=0.6, label="reading")
        ax.plot(time, clean, color=TRUTH_COLOR, linewidth=0.8, label="true")
        ax.set_ylabel(label)
    legend_above(axes[0])
    return figure


def pointing_figure(curves: dict[str, Any], reference: str, limit: float) -> Any:
    """Pitch and azimuth, errors of all methods within ±``limit`` deg; curves as :func:`.spatial.pointing_curves`.

    The first method is the proposed one, whose angles are drawn too.
    """
    figure, axes = time_figure(7.5, 7.0, 4)
    time, methods = curves["time"], list(curves["errors"])
    for row, angle in enumerate(("pitch", "azimuth")):
        top, below = axes[2 * row : 2 * row + 2]
        top.plot(time, curves[angle], color=TRUTH_COLOR, linewidth=1.2, label=reference)
        top.plot(time, proposed(curves, row), "--", color=LINES[0], linewidth=1.0, label="proposed")
        top.set_ylabel(f"{angle}, deg")
        for name, colour in reversed(list(zip(methods, LINES, strict=False))):
            style = {"linewidth": 1.4} if name == methods[0] else {"linewidth": 0.8, "alpha": 0.65}
            below.plot(time, curves["errors"][name][row], color=colour, label=name, **style)
        below.set(ylabel=f"error of {angle}, deg", ylim=(-limit, limit))
    legend_above(axes[0])
    handles, labels = axes[1].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside lower center", fontsize=7.5, ncols=3)
    return figure


def proposed(curves: dict[str, Any], row: int) -> np.ndarray:
    """Pitch (row 0) or azimuth (row 1) by the proposed method, deg."""
    angle = curves[("pitch", "azimuth")[row]]
    return np.add(angle, next(iter(curves["errors"].values()))[row])


def pointing_figures(report: Report, device: str, curves: dict[str, Any]) -> None:
    """Figures 5.6 to 5.8, or 5.9 to 5.11."""
    errors_name, path_name = NUMBERS[device]
    title = f"Figures {errors_name}: pitch and azimuth of the {device}"
    report.figure(f"pointing-{device}", pointing_figure(curves, "true", 30.0), title, "Errors beyond 30° are cut.")
    figure, (ax,) = new_figure(5.0, 4.6)
    limit = math.degrees(math.pi / 4.0)
    ax.plot([-limit, limit, limit, -limit, -limit], [-limit, -limit, limit, limit, -limit], "k:", linewidth=0.8)
    ax.plot(curves["azimuth"], curves["pitch"], color=TRUTH_COLOR, linewidth=0.9, label="true")
    ax.plot(proposed(curves, 1), proposed(curves, 0), "--", color=LINES[0], linewidth=0.9, label="proposed")
    ax.set(xlabel="azimuth, deg", ylabel="pitch, deg", aspect="equal")
    legend_above(ax)
    title = f"Figure {path_name}: where the {device} points"
    report.figure(f"path-{device}", figure, title, "Dotted: targets' limits.")
