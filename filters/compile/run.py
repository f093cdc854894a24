"""Run printed and compiled equations on NumPy data: one call for a tick, a sequence, or a batch of sequences."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.model import Equations, Model, Recurrence, parameters_of, structure_of
from ..core.quantity import Estimate, Measurement
from ..core.sampling import Gains, join, per_tick_gains
from .printer import load, print_model

if TYPE_CHECKING:
    from ..core.kalman import FilterState
    from ..core.observer import ObserverState

_FORMS: dict[tuple[Any, ...], Any] = {}
_HINTED: list[bool] = []
PROCESSORS = os.cpu_count() or 1
PARALLEL_WORK = 200_000
"""ticks × batch above which a batch is shared among threads"""


def compiled_model(model: Model) -> CompiledModel | None:
    """The compiled form of a model, made on first use of its class and structure; None without numba."""
    return _form(model, CompiledModel)


def compiled_recurrence(model: Recurrence) -> CompiledRecurrence | None:
    """The compiled form of a recurrence, made on first use of its class and structure; None without numba."""
    return _form(model, CompiledRecurrence)


def _form(model: Equations, kind: Callable[[Any], Any]) -> Any:
    key = structure_of(model)
    if key not in _FORMS:
        try:
            import numba  # noqa: F401
        except ImportError:
            if not _HINTED:
                _HINTED.append(True)
                warnings.warn("numba is not installed: filters run in their slower array form", stacklevel=4)
            _FORMS[key] = None
        else:
            _FORMS[key] = kind(model)
    return _FORMS[key]


class _Form:
    """What both kinds share: the kernel, parameters as a table, pose columns, threads."""

    def __init__(self, model: Equations) -> None:
        self.kernel = load(print_model(model), type(model).__name__).run
        self.names = tuple(parameters_of(model))
        self.columns: dict[str, slice] = {}
        start = 0
        for quantity in model.outputs:
            self.columns[quantity.name] = slice(start, start + quantity.size)
            start += quantity.size
        self.pose_size = start

    def _parameters(self, model: Equations, gains: Gains | None, length: int, batch: tuple[int, ...]) -> np.ndarray:
        """Parameters ``(T or 1, B or 1, count)`` with the gains applied."""
        base = np.array([*parameters_of(model).values()])
        if not gains:
            return base[None, None]
        factors = {name: np.asarray(array) for name, array in per_tick_gains(gains, length).items()}
        wide = any(array.ndim > 1 for array in factors.values())
        count = math.prod(batch) if wide else 1
        table = np.broadcast_to(base, (length, count, base.size)).copy()
        for name, array in factors.items():
            gain = model.gains[name]
            column = self.names.index(gain.parameter)
            flat = np.broadcast_to(array, (length, *batch)).reshape(length, -1) if array.ndim > 1 else array[:, None]
            table[:, :, column] = np.minimum(base[column] * np.exp(gain.power * flat), gain.maximum)
        return table

    def _samples(self, model: Equations, arrays: Measurement) -> tuple[np.ndarray, tuple[int, ...]]:
        """Samples ``(T, B, d)`` and the batch shape that B stands for."""
        Z = np.asarray(join(arrays, model.channels), dtype=float)
        batch = Z.shape[1:-1]
        return np.ascontiguousarray(Z.reshape(Z.shape[0], math.prod(batch), Z.shape[-1])), batch

    def _execute(self, states: list[np.ndarray], Z: np.ndarray, parameters: np.ndarray, outs: list[np.ndarray]) -> None:
        """Call the kernel, in threads where the work is worth it; sequences do not meet, so the numbers stay."""
        threads = min(PROCESSORS, Z.shape[1])
        if threads < 2 or Z.shape[0] * Z.shape[1] < PARALLEL_WORK:
            self.kernel(*states, Z, parameters, *outs)
            return

        def work(first: int, last: int) -> None:
            part = slice(first, last)
            own = parameters[:, part] if parameters.shape[1] > 1 else parameters
            self.kernel(*(state[part] for state in states), Z[:, part], own, *(out[:, part] for out in outs))

        bounds = np.linspace(0, Z.shape[1], threads + 1).astype(int)
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, bounds[:-1], bounds[1:]))

    def _pose(self, poses: np.ndarray, batch: tuple[int, ...]) -> dict[str, np.ndarray]:
        flat = poses.reshape(poses.shape[0], *batch, self.pose_size)
        return {name: flat[..., part] for name, part in self.columns.items()}


def _flatten(state: tuple[Any, ...], batch: tuple[int, ...]) -> list[np.ndarray]:
    """Fresh arrays ``(B, …)`` of a state, so that the caller's stay as they are."""
    return [np.array(array).reshape((math.prod(batch), *array.shape[len(batch) :])) for array in state]


