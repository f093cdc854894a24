"""Figures, drawn from tables and estimates; all figures of one report share their colours and order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..envs.data.trajectory import Trajectory
from ..filters.core.metrics import DEGREES, error
from ..filters.core.quantity import UP, Estimate
from ..filters.support.files import replacing
from .scoring import with_up

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

BLUE, VERMILION, GREEN, PINK, AMBER, SKY, GREY = PALETTE = (
    *("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"),
    "#4d4d4d",
)
"""Colours of estimates, told apart by colour-blind people too: M. Okabe, K. Ito, "Color Universal Design", 2008."""
COLOURS = {
    "filter": BLUE,
    "baseline": GREY,
    "learned": VERMILION,
    "adaptive": GREEN,
    "offline": PINK,
    "external": AMBER,
}
"""Kind of estimator → colour."""

UNDATED = {".png": "Software", ".pdf": "CreationDate", ".svg": "Date"}
"""Ending of a figure → the entry of its file that differs from run to run."""
TRUTH_COLOR = "black"
"""Colour of the truth, in every figure."""


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
        ax.set_prop_cycle(color=PALETTE)
    return figure, list(axes)


def time_figure(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Any]]:
    """As :func:`new_figure`, of curves over time in s."""
    figure, axes = new_figure(width, height, rows, columns)
    for ax in axes[-columns:]:
        ax.set_xlabel("time, s")
    return figure, axes


def new_spatial_figure(
    width: float, height: float, rows: int = 1, columns: int = 1, dpi: int = 140
) -> tuple[Figure, list[Any]]:
    """A figure in inches with ``rows`` × ``columns`` axes in three dimensions, row by row, drawn without a screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi)
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(rows, columns, index + 1, projection="3d") for index in range(rows * columns)]
    figure.subplots_adjust(0.0, 0.02, 1.0, 0.97, 0.0, 0.0)
    return figure, axes


def legend_above(ax: Any) -> None:
    """Put the legend above the axes, off the curves."""
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, frameon=False, fontsize=8, borderaxespad=0.1)


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, PDF or SVG, by its ending, without a date, so that equal runs give equal files.

    Raises:
        ValueError: another ending.
    """
    ending = path.suffix.lower()
    if ending not in UNDATED:
        raise ValueError(f"a figure must end in one of {', '.join(UNDATED)}, got {str(path)!r}")
    with replacing(path) as part:
        figure.savefig(part, metadata={UNDATED[ending]: None})
    return path


def save_animation(figures: Sequence[Figure], interval: float, path: Path) -> Path:
    """Write figures of equal size as an animated GIF that repeats, ``interval`` s from frame to frame."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    frames = []
    for figure in figures:
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]
        frames.append(Image.fromarray(pixels.copy()).quantize(64))
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=round(1000.0 * interval), loop=0)
    return path


