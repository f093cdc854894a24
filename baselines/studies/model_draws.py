"""Whether a filter's covariance is right where its model is exact: data whose residual at the truth is drawn.

An offset of the residual, a channel of its own, replaces measurement errors: at the true state the residual
then is white noise of the filter's own covariance, whatever the sensors of the recording read. What remains between
such a filter and a perfect one is linearisation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from ...filters.core.backend import Array
from ...filters.core.consistency import Consistency, consistency, nees
from ...filters.core.kalman import KalmanFilter
from ...filters.core.quantity import Channel, Measurement
from ...filters.core.sampling import empty_state, join
from .claims import Claim

OFFSET = "drawn/offset"


def with_offset(model: Any, rows: int) -> Any:
    """The same equations with the channel ``drawn/offset`` ``(rows,)``, which is added to the residual."""

    @dataclass(frozen=True)
    class Drawn(type(model)):  # type: ignore[misc]
        channels: ClassVar[tuple[Channel, ...]] = (*type(model).channels, Channel(OFFSET, rows, "any"))

        def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
            r, H, R = super().residual(x, z)
            return r + z[OFFSET], H, R

    return Drawn(**{item.name: getattr(model, item.name) for item in fields(model) if item.init})


def consistencies(
    model: Any,
    measurements: Mapping[str, np.ndarray],
    truth: np.ndarray,
    move: Callable[[int, np.ndarray, np.ndarray], np.ndarray],
    parts: Mapping[str, Any],
    rng: np.random.Generator,
    level: float = 0.95,
) -> dict[str, Consistency]:
    """NEES of parts of the error state at the end of runs, and NIS of all samples after the first.

    Args:
        model: of the filter; the error of its state is a difference of its first elements.
        measurements: channel → ``(T, runs, size)``, inputs of the runs.
        truth: ``(runs, e)`` true error-state elements at the start.
        move: from sample, what the model predicts of the true state ``(runs, n)`` and its process covariance
            ``(runs, e, e)`` to the true state.
        parts: name → elements of the error state.
        rng: draws measurement noise, and errors of the start.
        level: probability between the bounds of a consistent filter.
    """
    data = {channel.name: measurements[channel.name] for channel in model.channels}
    samples = [{name: values[k] for name, values in data.items()} for k in range(len(next(iter(data.values()))))]
    prior, P = model.prior(samples[0])
    runs, size = truth.shape
    P = np.broadcast_to(P, (runs, size, size)).copy()
    x, start = prior.copy(), prior.copy()
    x[:, :size] = truth
    offsets = []
    for k in range(1, len(samples)):
        predicted, _, Q = model.predict(x, samples[k], samples[k - 1])
        x = move(k, predicted, Q)
        r, _, R = model.residual(x, samples[k])
        offsets.append(np.sqrt(np.linalg.diagonal(R)) * rng.standard_normal(r.shape) - r)
    start[:, :size] = truth + np.sqrt(np.linalg.diagonal(P)) * rng.standard_normal((runs, size))
    drawn = with_offset(model, offsets[0].shape[-1])
    data[OFFSET] = np.stack([0.0 * offsets[0], *offsets])
    held = join({name: values[0] for name, values in data.items()}, drawn.channels)
    state = empty_state(drawn, held)._replace(x=start, covariance=P, held=held, started=np.ones(runs, dtype=bool))
    estimate, end = KalmanFilter(drawn, compiled=False).run_from(state, {name: v[1:] for name, v in data.items()})
    error, found = x[:, :size] - end.x[:, :size], {}
    for name, part in parts.items():
        e, covariance = error[:, part], end.covariance[:, part][:, :, part]
        found[name] = consistency(nees(e, covariance), e.shape[-1], level=level)
    return found | {"NIS": consistency(estimate.nis, offsets[0].shape[-1], level=level)}


def within_bounds(found: Mapping[str, Mapping[str, Any]]) -> list[Claim]:
    """Claims that the filter is consistent, from :func:`consistencies` as a study keeps them."""
    return [
        Claim.within(f"Where the model is exact, {name} is right", each["ratio"], each["lower"], each["upper"])
        for name, each in found.items()
    ]
