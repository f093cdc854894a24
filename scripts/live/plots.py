"""The plot beside the picture, by Plotly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...baselines.plots import PALETTE
from ...filters.support.optional import extra
from .curves import TRUTH

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

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
