"""Equations → text of a module whose function ``run`` runs them over time, and ``record`` and ``smooth`` back again.

A model runs once on recorded scalars (:mod:`.trace`); its floats stay parameters, so one printed module serves every
tuning, sampling interval and gain. What is the same for every model is imported from :mod:`.kernel`. A method without
covariance is a Kalman filter whose error state and measurement are empty.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import numpy as np

from ..core.held_inputs import grown
from ..core.model import Equations, Model, Recurrence, parameters_of, with_parameters
from ..core.monitor import (
    IMPACT,
    IMPACT_SHARE,
    INPUTS,
    LONGEST_IMPACT,
    LOST,
    MEMORY,
    places_of,
    starts_of,
    watch,
)
from ..core.quantity import ACCELEROMETER, GYROSCOPE
from ..core.sampling import split
from .trace import Expression, Tape, print_code

_HEAD = """
from math import *

import numpy as np
from numba import njit

from poise.filters.compile.cache import jit
from poise.filters.compile.kernel import (
    begin, copy, copy_matrix, correct, fill, gather, keep, propagate, realign, reject, scratch, squared, take, zeros
)
from poise.filters.compile.smoothing import remember, update_back

inf, nan = np.inf, np.nan
"""

WIDTH = 10
"""Columns of a product that are summed at a time."""
_INNER = '@njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)'

_RUN = """
starts = np.array({starts})


@jit
def run(x, P, held, age, monitor, started, Z, parameters, restart, poses, covariances, whites, nis):
    # All ticks of all sequences of a batch; the state, x to started, is changed in place.
    sizes = x.shape[1], P.shape[1], whites.shape[2], Z.shape[2], parameters.shape[2]
    vectors, square, measured, rows = scratch(*sizes)
    current, present, before, x1, x0, r, dx, grown = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured{memory}
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white, pose_now = Z[t, b], x[b], P[b], whites[t, b], poses[t, b]{rejected}
            missing = take(z, held[b], age[b], starts, p[{dt}], current, present, before)
            lost = {lost}
            if started[b] and not lost:
                noise = p{grown}
                predict(state, present, before, noise, x1, F, Q)
                if P1.shape[0] > 0:
                    propagate(F, P1, Q, work, F_first, F_column)
                    residual(x1, z, p, r, H, R)
                    nis[t, b] = correct(r, H, R, P1, dx, white, rows, S, HP, K, H_first, H_column)
                    # corrected
                retract(x1, dx, p, x0)
                # updated
                finish(x0, z, p, state)
            else:
                factor = 1.0{realigned}
                prior(current, p, x0, P0)
                nis[t, b] = 0.0
                fill(white, 0.0)
                started[b] = begin(x0, P0, factor, state, P1) or started[b]
                # begun
            pose(state, p, pose_now){watched}
            if covariances.shape[0] > 0 or not started[b]:
                keep(started[b], P1, pose_now, covariances, t, b)
