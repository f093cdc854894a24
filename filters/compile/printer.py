"""Equations → text of a module whose function ``run`` runs them over time, and ``record`` and ``smooth`` back again.

A model runs once on recorded scalars (:mod:`.trace`); its floats stay parameters, so one printed module serves every
tuning, sampling interval and gain. What is the same for every model is imported from :mod:`.kernel`. A method without
covariance is a Kalman filter whose error state and measurement are empty.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.model import Equations, Model, Recurrence, parameters_of, with_parameters
from ..core.sampling import split
from .trace import Tape, print_code

_HEAD = """
from math import *

import numpy as np
from numba import njit

from poise.filters.compile.cache import jit
from poise.filters.compile.kernel import begin, copy, copy_matrix, correct, fill, keep, propagate, scratch, take, zeros
from poise.filters.compile.smoothing import smooth_step

inf, nan = np.inf, np.nan

"""

_INNER = '@njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)'

_RUN = '''
@jit
def run(x, P, held, started, Z, parameters, poses, covariances, whites, nis):
    """All ticks of all sequences of a batch; x, P, held and started are changed in place."""
    vectors, square, measured, lists = scratch(x.shape[1], P.shape[1], whites.shape[2], Z.shape[2])
    current, present, before, x1, x0, r, dx = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured
    every, first, column, rows = lists
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white = Z[t, b], x[b], P[b], whites[t, b]
            take(z, held[b], current, present, before)
            if started[b]:
                predict(state, present, before, p, x1, F, Q)
                if P1.shape[0] > 0:
                    propagate(F, P1, Q, work, every, first, column)
                    # predicted
                    residual(x1, z, p, r, H, R)
                    nis[t, b] = correct(r, H, R, P1, dx, white, rows, S, HP, K, first, column)
                retract(x1, dx, p, x0)
                # updated
                finish(x0, z, p, state)
            else:
                prior(current, p, x0, P0)
                nis[t, b] = 0.0
                fill(white, 0.0)
                started[b] = begin(x0, P0, state, P1)
                # begun
            pose(state, p, poses[t, b])
            if covariances.shape[0] > 0 or not started[b]:
                keep(started[b], P1, poses[t, b], covariances, t, b)
'''

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


def print_model(model: Equations) -> str:
    """Trace equations and print the module that runs them.

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
    text = [_HEAD]
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
    text.append(_RUN.lstrip("\n"))
    if isinstance(traced, Model):
        recorded = _RUN
        for mark, line in _RECORDED.items():
            recorded = recorded.replace(mark, line)
        text += [recorded, _SMOOTH]
    return "\n".join(text)
