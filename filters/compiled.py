"""The compiled form of a Kalman filter: a model's equations traced once, printed, compiled and looped over time.

The model runs once on recorded scalars (:mod:`poise.filters.tracing`); its floats stay parameters, so one compiled file
serves every tuning, sampling interval and gain. The printed file, headed by the text of :mod:`poise.filters.kernel`, lies in
the user's cache folder under the hash of its content; numba keeps the machine code beside it, so only the first run
on a machine pays for compiling.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from .model import Model, parameters_of, structure_of, with_parameters
from .quantity import Estimate, Measurement
from .tracing import Tape, print_code

if TYPE_CHECKING:
    from .kalman import FilterState, Gains

_FORMS: dict[tuple[Any, ...], CompiledForm | None] = {}
_PARALLEL_WORK = 200_000
"""ticks × batch above which a batch is shared among threads"""

_RUN = '''
@njit(cache=True, nogil=True, error_model="numpy")
def run(x, P, held, started, Z, parameters, poses, covariances, whites, nis):
    """All ticks of all sequences of a batch; the state arrays are changed in place."""
    T, B, d = Z.shape
    n, e, m = x.shape[1], P.shape[1], whites.shape[2]
    keep = covariances.shape[0] > 0
    current, filled, before = np.empty(d), np.empty(d), np.empty(d)
    x1, x0, P0 = np.zeros(n), np.zeros(n), np.zeros((e, e))
    F, Q, work, dx = np.zeros((e, e)), np.zeros((e, e)), np.empty((e, e)), np.empty(e)
    r, H, R = np.zeros(m), np.zeros((m, e)), np.zeros((m, m))
    rows, S, HP, K = np.empty(m, np.int64), np.empty((m, m)), np.empty((m, e)), np.empty((m, e))
    for t in range(T):
        for b in range(B):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z = Z[t, b]
            for i in range(d):
                current[i] = z[i] if np.isfinite(z[i]) else held[b, i]
                filled[i] = current[i] if np.isfinite(current[i]) else 0.0
                before[i] = held[b, i] if np.isfinite(held[b, i]) else 0.0
                held[b, i] = current[i]
            if started[b]:
                predict(x[b], filled, before, p, x1, F, Q)
                propagate(F, P[b], Q, work)
                residual(x1, z, p, r, H, R)
                nis[t, b] = correct(r, H, R, P[b], dx, whites[t, b], rows, S, HP, K)
                retract(x1, dx, p, x0)
                finish(x0, z, p, x[b])
            else:
                prior(current, p, x0, P0)
                ready = True
                for i in range(n):
                    ready = ready and np.isfinite(x0[i])
                for i in range(e):
                    for j in range(e):
                        ready = ready and np.isfinite(P0[i, j])
                nis[t, b] = 0.0
                whites[t, b, :] = 0.0
                if ready:
                    started[b] = True
                    x[b, :] = x0
                    P[b, :, :] = P0
            if started[b]:
                pose(x[b], p, poses[t, b])
            else:
                poses[t, b, :] = np.nan
            if keep:
                for i in range(e):
                    for j in range(e):
                        covariances[t, b, i, j] = P[b, i, j] if started[b] else np.nan
'''


def cache_folder() -> Path:
    """Folder of the printed and compiled filters (``POISE_CACHE`` or the user's cache folder)."""
    import platformdirs

    root = os.environ.get("POISE_CACHE") or platformdirs.user_cache_dir("poise")
    folder = Path(root) / "compiled"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return Path(tempfile.mkdtemp(prefix="poise-compiled-"))


def compiled_form(model: Model) -> CompiledForm | None:
    """The compiled form of a model's class and structure, made on first use; None without numba."""
    key = structure_of(model)
    if key not in _FORMS:
        try:
            import numba  # noqa: F401
        except ImportError:
            if None not in _FORMS.values():
                warnings.warn("numba is not installed: filters run in their slower array form", stacklevel=3)
            _FORMS[key] = None
        else:
            _FORMS[key] = CompiledForm(model)
    return _FORMS[key]


def print_model(model: Model) -> str:
    """Trace a model and print the module that runs it."""
    tape = Tape()
    names = list(parameters_of(model))
    symbols = tape.inputs("p", len(names))
    traced = with_parameters(model, dict(zip(names, symbols, strict=True)))
    width = sum(channel.size for channel in model.channels)

    def measurement(name: str) -> dict[str, np.ndarray]:
        flat, parts, start = tape.inputs(name, width), {}, 0
        for channel in model.channels:
            parts[channel.name] = flat[start : start + channel.size]
            start += channel.size
        return parts

    x, dx, z = tape.inputs("x", model.state_size), tape.inputs("dx", model.error_size), measurement("z")
    x0, P0 = traced.prior(z)
    x1, F, Q = traced.predict(x, z, measurement("previous"))
    r, H, R = traced.residual(x, z)
    pose = traced.pose(x)
    functions = {
        "prior(z, p, xn, P)": {"xn": x0, "P": P0},
        "predict(x, z, previous, p, xn, F, Q)": {"xn": x1, "F": F, "Q": Q},
        "residual(x, z, p, r, H, R)": {"r": r, "H": H, "R": R},
        "retract(x, dx, p, xn)": {"xn": traced.retract(x, dx)},
        "finish(x, z, p, xn)": {"xn": traced.finish(x, z)},
        "pose(x, p, out)": {"out": np.concatenate([pose[quantity.name] for quantity in model.outputs])},
    }
    n, e, m = model.state_size, model.error_size, model.residual_size
    shapes = {"xn": (n,), "P": (e, e), "F": (e, e), "Q": (e, e), "r": (m,), "H": (m, e), "R": (m, m)}
    from . import kernel

    text = inspect.getsource(kernel).replace("\ndef ", '\n@njit(error_model="numpy")\ndef ')
    lines = ["from math import *", "from numba import njit", text, "inf, nan = np.inf, np.nan"]
    for head, outputs in functions.items():
        for name, array in outputs.items():
            if name in shapes and np.shape(array) != shapes[name]:
                raise ValueError(
                    f"{type(model).__name__}.{head.split('(')[0]}: {name} must have shape {shapes[name]}, "
                    f"got {np.shape(array)}"
                )
        # A zero that is written nowhere must not be left from an older call: whole outputs that can hold one are cleared.
        body = [f"    {name}[:] = 0.0" for name in outputs if name in ("xn", "out", "r")]
        code = print_code({name: np.asarray(array, dtype=object) for name, array in outputs.items()})
        lines += ['@njit(error_model="numpy")', f"def {head}:", *body, *code, "    return", ""]
    return "\n".join([*lines, _RUN])


def _load(text: str, label: str) -> ModuleType:
    import numba

    digest = hashlib.sha256(f"{numba.__version__} {np.__version__} {sys.version}\n{text}".encode()).hexdigest()[:20]
    path = cache_folder() / f"{label}_{digest}.py"
    if not path.exists():
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, path)
    name = f"poise_compiled_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load the compiled filter {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


