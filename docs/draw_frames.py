"""Draws the frames and signs of the conventions page: ``python docs/draw_frames.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from poise.baselines.plots import new_figure
from poise.filters.core import rotation

SHIPPED = Path(__file__).with_name("figures") / "frames.svg"
AXES = ("#c0392b", "#2c8c5a", "#1f5fa8")
VIEW = np.array([[0.87, 0.5, 0.0], [-0.28, 0.42, 0.86]])
"""World coordinates to the page: x to the right and towards the reader, y away from the reader, z up."""


def arrow(ax, start, vector, colour, label, *, width=1.8):
    """An arrow of the world in the plane of the page."""
    begin, end = VIEW @ np.asarray(start), VIEW @ (np.asarray(start) + vector)
    ax.annotate(
        "", end, begin, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0}
    )
    ax.annotate(label, begin + 1.18 * (end - begin), color=colour, ha="center", va="center", fontsize=9)


def draw():
    """World and sensor frame on the left, signs of an accelerometer at rest on the right."""
    figure, (left, right) = new_figure(8.2, 3.4, columns=2)
    for label, axis, colour in zip(("x east", "y north", "z up"), np.eye(3), AXES, strict=True):
        arrow(left, [0, 0, 0], 1.2 * axis, colour, label)
    tilted = np.array(rotation.from_euler_zyx(np.radians(25.0), np.radians(-20.0), np.radians(30.0)))
    place = [1.9, 0.6, 0.4]
    for label, axis, colour in zip(("x", "y", "z"), np.eye(3), AXES, strict=True):
        arrow(left, place, 0.8 * np.array(rotation.rotate(tilted, axis)), colour, label)
    left.set_title("world (left), sensor (right); q = (w, x, y, z)\nturns sensor into world coordinates", fontsize=9)
    for label, axis, colour in zip(("x", "y", "z"), np.eye(3), AXES, strict=True):
        arrow(right, [0, 0, 0], 0.8 * axis, colour, label)
    arrow(right, [-0.12, 0, 0], [0, 0, 1.35], "#333333", "f: +9.81 m/s²", width=1.2)
    arrow(right, [-0.12, 0, 0], [0, 0, -0.9], "#999999", "gravity", width=1.2)
    turn = np.linspace(-0.4, 4.2, 40)
    circle = VIEW @ np.array([0.35 * np.cos(turn), 0.35 * np.sin(turn), np.full(40, 0.55)])
    right.plot(*circle, color="#b08d1a", lw=1.6)
    right.annotate("", circle[:, -1], circle[:, -3], arrowprops={"arrowstyle": "-|>", "color": "#b08d1a", "lw": 1.6})
    right.annotate("ω > 0 about z", circle[:, 14] + [0.12, 0.12], color="#b08d1a", fontsize=9)
    right.set_title(
        "at rest the accelerometer reads +g on the axis\nthat points up; rates are right-handed", fontsize=9
    )
    for ax, limits in ((left, (-0.4, 3.4, -0.9, 1.6)), (right, (-1.5, 1.6, -1.1, 1.5))):
        ax.axis(limits)
        ax.set_aspect("equal")
        ax.set_axis_off()
    return figure


if __name__ == "__main__":
    draw().savefig(SHIPPED, metadata={"Date": None})
    print(SHIPPED.relative_to(Path.cwd()) if SHIPPED.is_relative_to(Path.cwd()) else SHIPPED)
