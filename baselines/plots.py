"""Figures, drawn from tables and estimates; all figures of one report share their colours and order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..envs.data.trajectory import Trajectory
from ..filters.core.metrics import DEGREES, error
from ..filters.core.quantity import UP, Estimate
from .evaluation import summary, with_up

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

COLOURS = {
    "filter": "#1f5fa8",
    "baseline": "#6d737c",
    "learned": "#c2571a",
    "adaptive": "#2c8c5a",
    "external": "#b08d1a",
}
"""Kind of estimator → colour."""

TRUTH_COLOR = "black"
"""Of what is true, in every figure."""


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Any]]:
    """A figure in inches, drawn without a screen, with ``rows`` × ``columns`` axes, row by row."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=140)
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, sharex="col", squeeze=False).ravel()
    for ax in axes:
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(axis="both", color="#e4e6ea", linewidth=0.7)
        ax.set_axisbelow(True)
    return figure, list(axes)


def legend_above(ax: Any) -> None:
    """Put the legend above the axes, off the curves."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, frameon=False, fontsize=8, borderaxespad=0.1)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, without a date, so that equal runs give equal files."""
    figure.savefig(path, metadata={"Software": None})
    return path


def rms_bars(
    table: pandas.DataFrame, kinds: Mapping[str, str], metric: str = "inclination", title: str = "", limit: float = 12.0
) -> Figure:
    """Mean error of every estimator as bars, best on top, with each trajectory as a dot.

    Args:
        table: from :func:`poise.evaluate`.
        kinds: estimator → kind, for the colours.
        metric: which metric.
        title: above the axes.
        limit: bars and dots beyond it are cut (the number at the right is not).
    """
    means = summary(table, metric)["mean"]
    chosen = table[table["metric"] == metric]
    unit = chosen["unit"].iloc[0]
    figure, (ax,) = new_figure(7.5, 1.1 + 0.3 * len(means))
    positions = np.arange(len(means))[::-1]
    limit = min(limit, 1.15 * float(means.max()))
    for position, (name, mean) in zip(positions, means.items(), strict=True):
        colour = COLOURS.get(kinds.get(str(name), ""), COLOURS["baseline"])
        ax.barh(position, min(mean, limit), height=0.62, color=colour, alpha=0.85)
        values = chosen.loc[chosen["estimator"] == name, "value"]
        inside = values[values <= limit]
        ax.plot(inside, np.full(len(inside), position), "o", color="black", markersize=2.6, alpha=0.55)
        # Values stand in a column of their own, where no dot can lie.
        ax.text(1.02 * limit, position, f"{mean:.2f}", va="center", fontsize=8.5)
    ax.set_yticks(positions, [str(name) for name in means.index])
    ax.set_xlim(0.0, 1.12 * limit)
    ax.set_xlabel(f"{metric} error, RMS, {unit} (bar: mean, dot: one trajectory)")
    ax.grid(axis="y", visible=False)
    present = [kind for kind in COLOURS if kind in {kinds.get(str(name)) for name in means.index}]
    patches = [_patch(COLOURS[kind]) for kind in present]
    figure.legend(patches, present, loc="outside upper right", ncols=len(present), frameon=False, fontsize=8.5)
    if title:
        ax.set_title(title, loc="left", fontsize=10.5)
    return figure


def _patch(colour: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(color=colour, alpha=0.85)


def error_curves(
    trajectory: Trajectory, estimates: Mapping[str, Estimate], kinds: Mapping[str, str], title: str = ""
) -> Figure:
    """What the motion was and how wrong the inclination of some estimators was, over time.

    Args:
        trajectory: with truth; its specific force and angular rate (true ones without an IMU) are drawn above.
        estimates: label → estimate over the whole trajectory.
        kinds: label → kind, for the colours.
        title: above the figure.
    """
    figure, (motion, errors) = new_figure(8.5, 4.6, rows=2)
    time = trajectory.time - trajectory.time[0]
    # a device with an array of accelerometers has no such channels: its true motion is drawn
    for channel, quantity, colour, read, true in (
        ("imu/acc", "external_acceleration", "#3b3f46", "specific force, m/s²", "true acceleration, m/s²"),
        ("imu/gyr", "angular_rate", "#9a6fb0", "angular rate, rad/s", "true angular rate, rad/s"),
    ):
        values = trajectory.measurements.get(channel, trajectory.truth.get(quantity))
        if values is not None:
            length, label = np.linalg.norm(values, axis=-1), read if channel in trajectory.measurements else true
            motion.plot(time, length, color=colour, linewidth=0.6, label=label)
    motion.legend(loc="upper left", frameon=False, fontsize=8, ncols=2)
    truth = trajectory.truth_of(UP.name)
    styles: Sequence[str] = ("-", "--", ":", "-.")
    used: dict[str, int] = {}
    for label, estimate in estimates.items():
        kind = kinds.get(label, "")
        style = styles[used.get(kind, 0) % len(styles)]
        used[kind] = used.get(kind, 0) + 1
        per_tick = error(UP, with_up(estimate.pose)[UP.name], truth) * DEGREES
        colour = COLOURS.get(kind, COLOURS["baseline"])
        errors.plot(time, per_tick, color=colour, linestyle=style, linewidth=0.9, label=label)
    errors.set_ylabel("inclination error, deg")
    errors.set_xlabel("time, s")
    errors.set_ylim(bottom=0.0)
    errors.legend(loc="upper left", frameon=False, fontsize=8, ncols=3)
    if title:
        motion.set_title(title, loc="left", fontsize=10.5)
    return figure