class CompiledForm:
    """The compiled recursion of one model class; parameters are passed at every call."""

    def __init__(self, model: Model) -> None:
        self.kernel = _load(print_model(model), type(model).__name__).run
        self.names = tuple(parameters_of(model))
        self.slices: dict[str, slice] = {}
        start = 0
        for quantity in model.outputs:
            self.slices[quantity.name] = slice(start, start + quantity.size)
            start += quantity.size
        self.pose_size = start

    def _parameters(self, model: Model, gains: Gains | None, length: int, batch: tuple[int, ...]) -> np.ndarray:
        """Parameters ``(T or 1, B or 1, count)`` with the gains applied."""
        values = parameters_of(model)
        base = np.array([values[name] for name in self.names])
        if not gains:
            return base[None, None]
        from .kalman import per_tick_gains

        factors = {name: np.asarray(array) for name, array in per_tick_gains(gains, length).items()}
        wide = any(array.ndim > 1 for array in factors.values())
        columns = int(np.prod(batch, dtype=int)) if wide else 1
        table = np.broadcast_to(base, (length, columns, base.size)).copy()
        for name, array in factors.items():
            gain = model.gains[name]
            column = self.names.index(gain.parameter)
            if array.ndim > 1:
                flat = np.broadcast_to(array, (length, *batch)).reshape(length, columns)
            else:
                flat = array[:, None]
            table[:, :, column] = np.minimum(base[column] * np.exp(gain.power * flat), max(gain.maximum, 0.0))
        return table

    def step(
        self, model: Model, state: FilterState, arrays: Measurement, gains: Gains | None
    ) -> tuple[FilterState, Estimate]:
        """One tick; see :meth:`poise.filters.kalman.KalmanFilter.step`."""
        if gains:
            gains = {name: np.asarray(factor, dtype=float)[None] for name, factor in gains.items()}
        arrays = {name: array[None] for name, array in arrays.items()}
        estimate, state = self.run(model, state, arrays, gains, True)
        pose = {name: value[0] for name, value in estimate.pose.items()}
        covariance, innovation, nis = estimate[1:]
        assert covariance is not None
        assert innovation is not None
        assert nis is not None
        return state, Estimate(pose, covariance[0], innovation[0], nis[0])

    def run(
        self, model: Model, state: FilterState, arrays: Measurement, gains: Gains | None, keep_covariance: bool
    ) -> tuple[Estimate, FilterState]:
        """A whole sequence; see :meth:`poise.filters.kalman.KalmanFilter.run_from`."""
        parts = [arrays[channel.name] for channel in model.channels]
        Z = np.concatenate(parts, axis=-1, dtype=float) if len(parts) > 1 else np.asarray(parts[0], dtype=float)
        length, batch = Z.shape[0], Z.shape[1:-1]
        count = 1
        for size in batch:
            count *= size
        n, e, m = model.state_size, model.error_size, model.residual_size
        Z = np.ascontiguousarray(Z.reshape(length, count, Z.shape[-1]))
        x = np.array(state.x, dtype=float).reshape(count, n)
        P = np.array(state.covariance, dtype=float).reshape(count, e, e)
        held = np.array(state.held, dtype=float).reshape(count, -1)
        started = np.array(state.started, dtype=bool).reshape(count)
        parameters = self._parameters(model, gains, length, batch)
        poses = np.empty((length, count, self.pose_size))
        covariances = np.empty((length if keep_covariance else 0, count, e, e))
        whites, nis = np.empty((length, count, m)), np.empty((length, count))
        everything = (x, P, held, started, Z, parameters, poses, covariances, whites, nis)
        threads = min(os.cpu_count() or 1, count)
        if threads > 1 and length * count >= _PARALLEL_WORK:
            self._run_in_threads(threads, everything)
        else:
            self.kernel(*everything)
        flat = poses.reshape(length, *batch, self.pose_size)
        pose = {name: flat[..., part] for name, part in self.slices.items()}
        covariance = covariances.reshape(length, *batch, e, e) if keep_covariance else None
        estimate = Estimate(pose, covariance, whites.reshape(length, *batch, m), nis.reshape(length, *batch))
        final = state._replace(
            x=x.reshape(*batch, n),
            covariance=P.reshape(*batch, e, e),
            held=held.reshape(*batch, held.shape[-1]),
            started=started.reshape(batch),
        )
        return estimate, final

    def _run_in_threads(self, threads: int, everything: tuple[np.ndarray, ...]) -> None:
        """Share a batch among threads; sequences do not meet, so the numbers stay the same."""
        x, P, held, started, Z, parameters, poses, covariances, whites, nis = everything
        bounds = np.linspace(0, x.shape[0], threads + 1).astype(int)

        def work(first: int, last: int) -> None:
            part = slice(first, last)
            own = parameters[:, part] if parameters.shape[1] > 1 else parameters
            outputs = (array[:, part] for array in (poses, covariances, whites, nis))
            self.kernel(x[part], P[part], held[part], started[part], Z[:, part], own, *outputs)

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, bounds[:-1], bounds[1:]))


def clear_compiled(remove_files: bool = False) -> None:
    """Forget compiled forms of this process; with ``remove_files`` also those of the cache folder."""
    _FORMS.clear()
    if remove_files:
        for path in cache_folder().rglob("*"):
            if path.is_file():
                path.unlink(missing_ok=True)


__all__: list[str] = ["CompiledForm", "cache_folder", "clear_compiled", "compiled_form", "print_model"]


def describe(model: Model) -> Mapping[str, int]:
    """Sizes of the printed code of a model: lines, and what of F, H and Q is not a structural zero."""
    text = print_model(model)
    return {"lines": text.count("\n"), "F": text.count("    F["), "H": text.count("    H["), "Q": text.count("    Q[")}
