"""Figures 3.3 to 3.15 of the thesis: trajectories in the plane, readings, estimates of the angle and of its rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.planar.orientation import PLANAR_ANGLE
from ....filters.arrays.planar.pose import PLANAR_RATE
from ....filters.core.estimator import run
from ....filters.core.rotation import wrap
from ...plots import TRUTH_COLOR, legend_above, new_figure, time_figure
from ..kit import Study
from ..report import Report
from ..ride_figures import DRAWN
from .planar import DURATION, EXTENDED, INTEGRATION, LITERAL, MOTIONS, POSE, RATE, RETURNING, estimator, moved

NUMBERS = {
    "planar-walk": {"path": "3.3", "readings": "3.4", "estimates": "3.5", "errors": "3.6", "rate": "3.14"},
    "infinity": {"path": "3.7", "readings": "3.8", "estimates": "3.9", "errors": "3.10", "rate": "3.15"},
}
"""Motion → number of each figure"""
COMPARED = (INTEGRATION, "tilt", POSE, EXTENDED)
MORE = ("mean, literal", LITERAL, "unscented filter", EXTENDED)
"""Methods of figures 3.5, 3.6, 3.9, 3.10, and of 3.12"""
WINDOW = 10.0
"""s of estimates that are drawn; a hundred seconds of a hand that shakes are a solid block"""
EVERY = 10
"""samples from point to point in figures of a whole run"""


def planar_curves(seed: int, motion: str, duration: float) -> dict[str, Any]:
    """Everything that the figures of a motion draw, as lists.

    Returns:
        ``time``; ``path`` ``(T, 2)``, m; ``reading`` and ``clean``, m/s², first accelerometer with and without its
        noise; ``angle``, deg; ``estimates`` and ``errors``, method → deg; ``rate`` and ``rates``, rad/s.
    """
    trajectory = moved(seed, motion, duration)
    truth = trajectory.truth
    angle = np.unwrap(truth[PLANAR_ANGLE.name][:, 0])
    curves: dict[str, Any] = {
        "time": trajectory.time.tolist(),
        "path": truth["planar/position"].tolist(),
        "reading": trajectory.measurements["array/acc"][:, 0].tolist(),
        "angle": np.degrees(angle).tolist(),
        "rate": truth[PLANAR_RATE.name][:, 0].tolist(),
        "estimates": {},
        "errors": {},
        "rates": {},
    }
    for method in dict.fromkeys((*COMPARED, *MORE, RETURNING)):
        pose = run(estimator(method, motion), trajectory.measurements).pose
        error = wrap(pose[PLANAR_ANGLE.name][:, 0] - angle)
        curves["errors"][method] = np.degrees(error).tolist()
        # the estimate nearest to the true angle, whole turns apart
        curves["estimates"][method] = np.degrees(angle + error).tolist()
        if PLANAR_RATE.name in pose:
            curves["rates"][method] = pose[PLANAR_RATE.name][:, 0].tolist()
    return curves


def clean_reading(seed: int, motion: str, duration: float) -> list[float]:
    """The first accelerometer without noise, m/s²: the controller's array on the true motion."""
    ideal = simulate_hand(motion, seed, "ideal", RATE, duration, device="planar")
    return ideal.measurements["array/acc"][:, 0].tolist()


def planar_figures(report: Report, motion: str, curves: Mapping[str, Any], clean: Sequence[float]) -> None:
    """Path, readings, estimates, errors, and the rate of the complete pose."""
    numbers, time = NUMBERS[motion], np.array(curves["time"])
    report.figure(f"path-{motion}", path_figure(curves["path"]), f"Figure {numbers['path']}: path, {motion}")
    part = (time >= 2.0) & (time <= 3.0)
    figure, (ax,) = time_figure(7.5, 2.6)
    ax.plot(time[part], np.array(curves["reading"])[part], color=DRAWN[-1], linewidth=0.8, label="with noise")
    ax.plot(time[part], np.array(clean)[part], color=TRUTH_COLOR, linewidth=0.8, label="true")
    ax.set(ylabel="a₁, m/s²")
    legend_above(ax)
    report.figure(f"readings-{motion}", figure, f"Figure {numbers['readings']}: an accelerometer, {motion}")
    late = (time >= time[-1] - WINDOW) if motion == "infinity" else np.ones(len(time), bool)
    title = f"Figure {numbers['estimates']}: orientation by four methods, {motion}"
    report.figure(f"estimates-{motion}", angle_figure(time[late], curves, COMPARED, late), title)
    title = f"Figure {numbers['errors']}: errors of four methods, {motion}"
    report.figure(
        f"errors-{motion}", error_figure(time, curves["errors"], COMPARED), title, "Errors beyond 60° are cut."
    )
    figure, (ax,) = time_figure(7.5, 2.8)
    begin = (time >= 5.0) & (time <= 5.0 + WINDOW)
    ax.plot(time[begin], np.array(curves["rate"])[begin], color=TRUTH_COLOR, linewidth=1.2, label="true")
    for (name, rate), color in zip(curves["rates"].items(), (DRAWN[1], DRAWN[-1]), strict=True):
        ax.plot(time[begin], np.array(rate)[begin], color=color, linewidth=0.8, label=name)
    ax.set(ylabel="ω, rad/s")
    legend_above(ax)
    title = f"Figure {numbers['rate']}: angular rate by the complete pose, {motion}"
    report.figure(f"rate-{motion}", figure, title)


