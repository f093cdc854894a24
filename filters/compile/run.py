"""Run compiled equations on NumPy data: one call for a sample, a sequence, or a batch of sequences."""

from __future__ import annotations

import math
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ..core.model import Equations, parameters_of, structure_of
from ..core.monitor import starts_of
from ..core.quantity import Estimate, Measurement
from ..core.sampling import FilterState, Gains, empty_state, gains_over_time, join
from ..support.parallel import processors
from .cache import compile_now
from .printer import UntraceableError, print_model

_COMPILED: dict[tuple[Any, ...], CompiledEquations | None] = {}
PARALLEL_WORK = 200_000
"""samples × batch above which several threads process a batch"""
NOTHING = (
    *(np.empty((0, 0), np.int64), np.empty((0, 0, 0)), np.empty((0, 0, 0))),
    *(np.empty((0, 0, 0, 0)), np.empty((0, 0, 0, 0)), np.empty((0, 0, 0), np.int64)),
)
"""records of a filter that nothing is to smooth"""
RECORDED = 25_000_000
"""numbers that a smoother keeps in memory at a time (200 MB); the filter runs twice over longer recordings"""


def compiled_equations(model: Equations) -> CompiledEquations | None:
    """The compiled form of a model, made on first use of its class and structure; None if it cannot be traced.

    Warns:
        UserWarning: once for a model that cannot be traced.
    """
    key = structure_of(model)
    if key not in _COMPILED:
        try:
            _COMPILED[key] = CompiledEquations(model)
        except UntraceableError as reason:
            _COMPILED[key] = None
            warnings.warn(
                f"{reason}. It runs as written, one sequence at a time, a hundred times slower than compiled code. To "
                "compile it, take functions from xp = namespace(x) (poise.filters.core.backend), choose by xp.where "
                "instead of if, and join arrays by xp.concat and xp.stack instead of writing into them",
                stacklevel=4,
            )
    return _COMPILED[key]


