r"""Reverse-mode derivatives of recorded equations, as straight-line code.

The gradient of a number with respect to everything that it was computed from costs a small multiple of the computation
itself (A. Griewank, A. Walther, "Evaluating Derivatives", SIAM 2008, chapter 3). Each recorded operation passes the
derivative of its result on to its operands, from the last operation to the first; what is passed on is recorded too, so
equal terms are computed once and zeros cost nothing.

Where an operation is chosen by ``where``, the branch that was not taken gets the derivative zero. It may be singular
there (a square root of zero) or unknown (a missing sample), so products with such factors are zero whenever the
derivative is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .emit import TRUTHS
from .trace import Expression, Tape

SILENT = {"input", "constant", "floor", *TRUTHS}
"""Operations without a derivative."""


def gradient(
    outputs: Sequence[np.ndarray], seeds: Sequence[np.ndarray], inputs: Sequence[Expression], unknown: str = ""
) -> np.ndarray:
    """What inputs contribute: Σ seed · ∂output/∂input, recorded on the same tape.

    Args:
        outputs: arrays of recorded scalars or numbers.
        seeds: arrays of the same shapes, derivatives of the final number with respect to the outputs.
        inputs: recorded inputs.
        unknown: name of the input array whose elements may be NaN.

    Returns:
        ``(len(inputs),)`` recorded scalars, or 0.0 where an input contributes nothing.
    """
    adjoint: dict[int, Any] = {}
    live: dict[int, Expression] = {}
    for array, seed in zip(outputs, seeds, strict=True):
        for item, part in zip(array.ravel(), seed.ravel(), strict=True):
            if isinstance(item, Expression):
                adjoint[item.index] = adjoint.get(item.index, 0.0) + part
                live[item.index] = item
    pending = list(live.values())
    while pending:
        for operand in pending.pop().operands:
            if isinstance(operand, Expression) and operand.index not in live:
                live[operand.index] = operand
                pending.append(operand)
    risky = _depending_on(live, unknown) if unknown else set()
    for index in sorted(live, reverse=True):
        node, own = live[index], adjoint.get(index, 0.0)
        if node.operation in SILENT or not isinstance(own, Expression) or own.value == 0.0:
            continue
        for operand, part in _passed_on(node, own, risky):
            if isinstance(operand, Expression) and operand.operation != "constant":
                adjoint[operand.index] = adjoint.get(operand.index, 0.0) + part
    found = np.empty(len(inputs), dtype=object)
    for position, item in enumerate(inputs):
        found[position] = adjoint.get(item.index, 0.0)
    return found


def _depending_on(live: dict[int, Expression], name: str) -> set[int]:
    """Indices of the nodes that are computed from an input array."""
    found: set[int] = set()
    for index in sorted(live):
        node = live[index]
        own = node.operation == "input" and node.operands[0] == name
        if own or any(isinstance(part, Expression) and part.index in found for part in node.operands):
            found.add(index)
    return found


def _passed_on(node: Expression, g: Expression, risky: set[int]) -> list[tuple[Any, Any]]:
    """Operand → its share of the derivative g of a node."""
    tape, operation, operands = node.tape, node.operation, node.operands
    a: Any = operands[0]
    b: Any = operands[1] if len(operands) > 1 else None
    match operation:
        case "+":
            return [(a, g), (b, g)]
        case "-":
            return [(a, g), (b, -g)]
        case "neg":
            return [(a, -g)]
        case "*":
            return [(one, _times(g, other, other.index in risky)) for one, other in ((a, b), (b, a))]
        case "/":
            share = _times(g, 1.0 / b, b.value is None)
            return [(a, share), (b, -_times(share, node, node.index in risky))]
        case "**":
            power = float(b)
            factor = power * (a ** (int(power) - 1 if power.is_integer() else power - 1.0))
            return [(a, _times(g, factor, power < 1.0 or a.index in risky))]
        case "sin":
            return [(a, _times(g, tape.node("cos", a), a.index in risky))]
        case "cos":
            return [(a, -_times(g, tape.node("sin", a), a.index in risky))]
        case "tan":
            return [(a, _times(g, 1.0 + node * node, a.index in risky))]
        case "asin" | "acos":
            slope = 1.0 / tape.node("sqrt", 1.0 - a * a)
            return [(a, _times(g if operation == "asin" else -g, slope, True))]
        case "atan2":
            length = 1.0 / (a * a + b * b)
            return [(a, _times(g, b * length, True)), (b, -_times(g, a * length, True))]
        case "sqrt":
            return [(a, _times(g, 0.5 / node, True))]
        case "exp":
            return [(a, _times(g, node, node.index in risky))]
        case "log":
            return [(a, _times(g, 1.0 / a, True))]
        case "fabs":
            return [(a, tape.node("where", tape.node(">=", a, tape.constant(0.0)), g, -g))]
        case "where":
            zero = tape.constant(0.0)
            return [(b, tape.node("where", a, g, zero)), (operands[2], tape.node("where", a, zero, g))]
    raise NotImplementedError(f"no derivative of {operation!r}")


def _times(g: Any, factor: Any, singular: bool) -> Any:
    """The product g · factor; zero where g is zero if the factor may be infinite or unknown."""
    product = g * factor
    if not singular or not isinstance(product, Expression) or not isinstance(g, Expression) or g.value is not None:
        return product
    tape: Tape = g.tape
    return tape.node("where", tape.node("==", g, tape.constant(0.0)), tape.constant(0.0), product)
