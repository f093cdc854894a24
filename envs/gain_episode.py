"""An episode of gain tuning: the filter as configured for a trajectory, its samples, the truth, and the reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..filters.adaptation.tuned import TunedFilter
from ..filters.core.estimator import check_measurements
from ..filters.core.kalman import KalmanFilter
from ..filters.core.quantity import Quantity
from .data.trajectory import Trajectory
from .gain_reward import GainReward, errors_of, true_values

AHEAD = (1, 10, 40)
"""Decisions over which the privileged part of an observation looks ahead."""
PRIVILEGED = 2 + 2 * len(AHEAD)
"""Numbers of the privileged part: for the critic of a training only."""


@dataclass(frozen=True, eq=False)
class GainEpisode:
    """What an episode of gain tuning runs on.

    Attributes:
        trajectory: the motion and its measurements.
        kalman: the filter in its published tuning, at the trajectory's rate and for its rider, vehicle or device.
        samples: channel of the filter → ``(T, size)``, NaN where there is no possible sample.
        truth: ``(T, sizes)`` of the scored quantities, one after the other.
        reference: costs ``(T,)`` of the reference gains; zeros where nothing needs them.
        weight: factor on the rewards.
        decisions: whole intervals in the trajectory.
        interval_samples: samples of an interval.
    """

    trajectory: Trajectory
    kalman: KalmanFilter
    samples: dict[str, np.ndarray]
    truth: np.ndarray
    reference: np.ndarray
    weight: float
    decisions: int
    interval_samples: int

    @classmethod
    def of(
        cls,
        trajectory: Trajectory,
        tuned: TunedFilter,
        quantities: Sequence[Quantity],
        reward: GainReward,
        reference: np.ndarray | None,
    ) -> GainEpisode:
        """An episode over a trajectory.

        Args:
            trajectory: the motion and its measurements.
            tuned: the filter with the published constants of any device.
            quantities: what is scored.
            reward: how.
            reference: action of the reference gains; None where no reference is needed.

        Raises:
            ValueError: the trajectory lacks a channel of the filter, or the truth of a scored quantity.
        """
        check_channels(trajectory, tuned)
        kalman = filter_for(tuned.kalman, trajectory)
        samples = check_measurements(kalman.channels, trajectory.measurements, time_axis=True)
        truth = np.concatenate([true_values(trajectory, quantity, kalman) for quantity in quantities], axis=-1)
        costs, weight = np.zeros(len(trajectory)), 1.0
        if reference is not None:
            gains = {} if not reference.any() else replace(tuned, kalman=kalman).gains(reference)
            costs = reward.cost(errors_of(quantities, kalman.run(samples, gains).pose, truth))
            weight = reward.weight(costs, trajectory.mask)
        interval = tuned.features.interval_samples(trajectory.dt)
        return cls(trajectory, kalman, samples, truth, costs, weight, len(trajectory) // interval, interval)

    @cached_property
    def table(self) -> np.ndarray:
        """Samples of all channels, truth, mask and reference costs side by side ``(T, columns)``: one copy a step."""
        mask = self.trajectory.mask[:, None].astype(float)
        return np.concatenate([*self.samples.values(), self.truth, mask, self.reference[:, None]], axis=-1)

    @cached_property
    def known(self) -> tuple[tuple[tuple[str, int], ...], np.ndarray]:
        """Names and sizes of the trajectory's truth, and its values behind the time ``(T, 1 + sizes)``."""
        truth = self.trajectory.truth
        values = np.concatenate([self.trajectory.time[:, None], *truth.values()], axis=-1)
        return tuple((name, part.shape[1]) for name, part in truth.items()), values

    @cached_property
    def foresight(self) -> np.ndarray:
        """Privileged numbers at every decision ``(decisions + 1, PRIVILEGED - 1)``.

        The gyroscope's bias, and over each of :data:`AHEAD` the mean cost of the reference and the mean acceleration.
        """
        length, truth = self.decisions * self.interval_samples, self.trajectory.truth
        absent = np.zeros((length, 3))
        bias, force = (
            np.linalg.norm(truth.get(name, absent)[:length], axis=-1)
            for name in ("gyroscope_bias", "external_acceleration")
        )
        columns = [np.log1p(np.degrees(np.nan_to_num(bias[:: self.interval_samples])))]
        for values in (np.degrees(self.reference[:length]), force):
            means = np.nan_to_num(values).reshape(self.decisions, self.interval_samples).mean(axis=-1)
            columns += [np.log1p(mean_ahead(means, ahead)) for ahead in AHEAD]
        table = np.stack(columns, axis=-1)
        return np.concatenate([table, table[-1:]])

    def privileged(self, decision: int, last_error: float) -> np.ndarray:
        """The privileged part ``(PRIVILEGED,)`` of an observation; ``last_error`` in rad, NaN where it is not known."""
        own = 0.0 if math.isnan(last_error) else np.log1p(np.degrees(last_error))
        return np.append(self.foresight[decision], own).astype(np.float32)