def rms_bars(table: pandas.DataFrame, kinds: Mapping[str, str], metric: str = "inclination", title: str = "") -> Figure:
    """Mean error of every estimator as bars, best on top, with each trajectory as a dot.

    The scale is set by the better half of the estimators. Values beyond it are cut off and marked by a triangle at the
    edge with the largest value. ``kinds`` of estimators choose the colours.
    """
    from matplotlib.patches import Patch

    from .error_table import summary

    means = summary(table, metric)["mean"].dropna()
    chosen = table[table["metric"] == metric]
    unit = chosen["unit"].iloc[0]
    figure, (ax,) = new_figure(7.5, 1.1 + 0.3 * max(len(means), 1))
    positions = np.arange(len(means))[::-1]
    limit = scale_of(means, chosen)
    for position, (name, mean) in zip(positions, means.items(), strict=True):
        colour = COLOURS.get(kinds.get(str(name), ""), COLOURS["baseline"])
        ax.barh(position, min(mean, limit), height=0.62, color=colour, alpha=0.85)
        values = chosen.loc[chosen["estimator"] == name, "value"]
        inside, outside = values[values <= limit], values[values > limit]
        ax.plot(inside, np.full(len(inside), position), "o", color="black", markersize=2.6, alpha=0.55)
        # Values stand in a column of their own, where no dot can lie.
        text = f"{mean:.2f}"
        if len(outside):
            ax.plot(limit, position, ">", color="black", markersize=4.5, clip_on=False)
            text += f"  (largest {outside.max():.3g})"
        ax.text(1.03 * limit, position, text, va="center", fontsize=8.5)
    ax.set_yticks(positions, [str(name) for name in means.index])
    ax.set_ylim(-0.6, len(means) - 0.4)
    ax.set_xlim(0.0, (1.45 if (chosen["value"] > limit).any() else 1.12) * limit)
    ax.set_xticks([tick for tick in ax.get_xticks() if tick <= 1.001 * limit])
    beyond = ", triangle: cut" if (chosen["value"] > limit).any() else ""
    ax.set_xlabel(f"{metric} error, RMS, {unit}\n(bar: mean, dot: one trajectory{beyond})")
    ax.grid(axis="y", visible=False)
    present = [kind for kind in COLOURS if kind in {kinds.get(str(name)) for name in means.index}]
    if present:
        patches = [Patch(color=COLOURS[kind], alpha=0.85) for kind in present]
        figure.legend(patches, present, loc="outside upper right", ncols=len(present), frameon=False, fontsize=8.5)
    if title:
        ax.set_title(title, loc="left", fontsize=10.5)
    return figure