"""

_GROWN = """
                if missing:
                    for i in range(p.shape[0]):
                        grown[i] = p[i]
                    noise = grown"""

_GROWN_ONE = """
                    ω, dt = squared(present, {start}, {stop}), p[{dt}]
                    grown[{i}] = max(grown[{i}], grow(p[{i}], age[b, {c}], ω, dt, dt**{power}, {constants}))"""

_REJECTED = f"""
            if restart and started[b]:
                reject(z, places, monitor[b], age[b, {{a}}], {IMPACT}, {IMPACT_SHARE}, {LONGEST_IMPACT})"""

_REALIGNED = """
                if lost:
                    realign(monitor[b], places, present, p[{dt}], current)
                    factor = monitor[b, {lost}]"""

_WATCHED = """
            if restart and started[b]:
                gather(present, z, pose_now, age[b, {c}], p[{dt}], {declination}, {always}, places, inputs)
                watch(monitor[b], inputs, watched)
                copy(watched, monitor[b])"""

# ``record`` is ``run`` with further lines in place of the comments: it keeps what the way back needs.
_RECORDED = {
    "def run(": "def record(",
    "whites, nis):": "whites, nis, stage, updated, entries, gains, factors, used):",
    "# corrected": "store(F, H, entries[t, b])\n"
    + " " * 20
    + "remember(K, S, rows, gains[t, b], factors[t, b], used[t, b])",
    "# updated": "stage[t, b] = 2\n                copy(x0, updated[t, b])",
    "# begun": "stage[t, b] = 1 if started[b] else 0\n                copy(x0, updated[t, b])",
}

_SMOOTH = '''
@jit
def smooth_sample(P, vector, information, error, work):
    # The smoothed error δ = P λ and covariance P − P Λ P, in place of P, after the measurement update.
    e = P.shape[0]
    for i in range(e):
        total = 0.0
        for k in range(e):
            total += P[i, k] * vector[k]
        error[i] = total
    product(information, P, work)
    reduce(P, work)
    for i in range(e):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@jit
def predict_back(F, vector, information, moved, work):
    # Fᵀ λ and Fᵀ Λ F: from before the measurement update of a sample to after that of the one before, in place.
    e = F.shape[0]
    fill(moved, 0.0)
    for k in range(e):
        for c in range(e):
            moved[c] += F[k, c] * vector[k]
    copy(moved, vector)
    product(information, F, work)
    transposed_product(F, work, information)
    for i in range(e):
        for j in range(i):
            information[i, j] = information[j, i] = 0.5 * (information[i, j] + information[j, i])


@jit
def smooth(Z, parameters, whites, records, later, covariances, poses):
    """Backward over a recorded stretch; covariances (in: those of the filter) and ``later`` are changed in place."""
    stage, updated, entries, gains, factors, used = records
    vector, information = later
    n, m, e = updated.shape[2], used.shape[2], vector.shape[1]
    x0, x1, error, V, B, y = np.empty(n), np.empty(n), np.empty(e), zeros(m, e), np.empty((2, m, m)), np.empty(m)
    F, H, work, moved = zeros(e, e), zeros(m, e), zeros(e, e), np.empty(e)
    constants(F, H)
    for back in range(Z.shape[0]):
        t = Z.shape[0] - 1 - back
        for b in range(Z.shape[1]):
            if stage[t, b] == 0:
                fill(poses[t, b], np.nan)
                continue
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            smooth_sample(covariances[t, b], vector[b], information[b], error, work)
            retract(updated[t, b], error, p, x1)
            if stage[t, b] == 2:
                finish(x1, Z[t, b], p, x0)
                fetch(entries[t, b], F, H)
                measured = gains[t, b], factors[t, b], used[t, b], whites[t, b]
                update_back(H, H_first, H_column, *measured, vector[b], information[b], V, B, y)
                predict_back(F, vector[b], information[b], moved, work)
            else:
                copy(x1, x0)
                fill(vector[b], 0.0)
                for i in range(e):
                    fill(information[b, i], 0.0)
            pose(x0, p, poses[t, b])
'''


def _lists(name: str, array: np.ndarray) -> list[str]:
    """The places in a matrix that can be other than zero, line by line, as two constants of a printed module."""
    lines = [[j for j, item in enumerate(line) if _number_of(item) != 0.0] for line in array]
    first = np.concatenate([[0], np.cumsum([len(line) for line in lines], dtype=int)])
    flat = [j for line in lines for j in line]
    return [f"{name}_first = np.array({first.tolist()}, np.int64)", f"{name}_column = np.array({flat}, np.int64)"]


def _number_of(item: Any) -> float | None:
    """The number that an element is, or None."""
    return item.value if isinstance(item, Expression) else float(item)


def _print_entries(F: np.ndarray, H: np.ndarray) -> tuple[list[str], int]:
    """Functions that keep and restore the elements of F and H that vary, and the number of these."""
    stored: list[str] = []
    fetched: list[str] = []
    constants: list[str] = []
    for name, array in (("F", F), ("H", H)):
        for i, j in np.ndindex(array.shape):
            item, number = f"{name}[{i}, {j}]", _number_of(array[i, j])
            if number is None:
                fetched.append(f"    {item} = kept[{len(stored)}]")
                stored.append(f"    kept[{len(stored)}] = {item}")
            elif number != 0.0:
                constants.append(f"    {item} = {number!r}")
    text = []
    for signature, lines in (
        ("store(F, H, kept)", stored),
        ("fetch(kept, F, H)", fetched),
        ("constants(F, H)", constants),
    ):
        text += ["", "", _INNER, f"def {signature}:", *lines, "    return"]
    return text, len(stored)


def _print_products(e: int) -> list[str]:
    """Products of ``(e, e)`` matrices: C ← A B, C ← Aᵀ B, and A ← A − A B. The sums of a row stay in registers."""
    text = []
    for head, factor, target, sign in (
        ("product(A, B, C)", "A[i, k]", "C", "+"),
        ("transposed_product(A, B, C)", "A[k, i]", "C", "+"),
        ("reduce(A, B)", "A[i, k]", "A", "-"),
    ):
        text += ["", "", "@jit", f"def {head}:", f"    for i in range({e}):"]
        for start in range(0, e, WIDTH):
            columns = range(start, min(start + WIDTH, e))
            text += [f"        s{j} = {f'A[i, {j}]' if sign == '-' else '0.0'}" for j in columns]
            text += [f"        for k in range({e}):", f"            f = {factor}"]
            text += [f"            s{j} {sign}= f * B[k, {j}]" for j in columns]
            if sign == "+":
                text += [f"        {target}[i, {j}] = s{j}" for j in columns]
        if sign == "-":
            text += [f"        {target}[i, {j}] = s{j}" for j in range(e)]
    return text


class UntraceableError(TypeError):
    """A method of a model that computes something that cannot be recorded."""


def print_shared() -> str:
    """Print the equations that belong to no model: the growth of a held input's noise and the monitor."""
    names = list(inspect.signature(grown).parameters)
    tape = Tape()
    growth = print_code({"value": np.array([grown(*(tape.node("input", name) for name in names))], dtype=object)})
    memory, inputs = tape.inputs("memory", MEMORY), tape.inputs("inputs", INPUTS)
    text = [_HEAD, "", "@jit", f"def grow({', '.join(names)}):", *growth[:-1]]
    text += [growth[-1].replace("value[0] =", "return"), "", "", "@jit", "def watch(memory, inputs, after):"]
    text += ["    fill(after, 0.0)", *print_code({"after": watch(memory, inputs)})]
    return "\n".join([*text, ""])