class CompiledEquations:
    """The compiled recursion of one class of equations; parameters are passed at every call."""

    def __init__(self, model: Equations) -> None:
        # numba is imported here, since commands that run no filter need not wait for it
        from . import loops, native, plan, smoothing

        self.loops, self.smoothing = loops, smoothing
        self.printed = print_model(model)
        self.plan = plan.plan_of(self.printed, native.addresses(self.printed.functions, type(model).__name__))
        self.names = tuple(parameters_of(model))
        starts = starts_of(model.outputs)
        self.columns = {part.name: slice(starts[part.name], starts[part.name] + part.size) for part in model.outputs}
        self.pose_size = sum(part.size for part in model.outputs)
        width = sum(channel.size for channel in model.channels)
        state = empty_state(model, np.empty((0, width)))
        samples = [np.empty((0, 0, width)), self._parameters(model, None, 0, ()), True]
        arguments = *state, *samples, *self._outputs(model, 0, 0, 0), self.plan, NOTHING
        compile_now(loops.run, arguments, "the filters' recursion")

    def _parameters(self, model: Equations, gains: Gains | None, length: int, batch: tuple[int, ...]) -> np.ndarray:
        """Parameters ``(T or 1, B or 1, count)`` with the gains applied."""
        base = np.array([*parameters_of(model).values()])
        if not gains:
            return base[None, None]
        factors = {name: np.asarray(array) for name, array in gains_over_time(gains, length).items()}
        wide = any(array.ndim > 1 for array in factors.values())
        count = math.prod(batch) if wide else 1
        table = np.broadcast_to(base, (length, count, base.size)).copy()
        for name, array in factors.items():
            gain = model.gains[name]
            column = self.names.index(gain.parameter)
            flat = np.broadcast_to(array, (length, *batch)).reshape(length, -1) if array.ndim > 1 else array[:, None]
            table[:, :, column] = gain.scaled(base[column], flat)
        return table

    def _outputs(self, model: Equations, length: int, count: int, kept: int) -> list[np.ndarray]:
        """Arrays to be filled: poses, covariances (of the ``kept`` samples: all or none), whitened innovations, NIS."""
        e, m = model.error_size, model.residual_size
        shapes = (length, count, self.pose_size), (kept, count, e, e), (length, count, m), (length, count)
        return [np.empty(shape) for shape in shapes]

    def step(
        self, model: Equations, state: FilterState, arrays: Measurement, gains: Gains | None, restart: bool
    ) -> tuple[FilterState, Estimate]:
        """One sample; see :meth:`poise.filters.core.recursion.Recursion.step`. For speed, not through :meth:`run`."""
        if gains:
            gains = {name: np.asarray(factor, dtype=float)[None] for name, factor in gains.items()}
        z = np.concatenate([arrays[channel.name] for channel in model.channels], axis=-1, dtype=float)
        batch = z.shape[:-1]
        count = math.prod(batch)
        after = FilterState(*(np.array(array) for array in state))
        flat = [array.reshape(count, *array.shape[len(batch) :]) for array in after]
        outputs = self._outputs(model, 1, count, 1)
        parameters = self._parameters(model, gains, 1, batch)
        self.loops.run(*flat, z.reshape(1, count, -1), parameters, restart, *outputs, self.plan, NOTHING)
        shaped = [array.reshape((*batch, *array.shape[2:])) for array in outputs]
        return after, self._estimate(model, shaped[0], *shaped[1:])

    def run(
        self,
        model: Equations,
        state: FilterState,
        arrays: Measurement,
        gains: Gains | None,
        restart: bool,
        keep_covariance: bool,
    ) -> tuple[Estimate, FilterState]:
        """A whole sequence; see :meth:`poise.filters.core.recursion.Recursion.run_from`."""
        Z = np.asarray(join(arrays, model.channels), dtype=float)
        parameters = self._parameters(model, gains, Z.shape[0], Z.shape[1:-1])
        return self.run_samples(model, state, Z, parameters, restart, keep_covariance)

    def run_samples(
        self,
        model: Equations,
        state: FilterState,
        Z: np.ndarray,
        parameters: np.ndarray,
        restart: bool,
        keep_covariance: bool,
    ) -> tuple[Estimate, FilterState]:
        """As :meth:`run`, of samples ``(T, *batch, d)`` with parameters ``(T or 1, B or 1, count)``."""
        length, batch = Z.shape[0], Z.shape[1:-1]
        count = math.prod(batch)
        Z = np.require(Z.reshape(length, count, Z.shape[-1]), requirements=["C", "W"])
        states = [np.array(array).reshape(count, *array.shape[len(batch) :]) for array in state]
        outputs = self._outputs(model, length, count, length if keep_covariance else 0)
        self._execute(states, Z, parameters, restart, outputs)
        poses, covariances, whites, nis = (array.reshape((len(array), *batch, *array.shape[2:])) for array in outputs)
        estimate = self._estimate(model, poses, covariances if keep_covariance else None, whites, nis)
        return estimate, FilterState(*(array.reshape((*batch, *array.shape[1:])) for array in states))

    def smooth(
        self, model: Equations, arrays: Measurement, gains: Gains | None, restart: bool, keep_covariance: bool
    ) -> Estimate:
        """Smoothing of a whole sequence; see :meth:`poise.filters.core.kalman.KalmanFilter.smooth`.

        Records of the forward pass are kept for one section at a time; the filter runs twice over each.
        """
        Z = np.asarray(join(arrays, model.channels), dtype=float)
        length, batch = Z.shape[0], Z.shape[1:-1]
        n, e, m = model.state_size, model.error_size, model.residual_size
        count = math.prod(batch)
        Z = np.require(Z.reshape(length, count, Z.shape[-1]), requirements=["C", "W"])
        parameters = self._parameters(model, gains, length, batch)
        shapes = (n,), (self.printed.entries,), (m, e), (m, m)
        each = max(64, RECORDED // (count * (e * e + sum(map(math.prod, shapes)))))
        stretches = [slice(start, min(start + each, length)) for start in range(0, length, each)]
        states = [np.array(part) for part in empty_state(model, Z[0])]
        poses, covariances, whites, nis = self._outputs(model, length, count, length if keep_covariance else 0)
        starts = []
        for stretch in stretches:
            starts.append([part.copy() for part in states])
            if len(stretches) > 1:
                own = parameters if len(parameters) == 1 else parameters[stretch]
                size = stretch.stop - stretch.start
                unused = self._outputs(model, size, count, 0)
                self.loops.run(*states, Z[stretch], own, restart, *unused, self.plan, NOTHING)
        later = np.zeros((count, e)), np.zeros((count, e, e))
        label = "the filters' smoother"
        for stretch, start in zip(reversed(stretches), reversed(starts), strict=True):
            size, own = stretch.stop - stretch.start, parameters if len(parameters) == 1 else parameters[stretch]
            covariance = covariances[stretch] if keep_covariance else np.empty((size, count, e, e))
            outputs = poses[stretch], covariance, whites[stretch], nis[stretch]
            kept = (np.empty((size, count, *shape)) for shape in shapes)
            records = np.zeros((size, count), np.int64), *kept, np.empty((size, count, m), np.int64)
            self.loops.run(*start, Z[stretch], own, restart, *outputs, self.plan, records)
            backward = Z[stretch], own, outputs[2], records, later, covariance, outputs[0], self.plan
            compile_now(self.smoothing.smooth, backward, label)
        shaped = [array.reshape((len(array), *batch, *array.shape[2:])) for array in (poses, covariances, whites, nis)]
        return self._estimate(model, shaped[0], shaped[1] if keep_covariance else None, *shaped[2:])

    def _execute(
        self, states: list[np.ndarray], Z: np.ndarray, parameters: np.ndarray, restart: bool, outs: list[np.ndarray]
    ) -> None:
        """Call the kernel, in threads for large batches; sequences are independent, so the results are the same."""
        threads = min(processors(), Z.shape[1])
        if threads < 2 or Z.shape[0] * Z.shape[1] < PARALLEL_WORK:
            self.loops.run(*states, Z, parameters, restart, *outs, self.plan, NOTHING)
            return

        def work(first: int, last: int) -> None:
            # Copies in one piece: the kernel is compiled for contiguous arrays only.
            part = slice(first, last)
            own = np.ascontiguousarray(parameters[:, part]) if parameters.shape[1] > 1 else parameters
            mine = [np.empty(out[:, part].shape) for out in outs]
            samples = np.ascontiguousarray(Z[:, part])
            self.loops.run(*(state[part] for state in states), samples, own, restart, *mine, self.plan, NOTHING)
            for out, filled in zip(outs, mine, strict=True):
                out[:, part] = filled

        bounds = np.linspace(0, Z.shape[1], threads + 1).astype(int)
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, bounds[:-1], bounds[1:]))

    def _estimate(self, model: Equations, poses: np.ndarray, *rest: Any) -> Estimate:
        pose = {name: poses[..., part] for name, part in self.columns.items()}
        return Estimate(pose, *rest) if model.error_size else Estimate(pose)
