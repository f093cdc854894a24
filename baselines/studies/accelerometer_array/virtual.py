"""Section 5.6 of the thesis: the virtual controller of figure 5.24, drawn, and how far its position can be believed."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.devices import DEVICES
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.spatial.orientation import ArrayOrientation
from ....filters.core import rotation
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import STANDARD_GRAVITY, Estimate
from ...plots import TRUTH_COLOR, legend_above, new_spatial_figure, time_figure
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_figures import DRAWN
from .comparison import noise_of
from .spatial import RATE

SENSORS = "array-calibrated"
DURATION = 40.0
"""s"""
AZIMUTH, ELEVATION = -37.5, 30.0
"""deg: view of the thesis' window"""
BOX = np.array([0.06, 0.30, 0.06])
"""m: the controller, a little thicker than it is"""
SHOWN = (0.0, 0.75, 1.5, 2.25)
"""s after the begin of the picture"""
UNDAMPED = 1e-6
"""1/s: a damping that is as good as none, (5.64) and (5.65)"""


def shown(gesture: str, seed: int, **parameters: Any) -> tuple[Trajectory, Estimate]:
    """A controller that is moved, or lies still, and the filter's estimate with its virtual position."""
    trajectory = simulate_hand(gesture, seed, SENSORS, RATE, DURATION, device="controller")
    first = tuple(trajectory.truth["orientation"][0].tolist())
    model = ArrayOrientation(
        array=DEVICES["controller"].array,
        gravity=STANDARD_GRAVITY,
        dt=1.0 / RATE,
        start="given",
        start_orientation=first,
        **(noise_of(SENSORS) | parameters),
    )
    return trajectory, run(KalmanFilter(model, keep_covariance=False), trajectory.measurements)


def positions(gesture: str, seed: int) -> dict[str, Any]:
    """``time``; true, virtual and undamped virtual position less that at the start ``(T, 3)``, m."""
    trajectory, damped = shown(gesture, seed)
    _, free = shown(gesture, seed, position_damping=UNDAMPED, velocity_damping=UNDAMPED)
    true = trajectory.truth["position"]
    return {
        "time": trajectory.time.tolist(),
        "true": (true - true[0]).tolist(),
        "virtual": damped.pose["virtual_position"].tolist(),
        "undamped": free.pose["virtual_position"].tolist(),
    }


def edges() -> np.ndarray:
    """Corners of the box in the order in which one line draws all its edges ``(16, 3)``, body axes, m."""
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    bottom = [(x, y, -1) for x, y in square]
    top = [(x, y, 1) for x, y in square]
    rest = [(1, -1, 1), (1, -1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1), (-1, 1, -1)]
    return 0.5 * BOX * np.array([*bottom, *top, *rest], dtype=float)


def controller_figure(seed: int) -> tuple[Any, float]:
    """Figure 5.24: the true controller above, the virtual one below, at four moments; half the width of a box, m."""
    trajectory, estimate = shown("pointing", seed)
    figure, axes = new_spatial_figure(10.0, 5.2, 2, len(SHOWN))
    place = trajectory.truth["position"] - trajectory.truth["position"][0]
    rows = (
        ("true", trajectory.truth["orientation"], place, TRUTH_COLOR),
        ("virtual", estimate.pose["orientation"], estimate.pose["virtual_position"], DRAWN[-1]),
    )
    part = slice(round(10.0 * RATE), round((10.0 + SHOWN[-1]) * RATE) + 1)
    limit = 0.2 + max(float(np.abs(each[part]).max()) for _, _, each, _ in rows)
    for row, (name, orientation, position, color) in enumerate(rows):
        for column, after in enumerate(SHOWN):
            ax, k = axes[row * len(SHOWN) + column], round((10.0 + after) * RATE)
            points = rotation.rotate(orientation[k], edges()) + position[k]
            ax.plot(*points.T, color=color, linewidth=1.2)
            tip = rotation.rotate(orientation[k], np.array([[0.0, 0.0, 0.0], [0.0, 0.25, 0.0]])) + position[k]
            ax.plot(*tip.T, color=DRAWN[1], linewidth=1.0)
            ax.set(xlim=(-limit, limit), ylim=(-limit, limit), zlim=(-limit, limit))
            ax.view_init(ELEVATION, AZIMUTH)
            ax.set_box_aspect((1.0, 1.0, 1.0))
            # eight small boxes of one size: marks without numbers, and the size in the caption
            ax.set(xticklabels=(), yticklabels=(), zticklabels=())
            ax.set_title(f"{name}, {10.0 + after:g} s", fontsize=9, y=1.04)
    return figure, limit


def position_figure(curves: dict[str, Any]) -> Any:
    """The three positions over time."""
    figure, axes = time_figure(7.5, 4.6, 3)
    time = np.array(curves["time"])
    part = time <= 15.0
    for axis, ax in enumerate(axes):
        true, virtual, free = (np.array(curves[name])[part, axis] for name in ("true", "virtual", "undamped"))
        ax.plot(time[part], true, color=TRUTH_COLOR, linewidth=1.2, label="true")
        ax.plot(time[part], free, color=DRAWN[1], linewidth=0.8, label="twice integrated")
        ax.plot(time[part], virtual, color=DRAWN[-1], linewidth=0.9, label="virtual, damped")
        limit = 1.5 * max(np.abs(true).max(), np.abs(virtual).max())
        ax.set(ylabel=f"{('east', 'north', 'up')[axis]}, m", ylim=(-limit, limit))
    legend_above(axes[0])
    return figure


def virtual(study: Study, report: Report) -> None:
    """Pictures of the virtual controller, and how far its position goes at rest and in motion."""
    seed = study.seed_of("virtual", 0)
    found = {gesture: study.cached(f"virtual {gesture}", positions, gesture, seed) for gesture in ("pointing", "rest")}
    figure, half = controller_figure(seed)
    note = f"Boxes are {2.0 * half:.2g} m wide; the orange line points along y."
    report.figure("virtual-controller", figure, "Figure 5.24: true and virtual controller", note)
    title = "Figure 5.24: position of the virtual controller"
    report.figure("virtual-position", position_figure(found["pointing"]), title, "What is twice integrated leaves it.")
    sizes = {
        (gesture, name): float(np.linalg.norm(np.array(curves[name])[-1000:], axis=-1).max())
        for gesture, curves in found.items()
        for name in ("virtual", "undamped")
    }
    rows = [
        {
            "controller": gesture,
            "virtual, m": sizes[gesture, "virtual"],
            "twice integrated, m": sizes[gesture, "undamped"],
        }
        for gesture in found
    ]
    report.table("Virtual position: farthest in the last 10 s", rows, f"After {DURATION:g} s; errors *{SENSORS}*.")
    rest, drift = (sizes["rest", name] for name in ("virtual", "undamped"))
    report.claims(
        "Virtual controller: what holds",
        [
            Claim.less("At rest the twice integrated position drifts beyond 1 m", 1.0, sizes["rest", "undamped"], "m"),
            Claim.less("(5.66), (5.67) keep a controller at rest within 1 % of that", rest, drift, "m", factor=0.01),
            Claim.less("(5.66), (5.67) keep a moved controller within 1 m", sizes["pointing", "virtual"], 1.0, "m"),
        ],
    )