def more_figures(report: Report, curves: Mapping[str, Any]) -> None:
    """Figures 3.11 to 3.13, of another walk: its path, averaging and linear methods, the extended filter alone."""
    time = np.array(curves["time"])
    report.figure("path-another", path_figure(curves["path"]), "Figure 3.11: path, another walk")
    figure, axes = time_figure(7.5, 4.6, 2)
    draw_angles(axes[0], time, curves, MORE, np.ones(len(time), bool))
    draw_errors(axes[1], time, curves["errors"], MORE, 200.0)
    legend_above(axes[0])
    report.figure("more-methods", figure, "Figure 3.12: averaging, linear and unscented filter, another walk")
    title = "Figure 3.13: errors of the extended filter alone, another walk"
    largest = 1.05 * float(np.abs(curves["errors"][EXTENDED]).max())
    report.figure("extended-alone", error_figure(time, curves["errors"], (EXTENDED,), largest), title)


def planar_pictures(study: Study, report: Report) -> None:
    """All figures of chapter 3, of one motion each."""
    duration = 30.0 if study.quick else DURATION
    root = study.seed_of("planar", 0)
    for motion in MOTIONS:
        curves = study.cached(f"planar curves {motion}", planar_curves, root, motion, duration)
        planar_figures(report, motion, curves, clean_reading(root, motion, duration))
    other = study.seed_of("planar", "another")
    more_figures(report, study.cached("planar curves another", planar_curves, other, "planar-walk", duration))


def path_figure(path: Sequence[Sequence[float]]) -> Any:
    """The way of the controller in the plane."""
    figure, (ax,) = new_figure(4.6, 3.6)
    east, up = np.array(path).T
    ax.plot(east, up, color=TRUTH_COLOR, linewidth=0.6)
    ax.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    return figure


def angle_figure(time: np.ndarray, curves: Mapping[str, Any], methods: Sequence[str], part: np.ndarray) -> Any:
    """True angle and estimates, nearest turn."""
    figure, (ax,) = time_figure(7.5, 3.2)
    draw_angles(ax, time, curves, methods, part)
    legend_above(ax)
    return figure


def draw_angles(ax: Any, time: np.ndarray, curves: Mapping[str, Any], methods: Sequence[str], part: np.ndarray) -> None:
    """The last method on top; the truth in black below it."""
    ax.plot(time, np.array(curves["angle"])[part], color=TRUTH_COLOR, linewidth=1.4, label="true")
    for method, color in zip(methods, DRAWN[-len(methods) :], strict=True):
        last = method == methods[-1]
        values = np.array(curves["estimates"][method])[part]
        style = {"linewidth": 0.4, "alpha": 0.35} if method == "tilt" else {"linewidth": 1.0 if last else 0.8}
        ax.plot(time, values, color=color, label=method, **style)
    ax.set_ylabel("φ, deg")


def error_figure(time: np.ndarray, errors: Mapping[str, Any], methods: Sequence[str], limit: float = 60.0) -> Any:
    """Errors over the whole run."""
    figure, (ax,) = time_figure(7.5, 3.0)
    draw_errors(ax, time, errors, methods, limit)
    legend_above(ax)
    return figure


def draw_errors(ax: Any, time: np.ndarray, errors: Mapping[str, Any], methods: Sequence[str], limit: float) -> None:
    """Errors by method, the last on top."""
    for method, color in zip(methods, DRAWN[-len(methods) :], strict=True):
        # the tilt angle jumps from sample to sample and would cover the others
        style = {"linewidth": 0.4, "alpha": 0.35} if method == "tilt" else {"linewidth": 0.9}
        ax.plot(time[::EVERY], errors[method][::EVERY], color=color, label=method, **style)
    ax.set(ylabel="error of φ, deg", ylim=(-limit, limit))
