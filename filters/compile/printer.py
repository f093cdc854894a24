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
from ..core.monitor import INFLATION, INPUTS, LOST, MEMORY, places_of, starts_of, watch
from ..core.quantity import GYROSCOPE
from ..core.sampling import split
from .trace import Tape, print_code

_HEAD = """
from math import *

import numpy as np
from numba import njit

from poise.filters.compile.cache import jit
from poise.filters.compile.kernel import (
    begin, copy, copy_matrix, correct, fill, gather, keep, propagate, realign, scratch, squared, take, zeros
)
from poise.filters.compile.smoothing import smooth_step

inf, nan = np.inf, np.nan
"""

_INNER = '@njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)'

_RUN = """
starts = np.array({starts})


@jit
def run(x, P, held, age, monitor, started, Z, parameters, restart, poses, covariances, whites, nis):
    # All ticks of all sequences of a batch; the state, x to started, is changed in place.
    sizes = x.shape[1], P.shape[1], whites.shape[2], Z.shape[2], parameters.shape[2]
    vectors, square, measured, lists = scratch(*sizes)
    current, present, before, x1, x0, r, dx, grown = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured
    every, first, column, rows = lists{memory}
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white, pose_now = Z[t, b], x[b], P[b], whites[t, b], poses[t, b]
            missing = take(z, held[b], age[b], starts, p[{dt}], current, present, before)
            lost = {lost}
            if started[b] and not lost:
                noise = p{grown}
                predict(state, present, before, noise, x1, F, Q)
                if P1.shape[0] > 0:
                    propagate(F, P1, Q, work, every, first, column)
                    # predicted
                    residual(x1, z, p, r, H, R)
                    nis[t, b] = correct(r, H, R, P1, dx, white, rows, S, HP, K, first, column)
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
                    ω = squared(present, {start}, {stop})
                    grown[{i}] = grow(p[{i}], age[b, {c}], ω, p[{dt}], p[{dt}]**{power}, {constants})"""

_REALIGNED = """
                if lost:
                    realign(monitor[b], places, present, p[{dt}], current)
                    factor = {inflation}"""

_WATCHED = """
            if restart and started[b]:
                gather(present, z, pose_now, age[b, {c}], p[{dt}], {declination}, {always}, places, inputs)
                watch(monitor[b], inputs, watched)
                copy(watched, monitor[b])"""

# ``record`` is ``run`` with further lines in place of the comments: it keeps what the way back needs.
_RECORDED = {
    "def run(": "def record(",
    "whites, nis):": "whites, nis, stage, updated, corrections, transitions, predictions):",
    "# predicted": "copy_matrix(F, transitions[t, b])\n                    copy_matrix(P1, predictions[t, b])",
    "# updated": "stage[t, b] = 2\n"
    + " " * 16
    + "copy(x0, updated[t, b])\n"
    + " " * 16
    + "copy(dx, corrections[t, b])",
    "# begun": "stage[t, b] = 1 if started[b] else 0\n                copy(x0, updated[t, b])",
}

_SMOOTH = '''
@jit
def smooth(Z, parameters, stage, updated, corrections, transitions, predictions, later, covariances, poses):
    """Backward over a recorded stretch; covariances (in: those of the filter) and ``later`` are changed in place."""
    linked, error, smoothed, F, predicted = later
    n, e = updated.shape[2], error.shape[1]
    x0, x1, gain, work, scale = np.empty(n), np.empty(n), zeros(e, e), zeros(e, e), np.empty(e)
    for back in range(Z.shape[0]):
        t = Z.shape[0] - 1 - back
        for b in range(Z.shape[1]):
            if stage[t, b] == 0:
                fill(poses[t, b], np.nan)
                linked[b] = False
                continue
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            if linked[b]:
                smooth_step(covariances[t, b], F[b], predicted[b], error[b], smoothed[b], gain, work, scale)
            else:
                fill(error[b], 0.0)
                copy_matrix(covariances[t, b], smoothed[b])
            retract(updated[t, b], error[b], p, x1)
            if stage[t, b] == 2:
                finish(x1, Z[t, b], p, x0)
            else:
                copy(x1, x0)
            pose(x0, p, poses[t, b])
            copy_matrix(smoothed[b], covariances[t, b])
            linked[b] = stage[t, b] == 2
            if linked[b]:
                for i in range(e):
                    error[b, i] += corrections[t, b, i]
                copy_matrix(transitions[t, b], F[b])
                copy_matrix(predictions[t, b], predicted[b])
'''


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
        parts["realigned"] = _REALIGNED.format(dt=dt, inflation=INFLATION)
        c = channels.index(GYROSCOPE.name)
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
    text = [_HEAD, ""]
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
        # Zeros are not printed; matrices keep theirs between calls, vectors share their memory and are cleared.
        clear = [f"    fill({name}, 0.0)" for name in outputs if name in ("xn", "out", "r")]
        text += [_INNER, f"def {signature}:", *clear, *print_code(arrays), "    return", "", ""]
    run = _print_run(model, names, shared)
    text.append(run)
    if isinstance(traced, Model):
        recorded = run
        for mark, line in _RECORDED.items():
            recorded = recorded.replace(mark, line)
        text += [recorded, _SMOOTH]
    return "\n".join(text)
