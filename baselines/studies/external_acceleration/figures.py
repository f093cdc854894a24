"""Figures 2 to 7 of the external-acceleration paper, drawn of one simulated trial of each test."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ....filters.core import rotation
from ....filters.core.estimator import run
from ....filters.core.metrics import DEGREES
from ....filters.imu.external_acceleration import ExternalAcceleration
from ...plots import AMBER, BLUE, TRUTH_COLOR, legend_above, new_figure, time_figure
from ...registry import make_estimator
from .simulation import MODES, RATE, Trial, estimate, reference, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS, TRUE, BAND = BLUE, TRUTH_COLOR, AMBER
GRAVITY = ExternalAcceleration().gravity


def published(mode: Any = 1, **parameters: Any) -> ExternalAcceleration:
    """The filter as published."""
    return ExternalAcceleration(mode=mode, exact_rotation=False, **parameters)


def angles(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Roll and pitch of the first trial, deg; roll without jumps."""
    roll, pitch = rotation.roll_pitch(up[:, 0])
    return np.unwrap(roll) * DEGREES, pitch * DEGREES


def seconds(trial: Trial) -> np.ndarray:
    """Time of the samples, s."""
    return np.arange(len(trial.up)) / RATE


def beside(ax: Any, time: np.ndarray, ours: np.ndarray, true: np.ndarray, label: str) -> None:
    """An estimate or its error (solid, above) and the reference (dashed)."""
    ax.plot(time, true, color=TRUE, linewidth=1.1, linestyle="--", label="reference")
    ax.plot(time, ours, color=OURS, linewidth=0.8, label="estimate")
    ax.set_ylabel(label, fontsize=8.5)


def wrapped(off: np.ndarray) -> np.ndarray:
    """Angles, deg, within half a turn."""
    return rotation.wrap(off / DEGREES) * DEGREES


def figure_2(seed: int) -> Figure:
    """Test A: errors of modes 1 and 2, and the reference angles."""
    trial = simulate("A", [seed])
    figure, axes = new_figure(8.5, 5.5, 4)
    true = angles(trial.up)
    for index, mode in enumerate((1, 2)):
        found = angles(estimate(trial, published(mode))["up"])
        for which, name in enumerate(("roll", "pitch")):
            ax = axes[2 * index + which]
            ax.plot(seconds(trial), wrapped(found[which] - true[which]), color=OURS, linewidth=0.9)
            ax.plot(seconds(trial), true[which], color=TRUE, linewidth=0.9, linestyle="--")
            ax.set_ylabel(f"mode {mode}\n{name}, deg", fontsize=8.5)
    axes[-1].set_xlabel("time, s (solid: error, dashed: reference)")
    return figure


def figure_3(seed: int) -> Figure:
    """Test B: sizes of external acceleration and of the accelerometer's signal."""
    trial = simulate("B", [seed])
    figure, (upper, lower) = time_figure(8.5, 4.0, 2)
    upper.plot(seconds(trial), np.linalg.norm(trial.acceleration[:, 0], axis=-1), color=OURS, linewidth=0.9)
    upper.set_ylabel("‖a‖, m/s²")
    lower.plot(seconds(trial), np.linalg.norm(trial.measurements["imu/acc"][:, 0], axis=-1), color=OURS, linewidth=0.9)
    lower.axhline(GRAVITY, color=BAND, linewidth=0.8)
    for side in (-1.0, 1.0):
        lower.axhline(GRAVITY + side * ExternalAcceleration().threshold, color=BAND, linewidth=0.8, linestyle="--")
    lower.set_ylabel("‖y_A‖, m/s²")
    return figure


def figure_4(seed: int) -> Figure:
    """Test B: roll, pitch and external acceleration of the three modes."""
    trial = simulate("B", [seed])
    figure, axes = time_figure(11.0, 7.5, 5, 3)
    true, time = angles(trial.up), seconds(trial)
    for column, mode in enumerate(MODES):
        pose = estimate(trial, published(mode))
        for row, (ours, expected) in enumerate(zip(angles(pose["up"]), true, strict=True)):
            beside(axes[3 * row + column], time, ours, expected, f"{('roll', 'pitch')[row]}, deg")
        for axis in range(3):
            ours, true_a = pose["external_acceleration"][:, 0, axis], reference(trial)[:, 0, axis]
            beside(axes[3 * (2 + axis) + column], time, ours, true_a, f"a_{'xyz'[axis]}, m/s²")
        axes[column].set_title(f"mode {mode}", fontsize=10, loc="left")
        legend_above(axes[column])
    return figure


