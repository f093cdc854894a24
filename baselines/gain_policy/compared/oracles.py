"""Bounds that need the truth: gains that are best in each window of time, also when the sensors' errors are other ones.

A schedule of gains that is chosen with the truth fits the motion and the errors of that one recording. Most of what it
gains on them may be luck: only the part that remains on the same motion with another draw of the errors (the
cross-realisation oracle) could be learned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....envs.gain_reward import errors_of, scored_quantities, true_values
from ....filters.adaptation.tuned import TunedFilter
from ....filters.core.kalman import KalmanFilter
from ....filters.core.metrics import rms
from ....filters.core.sampling import FilterState

Quantities = str | Sequence[str] | None
"""Names of the outputs that are scored together; None for ``up``."""


def windowed_oracle(
    tuned: TunedFilter, trajectory: Trajectory, actions: np.ndarray, window: float = 1.0, quantity: Quantities = None
) -> np.ndarray:
    """The schedule ``(T, k)`` that takes in each window the action of least mean square error there, window by window.

    Args:
        tuned: the filter with its actions.
        trajectory: with a truth.
        actions: to choose from ``(n, k)``; the first is taken where no truth is known.
        window: s.
        quantity: what is scored.
    """
    kalman = filter_for(tuned.kalman, trajectory)
    outputs = scored_quantities(kalman, quantity)
    truth = np.concatenate([true_values(trajectory, output, kalman) for output in outputs], axis=-1)
    gains = replace(tuned, kalman=kalman).gains(actions)
    count, length, span = len(actions), len(trajectory), max(1, round(window / trajectory.dt))
    names = [channel.name for channel in kalman.channels]
    state, schedule = None, np.empty((length, actions.shape[1]))
    for start in range(0, length, span):
        part = slice(start, min(start + span, length))
        samples = {name: np.repeat(trajectory.measurements[name][part][:, None], count, axis=1) for name in names}
        now = {name: np.broadcast_to(values, (part.stop - start, count)) for name, values in gains.items()}
        estimate, after = kalman.run_from(state, samples, now)
        errors = errors_of(outputs, estimate.pose, np.repeat(truth[part][:, None], count, axis=1))
        known = np.isfinite(errors).all(axis=1)
        best = int(np.argmin((errors[known] ** 2).mean(axis=0))) if known.any() else 0
        schedule[part] = actions[best]
        state = FilterState(*(np.repeat(array[best : best + 1], count, axis=0) for array in after))
    return schedule


def schedule_error(
    tuned: TunedFilter, trajectory: Trajectory, schedule: np.ndarray, quantity: Quantities = None
) -> float:
    """Root mean square error, rad, of the actions ``(T, k)`` or ``(k,)`` on a trajectory."""
    kalman = filter_for(tuned.kalman, trajectory)
    estimate = kalman.run(trajectory.measurements, replace(tuned, kalman=kalman).gains(schedule))
    return pose_error(kalman, estimate.pose, trajectory, quantity)


def pose_error(
    kalman: KalmanFilter, pose: dict[str, np.ndarray], trajectory: Trajectory, quantity: Quantities = None
) -> float:
    """Root mean square error, rad, of a pose ``(T, …)`` over the evaluation mask."""
    outputs = scored_quantities(kalman, quantity)
    truth = np.concatenate([true_values(trajectory, output, kalman) for output in outputs], axis=-1)
    return float(rms(errors_of(outputs, pose, truth), trajectory.mask))
