"""Equations → printed functions, and the places in F and H that can be other than zero.

A model runs once on recorded scalars (:mod:`.trace`), which become machine code without numba's analysis
(:mod:`.emit`); its floats stay parameters, so one form serves every tuning, sampling interval and gain. The loops that
call these functions are the same for every model (:mod:`.loops`, :mod:`.smoothing`). A method without covariance is a
Kalman filter whose error state and measurement are empty.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..core.held_inputs import coarse_rows, grown_parameters, longest_gap, rotation_part
from ..core.model import Equations, Model, Recurrence, parameters_of, with_parameters
from ..core.monitor import MEMORY, inputs_of, places_of, realigned, starts_of, watch, without_impacts
from ..core.quantity import ACCELEROMETER, GYROSCOPE, MAGNETOMETER
from ..core.sampling import split
from .emit import print_function
from .trace import Expression, Tape


class Printed(NamedTuple):
    """A model as compiled loops need it."""

    functions: dict[str, str]
    """name → printed function: the equations, what the recursion needs besides, and ``store``, ``fetch``, ``constants``
    of the elements of F and H that vary"""
    lists: tuple[list[int], ...]
    """first elements of the channels in a sample; of F and of H the lists of elements that can be other than zero; the
    channels that are held inputs, where the equations start anew after a gap of all of them"""
    dt: int
    """place of the sampling interval among the parameters"""
    entries: int
    """number of elements of F and H that vary"""
    longest: float
    """s, of that gap"""
    tilt: int
    """first element of the rotation in the error of equations that may be levelled anew; −1 of others"""
    field: int
    """first element of the magnetometer in a sample, likewise"""


def _lists(array: np.ndarray) -> tuple[list[int], list[int]]:
    """The places in a matrix that can be other than zero: line i has ``column[first[i]:first[i + 1]]``."""
    lines = [[j for j, item in enumerate(line) if _number_of(item) != 0.0] for line in array]
    first = np.concatenate([[0], np.cumsum([len(line) for line in lines], dtype=int)])
    return first.tolist(), [j for line in lines for j in line]


def _number_of(item: Any) -> float | None:
    """The number that an element is, or None."""
    return item.value if isinstance(item, Expression) else float(item)


def _print_entries(
    tape: Tape, F: np.ndarray, H: np.ndarray, shapes: dict[str, tuple[int, ...]]
) -> tuple[dict[str, str], int]:
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
    both = {name: shapes[name] for name in ("F", "H")}
    keeping = {"kept": shapes["kept"]}
    functions = {
        "store": print_function("store", both | keeping, {"kept": np.array(kept)}),
        "fetch": print_function("fetch", keeping | both, varying),
        "constants": print_function("constants", both, constants),
    }
    return functions, len(kept)


class UntraceableError(TypeError):
    """A method of a model that computes something that cannot be recorded."""


def _recursion(traced: Equations, tape: Tape, names: list[str], begins: list[int]) -> dict[str, Any]:
    """What the recursion needs beside a model's equations: functions as in :func:`print_model`."""
    channels, places = [channel.name for channel in traced.channels], places_of(traced)
    p, age, x = tape.inputs("p", len(names)), tape.inputs("age", len(channels)), tape.inputs("x", traced.state_size)
    present, current, z = (tape.inputs(name, begins[-1]) for name in ("present", "current", "z"))
    P = tape.inputs("P", traced.error_size, traced.error_size)

    def grow() -> Any:
        grown = grown_parameters(traced, age, split(present, traced.channels), P)
        return np.array([grown.get(name, value) for name, value in zip(names, p, strict=True)])

    functions: dict[str, Any] = {"grow(p, age, present, P, grown)": (("grown",), grow)}
    if places is not None:
        memory, posed = tape.inputs("memory", MEMORY), tape.inputs("posed", sum(part.size for part in traced.outputs))
        of_rate, of_force = (age[i : i + 1] for i in map(channels.index, (GYROSCOPE.name, ACCELEROMETER.name)))
        functions["reject(z, memory, age)"] = ("z",), lambda: without_impacts(places, z, memory, of_force)
        functions["realign(current, memory, p)"] = (("current",), lambda: realigned(places, current, memory, traced.dt))
        functions["watch(memory, present, z, x, posed, age, p)"] = (
            ("memory",),
            lambda: watch(memory, inputs_of(traced, places, present, z, x, posed, of_rate)),
        )
        if rotation_part(traced) >= 0:
            # Its Jacobian can be other than zero where that of the residual can, and in the first two rows elsewhere.
            functions["level(x, z, P, p, r, H, R)"] = (
                ("r", "H", "R"),
                lambda: coarse_rows(traced, x, split(z, traced.channels), P),
            )
    return functions


def print_model(model: Equations) -> Printed:
    """Trace equations and print them.

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
    begins = [*starts_of(model.channels).values(), width]
    more = _recursion(traced, tape, names, begins)
    functions, jacobians = {}, {"F": np.zeros((e, e)), "H": np.zeros((m, e))}
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
        functions[name] = print_function(
            name, {argument: shapes[argument] for argument in arguments.split(", ")}, arrays
        )
    F, H, entries = jacobians["F"], jacobians["H"], 0
    if isinstance(traced, Model):
        kept, entries = _print_entries(tape, F, H, shapes)
        functions |= kept
    longest, inputs = longest_gap(model)
    lasting = places_of(model) is None and math.isfinite(longest)
    lists = begins, *_lists(F), *_lists(H), inputs if lasting else []
    tilt = rotation_part(model) if places_of(model) is not None else -1
    field = starts_of(model.channels).get(MAGNETOMETER.name, -1)
    return Printed(functions, lists, names.index("dt"), entries, longest if lasting else 0.0, tilt, field)
