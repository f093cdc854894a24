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
from .cache import compile_now
from .emit import print_function
from .run import CompiledEquations, compiled_equations
from .trace import Tape


def print_back(model: Model, gains: Sequence[str]) -> tuple[dict[str, str], list[int]]:
    """Print the derivatives of a model's functions.

    Args:
        model: the equations.
        gains: with respect to which the derivatives are taken.

    Returns:
        Name → printed function; pairs one after the other: a parameter that grows with the age of a sample, and its
        gain.
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
    shares = [
        number
        for i in {names.index(item.parameter): None for item in model.held_inputs}
        for g, place in enumerate(places)
        if place == i
        for number in (i, g)
    ]
    sizes = {"x": n, "dx": e, "p": len(names), "gx": n, "gdx": e, "gp": len(tuned), "gxn": n, "gr": m}
    sizes |= dict.fromkeys(("z", "previous"), width) | {"gout": len(posed)}
    shapes: dict[str, tuple[int, ...]] = {name: (size,) for name, size in sizes.items()}
    shapes |= {"gF": (e, e), "gQ": (e, e), "gH": (m, e), "gR": (m, m)}
    printed = {}
    for signature, (outputs, given, wanted, unknown) in functions.items():
        arrays = [np.asarray(array, dtype=object) for array in outputs]
        inputs = [item for part in wanted.values() for item in part]
        found = gradient(arrays, given, inputs, unknown)
        parts, start = {}, 0
        for name, part in wanted.items():
            parts[name] = found[start : start + len(part)]
            start += len(part)
        name, _, arguments = signature.rstrip(")").partition("(")
        printed[name] = print_function(name, {argument: shapes[argument] for argument in arguments.split(", ")}, parts)
    return printed, shares


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
        # numba is imported here, since commands that run no filter need not wait for it
        from . import adjoint_loops, native

        self.loops = adjoint_loops
        printed, shares = print_back(self.model, self.gains)
        found = native.addresses(printed, f"{type(self.model).__name__}_back")
        self.own = np.array([*(found[name] for name in adjoint_loops.BACK), *shares], np.int64)

    def with_model(self, model: Model) -> Self:
        """The same passes with the constants of another model of the same class and structure."""
        other = copy.copy(self)
        other.model, other.base = model, np.array([*parameters_of(model).values()])
        return other

    def parameters(self, factors: np.ndarray) -> np.ndarray:
        """Parameters ``(T, B, count)`` for log factors ``(T, B, gains)``."""
        table = np.broadcast_to(self.base, (*factors.shape[:2], self.base.shape[-1])).copy()
        for index, (gain, column) in enumerate(zip(self.scaled, self.columns, strict=True)):
            table[:, :, column] = gain.scaled(self.base[..., column], factors[..., index])
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
        forward = x, P, held, age, started, Z, table, *outputs, tuple(records), self.form.plan
        compile_now(self.loops.follow, forward, "the filters' derivatives")
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
        given = tuple(np.ascontiguousarray(part, dtype=float) for part in (poses, covariances, nis, logarithms))
        backward = Z, table, tuple(records), given, gx, gP, found, self.form.plan, self.own
        compile_now(self.loops.back, backward, "the filters' derivatives")
        for index, (gain, column) in enumerate(zip(self.scaled, self.columns, strict=True)):
            values = table[:, :, column]
            found[..., index] *= np.where(values < gain.maximum, gain.power * values, 0.0)
        return found, gx, gP
