"""The Kalman recursion around a model: the only place of the project with a covariance in it.

Extended (error-state) Kalman filter in Joseph form. Whatever the model, four things hold here and nowhere else:

* a row of a measurement that is not finite (no sample, drop-out, out of range) corrects nothing;
* a missing sample of an input (a gyroscope, say) is replaced by the channel's last one;
* the filter starts by itself at the first tick at which the model's prior is finite; estimates before are NaN;
* gains, log factors on named constants, may change at every tick; all zeros is exactly the published tuning.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .backend import Array, constant, is_torch, namespace
from .estimator import check_measurements, run_by_steps
from .model import Gain, Model
from .quantity import Channel, Estimate, Measurement, Quantity
from .sampling import Gains, check_batch, check_gains, empty_memory, filled, hold, join, per_tick_gains, scaled, split


class FilterState(NamedTuple):
    """All memory of a filter; arrays only, so copying them is saving it.

    Attributes:
        x: ``(*batch, n)`` state; zeros before the start.
        covariance: ``(*batch, e, e)`` of the error state.
        held: ``(*batch, d)`` last finite sample of every channel element, NaN if there was none.
        started: ``(*batch,)`` bool.
    """

    x: Array
    covariance: Array
    held: Array
    started: Array


@dataclass(frozen=True)
class KalmanFilter:
    """A model's equations made an estimator.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data (needs numba; the array form serves without it).
        keep_covariance: give the covariance with every estimate of a sequence (off saves memory in long runs).
    """

    model: Model
    compiled: bool = True
    keep_covariance: bool = True

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.model.dt

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What it reads."""
        return self.model.channels

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """What it gives."""
        return self.model.outputs

    @property
    def gains(self) -> Mapping[str, Gain]:
        """Constants that may be scaled at every tick."""
        return self.model.gains

    def with_dt(self, dt: float) -> KalmanFilter:
        """The same filter for another sampling interval."""
        return replace(self, model=self.model.with_dt(dt))

    def init(self, measurement: Measurement) -> FilterState:
        """Empty memory with the batch shape and array kind of ``measurement`` (no sample is used up)."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        n, e = self.model.state_size, self.model.error_size
        return FilterState(*empty_memory(join(arrays, self.channels), (n,), (e, e)))

    def step(
        self, state: FilterState, measurement: Measurement, gains: Gains | None = None
    ) -> tuple[FilterState, Estimate]:
        """Take one sample of every channel, ``(*batch, size)``; NaN where there is none.

        Args:
            state: from :meth:`init` or the step before; it is not changed.
            measurement: the samples.
            gains: log factors for this tick.

        Raises:
            ValueError: a channel is missing or has a wrong shape, a gain is unknown, or the state belongs to another
                batch.
        """
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        check_batch(arrays, state.started)
        check_gains(self.gains, gains, type(self.model).__name__)
        if self.compiled and not is_torch(state.x):
            from ..compile.run import compiled_model

            form = compiled_model(self.model)
            if form is not None:
                return form.step(self.model, state, arrays, gains)
        return self._step_arrays(state, arrays, gains)

    def run(self, measurements: Mapping[str, Any], gains: Gains | None = None) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, size)`` in and out; equal to stepping.

        Args:
            measurements: channel → ``(T, *batch, size)``; NaN where there is no sample.
            gains: log factors, constant or per tick.
        """
        estimate, _ = self.run_from(None, measurements, gains)
        return estimate

    def run_from(
        self, state: FilterState | None, measurements: Mapping[str, Any], gains: Gains | None = None
    ) -> tuple[Estimate, FilterState]:
        """As :meth:`run`, but going on from ``state`` (None: from the start) and giving the last state too."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        check_gains(self.gains, gains, type(self.model).__name__)
        if state is None:
            state = self.init({name: array[0] for name, array in arrays.items()})
        check_batch({name: array[0] for name, array in arrays.items()}, state.started)
        if self.compiled and not is_torch(state.x):
            from ..compile.run import compiled_model

            form = compiled_model(self.model)
            if form is not None:
                return form.run(self.model, state, arrays, gains, self.keep_covariance)
        return self._run_arrays(state, arrays, gains)

    # ---- the array form: the reference, and the one that gradients flow through -------------------------------------

    def _run_arrays(
        self, state: FilterState, arrays: dict[str, Array], gains: Gains | None
    ) -> tuple[Estimate, FilterState]:
        length = next(iter(arrays.values())).shape[0]
        ticks = _Sequence(self, state, per_tick_gains(gains, length))
        estimate = run_by_steps(ticks, arrays)
        if not self.keep_covariance:
            estimate = estimate._replace(covariance=None)
        return estimate, ticks.last

    def _step_arrays(
        self, state: FilterState, arrays: Measurement, gains: Gains | None
    ) -> tuple[FilterState, Estimate]:
        model = scaled(self.model, gains, state.x)
        sample = join(arrays, self.channels)
        xp = namespace(sample, state.x)
        current, started, samples = hold(sample, state.held), state.started, split(sample, self.channels)
        whitened = xp.zeros_like(state.x[..., :1]) + constant([0.0] * model.residual_size, state.x)
        x, P = state.x, state.covariance
        if bool(xp.any(started)):
            now, before = (split(filled(part), self.channels) for part in (current, state.held))
            x1, F, Q = model.predict(x, now, before)
            P1 = F @ P @ F.mT + 0.5 * (Q + Q.mT)
            r, H, R = model.residual(x1, samples)
            dx, P1, whitened = correct(P1, r, H, R)
            x1 = model.finish(model.retract(x1, dx), samples)
            if bool(xp.all(started)):
                x, P = x1, P1
            else:
                x = xp.where(started[..., None], x1, x)
                P = xp.where(started[..., None, None], P1, P)
                whitened = xp.where(started[..., None], whitened, xp.zeros_like(whitened))
        if not bool(xp.all(started)):
            x0, P0 = model.prior(split(current, self.channels))
            P0 = P0 + xp.zeros_like(P)
            ready = xp.all(xp.isfinite(x0), axis=-1) & xp.all(xp.all(xp.isfinite(P0), axis=-1), axis=-1)
            new = ready & ~started
            x = xp.where(new[..., None], x0, x)
            P = xp.where(new[..., None, None], P0, P)
            started = started | ready
        pose = model.pose(x)
        covariance = P
        if not bool(xp.all(started)):
            pose = {name: xp.where(started[..., None], value, value + xp.nan) for name, value in pose.items()}
            covariance = xp.where(started[..., None, None], P, P + xp.nan)
        estimate = Estimate(pose, covariance, whitened, xp.sum(whitened * whitened, axis=-1))
        return FilterState(x, P, current, started), estimate


class _Sequence:
    """A filter that starts from a given state and takes its gains from a table, for :func:`run_by_steps`."""

    def __init__(self, kalman: KalmanFilter, start: FilterState, gains: dict[str, Any]) -> None:
        self.kalman, self.last, self.gains, self.tick = kalman, start, gains, 0
        self.dt, self.channels, self.outputs = kalman.dt, kalman.channels, kalman.outputs

    def with_dt(self, dt: float) -> _Sequence:
        return _Sequence(self.kalman.with_dt(dt), self.last, self.gains)

    def init(self, measurement: Measurement) -> FilterState:
        return self.last

    def step(self, state: FilterState, measurement: Measurement) -> tuple[FilterState, Estimate]:
        gains = {name: factors[self.tick] for name, factors in self.gains.items()}
        self.last, estimate = self.kalman._step_arrays(state, measurement, gains)
        self.tick += 1
        return self.last, estimate


def correct(P: Array, r: Array, H: Array, R: Array) -> tuple[Array, Array, Array]:
    """Condition on one measurement; rows with anything not finite are left out.

        S = H P Hᵀ + R,   K = P Hᵀ S⁻¹,   P⁺ = (I − K H) P (I − K H)ᵀ + K R Kᵀ,   dx = K r

    Args:
        P: ``(..., e, e)`` covariance before.
        r: ``(..., m)`` measured minus expected.
        H: ``(..., m, e)`` Jacobian of the expectation with respect to the error state.
        R: ``(..., m, m)`` measurement covariance.

    Returns:
        ``dx`` ``(..., e)``, ``P⁺``, and the whitened innovation ``L⁻¹ r`` ``(..., m)`` with ``S = L Lᵀ``.
    """
    xp = namespace(P, r)
    usable = xp.isfinite(r) & xp.all(xp.isfinite(H), axis=-1) & xp.isfinite(xp.linalg.diagonal(R))
    unit = constant(np.eye(r.shape[-1]), P)
    r = xp.where(usable, r, xp.zeros_like(r))
    H = xp.where(usable[..., None], H, xp.zeros_like(H))
    R = xp.where(usable[..., None] & usable[..., None, :], 0.5 * (R + R.mT), unit + 0.0 * P[..., :1, :1])
    S = H @ P @ H.mT + R
    L = xp.linalg.cholesky(S)
    K = xp.linalg.solve(S, H @ P).mT
    A = constant(np.eye(P.shape[-1]), P) - K @ H
    joseph = A @ P @ A.mT + K @ R @ K.mT
    whitened = xp.linalg.solve(L, r[..., None])[..., 0]
    return (K @ r[..., None])[..., 0], 0.5 * (joseph + joseph.mT), whitened


__all__ = ["FilterState", "Gain", "Gains", "KalmanFilter", "Model", "correct", "scaled"]
