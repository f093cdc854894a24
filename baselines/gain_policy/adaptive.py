"""Adaptive filter: a policy sets the gains of a Kalman filter while it runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...filters.adaptation.gains import tunable_filter
from ...filters.adaptation.tuned import TunedFilter, TunedState
from ...filters.core.estimator import Enclosing, check_measurements
from ...filters.core.kalman import KalmanFilter
from ...filters.core.quantity import Estimate, Measurement
from ...filters.core.sampling import FilterState
from .known_bias import SETTLING, bias_of, witness_of
from .policy import GainPolicy


class WatchedState(NamedTuple):
    """State of a filter with a policy and of the filters beside it; arrays only.

    Attributes:
        tuned: of the filter whose gains the policy sets.
        plain: of the same filter with the published gains.
        witness: of the filter that estimates the gyroscope bias.
        trusted: ``(*batch,)`` whether the estimates are those of the first, since the last decision.
    """

    tuned: TunedState
    plain: FilterState
    witness: FilterState
    trusted: np.ndarray


State = TunedState | WatchedState
"""Watched where the policy has a limit for the bias."""


@dataclass(frozen=True)
class AdaptiveEstimator(Enclosing):
    """A Kalman filter tuned by a policy: an :class:`~poise.filters.core.estimator.Estimator` on NumPy arrays.

    The policy decides once per interval from the samples so far; between decisions the gains are constant. With
    a neutral policy it is the filter itself, bit by bit. Where the gyroscope bias is larger than the policy knows, and
    in the seconds before it can be told, the estimates are those of the published gains. Both filters run side by side:
    a filter that takes over other gains errs until its covariance suits them, by tens of degrees while it is shaken.
    The state holds arrays only. At another sampling interval the time between decisions is kept.

    Attributes:
        filter: in its published tuning, a KalmanFilter (or the name of one).
        policy: sets the gains.

    Raises:
        ValueError: the policy sets gains that the filter does not have, or the filter reads no gyroscope and
            accelerometer.
    """

    filter: KalmanFilter
    policy: GainPolicy

    def __post_init__(self) -> None:
        if isinstance(self.filter, str):
            object.__setattr__(self, "filter", tunable_filter(self.filter))
        unknown = [part.gain for part in self.policy.ranges if part.gain not in self.filter.gains]
        if unknown:
            raise ValueError(f"the policy sets the gains {unknown}; the filter has {sorted(self.filter.gains)}")
        inputs = self.policy.layers[0][0].shape[-1]
        if inputs != self.tuned.observation_size:
            raise ValueError(f"the policy takes {inputs} features, there are {self.tuned.observation_size}")

    @classmethod
    def load(cls, path_or_name: str | Path, dt: float = 0.01) -> AdaptiveEstimator:
        """The published tuning of a policy's filter, tuned by that policy.

        Args:
            path_or_name: file or shipped name of the policy.
            dt: sampling interval, s.
        """
        policy = GainPolicy.load(path_or_name)
        return cls(replace(tunable_filter(policy.filter), keep_covariance=True).with_dt(dt), policy)

    def configured(self, metadata: Mapping[str, Any]) -> AdaptiveEstimator:
        """The same for the person, vehicle or device that a recording's metadata describe."""
        return replace(self, filter=replace(self.filter, model=self.filter.model.configured(metadata)))

    @cached_property
    def tuned(self) -> TunedFilter:
        """The filter with the actions and observations of the policy."""
        return TunedFilter(self.filter, self.policy.ranges, self.policy.features, self.policy.smoothing)

    @cached_property
    def witness(self) -> KalmanFilter | None:
        """The filter beside it that estimates the gyroscope bias; None where the policy has no limit."""
        return witness_of(self.filter) if math.isfinite(self.policy.bias_limit) else None

    def init(self, measurement: Measurement) -> State:
        """Initial state with the batch shape of ``measurement``."""
        state = self.tuned.init(measurement)
        if self.witness is None:
            return state
        untrusted = np.zeros(state.action.shape[:-1], dtype=bool)
        return WatchedState(state, state.filter, self.witness.init(measurement), untrusted)

    def step(self, state: State, measurement: Measurement) -> tuple[State, Estimate]:
        """Process one sample ``(*batch, size)`` of every channel, NaN where there is none.

        Raises:
            ValueError: see :func:`poise.filters.core.estimator.check_measurements`.
        """
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        samples = {name: np.asarray(array)[None] for name, array in arrays.items()}
        estimate, state = self._advance(state, samples)
        pose = {name: value[0] for name, value in estimate.pose.items()}
        return state, Estimate(pose, *(None if part is None else part[0] for part in estimate[1:4]))

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence ``(T, *batch, size)``; equal to stepping."""
        return self.run_from(None, measurements)[0]

    def run_from(self, state: State | None, measurements: Mapping[str, Any]) -> tuple[Estimate, State]:
        """As :meth:`run`, but from ``state`` (None: from the start), and also returns the last state."""
        estimate, state, _ = self.run_with_actions(state, measurements)
        return estimate, state

    def run_with_actions(
        self, state: State | None, measurements: Mapping[str, Any]
    ) -> tuple[Estimate, State, np.ndarray]:
        """As :meth:`run_from`, with the action ``(T, *batch, k)`` of the estimate of every sample."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        arrays = {name: np.asarray(array) for name, array in arrays.items()}
        length = len(next(iter(arrays.values())))
        if state is None:
            state = self.init({name: array[0] for name, array in arrays.items()})
        parts, actions, start = [], [], 0
        while start < length:
            taken = int(tuned_part(state).memory.samples)
            stop = min(length, start + self.tuned.interval_samples - taken)
            estimate, state = self._advance(state, {name: array[start:stop] for name, array in arrays.items()})
            parts.append(estimate)
            action = tuned_part(state).action
            if isinstance(state, WatchedState):
                action = np.where(state.trusted[..., None], action, 0.0)
            actions.append(np.broadcast_to(action, (stop - start, *action.shape)))
            start = stop
        return joined(parts), state, np.concatenate(actions)

    def _advance(self, state: State, samples: Mapping[str, np.ndarray]) -> tuple[Estimate, State]:
        tuned = tuned_part(state)
        decides = int(tuned.memory.samples) == 0
        time = tuned.memory.decisions * (self.tuned.interval_samples * self.dt)
        if decides:
            tuned = self.tuned.decide(tuned, self.policy(self.tuned.observe(tuned)))
        estimate, tuned = self.tuned.advance(tuned, samples)
        witness = self.witness
        if witness is None or not isinstance(state, WatchedState):
            return estimate, tuned
        trusted = state.trusted
        if decides:
            known = bias_of(witness, state.witness) <= self.policy.bias_limit
            trusted = np.broadcast_to(known & (time >= SETTLING), trusted.shape)
        published, plain = self.filter.run_from(state.plain, samples)
        seen = {channel.name: samples[channel.name] for channel in witness.channels}
        after = WatchedState(tuned, plain, witness.run_from(state.witness, seen)[1], trusted)
        return chosen(trusted, estimate, published), after


