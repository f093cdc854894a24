"""Gains that a policy has learned to set where the motion is slow, fast, turning, pitching or shaking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import GRAVITY
from ..adaptive import AdaptiveEstimator
from ..policy import GainPolicy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WINDOW = 1.0
"""s over which motion and gains are averaged."""
SHARES = 5
"""Parts of equal size that the windows are sorted into, by each number of the motion."""
BINS = 12
"""Likewise in the figure."""


def motion_numbers(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Name → a number ``(T,)`` of the motion: absolute rates, the excess of the specific force, the speed."""
    found: dict[str, np.ndarray] = {}
    site = "bicycle_imu" if "bicycle_imu/gyr" in trajectory.measurements else "imu"
    rate = np.degrees(np.abs(trajectory.measurements[f"{site}/gyr"]))
    if site == "bicycle_imu":
        found |= {f"{name} rate, °/s": rate[:, axis] for axis, name in enumerate(("roll", "pitch", "yaw"))}
    else:
        found["rate, °/s"] = np.sqrt((rate**2).sum(axis=-1))
    if f"{site}/acc" in trajectory.measurements:
        force = trajectory.measurements[f"{site}/acc"]
        found["| ‖f‖ − g |, m/s²"] = np.abs(np.sqrt((force**2).sum(axis=-1)) - GRAVITY)
    if "bicycle/speed" in trajectory.truth:
        found["speed, m/s"] = trajectory.truth["bicycle/speed"][:, 0]
    return found


def windows_of(
    kalman: KalmanFilter, policy: GainPolicy, trajectories: Sequence[Trajectory]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Means over windows of :data:`WINDOW`: name → numbers of the motion ``(n,)``, and gain → log factors ``(n,)``.

    Args:
        kalman: the filter.
        policy: sets its gains.
        trajectories: all with the same sensors.
    """
    numbers: dict[str, list[np.ndarray]] = {}
    factors: dict[str, list[np.ndarray]] = {}
    for trajectory in trajectories:
        estimator = AdaptiveEstimator(filter_for(kalman, trajectory), policy)
        _, _, actions = estimator.run_with_actions(None, trajectory.measurements)
        span = max(1, round(WINDOW / trajectory.dt))
        count = len(trajectory) // span
        for name, values in motion_numbers(trajectory).items():
            windows = values[: count * span].reshape(count, span)
            known = np.isfinite(windows)
            sums = np.where(known, windows, 0.0).sum(axis=1)
            means = np.divide(sums, known.sum(axis=1), out=np.full(count, np.nan), where=known.any(axis=1))
            numbers.setdefault(name, []).append(means)
        for name, values in estimator.tuned.gains(actions).items():
            factors.setdefault(name, []).append(values[: count * span].reshape(count, span).mean(axis=1))
    joined = [{name: np.concatenate(parts) for name, parts in each.items()} for each in (numbers, factors)]
    return joined[0], joined[1]


def gains_by_motion(
    kalman: KalmanFilter, policy: GainPolicy, trajectories: Sequence[Trajectory]
) -> list[dict[str, Any]]:
    """Rows: for each gain and number of the motion, the factor on the variance where the number is small and large.

    Arguments as of :func:`windows_of`.
    """
    numbers, factors = windows_of(kalman, policy, trajectories)
    rows = []
    for gain, log in factors.items():
        for name, number in numbers.items():
            known = np.isfinite(number)
            order = np.argsort(number[known], kind="stable")
            groups = np.array_split(order, SHARES)
            means = [float(np.exp(log[known][group].mean())) for group in groups]
            ranks = [np.argsort(np.argsort(values, kind="stable")) for values in (number[known], log[known])]
            rows.append(
                {
                    "gain": gain,
                    "motion": name,
                    "of the lowest fifth": float(number[known][groups[0]].mean()),
                    "factor there": means[0],
                    "in the middle": means[SHARES // 2],
                    "of the highest fifth": float(number[known][groups[-1]].mean()),
                    "factor here": means[-1],
                    "rank correlation": float(np.corrcoef(ranks[0], ranks[1])[0, 1]),
                }
            )
    return rows


def gains_figure(kalman: KalmanFilter, policy: GainPolicy, sets: Mapping[str, Sequence[Trajectory]]) -> Figure:
    """Factors on the variances over the numbers of the motion: medians and middle halves of the windows of each set.

    Args:
        kalman: the filter.
        policy: sets its gains.
        sets: name → trajectories with the same sensors.
    """
    from ...plots import legend_above, new_figure

    found = {group: windows_of(kalman, policy, trajectories) for group, trajectories in sets.items()}
    numbers, factors = next(iter(found.values()))
    figure, axes = new_figure(3.2 * len(numbers), 1.6 + 1.7 * len(factors), rows=len(factors), columns=len(numbers))
    panels = [(gain, name) for gain in factors for name in numbers]
    for ax, (gain, name) in zip(axes, panels, strict=True):
        for group, (moving, set_to) in found.items():
            number, log = moving[name], set_to[gain]
            order = np.argsort(np.where(np.isfinite(number), number, np.inf), kind="stable")
            known = int(np.count_nonzero(np.isfinite(number)))
            parts = np.array_split(order[:known], min(BINS, known))
            quartiles = np.exp([np.percentile(log[part], [25, 50, 75]) for part in parts])
            middle = [np.median(number[part]) for part in parts]
            (line,) = ax.plot(middle, quartiles[:, 1], label=group)
            ax.fill_between(middle, quartiles[:, 0], quartiles[:, 2], color=line.get_color(), alpha=0.2, lw=0.0)
        ax.set(xscale="log", yscale="log", ylabel=f"factor on {gain}")
        if gain == list(factors)[-1]:
            ax.set_xlabel(name)
    legend_above(axes[0])
    return figure