def _unflatten(state: Any, arrays: list[np.ndarray], batch: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Fields of the state after the run, in the caller's batch shape."""
    shaped = (array.reshape((*batch, *array.shape[1:])) for array in arrays)
    return dict(zip(state._fields, shaped, strict=True))


class CompiledModel(_Form):
    """The compiled Kalman recursion of one model class; parameters are passed at every call."""

    def step(
        self, model: Model, state: FilterState, arrays: Measurement, gains: Gains | None
    ) -> tuple[FilterState, Estimate]:
        """One tick; see :meth:`.KalmanFilter.step`. Written for speed, not through :meth:`run`."""
        if gains:
            gains = {name: np.asarray(factor, dtype=float)[None] for name, factor in gains.items()}
        z = np.concatenate([arrays[channel.name] for channel in model.channels], axis=-1)
        batch = z.shape[:-1]
        count, e, m = math.prod(batch), model.error_size, model.residual_size
        x, P, held, started = (array.copy() for array in state)
        poses, covariances = np.empty((*batch, self.pose_size)), np.empty((*batch, e, e))
        whites, nis = np.empty((*batch, m)), np.empty(batch)
        self.kernel(
            x.reshape(count, -1),
            P.reshape(count, e, e),
            held.reshape(count, -1),
            started.reshape(count),
            z.reshape(1, count, -1),
            self._parameters(model, gains, 1, batch),
            poses.reshape(1, count, -1),
            covariances.reshape(1, count, e, e),
            whites.reshape(1, count, m),
            nis.reshape(1, count),
        )
        pose = {name: poses[..., part] for name, part in self.columns.items()}
        state = state._replace(x=x, covariance=P, held=held, started=started)
        return state, Estimate(pose, covariances, whites, nis)

    def run(
        self, model: Model, state: FilterState, arrays: Measurement, gains: Gains | None, keep_covariance: bool
    ) -> tuple[Estimate, FilterState]:
        """A whole sequence; see :meth:`poise.filters.core.kalman.KalmanFilter.run_from`."""
        Z, batch = self._samples(model, arrays)
        (length, count), e, m = Z.shape[:2], model.error_size, model.residual_size
        states = _flatten(state, batch)
        poses = np.empty((length, count, self.pose_size))
        # Threads slice the second axis, so an unkept covariance has no first one.
        covariances = np.empty((length if keep_covariance else 0, count, e, e))
        whites, nis = np.empty((length, count, m)), np.empty((length, count))
        parameters = self._parameters(model, gains, length, batch)
        self._execute(states, Z, parameters, [poses, covariances, whites, nis])
        covariance = covariances.reshape(length, *batch, e, e) if keep_covariance else None
        pose = self._pose(poses, batch)
        estimate = Estimate(pose, covariance, whites.reshape(length, *batch, m), nis.reshape(length, *batch))
        return estimate, state._replace(**_unflatten(state, states, batch))


class CompiledRecurrence(_Form):
    """The compiled recursion of one class of equations without covariance."""

    def step(self, model: Recurrence, state: ObserverState, arrays: Measurement) -> tuple[ObserverState, Estimate]:
        """One tick; see :meth:`poise.filters.core.observer.Observer.step`."""
        estimate, state = self.run(model, state, {name: array[None] for name, array in arrays.items()})
        return state, Estimate({name: value[0] for name, value in estimate.pose.items()})

    def run(self, model: Recurrence, state: ObserverState, arrays: Measurement) -> tuple[Estimate, ObserverState]:
        """A whole sequence, from a given state."""
        Z, batch = self._samples(model, arrays)
        states = _flatten(state, batch)
        poses = np.empty((*Z.shape[:2], self.pose_size))
        self._execute(states, Z, self._parameters(model, None, Z.shape[0], batch), [poses])
        return Estimate(self._pose(poses, batch)), state._replace(**_unflatten(state, states, batch))
