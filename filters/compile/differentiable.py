"""A compiled Kalman filter that gives derivatives: forward over a sequence, then backward through it.

The gradient of any number that depends on poses, covariances, innovations or the last state of a sequence, with respect
to the gains at every sample and to the first state. Start and restarts pass nothing on: a filter that has not started
begins at its prior, whose derivative is left out, and the monitor is off.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.model import Model, parameters_of, with_parameters
from ..core.quantity import Measurement
from ..core.sampling import FilterState, join, split
from .adjoint import gradient
from .cache import compile_now, load
from .emit import print_function
from .printer import print_model
from .run import CompiledEquations, compiled_equations
from .trace import Tape

_HEAD = """
import numpy as np
from numba.extending import intrinsic

from poise.filters.compile.adjoint_kernel import correct_back, gain_times, innovation, propagate_back, symmetric
from poise.filters.compile.cache import jit
from poise.filters.compile.emit import native
from poise.filters.compile.kernel import begin, copy, copy_matrix, correct, fill, propagate, scratch, take, zeros
from {primal} import F_column, F_first, H_column, H_first, finish, grow, pose, predict, prior, residual, retract

starts = np.array({starts})
"""

_LOOPS = """
@jit
def follow(x, P, held, age, started, Z, parameters, poses, covariances, whites, nis, logarithms,
           stages, xs, Ps, presents, befores, ages):
    # Forward; what the way back needs is kept: the state before each sample, and the samples as they were used.
    sizes = x.shape[1], P.shape[1], whites.shape[2], Z.shape[2], parameters.shape[2]
    vectors, square, measured, rows = scratch(*sizes)
    current, present, before, x1, x0, r, dx, noise = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white = Z[t, b], x[b], P[b], whites[t, b]
            copy(state, xs[t, b])
            copy_matrix(P1, Ps[t, b])
            take(z, held[b], age[b], starts, p[{dt}], current, present, before)
            copy(present, presents[t, b])
            copy(before, befores[t, b])
            copy(age[b], ages[t, b])
            logarithms[t, b] = 0.0
            if started[b]:
                grow(p, age[b], present, noise)
                predict(state, present, before, noise, x1, F, Q)
                propagate(F, P1, Q, work, F_first, F_column)
                residual(x1, z, p, r, H, R)
                for a in range(r.shape[0]):
                    S[a, a] = 1.0
                nis[t, b] = correct(r, H, R, P1, dx, white, rows, S, HP, K, H_first, H_column)
                if nis[t, b] != 0.0:
                    for a in range(r.shape[0]):
                        logarithms[t, b] += 2.0 * np.log(S[a, a])
                retract(x1, dx, p, x0)
                finish(x0, z, p, state)
                stages[t, b] = 2
            else:
                prior(current, p, x0, P0)
                nis[t, b] = 0.0
                fill(white, 0.0)
                started[b] = begin(x0, P0, 1.0, state, P1)
                stages[t, b] = 1 if started[b] else 0
            pose(state, p, poses[t, b])
            if not started[b]:
                fill(poses[t, b], np.nan)
            copy_matrix(P1, covariances[t, b])


@jit
def back(Z, parameters, stages, xs, Ps, presents, befores, ages, gposes, gcovariances, gnis, glogarithms,
         gx, gP, gparameters):
    # Backward; gx and gP, in: of the last state, out: of the first.
    n, e, m, w = xs.shape[2], Ps.shape[2], {m}, parameters.shape[2]
    x1, x2, x3, r, dx, noise, y = (
        np.empty(n), np.empty(n), np.empty(n), np.empty(m), np.empty(e), np.empty(w), np.empty(m)
    )
    F, Q, P1, square, H, R = zeros(e, e), zeros(e, e), zeros(e, e), zeros(e, e), zeros(m, e), zeros(m, m)
    A, S, W, factor = zeros(e, m), zeros(m, m), zeros(m, m), zeros(m, m)
    rows = np.empty(m, np.int64)
    gr, gH, gR, gdx, gF = np.empty(m), zeros(m, e), zeros(m, m), np.empty(e), zeros(e, e)
    more, passed, gp = np.empty(n), np.empty(n), np.empty({k})
    work = zeros(e, m), zeros(e, m), zeros(m, m), np.empty(m)
    for back in range(Z.shape[0]):
        t = Z.shape[0] - 1 - back
        for b in range(Z.shape[1]):
            if stages[t, b] == 0:
                continue
            if stages[t, b] == 1:
                fill(gx[b], 0.0)
                for i in range(e):
                    fill(gP[b, i], 0.0)
                continue
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, present, before = Z[t, b], presents[t, b], befores[t, b]
            # the sample again
            grow(p, ages[t, b], present, noise)
            predict(xs[t, b], present, before, noise, x1, F, Q)
            copy_matrix(Ps[t, b], P1)
            propagate(F, P1, Q, square, F_first, F_column)
            residual(x1, z, p, r, H, R)
            count, _ = innovation(r, H, R, P1, rows, A, S, W, y, factor)
            gain_times(A, y, count, dx)
            retract(x1, dx, p, x2)
            finish(x2, z, p, x3)
            # and back
            pose_back(x3, p, gposes[t, b], more)
            for i in range(n):
                gx[b, i] += more[i]
            for i in range(e):
                for j in range(e):
                    gP[b, i, j] += gcovariances[t, b, i, j]
            symmetric(gP[b])
            finish_back(x2, z, p, gx[b], passed, gp)
            for i in range({k}):
                gparameters[t, b, i] += gp[i]
            retract_back(x1, dx, p, passed, more, gdx, gp)
            for i in range({k}):
                gparameters[t, b, i] += gp[i]
            correct_back(
                H, P1, rows, count, A, W, y, gdx, gP[b], gnis[t, b], glogarithms[t, b], gr, gH, gR, work
            )
            if count > 0:
                residual_back(x1, z, p, gr, gH, gR, passed, gp)
                for i in range(n):
                    more[i] += passed[i]
                for i in range({k}):
                    gparameters[t, b, i] += gp[i]
            for i in range(e):
                copy(gP[b, i], Q[i])
            propagate_back(F, Ps[t, b], gP[b], gF, square)
            predict_back(xs[t, b], present, before, noise, more, gF, Q, gx[b], gp)
            for i in range(e):
                fill(Q[i], 0.0){share}
            for i in range({k}):
                gparameters[t, b, i] += gp[i]
