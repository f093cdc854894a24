r"""Multiple-model adaptive estimation: a bank of one filter in several tunings, weighted by their likelihoods.

D. T. Magill, "Optimal adaptive estimation of sampled stochastic processes", IEEE Trans. Automatic Control 10(4), 1965.
With the innovation r_k and its covariance S_k of filter k, the probabilities of the tunings and the estimate are

    w_k ← w_k N(r_k; 0, S_k) / Σ_j w_j N(r_j; 0, S_j),    x̂ = Σ_k w_k x̂_k

Between two samples a tuning gives way to any other with the probability Δt / τ, as between the modes of a Markov chain
(H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm", IEEE Trans. Automatic Control 33(8), 1988),
so that no probability vanishes for good. Unlike there, the filters of the bank do not exchange their states.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..compile.differentiable import DifferentiableEquations
from ..core.estimator import Enclosing, check_measurements
from ..core.kalman import KalmanFilter
from ..core.model import structure_of
from ..core.quantity import Estimate, Measurement, Quantity
from ..core.sampling import FilterState
from .gains import gain_ranges

LEVELS = (-0.7, 0.0, 0.7)
"""Shares of the range of each gain that :func:`bank_of` combines."""

SECTION = 200_000
"""Samples of all filters together that are computed at a time, which bounds the memory."""

_EQUATIONS: dict[Any, DifferentiableEquations] = {}
"""Structure and gains → compiled filter, which serves banks of all riders, vehicles and devices."""


class BankState(NamedTuple):
    """State of a bank; arrays only.

    Attributes:
        filters: states of its K filters ``(*batch, K, …)``.
        weights: their probabilities ``(*batch, K)``.
    """

    filters: FilterState
    weights: np.ndarray


@dataclass(frozen=True)
class MultipleModel(Enclosing):
    """A bank of Kalman filters that differ in their gains: an :class:`~poise.filters.core.estimator.Estimator`.

    The monitor that restarts a lost filter is off, and the estimate has no covariance.

    Attributes:
        filter: the Kalman filter.
        gains: names of the gains in which the bank differs.
        factors: log factors of each filter of the bank, ``(K, gains)``.
        stay: s, mean time between changes of the true tuning.

    Raises:
        ValueError: an unknown gain, no filter, factors of another width, or a time that is not positive.
    """

    filter: KalmanFilter
    gains: tuple[str, ...]
    factors: tuple[tuple[float, ...], ...]
    stay: float = 10.0

    def __post_init__(self) -> None:
        unknown = sorted(set(self.gains) - set(self.filter.gains))
        if unknown:
            raise ValueError(f"gains must be among {sorted(self.filter.gains)}, got {unknown}")
        if not self.factors or any(len(each) != len(self.gains) for each in self.factors):
            raise ValueError(f"factors must hold rows of {len(self.gains)} log factors, got {self.factors!r}")
        if not 0.0 < self.stay < math.inf:
            raise ValueError(f"stay must be positive seconds, got {self.stay}")

    @cached_property
    def equations(self) -> DifferentiableEquations:
        """The compiled filter with log det S as an output."""
        key = (structure_of(self.filter.model), self.gains)
        if key not in _EQUATIONS:
            _EQUATIONS[key] = DifferentiableEquations(replace(self.filter, restart=False), self.gains)
        return _EQUATIONS[key].of_rows([self.filter.model])

    def configured(self, metadata: Mapping[str, Any]) -> MultipleModel:
        """The same for the person, vehicle or device that a recording's metadata describe."""
        return replace(self, filter=replace(self.filter, model=self.filter.model.configured(metadata)))

    def init(self, measurement: Measurement) -> BankState:
        """Initial state with the batch shape of ``measurement``; all tunings are equally likely."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        count = len(self.factors)
        wide = {name: np.stack([np.asarray(array)] * count, axis=-2) for name, array in arrays.items()}
        state = self.filter.init(wide)
        return BankState(state, np.full(tuple(state.started.shape), 1.0 / count))

    def step(self, state: BankState, measurement: Measurement) -> tuple[BankState, Estimate]:
        """Process one sample ``(*batch, size)`` of every channel."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        estimate, after = self.run_from(state, {name: np.asarray(array)[None] for name, array in arrays.items()})
        return after, Estimate({name: values[0] for name, values in estimate.pose.items()})

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence ``(T, *batch, size)``; equal to stepping."""
        return self.run_from(None, measurements)[0]

    def run_from(self, state: BankState | None, measurements: Mapping[str, Any]) -> tuple[Estimate, BankState]:
        """As :meth:`run`, but from ``state`` (None: from the start), and also returns the last state."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        first = {name: np.asarray(array)[0] for name, array in arrays.items()}
        state = self.init(first) if state is None else state
        length, parts = len(next(iter(arrays.values()))), []
        section = max(1, SECTION // state.weights.size)
        for start in range(0, length, section):
            some = {name: np.asarray(array)[start : start + section] for name, array in arrays.items()}
            pose, state = self._section(state, some)
            parts.append(pose)
        return Estimate({name: np.concatenate([part[name] for part in parts]) for name in parts[0]}), state

    def _section(self, state: BankState, samples: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], BankState]:
        """Poses of some samples ``(T, *batch, size)``, few enough for the records of all filters; the last state."""
        shape = tuple(state.weights.shape)
        length, rows = len(next(iter(samples.values()))), math.prod(shape)
        wide = {
            name: np.stack([array] * shape[-1], axis=-2).reshape(length, rows, -1) for name, array in samples.items()
        }
        flat = FilterState(*(np.asarray(part).reshape(rows, *part.shape[len(shape) :]) for part in state.filters))
        factors = np.broadcast_to(np.array(self.factors, float), (length, *shape, len(self.gains)))
        followed, after = self.equations.follow(flat, wide, factors.reshape(length, rows, -1))
        weights = self._weights(state.weights, -0.5 * (followed.nis + followed.logarithms).reshape(length, *shape))
        poses = followed.poses.reshape(length, *shape, -1)
        columns = self.equations.form.columns
        pose = {each.name: mixed(each, poses[..., columns[each.name]], weights) for each in self.outputs}
        return pose, BankState(FilterState(*(part.reshape(*shape, *part.shape[1:]) for part in after)), weights[-1])

    def _weights(self, before: np.ndarray, logarithms: np.ndarray) -> np.ndarray:
        """Probabilities after each sample ``(T, *batch, K)`` from the logarithms of the likelihoods."""
        change, count = -math.expm1(-self.dt / self.stay), before.shape[-1]
        likelihoods = np.exp(logarithms - logarithms.max(axis=-1, keepdims=True))
        weights, found = before, np.empty_like(likelihoods)
        for t, likelihood in enumerate(likelihoods):
            weights = ((1.0 - change) * weights + change / count) * likelihood
            weights = weights / weights.sum(axis=-1, keepdims=True)
            found[t] = weights
        return found


