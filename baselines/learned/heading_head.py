"""Head of a network that weighs the headings which several tunings of a filter find."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.core import rotation
from ...filters.core.backend import Array, namespace
from ...filters.core.metrics import length
from ...filters.core.quantity import ORIENTATION, UP, Estimate, Quantity
from ...filters.imu.magnetic_heading import heading_between, turn_heading
from .head import of_sequences
from .inputs.front_end import Seen
from .mixture_head import MixtureHead


@dataclass(frozen=True)
class HeadingHead(MixtureHead):
    """The orientation of a filter, its heading a weighted mean of the filter's and of its candidates'.

    The network says logarithms of K + 1 weights as for a :class:`.mixture_head.MixtureHead`; the inclination remains
    the filter's (:class:`.heading_bank.HeadingBank`).

    Attributes:
        largest: rad by which a candidate may differ, smoothly bounded: one that is lost does no harm.
    """

    preference: float = 1.0
    least: float = 0.01
    largest: float = 0.2

    kind: ClassVar[str] = "heading"
    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP)

    def turn(self, output: Array, spread: Array) -> Array:
        """What is added to the filter's heading ``(..., 1)``, rad."""
        xp = namespace(output)
        bounded = self.largest * xp.tanh(spread[..., 1:] / self.largest)
        return xp.sum(self.weights(output)[..., 1:] * bounded, axis=-1, keepdims=True)

    def estimate(self, seen: Seen, output: Array) -> Estimate:
        """See :class:`.head.Head`."""
        orientation = turn_heading(seen.base["relative_orientation"], self.turn(output, seen.spread))
        return Estimate({ORIENTATION.name: orientation, UP.name: rotation.up_in_body(orientation)})

    def target(self, seen: Seen, trajectory: Trajectory) -> np.ndarray:
        """See :class:`.head.Head`: the true heading less that of the filter, rad."""
        return np.asarray(heading_between(trajectory.truth_of(ORIENTATION.name), seen.base["relative_orientation"]))

    def loss(self, output: Any, target: Any, spread: Any, mask: Any) -> Any:
        """Mean over sequences of the logarithm of the ratio of root mean square errors, to the published filter's.

        Most of an error of the heading is constant and common to all candidates; its size must not decide.
        """
        xp = namespace(output)
        error = of_sequences(length(rotation.wrap(self.turn(output, spread) - target)), mask)
        published = of_sequences(length(target), mask)
        return xp.log((error + self.least) / (published + self.least)).mean()

    def errors(self, output: Array, target: Array, spread: Array) -> Array:
        """See :class:`.head.Head`."""
        return namespace(output).abs(rotation.wrap(self.turn(output, spread) - target))
