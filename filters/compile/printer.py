"""Equations → printed module → compiled module, kept in the user's cache folder.

A model runs once on recorded scalars (:mod:`.trace`); its floats stay parameters, so one printed file
serves every tuning, sampling interval and gain. The file is headed by the text of :mod:`.kernel` and lies
under the hash of its content; numba keeps the machine code beside it, so only the first run on a machine pays for
compiling.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import itertools
import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np

from ..core.model import Equations, Model, Recurrence, parameters_of, with_parameters
from ..core.sampling import split
from . import kernel
from .sparsity import Part, can_differ_from_zero, find_parts, whole
from .trace import Tape, print_code

_TICK = '''
@njit(cache=True, nogil=True, error_model="numpy")
def run(x, {state}held, started, Z, parameters, poses{outputs}):
    """All ticks of all sequences of a batch; the state arrays are changed in place."""
    T, B, d = Z.shape
    n = x.shape[1]
    current, present, before, x1, x0 = np.empty(d), np.empty(d), np.empty(d), np.zeros(n), np.zeros(n)
    {scratch}
    for t in range(T):
        for b in range(B):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z = Z[t, b]
            for i in range(d):
                current[i] = z[i] if np.isfinite(z[i]) else held[b, i]
                present[i] = current[i] if np.isfinite(current[i]) else 0.0
                before[i] = held[b, i] if np.isfinite(held[b, i]) else 0.0
                held[b, i] = current[i]
            if started[b]:
                {advance}
            else:
                {begin}
            if started[b]:
                pose(x[b], p, poses[t, b])
            else:
                fill(poses[t, b], np.nan)
            {keep}
'''

_KALMAN = {
    "state": "P, ",
    "outputs": ", covariances, whites, nis",
    "scratch": """e, m = P.shape[1], whites.shape[2]
    P0, F, Q, work, dx = np.zeros((e, e)), np.zeros((e, e)), np.zeros((e, e)), np.empty((e, e)), np.empty(e)
    r, H, R = np.zeros(m), np.zeros((m, e)), np.zeros((m, m))
    rows, S, HP, K = np.empty(m, np.int64), np.empty((m, m)), np.empty((m, e)), np.empty((m, e))
    {parts}""",
    "advance": """predict(x[b], present, before, p, x1, F, Q)
                residual(x1, z, p, r, H, R)
                {update}
                retract(x1, dx, p, x0)
                finish(x0, z, p, x[b])""",
    "begin": """prior(current, p, x0, P0)
                nis[t, b] = 0.0
                fill(whites[t, b], 0.0)
                if finite(x0) and finite(P0.ravel()):
                    started[b] = True
                    copy(x0, x[b])
                    for i in range(e):
                        copy(P0[i], P[b, i])""",
    "keep": """if covariances.shape[0] > 0:
                for i in range(e):
                    for j in range(e):
                        covariances[t, b, i, j] = P[b, i, j] if started[b] else np.nan""",
}

_UPDATE = """propagate(F, {P}, Q, work, s{k}, ff{k}, fc{k})
{indent}{total} correct(r, H, R, {P}, dx, whites[t, b], rows, S, HP, K, s{k}, r{k}, hf{k}, hc{k}, {uncorrelated})"""

_WHOLE = """propagate(F, P[b], Q, work, None, None, None)
                nis[t, b] = correct(r, H, R, P[b], dx, whites[t, b], rows, S, HP, K, None, None, None, None, False)"""

_RECURRENCE = {
    "state": "",
    "outputs": "",
    "scratch": "",
    "advance": """predict(x[b], present, before, p, x1)
                finish(x1, z, p, x[b])""",
    "begin": """prior(current, p, x0)
                if finite(x0):
                    started[b] = True
                    copy(x0, x[b])""",
    "keep": "",
}


def _print_parts(parts: list[Part], everything: Part) -> tuple[list[str], dict[str, str]]:
    """Index lists of the parts (module constants), and what the recursion of a tick does with each part.

    A covariance that links parts (one that the user made) is treated as a whole.
    """
    several = len(parts) > 1
    constants = []
    for k, part in enumerate(parts if several else []):
        lists = {"s": part.states, "r": part.rows}
        for name, lines in (("f", part.transition), ("h", part.jacobian)):
            lists[f"{name}f"] = (0, *itertools.accumulate(len(line) for line in lines))
            lists[f"{name}c"] = tuple(itertools.chain.from_iterable(lines))
        constants += [f"{name}{k} = np.array({list(values)}, dtype=np.int64)" for name, values in lists.items()]
    if not several:
        return [], {"parts": "", "update": _WHOLE}
    owner = [next(k for k, part in enumerate(parts) if i in part.states) for i in everything.states]
    constants.append(f"owner = np.array({owner}, dtype=np.int64)")
    steps = ["nis[t, b] = 0.0", "if linked[b]:"]
    steps += [f"    {line.strip()}" for line in _WHOLE.splitlines()] + ["else:"]
    for k, part in enumerate(parts):
        text = _UPDATE.format(k=k, P="local", total="nis[t, b] +=", uncorrelated=part.uncorrelated, indent=" " * 20)
        steps += [f"    gather(P[b], s{k}, local)", f"    {text}", f"    scatter(local, s{k}, P[b])"]
    largest = max(len(part.states) for part in parts)
    scratch = f"""local, linked = np.empty(({largest}, {largest})), np.zeros(B, np.bool_)
    for b in range(B):
        linked[b] = coupled(P[b], owner)"""
    return [*constants, ""], {"parts": scratch, "update": ("\n" + " " * 16).join(steps)}


def cache_folder() -> Path:
    """Folder of the printed and compiled filters (below ``POISE_CACHE`` or the user's cache folder)."""
    import platformdirs

    folder = Path(os.environ.get("POISE_CACHE") or platformdirs.user_cache_dir("poise")) / "compiled"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return Path(tempfile.mkdtemp(prefix="poise-compiled-"))


def print_model(model: Equations) -> str:
    """Trace equations and print the module that runs them.

    Raises:
        ValueError: an equation returns another shape than the model's sizes say.
        TypeError: an equation branches on values.
    """
    tape, template = Tape(), _RECURRENCE
    names = list(parameters_of(model))
    traced = with_parameters(model, dict(zip(names, tape.inputs("p", len(names)), strict=True)))
    width, n = sum(channel.size for channel in model.channels), model.state_size
    x = tape.inputs("x", n)
    z, previous = (split(tape.inputs(name, width), model.channels) for name in ("z", "previous"))
    shapes: dict[str, tuple[int, ...]] = {"xn": (n,)}
    functions: dict[str, dict[str, np.ndarray]] = {}
    if isinstance(traced, Model):
        e, m = traced.error_size, traced.residual_size
        shapes |= {"P": (e, e), "F": (e, e), "Q": (e, e), "r": (m,), "H": (m, e), "R": (m, m)}
        functions["prior(z, p, xn, P)"] = dict(zip(("xn", "P"), traced.prior(z), strict=True))
        predicted = traced.predict(x, z, previous)
        functions["predict(x, z, previous, p, xn, F, Q)"] = dict(zip(("xn", "F", "Q"), predicted, strict=True))
        functions["residual(x, z, p, r, H, R)"] = dict(zip(("r", "H", "R"), traced.residual(x, z), strict=True))
        functions["retract(x, dx, p, xn)"] = {"xn": traced.retract(x, tape.inputs("dx", e))}
    elif isinstance(traced, Recurrence):
        functions["prior(z, p, xn)"] = {"xn": traced.prior(z)}
        functions["predict(x, z, previous, p, xn)"] = {"xn": traced.predict(x, z, previous)}
    else:
        raise TypeError(f"{type(model).__name__} is neither a Model nor a Recurrence")
    functions["finish(x, z, p, xn)"] = {"xn": traced.finish(x, z)}
    pose = traced.pose(x)
    shapes["out"] = (sum(quantity.size for quantity in model.outputs),)
    functions["pose(x, p, out)"] = {"out": np.concatenate([pose[quantity.name] for quantity in model.outputs])}
    head = inspect.getsource(kernel).replace("\ndef ", '\n@njit(error_model="numpy")\ndef ')
    lines = ["from math import *", "from numba import njit", head, "inf, nan = np.inf, np.nan", ""]
    matrices: dict[str, np.ndarray] = {}
    for signature, outputs in functions.items():
        for name, array in outputs.items():
            if np.shape(array) != shapes[name]:
                where = f"{type(model).__name__}.{signature.split('(')[0]}"
                raise ValueError(f"{where}: {name} must have shape {shapes[name]}, got {np.shape(array)}")
            matrices[name] = np.asarray(array, dtype=object)
        # Zeros are not printed; matrices keep theirs between calls, vectors share their memory and are cleared.
        clear = [f"    fill({name}, 0.0)" for name in outputs if name in ("xn", "out", "r")]
        code = print_code({name: np.asarray(array, dtype=object) for name, array in outputs.items()})
        lines += ['@njit(error_model="numpy")', f"def {signature}:", *clear, *code, "    return", ""]
    if isinstance(traced, Model):
        F, Q, P0, H, R = (can_differ_from_zero(matrices[name]) for name in ("F", "Q", "P", "H", "R"))
        constants, texts = _print_parts(find_parts(F, Q, P0, H, R), whole(F, H, R))
        lines += constants
        template = {name: text.format(**texts) for name, text in _KALMAN.items()}
    return "\n".join([*lines, _TICK.format(**template)])


def load(text: str, label: str) -> ModuleType:
    """Write a printed module to the cache folder (once) and import it."""
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