def bank_of(
    filter: KalmanFilter, gains: Sequence[str] | None = None, levels: Sequence[float] = LEVELS, stay: float = 10.0
) -> MultipleModel:
    """A bank of all combinations of some levels of the gains.

    Args:
        filter: in its published tuning.
        gains: names; None for the measurement and the process variance, as far as the filter has them.
        levels: shares of the range of each gain, in [−1, 1].
        stay: s, mean time between changes of the true tuning.

    Raises:
        ValueError: see :func:`.gain_ranges`.
    """
    chosen = [name for name in ("process", "measurement") if name in filter.gains] if gains is None else gains
    ranges = gain_ranges(filter, chosen)
    sides = [[level * (-part.lower if level < 0.0 else part.upper) for level in levels] for part in ranges]
    return MultipleModel(filter, tuple(part.gain for part in ranges), tuple(product(*sides)), stay)


def mixed(quantity: Quantity, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted mean ``(T, *batch, size)`` of the values ``(T, *batch, K, size)``, by the kind of the quantity."""
    weight = weights[..., None]
    if quantity.kind == "angle":
        best = np.take_along_axis(values, weights.argmax(axis=-1)[..., None, None], axis=-2)
        apart = np.mod(values - best + np.pi, 2.0 * np.pi) - np.pi
        return best[..., 0, :] + (weight * apart).sum(axis=-2)
    if quantity.kind == "rotation":
        best = np.take_along_axis(values, weights.argmax(axis=-1)[..., None, None], axis=-2)
        values = values * np.where((values * best).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    mean = (weight * values).sum(axis=-2)
    if quantity.kind in ("rotation", "direction"):
        mean = mean / np.sqrt((mean * mean).sum(axis=-1, keepdims=True))
    return mean
