"""What a network should beat: constants, a linear regression on moving averages of its inputs, re-tuned gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

SPANS = (1, 25, 125)
"""updates (0.04 s, 1 s, 5 s) of the moving averages, besides the mean of all so far"""


def moving_averages(features: np.ndarray) -> np.ndarray:
    """Causal means ``(N, 4 F)`` of features ``(N, F)`` over :data:`SPANS` and over all updates so far."""
    total = np.concatenate([np.zeros((1, features.shape[1])), np.cumsum(features, axis=0, dtype=float)])
    index = np.arange(1, len(total))
    starts = [np.maximum(index - span, 0) for span in SPANS] + [np.zeros_like(index)]
    return np.concatenate([(total[index] - total[start]) / (index - start)[:, None] for start in starts], axis=1)


@dataclass(frozen=True, eq=False)
class Ridge:
    """A linear regression with a penalty on its standardised coefficients.

    Attributes:
        mean: ``(P,)`` of the inputs.
        factor: ``(P,)`` 1 / standard deviation; 0 for an input that does not vary.
        weights: ``(P, K)``.
        offset: ``(K,)``.
    """

    mean: np.ndarray
    factor: np.ndarray
    weights: np.ndarray
    offset: np.ndarray

    @classmethod
    def fit(cls, inputs: np.ndarray, targets: np.ndarray, penalty: float) -> Self:
        """The regression of targets ``(N, K)`` on inputs ``(N, P)`` of all updates.

        The penalty counts in updates: so many with standardised inputs of 1 and no target.
        """
        if not penalty > 0.0:
            raise ValueError(f"penalty must be positive, got {penalty}")
        mean, deviation = inputs.mean(axis=0), inputs.std(axis=0)
        factor = np.where(deviation > 1e-9, 1.0 / np.maximum(deviation, 1e-9), 0.0)
        scaled, offset = (inputs - mean) * factor, targets.mean(axis=0)
        normal = scaled.T @ scaled + penalty * np.eye(len(mean))
        return cls(mean, factor, np.linalg.solve(normal, scaled.T @ (targets - offset)), offset)

    def predict(self, inputs: np.ndarray) -> np.ndarray:
        """Targets ``(N, K)``."""
        return (inputs - self.mean) * self.factor @ self.weights + self.offset
