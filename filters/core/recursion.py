"""Recursion over samples for Kalman filters and observers, identical in the array form and the compiled form.

Seven rules hold for all equations:

* where a row of a measurement is not finite (no sample, drop-out, out of range), its update is skipped;
* a missing sample of an input (a gyroscope, say) is replaced by the channel's last one;
* an estimator initialises itself at the first sample with a finite prior; earlier estimates are NaN;
* gains, log factors on named constants, may change at every sample; all zeros is exactly the published tuning;
* the noise of an input grows with the age of its last sample (:mod:`.held_inputs`);
* while the tilt is too uncertain for a linear measurement, the direction of the force stands in for it (likewise);
* an estimate that contradicts the sensors for too long starts anew, and a force that no motion explains is no sample
  (:mod:`.monitor`); so does one of a rider that had no input for too long.

NumPy data are processed in the compiled form (:mod:`poise.filters.compile.run`). The array form below defines the
result, is differentiable, and runs equations that cannot be traced.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, cast

import numpy as np

from ..compile.run import compiled_equations
from .backend import Array, constant, is_torch, namespace
from .estimator import check_measurements, stack_estimates
from .held_inputs import (
    UNCERTAIN_TILT,
    coarse_rows,
    grown_parameters,
    heading_kept,
    longest_gap,
    rotation_part,
    tilt_variance,
    without_field,
)
from .matrices import times
from .model import Gain, Model, Recurrence, with_parameters
from .monitor import LOST, inputs_of, places_of, realigned, watch, without_impacts
from .quantity import ACCELEROMETER, GYROSCOPE, Channel, Estimate, Measurement, Quantity
from .sampling import (
    FilterState,
    Gains,
    aged,
    check_batch,
    check_gains,
    empty_state,
    filled,
    gains_over_time,
    hold,
    join,
    scaled,
    split,
)


@dataclass(frozen=True)
class Recursion:
    """Common base class of :class:`.KalmanFilter` and :class:`.Observer`.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data.
        restart: start anew when the estimate contradicts the sensors for too long; off for the equations alone.
    """

    model: Model | Recurrence
    compiled: bool = True
    restart: bool = True

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.model.dt

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Required channels."""
        return self.model.channels

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Estimated quantities."""
        return self.model.outputs

    @property
    def gains(self) -> Mapping[str, Gain]:
        """Constants that may be scaled at every sample."""
        return self.model.gains

    @property
    def _keeps_covariance(self) -> bool:
        return False

    def with_dt(self, dt: float) -> Self:
        """The same for another sampling interval."""
        return replace(self, model=self.model.with_dt(dt))

    def init(self, measurement: Measurement) -> FilterState:
        """Initial state with the batch shape and array type of ``measurement``, which is not processed."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        return empty_state(self.model, join(arrays, self.channels))

    def step(
        self, state: FilterState, measurement: Measurement, gains: Gains | None = None
    ) -> tuple[FilterState, Estimate]:
        """Process one sample of every channel, ``(*batch, size)``; NaN where there is none.

        Args:
            state: from :meth:`init` or the step before; it is not changed.
            measurement: the samples.
            gains: log factors for this sample.

        Raises:
            ValueError: a channel is missing or has a wrong shape, a gain is unknown, or the state belongs to another
                batch.
        """
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        check_batch(arrays, state.started)
        check_gains(self.gains, gains, type(self.model).__name__)
        if self.compiled and not is_torch(state.x):
            form = compiled_equations(self.model)
            return (
                form.step(self.model, state, arrays, gains, self.restart)
                if form
                else self._step_each(state, arrays, gains)
            )
        return self._step_arrays(state, arrays, gains)

    def run(self, measurements: Mapping[str, Any], gains: Gains | None = None) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, size)`` in and out; equal to stepping.

        Args:
            measurements: channel → ``(T, *batch, size)``; NaN where there is no sample.
            gains: log factors, constant or per sample.
        """
        estimate, _ = self.run_from(None, measurements, gains)
        return estimate

    def run_from(
        self, state: FilterState | None, measurements: Mapping[str, Any], gains: Gains | None = None
    ) -> tuple[Estimate, FilterState]:
        """As :meth:`run`, but from ``state`` (None: from the start), and also returns the last state."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        check_gains(self.gains, gains, type(self.model).__name__)
        first = {name: array[0] for name, array in arrays.items()}
        if state is None:
            state = empty_state(self.model, join(first, self.channels))
        check_batch(first, state.started)
        step, length = self._step_arrays, next(iter(arrays.values())).shape[0]
        if self.compiled and not is_torch(state.x):
            form = compiled_equations(self.model)
            if form:
                return form.run(self.model, state, arrays, gains, self.restart, self._keeps_covariance)
            step = self._step_each
        factors, estimates = gains_over_time(gains, length), []
        for t in range(length):
            now = {name: factor[t] for name, factor in factors.items()}
            state, estimate = step(state, {name: array[t] for name, array in arrays.items()}, now)
            estimates.append(estimate if self._keeps_covariance else estimate._replace(covariance=None))
        return stack_estimates(estimates), state

    def _step_each(self, state: FilterState, arrays: Measurement, gains: Gains | None) -> tuple[FilterState, Estimate]:
        """One sample of each sequence separately, for equations whose code depends on values."""
        batch = tuple(state.started.shape)
        if not batch:
            return self._step_arrays(state, arrays, gains)
        factors = {name: np.broadcast_to(factor, batch) for name, factor in (gains or {}).items()}
        states, estimates = [], []
        for index in np.ndindex(batch):
            own = FilterState(*(array[index] for array in state))
            sample = {name: array[index] for name, array in arrays.items()}
            own, estimate = self._step_arrays(own, sample, {name: factor[index] for name, factor in factors.items()})
            states.append(own)
            estimates.append(estimate)
        parts = (np.stack(part) for part in zip(*states, strict=True))
        joined = FilterState(*(part.reshape((*batch, *part.shape[1:])) for part in parts))
        estimate = stack_estimates(estimates)
        pose = {name: array.reshape((*batch, *array.shape[1:])) for name, array in estimate.pose.items()}
        rest = (
            None if part is None else part.reshape((*batch, *part.shape[1:]))
            for part in cast(tuple[Any, ...], estimate[1:4])
        )
        return joined, Estimate(pose, *rest)

    def _step_arrays(
        self, state: FilterState, arrays: Measurement, gains: Gains | None
    ) -> tuple[FilterState, Estimate]:
        model = scaled(self.model, gains, state.x)
        sample = join(arrays, self.channels)
        xp, names = namespace(sample, state.x), [channel.name for channel in self.channels]
        places = places_of(model) if self.restart else None
        if places is not None:
            force_age = state.age[..., names.index(ACCELEROMETER.name)][..., None]
            clean = without_impacts(places, sample, state.monitor, force_age)
            sample = xp.where(state.started[..., None], clean, sample)
        current, started, samples = hold(sample, state.held), state.started, split(sample, self.channels)
        age = aged(state.age, sample, self.channels, model.dt)
        whitened = xp.zeros_like(state.x[..., :1]) + constant([0.0] * model.residual_size, state.x)
        x, P = state.x, state.covariance
        lost = started & (state.monitor[..., LOST] > 0.5) if places is not None else started & ~started
        longest, inputs = longest_gap(model)
        if self.restart and places is None and math.isfinite(longest):
            back = [(state.age[..., index] > longest) & (age[..., index] == 0.0) for index in inputs]
            lost = lost | (started & xp.all(xp.stack(back, axis=-1), axis=-1))
        going = started & ~lost
        if bool(xp.any(going)):
            now, before = (split(filled(part), self.channels) for part in (current, state.held))
            grown = grown_parameters(model, age, now, P) if bool(xp.any(age > 0.0)) else {}
            held = with_parameters(model, grown) if grown else model
            if isinstance(held, Model) and isinstance(model, Model):
                x1, F, Q = held.predict(x, now, before)
                P1 = F @ P @ F.mT + 0.5 * (Q + Q.mT)
                start = rotation_part(model) if places is not None else -1
                unsure = tilt_variance(P1, start) > UNCERTAIN_TILT**2 if start >= 0 else started & ~started
                coarse = bool(xp.any(unsure))
                samples = without_field(samples, unsure) if coarse else samples
                rows = coarse_rows(model, x1, samples, P1) if coarse else model.residual(x1, samples)
                dx, corrected, whitened = correct(P1, *rows)
                P1 = heading_kept(P1, corrected, unsure, start) if coarse else corrected
                x1 = model.retract(x1, dx)
            else:
                x1, P1 = held.predict(x, now, before), P
            x1 = model.finish(x1, samples)
            if bool(xp.all(going)):
                x, P = x1, P1
            else:
                x = xp.where(going[..., None], x1, x)
                P = xp.where(going[..., None, None], P1, P)
                whitened = xp.where(going[..., None], whitened, xp.zeros_like(whitened))
        if not bool(xp.all(going)):
            first = current
            if places is not None:
                anew = realigned(places, current, state.monitor, model.dt)
                first = xp.where(lost[..., None], anew, current)
            begun = model.prior(split(first, self.channels))
            x0, P0 = begun if isinstance(model, Model) else (begun, P)
            factor = state.monitor[..., LOST][..., None, None] if places is not None else 1.0
            P0 = xp.where(lost[..., None, None], factor * P0, P0 + xp.zeros_like(P))
            ready = xp.all(xp.isfinite(x0), axis=-1) & xp.all(xp.all(xp.isfinite(P0), axis=-1), axis=-1)
            new = ready & ~going
            x = xp.where(new[..., None], x0, x)
            P = xp.where(new[..., None, None], P0, P)
            started = started | ready
        pose, covariance, memory = model.pose(x), P, state.monitor
        if places is not None and bool(xp.any(started)):
            outputs = xp.concat([pose[quantity.name] for quantity in self.outputs], axis=-1)
            ages = age[..., names.index(GYROSCOPE.name)][..., None]
            seen = watch(memory, inputs_of(model, places, filled(current), sample, x, outputs, ages))
            memory = xp.where(started[..., None], seen, memory)
        if not bool(xp.all(started)):
            pose = {name: xp.where(started[..., None], value, value + xp.nan) for name, value in pose.items()}
            covariance = xp.where(started[..., None, None], P, P + xp.nan)
        after = FilterState(x, P, current, age, memory, started)
        if not isinstance(model, Model):
            return after, Estimate(pose)
        return after, Estimate(pose, covariance, whitened, xp.sum(whitened * whitened, axis=-1))


def correct(P: Array, r: Array, H: Array, R: Array) -> tuple[Array, Array, Array]:
    """Condition on one measurement; rows with an element that is not finite are skipped.

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
    return times(K, r), 0.5 * (joseph + joseph.mT), whitened


@dataclass(frozen=True)
class Observer(Recursion):
    """Estimator for equations without covariance: the recursion of :class:`.KalmanFilter` without error state.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data.
        restart: start anew when the estimate contradicts the sensors for too long (:mod:`.monitor`).
    """

    model: Recurrence
    compiled: bool = True
    restart: bool = True