def chosen(first: np.ndarray, one: Estimate, other: Estimate) -> Estimate:
    """Of each sequence of the batch the estimates ``(T, *batch, …)`` of ``one`` or ``other``, as ``first`` says."""

    def choose(a: Any, b: Any) -> Any:
        if a is None:
            return None
        return np.where(np.reshape(first, first.shape + (1,) * (a.ndim - 1 - first.ndim)), a, b)

    pose = {name: choose(value, other.pose[name]) for name, value in one.pose.items()}
    return Estimate(pose, *(choose(a, b) for a, b in zip(one[1:4], other[1:4], strict=True)))


def tuned_part(state: State) -> TunedState:
    """The state of the filter and its features."""
    return state.tuned if isinstance(state, WatchedState) else state


def joined(parts: list[Estimate]) -> Estimate:
    """Estimates of consecutive samples as one, time first."""

    def join(pieces: list[Any]) -> Any:
        return None if pieces[0] is None else np.concatenate(pieces)

    pose = {name: join([part.pose[name] for part in parts]) for name in parts[0].pose}
    return Estimate(pose, *(join([part[index] for part in parts]) for index in (1, 2, 3)))


def shipped(weights: str, dt: float = 0.01, **parameters: Any) -> AdaptiveEstimator:
    """An estimator with a shipped policy.

    Args:
        weights: name of the policy.
        dt: sampling interval, s.
        parameters: constants of the filter that differ from the published tuning, by the model's field names. The
            policy was trained on the published ones.

    Raises:
        ValueError: an unknown or impossible parameter.
    """
    estimator = AdaptiveEstimator.load(weights, dt)
    if not parameters:
        return estimator
    model = estimator.filter.model
    known = {field.name for field in fields(model)}
    unknown = sorted(set(parameters) - known)
    if unknown:
        raise ValueError(f"unknown parameters {unknown}; {type(model).__name__} has {sorted(known)}")
    return replace(estimator, filter=replace(estimator.filter, model=replace(model, **parameters)))