def check_channels(trajectory: Trajectory, tuned: TunedFilter) -> None:
    """Refuse a trajectory without a channel of the filter.

    Raises:
        ValueError: names trajectory and channels.
    """
    names = [channel.name for channel in tuned.kalman.channels]
    if missing := [name for name in names if name not in trajectory.measurements]:
        raise ValueError(f"trajectory {trajectory.name!r} lacks the channels {missing} that {tuned.name} reads")


def check_scored(trajectory: Trajectory, tuned: TunedFilter, quantities: Sequence[Quantity]) -> None:
    """Refuse a trajectory on which a filter cannot be scored.

    Raises:
        ValueError: it lacks a channel of the filter or the truth of a quantity, a channel holds no sample, or no scored
            sample has a known truth.
    """
    check_channels(trajectory, tuned)
    name, kalman = trajectory.name, filter_for(tuned.kalman, trajectory)
    for channel in kalman.channels:
        if not np.isfinite(trajectory.measurements[channel.name]).all(axis=-1).any():
            raise ValueError(f"trajectory {name!r} has no sample of {channel.name!r}: all are NaN")
    for quantity in quantities:
        known = np.isfinite(true_values(trajectory, quantity, kalman)).all(axis=-1)
        if not (trajectory.mask & known).any():
            raise ValueError(f"trajectory {name!r} has no scored sample with a known {quantity.name!r}")


def scorable_starts(
    trajectory: Trajectory, tuned: TunedFilter, quantities: Sequence[Quantity], samples: int
) -> np.ndarray:
    """Samples at which an episode of ``samples`` samples can start: every channel is read in it, then something scored.

    What fills no interval at its end does not count.

    Raises:
        ValueError: there is no such sample.
    """
    interval, kalman = tuned.features.interval_samples(trajectory.dt), filter_for(tuned.kalman, trajectory)
    index = np.arange(len(trajectory))
    scored = trajectory.mask.copy()
    for quantity in quantities:
        scored &= np.isfinite(true_values(trajectory, quantity, kalman)).all(axis=-1)
    latest = np.maximum.accumulate(np.where(scored, index, -1))
    starts = index[: len(index) - samples + 1]
    there = np.ones(len(starts), dtype=bool)
    for channel in kalman.channels:
        read = np.isfinite(trajectory.measurements[channel.name]).all(axis=-1)
        first = np.minimum.accumulate(np.where(read, index, len(index))[::-1])[::-1]
        there &= first[starts] <= latest[starts + samples // interval * interval - 1]
    if not there.any():
        raise ValueError(
            f"no part of {trajectory.name!r} of {samples * trajectory.dt:g} s has a sample of every channel of "
            f"{tuned.name} and then a scored sample with a known truth"
        )
    return starts[there]


def filter_for(kalman: KalmanFilter, trajectory: Trajectory) -> KalmanFilter:
    """The filter at the rate of a trajectory, and for the rider, vehicle or device that its metadata describe."""
    kalman = kalman.with_dt(trajectory.dt)
    return replace(kalman, model=kalman.model.configured(trajectory.metadata))


def mean_ahead(values: np.ndarray, ahead: int) -> np.ndarray:
    """Mean of each entry of ``(n,)`` and those after it, ``ahead`` in all or as many as there are."""
    total = np.concatenate([np.zeros(1), np.cumsum(values)])
    first = np.arange(len(values))
    last = np.minimum(first + ahead, len(values))
    return (total[last] - total[first]) / (last - first)
