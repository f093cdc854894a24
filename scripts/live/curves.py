"""Curves beside the picture: errors against the truth, and angles; drawn by Plotly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...baselines.plots import PALETTE
from ...baselines.scoring import with_up
from ...filters.core import metrics, rotation
from ...filters.core.quantity import UP, Quantity
from ...filters.support.optional import extra

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

TRUTH = "truth"
"""Label of the truth beside those of estimates."""
Arrays = Mapping[str, np.ndarray]
Curves = dict[str, dict[str, np.ndarray]]
"""What a plot shows → label of the curve → ``(n,)``; angles in degrees."""


def curves_of(truth: Arrays, estimates: Mapping[str, Arrays], outputs: Mapping[str, Sequence[Quantity]]) -> Curves:
    """Errors of the quantities whose truth is known, then angles of truth and estimates; deg where these are angles.

    Truth and estimates hold quantities ``(n, size)``; estimates and their ``outputs`` go by label.
    """
    errors: Curves = {}
    angles: Curves = {}
    truth = with_up(truth)
    for label, estimate in estimates.items():
        pose = with_up(estimate)
        for quantity in {each.name: each for each in (UP, *outputs[label])}.values():
            if quantity.name in pose and quantity.name in truth:
                error = np.asarray(metrics.error(quantity, pose[quantity.name], truth[quantity.name]))
                scale, unit = (math.degrees(1.0), "deg") if quantity.kind != "vector" else (1.0, quantity.unit)
                named = "inclination" if quantity.name == UP.name else quantity.name
                errors.setdefault(f"error of {named} ({unit})", {})[label] = scale * error
        for name, values in angles_of(pose, outputs[label]).items():
            angles.setdefault(name, {})[label] = values
    every = [quantity for each in outputs.values() for quantity in each]
    for name, values in angles_of(truth, every).items():
        if name in angles or not outputs:
            angles[name] = {TRUTH: values, **angles.get(name, {})}
    return errors | angles


def angles_of(pose: Arrays, outputs: Sequence[Quantity]) -> dict[str, np.ndarray]:
    """Angles of a pose in degrees: roll, pitch and yaw of a device, all angles of a rider."""
    found: dict[str, np.ndarray] = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = next((pose[name] for name in ("orientation", "relative_orientation") if name in pose), None)
        if turn is not None:
            angles: Sequence[np.ndarray] = rotation.to_euler_zyx(np.asarray(turn, float))[::-1]
        else:
            angles = rotation.roll_pitch(np.asarray(pose["up"], float)) if "up" in pose else ()
        for name, values in zip(("roll", "pitch", "yaw"), angles, strict=False):
            found[f"{name} (deg)"] = np.degrees(values)
    for quantity in outputs:
        if quantity.kind == "angle" and quantity.name in pose:
            for index in range(quantity.size):
                name = quantity.name if quantity.size == 1 else f"{quantity.name} {index + 1}"
                found[f"{name} (deg)"] = np.degrees(np.asarray(pose[quantity.name], float)[:, index])
    return found


COLOURS = tuple((int(each[1:3], 16), int(each[3:5], 16), int(each[5:], 16)) for each in PALETTE)
"""Red, green, blue of estimates, in the order in which they are named."""
TRUTH_COLOUR = (0, 0, 0)
"""As in figures."""
POINTS = 600
"""Samples of a curve that are drawn."""
MARGIN = {"l": 46, "r": 10, "t": 8, "b": 36}


def colours_of(labels: list[str]) -> dict[str, tuple[int, int, int]]:
    """Label → colour; the truth is black."""
    estimates = [label for label in labels if label != TRUTH]
    found = {label: COLOURS[index % len(COLOURS)] for index, label in enumerate(estimates)}
    return {TRUTH: TRUTH_COLOUR, **found}


def curve_figure(
    time: np.ndarray,
    curves: Mapping[str, np.ndarray],
    title: str,
    colours: Mapping[str, tuple[int, int, int]],
    now: float,
) -> Figure:
    """Curves ``(n,)`` over time ``(n,)``, s, with a line at the time that is shown; ``title`` is that of the axis."""
    with extra("view"):
        from plotly.graph_objects import Figure, Scatter

    figure = Figure()
    stride = max(1, -(-len(time) // POINTS))
    for label, values in curves.items():
        red, green, blue = colours.get(label, TRUTH_COLOUR)
        line = {"color": f"rgb({red},{green},{blue})", "width": 1.5, "dash": "dash" if label == TRUTH else "solid"}
        figure.add_trace(Scatter(x=time[::stride], y=values[::stride], name=label, mode="lines", line=line))
    figure.add_vline(x=now, line={"color": "rgb(60,60,60)", "width": 1.2})
    figure.update_layout(
        template="simple_white",
        margin=MARGIN,
        showlegend=True,
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0, "font": {"size": 11}},
        xaxis={"title": {"text": "time (s)", "standoff": 4}, "range": [float(time[0]), float(time[-1])]},
        yaxis={"title": {"text": title, "standoff": 2, "font": {"size": 11}}},
        font={"size": 11},
        uirevision=title,
    )
    return figure