"""

_SHARE = """
            if noise[{i}] > 0.0:
                gp[{g}] *= p[{i}] / noise[{i}]"""


def print_back(model: Model, primal: str, gains: Sequence[str]) -> str:
    """Print the module that runs a model forward and backward.

    Args:
        model: the equations.
        primal: name of the module of :func:`.printer.print_model`.
        gains: with respect to which the derivatives are taken.
    """
    tape = Tape()
    names = list(parameters_of(model))
    p = tape.inputs("p", len(names))
    traced = with_parameters(model, dict(zip(names, p, strict=True)))
    places = [names.index(model.gains[name].parameter) for name in gains]
    width, n, e, m = (sum(c.size for c in model.channels), model.state_size, model.error_size, model.residual_size)
    x, dx, raw = tape.inputs("x", n), tape.inputs("dx", e), tape.inputs("z", width)
    z, previous = split(raw, model.channels), split(tape.inputs("previous", width), model.channels)

    pose = traced.pose(x)
    posed = np.concatenate([np.asarray(pose[quantity.name], dtype=object) for quantity in model.outputs])
    tuned = [p[place] for place in places]
    functions: dict[str, tuple[Any, Sequence[np.ndarray], dict[str, Sequence[Any]], str]] = {
        "predict_back(x, z, previous, p, gxn, gF, gQ, gx, gp)": (
            traced.predict(x, z, previous),
            (tape.inputs("gxn", n), tape.inputs("gF", e, e), tape.inputs("gQ", e, e)),
            {"gx": list(x), "gp": tuned},
            "",
        ),
        "residual_back(x, z, p, gr, gH, gR, gx, gp)": (
            traced.residual(x, z),
            (tape.inputs("gr", m), tape.inputs("gH", m, e), tape.inputs("gR", m, m)),
            {"gx": list(x), "gp": tuned},
            "z",
        ),
        "retract_back(x, dx, p, gxn, gx, gdx, gp)": (
            (traced.retract(x, dx),),
            (tape.inputs("gxn", n),),
            {"gx": list(x), "gdx": list(dx), "gp": tuned},
            "",
        ),
        "finish_back(x, z, p, gxn, gx, gp)": (
            (traced.finish(x, z),),
            (tape.inputs("gxn", n),),
            {"gx": list(x), "gp": tuned},
            "z",
        ),
        "pose_back(x, p, gout, gx)": ((posed,), (tape.inputs("gout", len(posed)),), {"gx": list(x)}, ""),
    }
    begins = [0, *np.cumsum([channel.size for channel in model.channels]).tolist()]
    dt = names.index("dt")
    share = ""
    for i in {names.index(item.parameter): None for item in model.held_inputs}:
        share += "".join(_SHARE.format(i=i, g=g) for g, place in enumerate(places) if place == i)
    text = [_HEAD.format(primal=primal, starts=begins)]
    sizes = {"x": n, "dx": e, "p": len(names), "gx": n, "gdx": e, "gp": len(tuned), "gxn": n, "gr": m}
    sizes |= dict.fromkeys(("z", "previous"), width) | {"gout": len(posed)}
    shapes: dict[str, tuple[int, ...]] = {name: (size,) for name, size in sizes.items()}
    shapes |= {"gF": (e, e), "gQ": (e, e), "gH": (m, e), "gR": (m, m)}
    for signature, (outputs, given, wanted, unknown) in functions.items():
        arrays = [np.asarray(array, dtype=object) for array in outputs]
        inputs = [item for part in wanted.values() for item in part]
        found = gradient(arrays, given, inputs, unknown)
        parts, start = {}, 0
        for name, part in wanted.items():
            parts[name] = found[start : start + len(part)]
            start += len(part)
        name, _, arguments = signature.rstrip(")").partition("(")
        text.append(print_function(name, {argument: shapes[argument] for argument in arguments.split(", ")}, parts))
    text.append(_LOOPS.format(share=share, dt=dt, m=m, k=len(places)))
    return "\n".join(text)


class Followed(NamedTuple):
    """What a filter did over a sequence, arrays ``(T, B, …)``, and what the way back needs."""

    poses: np.ndarray
    covariances: np.ndarray
    whites: np.ndarray
    nis: np.ndarray
    logarithms: np.ndarray
    """log det S of each update, 0 where there was none"""
    records: tuple[np.ndarray, ...]


class DifferentiableEquations:
    """The compiled forward and backward passes of one class of equations.

    Args:
        kalman: the filter.
        gains: names of its gains, in the order of the derivatives; None for all.

    Raises:
        TypeError: the model cannot be compiled.
    """

    def __init__(self, kalman: KalmanFilter, gains: Sequence[str] | None = None) -> None:
        form = compiled_equations(kalman.model)
        if form is None:
            raise TypeError(f"{type(kalman.model).__name__} cannot be compiled, which derivatives need")
        self.form: CompiledEquations = form
        self.model = kalman.model
        self.gains = tuple(kalman.gains if gains is None else gains)
        self.base = np.array([*parameters_of(self.model).values()])
        self.scaled = [self.model.gains[name] for name in self.gains]
        self.columns = [form.names.index(gain.parameter) for gain in self.scaled]
        primal = load(print_model(self.model), type(self.model).__name__).__name__
        self.module = load(print_back(self.model, primal, self.gains), f"{type(self.model).__name__}_back")

    def with_model(self, model: Model) -> Self:
        """The same passes with the constants of another model of the same class and structure."""
        other = copy.copy(self)
        other.model, other.base = model, np.array([*parameters_of(model).values()])
        return other

    def parameters(self, factors: np.ndarray) -> np.ndarray:
        """Parameters ``(T, B, count)`` for log factors ``(T, B, gains)``."""
        table = np.broadcast_to(self.base, (*factors.shape[:2], self.base.shape[-1])).copy()
        for index, (gain, column) in enumerate(zip(self.scaled, self.columns, strict=True)):
            scaled = self.base[..., column] * np.exp(gain.power * factors[..., index])
            table[:, :, column] = np.minimum(scaled, gain.maximum)
        return table

    def of_rows(self, models: Sequence[Model]) -> DifferentiableEquations:
        """The same for sequences side by side that differ in the numbers of their equations: one model a sequence."""
        changed = copy.copy(self)
        changed.base = np.array([[*parameters_of(model).values()] for model in models])
        return changed

    def follow(
        self, state: FilterState, measurements: Measurement, factors: np.ndarray
    ) -> tuple[Followed, FilterState]:
        """Forward over samples ``(T, B, size)`` from a state of batch shape ``(B,)``, with log factors a sample."""
        Z = np.ascontiguousarray(join(measurements, self.model.channels), dtype=float)
        length, count = Z.shape[:2]
        n, e, m, d = self.model.state_size, self.model.error_size, self.model.residual_size, Z.shape[2]
        table = self.parameters(factors)
        x, P, held, age, monitor, started = (np.array(part) for part in state)
        shapes = ((self.form.pose_size,), (e, e), (m,), (), ())
        outputs: list[np.ndarray] = [np.empty((length, count, *shape)) for shape in shapes]
        sizes = ((n,), (e, e), (d,), (d,), (age.shape[-1],))
        records = [np.zeros((length, count), np.int64), *(np.empty((length, count, *size)) for size in sizes)]
        compile_now(
            self.module.follow,
            (x, P, held, age, started, Z, table, *outputs, *records),
            f"{type(self.model).__name__} (derivatives)",
        )
        poses, covariances, whites, nis, logarithms = outputs
        followed = Followed(poses, covariances, whites, nis, logarithms, (Z, table, *records))
        return followed, FilterState(x, P, held, age, monitor, started)

    def back(
        self,
        followed: Followed,
        poses: np.ndarray,
        covariances: np.ndarray,
        nis: np.ndarray,
        logarithms: np.ndarray,
        x: np.ndarray,
        P: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives with respect to the log factors ``(T, B, gains)``, the first state and its covariance.

        Args:
            followed: of :meth:`follow`.
            poses: derivative of the final number with respect to those in ``followed``, of their shape.
            covariances: likewise.
            nis: likewise.
            logarithms: likewise.
            x: with respect to the last state ``(B, n)``.
            P: with respect to its covariance ``(B, e, e)``.
        """
        Z, table, *records = followed.records
        gx, gP, found = np.array(x), np.array(P), np.zeros((*Z.shape[:2], len(self.gains)))
        given = [np.ascontiguousarray(part, dtype=float) for part in (poses, covariances, nis, logarithms)]
        compile_now(
            self.module.back, (Z, table, *records, *given, gx, gP, found), f"{type(self.model).__name__} (derivatives)"
        )
        for index, (gain, column) in enumerate(zip(self.scaled, self.columns, strict=True)):
            values = table[:, :, column]
            found[..., index] *= np.where(values < gain.maximum, gain.power * values, 0.0)
        return found, gx, gP