def figure_5(seed: int) -> Figure:
    """Test C: size of the external acceleration, and of its error in the three modes."""
    trial = simulate("C", [seed])
    figure, axes = time_figure(8.5, 6.0, 4)
    axes[0].plot(seconds(trial), np.linalg.norm(trial.acceleration[:, 0], axis=-1), color=TRUE, linewidth=0.8)
    axes[0].set_ylabel("‖a‖, m/s²")
    for ax, mode in zip(axes[1:], MODES, strict=True):
        off = estimate(trial, published(mode))["external_acceleration"][:, 0] - reference(trial)[:, 0]
        ax.plot(seconds(trial), np.linalg.norm(off, axis=-1), color=OURS, linewidth=0.8)
        ax.set_ylabel(f"error, mode {mode}\nm/s²", fontsize=8.5)
    return figure


def truth_figure(seed: int) -> Figure:
    """Tests B and C: size of the external acceleration, true and estimated by modes 1 and 3, and the errors."""
    figure, axes = time_figure(10.0, 5.5, 3, 2)
    for column, test in enumerate("BC"):
        trial = simulate(test, [seed])
        true, time = trial.acceleration[:, 0], seconds(trial)
        for row, mode in enumerate((1, 3)):
            ax = axes[2 * row + column]
            found = estimate(trial, published(mode))["external_acceleration"][:, 0]
            label = f"‖a‖, mode {mode}, m/s²"
            beside(ax, time, np.linalg.norm(found, axis=-1), np.linalg.norm(true, axis=-1), label)
            color = OURS if mode == 1 else BAND
            axes[4 + column].plot(time, np.linalg.norm(found - true, axis=-1), color=color, linewidth=0.8)
        axes[column].set_title(f"test {test}", fontsize=10, loc="left")
        legend_above(axes[column])
        axes[4 + column].set(ylabel="‖error‖, m/s²")
    return figure


def figure_6(seed: int) -> Figure:
    """Test C, mode 1: errors of attitude and external acceleration with the references."""
    trial = simulate("C", [seed])
    figure, axes = new_figure(8.5, 8.0, 6)
    time, pose = seconds(trial), estimate(trial, published(1))
    axes[0].plot(time, np.linalg.norm(trial.acceleration[:, 0], axis=-1), color=TRUE, linewidth=0.8)
    axes[0].set_ylabel("‖a‖, m/s²", fontsize=8.5)
    for ax, ours, true, name in zip(
        axes[1:3], angles(pose["up"]), angles(trial.up), ("roll, deg", "pitch, deg"), strict=True
    ):
        beside(ax, time, wrapped(ours - true), wrapped(true), name)
    for axis, ax in enumerate(axes[3:]):
        true = reference(trial)[:, 0, axis]
        beside(ax, time, pose["external_acceleration"][:, 0, axis] - true, true, f"a_{'xyz'[axis]}, m/s²")
    axes[-1].set_xlabel("time, s (solid: error, dashed: reference)")
    return figure


def figure_7(seed: int) -> Figure:
    """Roll of tests A and B: gyroscope alone or mode 2, c_a = 0.001, c_a = 1."""
    figure, axes = time_figure(10.0, 5.5, 3, 2)
    a, b = simulate("A", [seed]), simulate("B", [seed])
    alone = run(make_estimator("gyroscope-integration", dt=1.0 / RATE), a.measurements).pose["up"]
    columns = (
        (a, (("gyroscope alone", alone), *swept(a))),
        (b, (("mode 2", estimate(b, published(2))["up"]), *swept(b))),
    )
    for column, (trial, curves) in enumerate(columns):
        for row, (name, up) in enumerate(curves):
            ax = axes[2 * row + column]
            beside(ax, seconds(trial), angles(up)[0], angles(trial.up)[0], f"{name}\nroll, deg")
        axes[column].set_title(f"test {'AB'[column]}", fontsize=10, loc="left")
        legend_above(axes[column])
    return figure


def swept(trial: Trial) -> tuple[tuple[str, np.ndarray], ...]:
    """Verticals of mode 1 with the smallest and the largest c_a of table II."""
    return tuple((f"c_a = {c_a:g}", estimate(trial, published(1, c_a=c_a))["up"]) for c_a in (0.001, 1.0))


FIGURES: dict[str, tuple[str, str, Callable[[int], Figure]]] = {
    "fig-2": ("Figure 2: test A, errors of modes 1 and 2", "Of one trial, like all figures here.", figure_2),
    "fig-3": (
        "Figure 3: test B, external acceleration and accelerometer",
        "Dashed: the threshold of mode 3.",
        figure_3,
    ),
    "fig-4": ("Figure 4: test B, the three modes", "Solid: estimate, dashed: reference.", figure_4),
    "fig-5": ("Figure 5: test C, errors of the external acceleration", "", figure_5),
    "truth": (
        "External acceleration and truth over time",
        "Solid: estimate, dashed: the true acceleration of the motion; below: errors of mode 1 (blue) and 3.",
        truth_figure,
    ),
    "fig-6": ("Figure 6: test C, errors of mode 1", "Solid: error, dashed: reference.", figure_6),
    "fig-7": ("Figure 7: roll of tests A and B against c_a", "Solid: estimate, dashed: reference.", figure_7),
}
"""Name → title, note, and what draws it from a seed."""
