"""Figures 4.6 to 4.21 of the thesis, from what :mod:`.rate_table` measured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...plots import TRUTH_COLOR, legend_above, new_figure, time_figure
from ..report import Report
from ..ride_figures import DRAWN

EVERY = 5
"""samples from point to point"""


def rate_table_figures(report: Report, found: dict[str, Any]) -> None:
    """All figures of one device."""
    runs = {name: np.array(values) for name, values in found["runs"].items() if name not in ("mounting", "fitted")}
    accelerometer_figures(report, runs, np.array(found["runs"]["mounting"]), found["runs"]["fitted"])
    gyroscope_figures(report, found["turns"])
    pair_figures(report, found)
    figure, axes = new_figure(8.0, 3.8, 1, 2)
    for ax, name, label in zip(axes, ("raw", "unit"), ("counts", "of the unit field"), strict=True):
        values = np.array(found["magnetometer"][name])
        for (one, other), color in zip(((0, 1), (0, 2), (1, 2)), (DRAWN[0], DRAWN[1], DRAWN[3]), strict=True):
            pair = f"{'xyz'[one]}{'xyz'[other]}"
            ax.plot(values[:, one], values[:, other], ".", markersize=1.5, color=color, label=pair)
        ax.set(aspect="equal", xlabel=label)
        legend_above(ax)
    title = "Figures 4.20 and 4.21: magnetometer before and after compensation"
    report.figure("magnetometer", figure, title, "Pairs of components.")


def accelerometer_figures(report: Report, runs: dict[str, Any], mounting: Any, fitted: list[float]) -> None:
    """Imposed rates, raw output, output against acceleration with the fit, and its residuals."""
    ways = [("outwards", "out +x"), ("inwards", "out -x")]
    for key, label, number in (("rate", "rate, °/s", "4.6"), ("raw", "output, digits", "4.7")):
        figure, axes = time_figure(7.5, 2.8, 1, 2)
        for ax, (title, end) in zip(axes, ways, strict=True):
            part = np.char.endswith(mounting, end)
            time = runs["time"][part] - runs["time"][part][0]
            ax.plot(time[::EVERY], runs[key][part][::EVERY], color=DRAWN[-1], linewidth=0.8)
            ax.set(title=f"axis {title}")
        axes[0].set_ylabel(label)
        name = "imposed rates" if key == "rate" else "output of an accelerometer"
        report.figure(f"table-{key}", figure, f"Figure {number}: {name}")
    scale, offset = fitted
    # only runs in which the axis is along the radius or upright, as in the thesis
    figure, (ax,) = new_figure(6.0, 3.4)
    ax.plot(runs["imposed"][::EVERY], runs["raw"][::EVERY], ".", color=DRAWN[-1], markersize=1.5, label="readings")
    ends = np.array([runs["imposed"].min(), runs["imposed"].max()])
    ax.plot(ends, (ends - offset) / scale, color=TRUTH_COLOR, linewidth=0.9, label="best fit")
    ax.set(xlabel="imposed acceleration, m/s²", ylabel="output, digits")
    legend_above(ax)
    report.figure("table-fit", figure, "Figure 4.8: output and imposed acceleration")
    figure, (ax,) = new_figure(6.0, 3.0)
    left = scale * runs["raw"] + offset - runs["imposed"]
    ax.plot(runs["imposed"][::EVERY], left[::EVERY], ".", color=DRAWN[-1], markersize=1.5)
    ax.set(xlabel="imposed acceleration, m/s²", ylabel="residual, m/s²")
    report.figure("table-residual", figure, "Figure 4.9: residuals of the fit of an accelerometer")


def gyroscope_figures(report: Report, turns: dict[str, Any]) -> None:
    """Rate of the table, output, best fit and residuals of the gyroscope."""
    time, rate, raw, kept = (np.array(turns[name]) for name in ("time", "rate", "raw", "kept"))
    scale, offset = (math.degrees(value) for value in turns["fitted"])
    figure, axes = time_figure(7.5, 4.2, 2)
    for ax, values, label in zip(axes, (rate, raw), ("rate, °/s", "output, digits"), strict=True):
        ax.plot(time[::EVERY] - time[0], values[::EVERY], color=DRAWN[-1], linewidth=0.8)
        ax.set_ylabel(label)
    report.figure("gyroscope-runs", figure, "Figures 4.11 and 4.12: rate of the table and output of the gyroscope")
    figure, axes = new_figure(8.0, 3.4, 1, 2)
    axes[0].plot(raw[::EVERY], rate[::EVERY], ".", color=DRAWN[-1], markersize=2.0, label="readings")
    ends = np.array([raw[kept].min(), raw[kept].max()])
    axes[0].plot(ends, scale * ends + offset, color=TRUTH_COLOR, linewidth=0.9, label="best fit")
    axes[0].set(xlabel="output, digits", ylabel="rate, °/s")
    legend_above(axes[0])
    left = (scale * raw + offset - rate)[kept]
    axes[1].plot(rate[kept][::EVERY], left[::EVERY], ".", color=DRAWN[-1], markersize=2.0)
    axes[1].set(xlabel="rate, °/s", ylabel="residual, °/s")
    report.figure("gyroscope-fit", figure, "Figures 4.13 and 4.14: best fit of the gyroscope and its residuals")


def pair_figures(report: Report, found: dict[str, Any]) -> None:
    """Best-fit lines of two places, and of both directions of change, and their differences."""
    titles = {
        "places": ("Figures 4.15 and 4.16: two places on the table", ("on the axis", "0.2 m from it")),
        "ways": ("Figures 4.17 to 4.19: back and forth", ("rising", "falling")),
    }
    grid = np.linspace(-240.0, 240.0, 49)
    for name, (title, labels) in titles.items():
        lines = [np.polyval(line, np.radians(grid)) for line in found["lines"][name]]
        columns = 3 if name == "ways" else 2
        figure, axes = new_figure(4.0 * columns, 3.0, 1, columns)
        if name == "ways":
            for rates, color, label in zip(found["pairs"][name], DRAWN[1::2], labels, strict=True):
                axes[0].plot(np.linspace(0.0, 1.0, len(rates)), rates, color=color, linewidth=0.9, label=label)
            axes[0].set(xlabel="share of the run", ylabel="rate, °/s")
            legend_above(axes[0])
        top, below = axes[-2:]
        for line, color, style, label in zip(lines, DRAWN[1::2], ("-", "--"), labels, strict=True):
            top.plot(grid, line, style, color=color, linewidth=0.9, label=label)
        top.set(xlabel="rate, °/s", ylabel="output, digits")
        legend_above(top)
        below.plot(grid, lines[0] - lines[1], color=DRAWN[-1], linewidth=0.9)
        below.set(xlabel="rate, °/s", ylabel="difference, digits")
        report.figure(f"gyroscope-{name}", figure, title)