def _print_run(model: Equations, names: list[str], shared: str) -> str:
    """The loop over time, with what the model's held inputs and the monitor need."""
    channels = [channel.name for channel in model.channels]
    begins, dt, places = [*starts_of(model.channels).values()], names.index("dt"), places_of(model)
    begins.append(sum(channel.size for channel in model.channels))
    parts: dict[str, Any] = {
        "starts": begins,
        "dt": dt,
        "grown": "",
        "watched": "",
        "memory": "",
        "lost": "False",
        "realigned": "",
        "rejected": "",
    }
    head = []
    if model.held_inputs:
        head = [f"from {shared} import grow"]
        parts["grown"] = _GROWN
        for item in model.held_inputs:
            c = channels.index(item.channel)
            constants = ", ".join(repr(float(v)) for v in (item.spread, item.share, item.time, item.bound))
            place = {"i": names.index(item.parameter), "c": c, "start": begins[c], "stop": begins[c + 1]}
            parts["grown"] += _GROWN_ONE.format(**place, dt=dt, power=item.power, constants=constants)
    if places is not None:
        head += [f"from {shared} import watch", f"places = np.array({list(astuple(places))})"]
        declination = f"p[{names.index('declination')}]" if "declination" in names and places.field >= 0 else "0.0"
        parts["memory"] = f"\n    inputs, watched = np.empty({INPUTS}), np.empty({MEMORY})"
        parts["lost"] = f"restart and monitor[b, {LOST}] > 0.5"
        parts["realigned"] = _REALIGNED.format(dt=dt, lost=LOST)
        c, a = (channels.index(channel.name) for channel in (GYROSCOPE, ACCELEROMETER))
        parts["rejected"] = _REJECTED.format(a=a)
        parts["watched"] = _WATCHED.format(c=c, dt=dt, declination=declination, always=float(model.error_size > 0))
    return "\n".join([*head, _RUN.format(**parts)])


