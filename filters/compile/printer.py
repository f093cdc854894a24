"""Equations → text of a module whose function ``run`` runs them over time, and ``record`` and ``smooth`` back again.

A model runs once on recorded scalars (:mod:`.trace`), which become machine code without numba's analysis
(:mod:`.emit`); its floats stay parameters, so one printed module serves every tuning, sampling interval and gain. What
is the same for every model is imported from :mod:`.kernel`. A method without covariance is a Kalman filter whose error
state and measurement are empty.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.held_inputs import grown_parameters
from ..core.model import Equations, Model, Recurrence, parameters_of, with_parameters
from ..core.monitor import LOST, MEMORY, inputs_of, places_of, realigned, starts_of, watch, without_impacts
from ..core.quantity import ACCELEROMETER, GYROSCOPE
from ..core.sampling import split
from .emit import print_function
from .trace import Expression, Tape

_HEAD = """
import numpy as np
from numba.extending import intrinsic

from poise.filters.compile.cache import jit
from poise.filters.compile.emit import native
from poise.filters.compile.kernel import begin, copy, correct, fill, keep, propagate, scratch, take, zeros
from poise.filters.compile.smoothing import remember, update_back
"""

WIDTH = 10
"""Columns of a product that are summed at a time."""

_RUN = """
starts = np.array({starts})


@jit
def run(x, P, held, age, monitor, started, Z, parameters, restart, poses, covariances, whites, nis):
    # All time steps of all sequences of a batch; the state, x to started, is changed in place.
    sizes = x.shape[1], P.shape[1], whites.shape[2], Z.shape[2], parameters.shape[2]
    vectors, square, measured, rows = scratch(*sizes)
    current, present, before, x1, x0, r, dx, grown = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white, pose_now = Z[t, b], x[b], P[b], whites[t, b], poses[t, b]{rejected}
            missing = take(z, held[b], age[b], starts, p[{dt}], current, present, before)
            lost = {lost}
            if started[b] and not lost:
                noise = p
                if missing:
                    grow(p, age[b], present, grown)
                    noise = grown
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

_REJECTED = """
            if restart and started[b]:
                reject(z, monitor[b], age[b])"""

_REALIGNED = f"""
                if lost:
                    realign(current, monitor[b], p)
                    factor = monitor[b, {LOST}]"""

_WATCHED = """
            if restart and started[b]:
                watch(monitor[b], present, z, state, pose_now, age[b], p)"""

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


def _print_entries(tape: Tape, F: np.ndarray, H: np.ndarray, shapes: dict[str, tuple[int, ...]]) -> list[str]:
    """Functions that keep and restore the elements of F and H that vary, and the number of these."""
    varying = {"F": np.zeros(F.shape, dtype=object), "H": np.zeros(H.shape, dtype=object)}
    constants = {"F": varying["F"].copy(), "H": varying["H"].copy()}
    kept: list[Any] = []
    for name, array in (("F", F), ("H", H)):
        elements = tape.inputs(name, *array.shape)
        for place in np.ndindex(array.shape):
            value = _number_of(array[place])
            if value is None:
                varying[name][place] = tape.node("input", "kept", len(kept))
                kept.append(elements[place])
            else:
                constants[name][place] = value
    shapes = {"kept": (len(kept),)} | shapes
    functions = [
        print_function("store", {name: shapes[name] for name in ("F", "H", "kept")}, {"kept": np.array(kept)}),
        print_function("fetch", {name: shapes[name] for name in ("kept", "F", "H")}, varying),
        print_function("constants", {name: shapes[name] for name in ("F", "H")}, constants),
    ]
    return [*functions, f"ENTRIES = {len(kept)}"]


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


