"""Head of a network that weighs the inclinations which several tunings of a filter find."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ...filters.core.backend import Array, constant, namespace
from ...filters.core.metrics import direction_error
from .head import InclinationHead, of_sequences


@dataclass(frozen=True)
class MixtureHead(InclinationHead):
    """The inclination: a weighted mean of the filter's and of its candidates'.

    The network says logarithms of K + 1 weights, that of the published filter first. The weights are positive and have
    the sum of one, so the estimate lies between those of the filters, and turns with the heading of the frame, whatever
    the network says (:class:`.filter_bank.FilterBank`).

    Attributes:
        candidates: K.
        preference: of the logarithm of the published filter's weight where the network says nothing.
        least: rad, added to the error of the published filter, in units of which errors are counted in training.
    """

    candidates: int
    preference: float = 3.0
    least: float = 0.003

    kind: ClassVar[str] = "mixture"

    def __post_init__(self) -> None:
        if self.candidates < 1:
            raise ValueError(f"candidates must be at least 1, got {self.candidates}")

    @property
    def size(self) -> int:
        """Numbers that the network gives."""
        return self.candidates + 1

    def describe(self) -> dict[str, Any]:
        """See :class:`.head.Head`."""
        return {"kind": self.kind, **asdict(self)}

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`describe`."""
        return cls(**{name: value for name, value in described.items() if name != "kind"})

    def up(self, output: Array, spread: Array) -> Array:
        """The up vector ``(..., 3)``, of any length, in the level frame."""
        xp, count = namespace(output), self.candidates
        # Σ w c over the candidates c; the published filter's own tilt in its level frame is zero
        tilts = xp.reshape(spread[..., 1:], (*tuple(spread.shape[:-1]), count, 2))
        return _vector(xp.sum(self.weights(output)[..., 1:, None] * tilts, axis=-2))

    def weights(self, output: Array) -> Array:
        """Of the published filter and its candidates ``(..., K + 1)``, with the sum of one."""
        xp = namespace(output)
        logits = output + constant([self.preference, *[0.0] * self.candidates], output)
        weights = xp.exp(logits - xp.max(logits, axis=-1, keepdims=True))
        return weights / xp.sum(weights, axis=-1, keepdims=True)

    def loss(self, output: Any, target: Any, spread: Any, mask: Any) -> Any:
        """Mean over sequences of the ratio of root mean square errors, this one's to the published filter's.

        A ratio weighs quiet and violent motions alike, which differ tenfold in their errors.
        """
        error = of_sequences(direction_error(self.up(output, spread), target), mask)
        published = of_sequences(direction_error(_vector(0.0 * target[..., :2]), target), mask)
        return (error / (published + self.least)).mean()

    def augmented(
        self, features: np.ndarray, target: np.ndarray, generator: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """As they are: nothing depends on the heading."""
        return features, target


def _vector(tilt: Array) -> Array:
    """The vector ``(..., 3)`` of unit height over a horizontal one ``(..., 2)``."""
    xp = namespace(tilt)
    return xp.concat([tilt, xp.ones_like(tilt[..., :1])], axis=-1)