def scale_of(means: pandas.Series, chosen: pandas.DataFrame) -> float:
    """End of the scale: all values of the better half of the estimators, and the bars of those nearly as good."""
    better = list(means.index[: max(1, (len(means) + 1) // 2)])
    values = chosen.loc[chosen["estimator"].isin(better), "value"].to_numpy()
    values = values[np.isfinite(values)]
    if not len(values) or not values.max() > 0.0:
        return 1.0
    # A single bad trajectory of a good estimator must not set the scale either.
    middle = max(float(np.quantile(values, 0.9)), float(means[better].max()))
    limit = min(float(values.max()), 2.0 * middle)
    near = means[means <= 1.5 * limit]
    return 1.08 * max(limit, float(near.max()) if len(near) else 0.0)


def error_curves(
    trajectory: Trajectory, estimates: Mapping[str, Estimate], kinds: Mapping[str, str], title: str = ""
) -> Figure:
    """Motion and inclination errors of some estimators over time.

    Specific force and angular rate (true ones without an IMU) are drawn above. ``kinds`` of labels choose the colours.
    """
    figure, (motion, errors) = time_figure(8.5, 4.6, rows=2)
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
    legend_above(motion)
    truth = trajectory.truth_of(UP.name)
    styles: Sequence[str] = ("-", "--", ":", "-.")
    used: dict[str, int] = {}
    usual: list[float] = []
    for label, estimate in estimates.items():
        kind = kinds.get(label, "")
        style = styles[used.get(kind, 0) % len(styles)]
        used[kind] = used.get(kind, 0) + 1
        degrees = error(UP, with_up(estimate.pose)[UP.name], truth) * DEGREES
        usual.append(float(np.nanquantile(degrees, 0.995)) if np.isfinite(degrees).any() else 0.0)
        colour = COLOURS.get(kind, COLOURS["baseline"])
        errors.plot(time, degrees, color=colour, linestyle=style, linewidth=0.9, label=label)
    errors.set_ylabel("inclination error, deg")
    # The better half sets the scale, so that one diverging estimator does not hide the others.
    end = 1.3 * sorted(usual)[(len(usual) - 1) // 2] if usual else 1.0
    errors.set_ylim(0.0, max(end, 1e-3))
    legend_above(errors)
    cut = [label for label, value in zip(estimates, usual, strict=True) if value > end]
    if cut:
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
        text = f"cut: {', '.join(cut)}"
        errors.text(0.005, 0.97, text, transform=errors.transAxes, fontsize=8, verticalalignment="top", bbox=box)
    if title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=10.5)
    return figure


def angle_curves(trajectories: Mapping[str, Trajectory], estimates: Mapping[str, Estimate]) -> Figure:
    """Roll, pitch and yaw of sensors over time, with two standard deviations to either side, and the truth if known."""
    from ..filters.core.frames import ANGLES, attitude_columns

    frames = {name: estimate.to_frame() for name, estimate in estimates.items()}
    shown = [angle for angle in ANGLES if any(angle in frame for frame in frames.values())]
    figure, axes = time_figure(8.5, 1.0 + 1.7 * len(shown), rows=len(shown))
    colours = list(COLOURS.values())
    spans: dict[str, list[float]] = {}
    for number, (name, frame) in enumerate(frames.items()):
        trajectory, colour = trajectories[name], colours[number % len(colours)]
        # A heading that no magnetometer gave is not that of the truth.
        absolute = "orientation" in estimates[name].pose
        truth = attitude_columns(trajectory.truth)
        for ax, angle in zip(axes, shown, strict=True):
            if angle not in frame:
                continue
            if angle in truth and (absolute or angle != "yaw"):
                ax.plot(trajectory.time, unwrapped(truth[angle]), color=TRUTH_COLOR, linewidth=0.9, label="truth")
            values = unwrapped(frame[angle].to_numpy())
            ax.plot(frame["time"], values, color=colour, linewidth=0.9, label=name)
            if f"std_{angle}" in frame and (absolute or angle != "yaw"):
                # Where an angle is undefined (pitch ±90°) its band would hide everything.
                band = np.minimum(2.0 * frame[f"std_{angle}"].to_numpy(), 180.0)
                ax.fill_between(frame["time"], values - band, values + band, color=colour, alpha=0.2, linewidth=0.0)
            ax.set_ylabel(f"{angle}, deg")
            span = [np.nanmin(values), np.nanmax(values)] if np.isfinite(values).any() else [0.0, 1.0]
            spans.setdefault(angle, []).extend(span)
    for ax, angle in zip(axes, shown, strict=True):
        low, high = min(spans[angle]), max(spans[angle])
        # The angles set the scale; wider bands are cut.
        ax.set_ylim(low - 0.1 * (high - low) - 1.0, high + 0.1 * (high - low) + 1.0)
    handles = dict(zip(*axes[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles, loc="outside upper right", ncols=6, frameon=False, fontsize=8)
    return figure


def unwrapped(degrees: np.ndarray) -> np.ndarray:
    """Angles with a gap instead of a line where they wrap."""
    jump = np.abs(np.diff(degrees, prepend=degrees[:1])) > 180.0
    return np.where(jump, np.nan, degrees)


def signals(trajectory: Trajectory, rest: Mapping[str, np.ndarray]) -> Figure:
    """Lengths of angular rate, specific force and magnetic field of every sensor over time; rest is shaded.

    ``rest`` is that of :func:`poise.envs.data.inspection.inspect_recording`: sensor → ``(T,)`` bool.
    """
    labels = {"gyr": "|rate|, rad/s", "acc": "|force|, m/s²", "mag": "|field|"}
    kinds = [kind for kind in labels if any(f"{site}/{kind}" in trajectory.measurements for site in rest)]
    figure, axes = time_figure(8.5, 0.8 + 1.5 * max(len(kinds), 1), rows=max(len(kinds), 1))
    for kind, ax in zip(kinds, axes, strict=False):
        for number, site in enumerate(rest):
            values = trajectory.measurements.get(f"{site}/{kind}")
            if values is not None:
                colour = list(COLOURS.values())[number % len(COLOURS)]
                ax.plot(trajectory.time, np.linalg.norm(values, axis=1), color=colour, linewidth=0.6, label=site)
        ax.set_ylabel(labels[kind])
        ax.set_ylim(bottom=0.0)
    if len(rest) == 1:
        (resting,) = rest.values()
        for ax in axes:
            ax.fill_between(
                trajectory.time, 0, 1, where=resting, transform=ax.get_xaxis_transform(), color="#d9dde3", step="post"
            )
    elif kinds:
        legend_above(axes[0])
    axes[0].set_title(f"{trajectory.name}{' (shaded: rest)' if len(rest) == 1 else ''}", loc="left", fontsize=10)
    return figure
