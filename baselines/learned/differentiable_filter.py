"""A Kalman filter as a differentiable torch operation: networks are trained through it.

The filter runs compiled, sequence by sequence, and its derivatives come from a compiled backward pass
(:mod:`poise.filters.compile.differentiable`), some ten to hundred times faster than automatic differentiation of the
array form, to which they are equal to rounding.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from ...filters.compile.differentiable import DifferentiableEquations
from ...filters.core.kalman import KalmanFilter
from ...filters.core.model import Model
from ...filters.core.sampling import FilterState
from ...filters.support.optional import extra

with extra("learn"):
    import torch


class Filtered(NamedTuple):
    """Outputs over a stretch, torch float64.

    Attributes:
        pose: quantity → ``(T, B, size)``; NaN before the start.
        covariance: ``(T, B, e, e)`` of the error state.
        nis: ``(T, B)`` normalised innovation squared, 0 where nothing was measured.
        log_determinant: ``(T, B)`` log det S of the innovation's covariance, likewise.
        innovation: ``(T, B, m)`` whitened innovations; no derivatives pass through these.
    """

    pose: dict[str, torch.Tensor]
    covariance: torch.Tensor
    nis: torch.Tensor
    log_determinant: torch.Tensor
    innovation: torch.Tensor

    def innovation_loss(self) -> torch.Tensor:
        """Negative log likelihood of the innovations for each sequence ``(B,)``, up to a constant."""
        return 0.5 * (self.nis + self.log_determinant).sum(dim=0)


class DifferentiableFilter:
    """A Kalman filter whose gains at every sample may come from a network.

    Training runs in stretches: :meth:`init`, then :meth:`run` from state to state (detach the states between stretches
    for truncated back-propagation). The monitor that restarts a filter is off, and the prior passes no derivatives on.

    Args:
        kalman: the filter.
        gains: names of the gains, the last axis of log factors; None for all of the filter.

    Raises:
        TypeError: the model cannot be compiled.
        ValueError: a gain is unknown.
    """

    def __init__(self, kalman: KalmanFilter, gains: Sequence[str] | None = None) -> None:
        unknown = sorted(set(gains or ()) - set(kalman.gains))
        if unknown:
            raise ValueError(f"unknown gains {unknown}; {type(kalman.model).__name__} has {sorted(kalman.gains)}")
        self.kalman = replace(kalman, restart=False)
        self.gains = tuple(kalman.gains if gains is None else gains)
        self._equations = DifferentiableEquations(self.kalman, self.gains)

    def with_model(self, model: Model) -> Self:
        """The same equations with other constants: another sampling interval, rider or device; nothing is compiled."""
        other = copy.copy(self)
        other.kalman = replace(self.kalman, model=model)
        other._equations = self._equations.with_model(model)
        return other

    def init(self, measurement: Mapping[str, Any]) -> FilterState:
        """The state before samples of the batch shape ``(B,)`` of ``measurement`` (channel → ``(B, size)``)."""
        state = self.kalman.init({name: np.asarray(array, dtype=float) for name, array in measurement.items()})
        return state._replace(x=torch.from_numpy(state.x), covariance=torch.from_numpy(state.covariance))

    def run(
        self, state: FilterState, measurements: Mapping[str, Any], log_factors: torch.Tensor
    ) -> tuple[FilterState, Filtered]:
        """Filter a stretch.

        Args:
            state: of :meth:`init` or of the stretch before; derivatives pass through its ``x`` and ``covariance``.
            measurements: channel → ``(T, B, size)``, NaN where there is no sample.
            log_factors: ``(T, B, gains)`` on the gains, 0 for the published tuning.

        Raises:
            ValueError: a channel is missing, or ``log_factors`` has another shape.
        """
        arrays = {name: np.asarray(measurements[name], dtype=float) for name in self._names(measurements)}
        expected = (*next(iter(arrays.values())).shape[:2], len(self.gains))
        if tuple(log_factors.shape) != expected:
            raise ValueError(f"log_factors must have shape {expected} (T, B, gains), got {tuple(log_factors.shape)}")
        box: list[Any] = [self._equations, arrays, state]
        poses, covariance, nis, logarithm, x, P, whites = _Pass.apply(box, log_factors, state.x, state.covariance)
        pose = {name: poses[..., part] for name, part in self._equations.form.columns.items()}
        after = box[-1]._replace(x=x, covariance=P)
        return after, Filtered(pose, covariance, nis, logarithm, whites)

    def _names(self, measurements: Mapping[str, Any]) -> list[str]:
        names = [channel.name for channel in self.kalman.channels]
        missing = [name for name in names if name not in measurements]
        if missing:
            raise ValueError(f"measurements lack the channels {missing}; they hold {sorted(measurements)}")
        return names


class _Pass(torch.autograd.Function):
    """One stretch: compiled forward and backward passes."""

    @staticmethod
    def forward(ctx: Any, box: list[Any], factors: torch.Tensor, x: torch.Tensor, P: torch.Tensor) -> Any:
        equations, arrays, state = box
        numbers = factors.detach().numpy().astype(float)
        began = state._replace(x=x.detach().numpy().astype(float), covariance=P.detach().numpy().astype(float))
        followed, after = equations.follow(began, arrays, numbers)
        box.append(after)
        ctx.equations, ctx.followed, ctx.kinds = equations, followed, (factors.dtype, x.dtype, P.dtype)
        found = (followed.poses, followed.covariances, followed.nis, followed.logarithms, after.x, after.covariance)
        whites = torch.from_numpy(followed.whites)
        ctx.mark_non_differentiable(whites)
        return (*(torch.from_numpy(part) for part in found), whites)

    @staticmethod
    def backward(ctx: Any, *given: Any) -> Any:
        # What a filter says before its start is NaN and has no derivative.
        arrays = [np.where(np.isfinite(part), part, 0.0) for part in (part.numpy() for part in given[:6])]
        found = ctx.equations.back(ctx.followed, *arrays)
        return None, *(torch.from_numpy(part).to(kind) for part, kind in zip(found, ctx.kinds, strict=True))
