"""The recursion around equations without a covariance: observers with fixed gains, integration, plain tilt.

It treats samples as :mod:`.kalman` does: missing inputs are held, missing corrections left out, the start
waits for a finite prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from .backend import Array, is_torch, namespace
from .estimator import check_measurements, run_by_steps
from .model import Recurrence
from .quantity import Channel, Estimate, Measurement, Quantity
from .sampling import check_batch, empty_memory, filled, hold, join, split


class ObserverState(NamedTuple):
    """All memory of an observer.

    Attributes:
        x: ``(*batch, n)`` state; zeros before the start.
        held: ``(*batch, d)`` last finite sample of every channel element, NaN if there was none.
        started: ``(*batch,)`` bool.
    """

    x: Array
    held: Array
    started: Array


@dataclass(frozen=True)
class Observer:
    """Equations without covariance made an estimator.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data (needs numba; the array form serves without it).
    """

    model: Recurrence
    compiled: bool = True

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

    def with_dt(self, dt: float) -> Observer:
        """The same observer for another sampling interval."""
        return replace(self, model=self.model.with_dt(dt))

    def init(self, measurement: Measurement) -> ObserverState:
        """Empty memory with the batch shape and array kind of ``measurement`` (no sample is used up)."""
        like = join(check_measurements(self.channels, measurement, time_axis=False), self.channels)
        return ObserverState(*empty_memory(like, (self.model.state_size,)))

    def step(self, state: ObserverState, measurement: Measurement) -> tuple[ObserverState, Estimate]:
        """Take one sample of every channel, ``(*batch, size)``; NaN where there is none."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        check_batch(arrays, state.started)
        if self.compiled and not is_torch(state.x):
            from ..compile.run import compiled_recurrence

            form = compiled_recurrence(self.model)
            if form is not None:
                return form.step(self.model, state, arrays)
        return self._step_arrays(state, arrays)

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, size)`` in and out; equal to stepping."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        first = next(iter(arrays.values()))
        if self.compiled and not is_torch(first):
            from ..compile.run import compiled_recurrence

            form = compiled_recurrence(self.model)
            if form is not None:
                state = self.init({name: array[0] for name, array in arrays.items()})
                return form.run(self.model, state, arrays)[0]
        return run_by_steps(replace(self, compiled=False), arrays)

    def _step_arrays(self, state: ObserverState, arrays: Measurement) -> tuple[ObserverState, Estimate]:
        model = self.model
        sample = join(arrays, self.channels)
        xp = namespace(sample, state.x)
        current, started, x = hold(sample, state.held), state.started, state.x
        if bool(xp.any(started)):
            x1 = model.predict(x, split(filled(current), self.channels), split(filled(state.held), self.channels))
            x1 = model.finish(x1, split(sample, self.channels))
            x = x1 if bool(xp.all(started)) else xp.where(started[..., None], x1, x)
        if not bool(xp.all(started)):
            x0 = model.prior(split(current, self.channels))
            ready = xp.all(xp.isfinite(x0), axis=-1)
            x = xp.where((ready & ~started)[..., None], x0, x)
            started = started | ready
        pose = model.pose(x)
        if not bool(xp.all(started)):
            pose = {name: xp.where(started[..., None], value, value + xp.nan) for name, value in pose.items()}
        return ObserverState(x, current, started), Estimate(pose)
