"""A Kalman filter whose gains a network sets while it runs: learned noise, and learned gains.

The network sees statistics of innovations and sensors (:mod:`..inputs.gain_features`) at fixed intervals. What it says
holds over the next interval, as bounded log factors on the filter's constants (:mod:`.gain_head`): the noises that Q
and R are made of, or shares of the Kalman gain (:mod:`.gain_shares`). The covariance is the filter's own.

A tuning that is right while errors are small is not right while a large one is corrected: where an input was missing
for longer than :data:`.gain_head.LONGEST_GAP`, the published gains hold until a second after it. On simulated gestures
(mixed, fast, slow) the NEES of ``mekf+noise`` 0.2 s after gaps of 2 s is 3 so, as that of ``mekf``, and 15 without; one
second does as much as ten.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import Estimate, Measurement, Quantity
from ....filters.core.sampling import FilterState, GapWatch
from ....filters.support.names import look_up
from ...weights_io import load_weights
from ..estimator import NETWORKS, NetworkParts
from ..inputs.gain_features import GainFeatures, ObservedState
from .gain_head import LONGEST_GAP, GainHead, recovering


class GainFilterState(NamedTuple):
    """Complete state of a :class:`GainFilter`.

    Attributes:
        filter: of the filter whose gains are set.
        front: of the front end.
        memory: ``(*batch, M)`` of the network.
        output: ``(*batch, gains)`` last output of the network.
        since: ``(*batch,)`` samples since an input was missing for too long; infinite if none ever was.
    """

    filter: FilterState
    front: ObservedState
    memory: np.ndarray
    output: np.ndarray
    since: np.ndarray


@dataclass(frozen=True, eq=False)
class GainFilter(NetworkParts):
    """A filter with gains of a network: an :class:`~poise.filters.core.estimator.Estimator` on NumPy arrays.

    A network that says zeros leaves the filter as it is, bit by bit.

    Attributes:
        network: the weights.
        front_end: what the network sees, and the filter in its published tuning.
        head: what its outputs mean.

    Raises:
        ValueError: front end, network and head do not fit together.
    """

    front_end: GainFeatures
    head: GainHead

    @classmethod
    def load(cls, path_or_name: str | Path, dt: float = 0.01) -> Self:
        """The estimator of a weights file or of shipped weights.

        Args:
            path_or_name: file, or name of shipped weights.
            dt: sampling interval, s.

        Raises:
            FileNotFoundError: there are no such weights.
            ValueError: they are damaged, or are those of something else.
        """
        arrays, card = load_weights(path_or_name)
        try:
            network = look_up("kind of network", card["network"], NETWORKS).from_arrays(arrays)
            front_end = GainFeatures.read(card["front_end"], dt)
            return cls(network, front_end, GainHead.read(card["head"], front_end.kalman))
        except (KeyError, TypeError) as reason:
            raise ValueError(f"{path_or_name}: the card does not describe gains of a filter ({reason})") from None

    @property
    def filter(self) -> KalmanFilter:
        """The filter whose gains are set, in its published tuning."""
        return replace(self.front_end.kalman, keep_covariance=True)

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Estimated quantities: those of the filter."""
        return self.front_end.kalman.outputs

    def init(self, measurement: Measurement) -> GainFilterState:
        """Initial state with the batch shape of ``measurement``, which is not processed."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        front = self.front_end.init(arrays)
        batch = front.memory.decisions.shape
        memory, output = (np.zeros((*batch, size)) for size in (self.network.memory_size, self.network.outputs))
        return GainFilterState(self.filter.init(arrays), front, memory, output, self._gaps.start(batch))

    def step(self, state: GainFilterState, measurement: Measurement) -> tuple[GainFilterState, Estimate]:
        """Process one sample of every channel, ``(*batch, size)``; NaN where there is none."""
        gains = self._unless(self._gaps.bears(state.since), state.output)
        inner, estimate = self.filter.step(state.filter, measurement, gains)
        front, seen = self.front_end.step(state.front, measurement)
        memory, output = state.memory, state.output
        if (np.asarray(seen.due) == 1.0).any():
            memory, output, _ = self._advance(seen.features[None], seen.due[None], memory, output)
        since = self._gaps.advance(state.since, inner.age)
        return GainFilterState(inner, front, memory, output, since), estimate

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, size)`` in and out; equal to stepping."""
        return self.run_with_gains(measurements)[0]

    def run_with_gains(self, measurements: Mapping[str, Any]) -> tuple[Estimate, dict[str, np.ndarray]]:
        """As :meth:`run`, with the log factors ``(T, *batch)`` at every sample."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        arrays = {name: np.asarray(array) for name, array in arrays.items()}
        seen = self.front_end.run(arrays)
        batch = seen.due.shape[1:]
        memory, output = (np.zeros((*batch, size)) for size in (self.network.memory_size, self.network.outputs))
        _, _, outputs = self._advance(seen.features, seen.due, memory, output)
        # what is said at the end of an interval holds from the next sample on
        bears = recovering(self.front_end.kalman.model, arrays)
        gains = self._unless(bears, np.concatenate([output[None], outputs[:-1]]))
        return self.filter.run(arrays, gains), gains

    def gains(self, output: np.ndarray) -> dict[str, np.ndarray]:
        """Log factors by gain of outputs ``(..., gains)``."""
        factors = self.head.factors(output)
        named = {name: factors[..., index] for index, name in enumerate(self.head.gains)}
        return self.front_end.kalman.model.limited(named)

    def _unless(self, bears: np.ndarray, output: np.ndarray) -> dict[str, np.ndarray]:
        """Log factors by gain: zeros, the published tuning, where the estimate bears a gap."""
        return {name: np.where(bears, 0.0, factor) for name, factor in self.gains(output).items()}

    @cached_property
    def _gaps(self) -> GapWatch:
        return GapWatch(self.front_end.kalman.model, LONGEST_GAP)


def shipped(weights: str, dt: float = 0.01) -> GainFilter:
    """The estimator with weights of the package, for samples ``dt`` seconds apart."""
    return GainFilter.load(weights, dt)
