"""Figures of rides: angles of one ride, and errors of all riders over time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.core.quantity import DEG, Estimate
from ..plots import AMBER, BLUE, GREEN, TRUTH_COLOR, VERMILION, legend_above, new_figure, time_figure
from .claims import Claim
from .report import Report
from .ride_study import SETTLED, SPACING, RideStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN = (GREEN, VERMILION, AMBER, BLUE)
"""Colours of the methods of a figure; the last is that of the study's filter, the one before that of integration."""


def ride_figure(
    study: RideStudy, report: Report, path: Path, title: str, angles: Sequence[str] | None = None
) -> Trajectory:
    """Angles of one ride, true and estimated; the scale is that of the truth and of the last method drawn.

    Returns:
        The ride.
    """
    ride, shown = study.load(path), list(angles or study.angles)
    truth = study.truth(ride.truth)
    errors = {name: study.errors(study.estimate(ride, study.variants[name]).pose, truth) for name in study.drawn}
    figure, axes = time_figure(7.5, 0.6 + 1.9 * len(shown), len(shown))
    for ax, angle in zip(axes, shown, strict=True):
        curves = {name: error[angle] for name, error in errors.items() if angle in error}
        draw_angle(ax, ride.time, true_angle(study, truth, angle), curves, angle)
    legend_above(axes[0])
    report.figure(title, figure, title, SCALES)
    return ride


SCALES = "Scales are those of truth and filter; what drifts leaves the picture."


def true_angle(study: RideStudy, truth: Mapping[str, np.ndarray], angle: str) -> np.ndarray:
    """True angle ``(T,)`` of the paper, deg, without jumps."""
    name, part = study.angles[angle]
    return np.asarray(np.degrees(np.unwrap(truth[name][:, part])))


def draw_angle(
    ax: Any,
    time: np.ndarray,
    true: np.ndarray,
    errors: Mapping[str, np.ndarray],
    label: str,
    colors: Sequence[str] = DRAWN,
) -> None:
    """The true angle and the estimates of some methods; the scale is that of the truth and of the last method.

    Methods have the last ``colors``.
    """
    ax.plot(time, true, color=TRUTH_COLOR, linewidth=1.2, label="truth")
    for (method, error), color in zip(errors.items(), colors[-len(errors) :], strict=True):
        ax.plot(time, true + error, color=color, linewidth=0.9, label=method)
    scale = np.concatenate([true, true + list(errors.values())[-1]])
    low, high = np.nanmin(scale), np.nanmax(scale)
    margin = 0.25 * (high - low) + 1.0
    ax.set(ylabel=f"{symbol(label)}, deg", ylim=(low - margin, high + margin))


def symbol(angle: str) -> str:
    """An angle of a paper with its index below the line: φ_h, θ1, φr2."""
    return re.sub(r"^([α-ω])_?(\w+)$", r"$\\mathrm{\1}_{\2}$", angle)


def with_band(ax: Any, time: np.ndarray, error: np.ndarray, estimate: Estimate, color: str, label: str) -> None:
    """An error, deg, within three of the filter's standard deviations of the first element of its state."""
    assert estimate.covariance is not None
    band = 3.0 * np.sqrt(estimate.covariance[: len(time), 0, 0]) / DEG
    ax.plot(time, error[: len(time)], color=color, linewidth=0.9, label=label)
    ax.plot(time, np.stack([-band, band], axis=-1), color=color, linewidth=0.6, alpha=0.6)


def errors_over_time(
    results: Sequence[Mapping[str, Any]], angle: str, method: str | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (s), and mean and standard deviation of an error over all rides (deg), as far as the shortest ride goes.

    ``method`` is one that was followed (:meth:`.RideStudy.assess`); None for the study's first.
    """
    curves = [each["over time"][method or next(iter(each["over time"]))][angle] for each in results]
    length = min(map(len, curves))
    values = np.array([curve[:length] for curve in curves])
    deviation = values.std(axis=0, ddof=1) if len(values) > 1 else np.full(length, np.nan)
    return SPACING * np.arange(length), values.mean(axis=0), deviation


def spread_figure(results: Sequence[Mapping[str, Any]], angles: Sequence[str]) -> Figure:
    """Mean over riders of the errors over time, and one standard deviation."""
    figure, axes = new_figure(7.5, 0.6 + 1.5 * len(angles), len(angles))
    for ax, angle in zip(axes, angles, strict=True):
        time, mean, deviation = errors_over_time(results, angle)
        ax.plot(time, mean, color=DRAWN[-1], linewidth=1.0)
        ax.plot(time, np.stack([mean - deviation, mean + deviation], -1), "--", color=DRAWN[-1], linewidth=0.8)
        ax.axhline(0.0, color=TRUTH_COLOR, linewidth=0.6)
        ax.set_ylabel(f"error of {symbol(angle)}, deg", fontsize=8.5)
    axes[-1].set_xlabel("time, s (solid: mean over rides, dashed: one standard deviation)")
    return figure


def spread_claims(results: Sequence[Mapping[str, Any]], angles: Sequence[str], figure: str) -> list[Claim]:
    """Whether errors lie around zero and do not grow, as a figure of mean and deviation over time says."""
    centred, growth = {}, {}
    for angle in angles:
        time, mean, deviation = errors_over_time(results, angle)
        settled, late = time >= SETTLED, time >= 0.5 * (SETTLED + time[-1])
        known = np.isfinite(mean) & np.isfinite(deviation)
        settled, late, early = settled & known, late & known, settled & known & ~late
        if early.any() and late.any():
            size = np.sqrt(np.mean(deviation[settled] ** 2))
            centred[angle] = float(abs(mean[settled].mean()) / size)
            growth[angle] = float(np.sqrt(np.mean(deviation[late] ** 2) / np.mean(deviation[early] ** 2)))
    return [
        Claim.every(f"{figure}: errors are around zero (mean below their standard deviation)", centred, 1.0, "of it"),
        Claim.every(f"{figure}: standard deviations do not grow from the first to the second half", growth, 1.5, "×"),
    ]


def offset_shares(results: Sequence[Mapping[str, Any]], angles: Sequence[str], method: str) -> tuple[str, float, float]:
    """The angle whose mean error is largest beside its deviation, and that mean (deg) of the first and of a method."""

    def offset(angle: str, name: str | None = None) -> tuple[float, float]:
        time, mean, deviation = errors_over_time(results, angle, name)
        known = (time >= SETTLED) & np.isfinite(mean) & np.isfinite(deviation)
        if not known.any():
            return float("nan"), float("nan")
        return float(abs(mean[known].mean())), float(np.sqrt(np.mean(deviation[known] ** 2)))

    sizes = {angle: offset(angle) for angle in angles}
    worst = max(sizes, key=lambda angle: np.nan_to_num(np.divide(*sizes[angle])))
    return worst, sizes[worst][0], offset(worst, method)[0]
