"""Trajectories of one rate as arrays, so that a filter runs over all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.gain_episode import filter_for
from ...envs.gain_reward import scored_quantity, true_values
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.metrics import error
from ...filters.core.model import parameters_of, structure_of
from ...filters.core.quantity import Quantity


@dataclass(frozen=True, eq=False)
class TrajectoryStack:
    """N trajectories of one rate, cut to the D whole decisions of the shortest.

    Attributes:
        tuned: the filter at that rate.
        trajectories: the N trajectories.
        quantity: output of the filter that is scored.
        channels: of the filter, channel → ``(T, N, size)``.
        truth: true values of ``quantity`` ``(T, N, size)``.
        mask: evaluation mask ``(T, N)``.
        decisions: D; T is D times the samples between decisions.
    """

    tuned: TunedFilter
    trajectories: tuple[Trajectory, ...]
    quantity: Quantity
    channels: dict[str, np.ndarray]
    truth: np.ndarray
    mask: np.ndarray
    decisions: int

    @classmethod
    def of(cls, tuned: TunedFilter, trajectories: Sequence[Trajectory], quantity: str | None = None) -> Self:
        """Stack trajectories of one rate and of one rider, vehicle or device; ``quantity`` None scores ``up``."""
        tuned = replace(tuned, kalman=filter_for(tuned.kalman, trajectories[0]))
        output = scored_quantity(tuned.kalman, quantity)
        decisions = min(len(trajectory) for trajectory in trajectories) // tuned.interval_samples
        length = decisions * tuned.interval_samples
        channels = {
            channel.name: np.stack([trajectory.measurements[channel.name][:length] for trajectory in trajectories], 1)
            for channel in tuned.kalman.channels
        }
        truth = np.stack([true_values(one, output, tuned.kalman)[:length] for one in trajectories], 1)
        mask = np.stack([trajectory.mask[:length] for trajectory in trajectories], 1)
        return cls(tuned, tuple(trajectories), output, channels, truth, mask, decisions)

    @classmethod
    def by_rate(cls, tuned: TunedFilter, trajectories: Sequence[Trajectory], quantity: str | None = None) -> list[Self]:
        """One stack for each rate and filter among the trajectories, in the order of their first appearance."""
        parts: dict[Any, list[Trajectory]] = {}
        for trajectory in trajectories:
            model = filter_for(tuned.kalman, trajectory).model.with_dt(1.0)
            key = (round(1e6 * trajectory.dt), structure_of(model), tuple(parameters_of(model).values()))
            parts.setdefault(key, []).append(trajectory)
        return [cls.of(tuned, part, quantity) for part in parts.values()]

    def errors(self, action: np.ndarray) -> np.ndarray:
        """Error of constant gains at every sample ``(T, N)``, rad."""
        pose = self.tuned.kalman.run(self.channels, self.tuned.gains(action)).pose[self.quantity.name]
        return error(self.quantity, pose, self.truth)