def print_model(model: Equations, shared: str = "shared") -> str:
    """Trace equations and print the module that runs them.

    Args:
        model: the equations.
        shared: name of the module that :func:`print_shared` has printed.

    Raises:
        ValueError: an equation returns another shape than the model's sizes say.
        UntraceableError: an equation branches on values, or uses functions that do not support traced numbers.
    """
    tape, kind = Tape(), type(model).__name__
    names = list(parameters_of(model))
    traced = with_parameters(model, dict(zip(names, tape.inputs("p", len(names)), strict=True)))
    width, n, e, m = (sum(c.size for c in model.channels), model.state_size, model.error_size, model.residual_size)
    x, dx = tape.inputs("x", n), tape.inputs("dx", e)
    z, previous = (split(tape.inputs(name, width), model.channels) for name in ("z", "previous"))
    shapes = {"xn": (n,), "P": (e, e), "F": (e, e), "Q": (e, e), "r": (m,), "H": (m, e), "R": (m, m)}
    shapes["out"] = (sum(quantity.size for quantity in model.outputs),)

    def posed() -> Any:
        pose = traced.pose(x)
        return np.concatenate([pose[quantity.name] for quantity in model.outputs])

    # Signature → the arrays that the function fills, and what gives them (an array or a tuple of arrays).
    equations: dict[str, tuple[tuple[str, ...], Callable[[], Any]]]
    if isinstance(traced, Model):
        equations = {
            "prior(z, p, xn, P)": (("xn", "P"), lambda: traced.prior(z)),
            "predict(x, z, previous, p, xn, F, Q)": (("xn", "F", "Q"), lambda: traced.predict(x, z, previous)),
            "residual(x, z, p, r, H, R)": (("r", "H", "R"), lambda: traced.residual(x, z)),
            "retract(x, dx, p, xn)": (("xn",), lambda: traced.retract(x, dx)),
        }
    elif isinstance(traced, Recurrence):
        equations = {
            "prior(z, p, xn, P)": (("xn",), lambda: traced.prior(z)),
            "predict(x, z, previous, p, xn, F, Q)": (("xn",), lambda: traced.predict(x, z, previous)),
            "residual(x, z, p, r, H, R)": ((), tuple),
            "retract(x, dx, p, xn)": (("xn",), lambda: x),
        }
    else:
        raise TypeError(f"{kind} is neither a Model nor a Recurrence")
    equations["finish(x, z, p, xn)"] = (("xn",), lambda: traced.finish(x, z))
    equations["pose(x, p, out)"] = (("out",), posed)
    text, jacobians = [_HEAD, ""], {"F": np.zeros((e, e)), "H": np.zeros((m, e))}
    for signature, (outputs, compute) in equations.items():
        where = f"{kind}.{signature.split('(')[0]}"
        try:
            found = compute()
        except Exception as reason:  # functions that do not know traced numbers raise whatever they like
            raise UntraceableError(f"{where}: {reason}") from reason
        found = found if isinstance(found, tuple) else (found,)
        arrays = {name: np.asarray(part, dtype=object) for name, part in zip(outputs, found, strict=True)}
        for name, array in arrays.items():
            if array.shape != shapes[name]:
                raise ValueError(f"{where}: {name} must have shape {shapes[name]}, got {array.shape}")
        jacobians |= {name: arrays[name] for name in ("F", "H") if name in arrays}
        # Zeros are not printed; matrices keep theirs between calls, vectors share their memory and are cleared.
        clear = [f"    fill({name}, 0.0)" for name in outputs if name in ("xn", "out", "r")]
        text += [_INNER, f"def {signature}:", *clear, *print_code(arrays), "    return", "", ""]
    run = _print_run(model, names, shared)
    text += [*_lists("F", jacobians["F"]), *_lists("H", jacobians["H"]), run]
    if isinstance(traced, Model):
        recorded = run
        for mark, line in _RECORDED.items():
            recorded = recorded.replace(mark, line)
        entries, count = _print_entries(jacobians["F"], jacobians["H"])
        text += [*entries, f"ENTRIES = {count}", *_print_products(e), recorded, _SMOOTH]
    return "\n".join(text)
