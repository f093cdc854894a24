"""What a policy learned: its gains where the motion is slow, fast, turning, pitching or shaking."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import GRAVITY
from ..adaptive import AdaptiveEstimator
from ..policy import GainPolicy

WINDOW = 1.0
"""s over which motion and gains are averaged."""
SHARES = 5
"""Parts of equal size that the windows are sorted into, by each number of the motion."""


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


def gains_by_motion(
    kalman: KalmanFilter, policy: GainPolicy, trajectories: Sequence[Trajectory]
) -> list[dict[str, Any]]:
    """Rows: for each gain and number of the motion, the factor on the variance where the number is small and large.

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
            numbers.setdefault(name, []).append(np.nanmean(values[: count * span].reshape(count, span), axis=1))
        for name, values in estimator.tuned.gains(actions).items():
            factors.setdefault(name, []).append(values[: count * span].reshape(count, span).mean(axis=1))
    rows = []
    for gain, logs in factors.items():
        log = np.concatenate(logs)
        for name, parts in numbers.items():
            number = np.concatenate(parts)
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