def _recursion(traced: Equations, tape: Tape, names: list[str]) -> tuple[dict[str, Any], str]:
    """What the recursion needs beside a model's equations, and the loop over time.

    Returns the functions as in :func:`print_model`.
    """
    channels, places = [channel.name for channel in traced.channels], places_of(traced)
    begins = [*starts_of(traced.channels).values(), sum(channel.size for channel in traced.channels)]
    parts = {"starts": begins, "dt": names.index("dt"), "lost": "False", "rejected": "", "realigned": "", "watched": ""}
    p, age, x = tape.inputs("p", len(names)), tape.inputs("age", len(channels)), tape.inputs("x", traced.state_size)
    present, current, z = (tape.inputs(name, begins[-1]) for name in ("present", "current", "z"))

    def grow() -> Any:
        grown = grown_parameters(traced, age, split(present, traced.channels))
        return np.array([grown.get(name, value) for name, value in zip(names, p, strict=True)])

    functions: dict[str, Any] = {"grow(p, age, present, grown)": (("grown",), grow)}
    if places is not None:
        memory, posed = tape.inputs("memory", MEMORY), tape.inputs("posed", sum(part.size for part in traced.outputs))
        of_rate, of_force = (age[i : i + 1] for i in map(channels.index, (GYROSCOPE.name, ACCELEROMETER.name)))
        functions["reject(z, memory, age)"] = ("z",), lambda: without_impacts(places, z, memory, of_force)
        functions["realign(current, memory, p)"] = (("current",), lambda: realigned(places, current, memory, traced.dt))
        functions["watch(memory, present, z, x, posed, age, p)"] = (
            ("memory",),
            lambda: watch(memory, inputs_of(traced, places, present, z, x, posed, of_rate)),
        )
        lost = f"restart and monitor[b, {LOST}] > 0.5"
        parts |= {"lost": lost, "rejected": _REJECTED, "realigned": _REALIGNED, "watched": _WATCHED}
    return functions, _RUN.format(**parts)


def print_model(model: Equations) -> str:
    """Trace equations and print the module that runs them.

    Args:
        model: the equations.

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
    shapes: dict[str, tuple[int, ...]] = {"x": (n,), "dx": (e,), "p": (len(names),), "grown": (len(names),)}
    shapes |= dict.fromkeys(("z", "previous", "present", "current"), (width,))
    shapes |= {"xn": (n,), "P": (e, e), "F": (e, e), "Q": (e, e), "r": (m,), "H": (m, e), "R": (m, m)}
    shapes |= {"memory": (MEMORY,), "age": (len(model.channels),), "posed": (sum(part.size for part in model.outputs),)}

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
    equations["pose(x, p, posed)"] = (("posed",), posed)
    more, run = _recursion(traced, tape, names)
    text, jacobians = [_HEAD, ""], {"F": np.zeros((e, e)), "H": np.zeros((m, e))}
    for signature, (outputs, compute) in (equations | more).items():
        name, _, arguments = signature.rstrip(")").partition("(")
        where = f"{kind}.{name}"
        try:
            with np.errstate(all="ignore"):  # constants that are not numbers stand for what is missing
                found = compute()
        except Exception as reason:  # functions that do not know traced numbers raise whatever they like
            raise UntraceableError(f"{where}: {reason}") from reason
        found = found if isinstance(found, tuple) else (found,)
        arrays = {output: np.asarray(part, dtype=object) for output, part in zip(outputs, found, strict=True)}
        for output, array in arrays.items():
            if array.shape != shapes[output]:
                raise ValueError(f"{where}: {output} must have shape {shapes[output]}, got {array.shape}")
        jacobians |= {output: arrays[output] for output in ("F", "H") if output in arrays}
        # Matrices keep their zeros between calls.
        text.append(print_function(name, {argument: shapes[argument] for argument in arguments.split(", ")}, arrays))
    text += [*_lists("F", jacobians["F"]), *_lists("H", jacobians["H"]), run]
    if isinstance(traced, Model):
        recorded = run
        for mark, line in _RECORDED.items():
            recorded = recorded.replace(mark, line)
        text += [*_print_entries(tape, jacobians["F"], jacobians["H"], shapes), *_print_products(e), recorded, _SMOOTH]
    return "\n".join(text)
