"""Recorded equations → LLVM code.

A recording is straight-line code on numbers whose types are known. Numba would find this out again, statement by
statement, which takes longer than to make machine code of it; so the code is printed as what numba would arrive at.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping

import numpy as np

from .trace import Expression

_ARITHMETIC = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
_COMPARISONS = {">": "ogt", ">=": "oge", "<": "olt", "<=": "ole", "==": "oeq"}
_LOGIC = {"and": "and", "or": "or"}
_FUNCTIONS = {name: f"llvm.{name}.f64" for name in ("sin", "cos", "sqrt", "exp", "log", "fabs", "floor")}
_FUNCTIONS |= {name: name for name in ("tan", "asin", "acos", "atan2")}
_POWER = "llvm.pow.f64"
TRUTHS = {*_COMPARISONS, *_LOGIC, "not", "isfinite"}
"""Operations whose result is true or false."""


def print_function(name: str, arguments: Mapping[str, tuple[int, ...]], outputs: Mapping[str, np.ndarray]) -> str:
    """Print a function of a recording.

    Args:
        name: of the function.
        arguments: name → shape of the arrays of floats, each in one piece, to whose first elements it takes pointers.
        outputs: argument → object array, of its shape, of what to write into it. Vectors are written whole; elements
            of matrices that are exactly zero are not: the caller clears matrices once.
    """
    body = "\n".join(_Emitter(arguments).function(outputs))
    pointers = ", ".join(f"ptr %{argument}" for argument in arguments)
    return f"define void @{name}({pointers}) nounwind {{\n{body}\n  ret void\n}}\n"


def module_of(functions: Mapping[str, str], triple: str) -> str:
    """Text of a module of printed functions for a kind of machine."""
    bodies = "".join(functions.values())
    return f'target triple = "{triple}"\n{bodies}{_declarations(bodies)}'


def _declarations(body: str) -> str:
    """Declarations of the mathematical functions that code calls."""
    arities = dict.fromkeys(_FUNCTIONS.values(), 1) | {"atan2": 2, _POWER: 2}
    used = {name: arity for name, arity in arities.items() if f"@{name}(" in body}
    return "".join(f"declare double @{name}({', '.join(['double'] * arity)})\n" for name, arity in used.items())


def number(value: float) -> str:
    """A floating-point constant, exactly."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class _Emitter:
    """The lines of one function; every value has a name of its own."""

    def __init__(self, arguments: Mapping[str, tuple[int, ...]]) -> None:
        self.arguments = arguments
        self.lines: list[str] = []
        self.names: dict[int, str] = {}

    def function(self, outputs: Mapping[str, np.ndarray]) -> list[str]:
        """Lines that compute and write outputs."""
        live: dict[int, Expression] = {}
        pending = [item for array in outputs.values() for item in array.ravel() if isinstance(item, Expression)]
        while pending:
            node = pending.pop()
            if node.index not in live:
                live[node.index] = node
                pending.extend(operand for operand in node.operands if isinstance(operand, Expression))
        for index in sorted(live):
            if live[index].operation not in ("input", "constant"):
                self._name(live[index])
        # Everything is read before anything is written, so an output may be an input.
        written = []
        for name, array in outputs.items():
            for place, item in enumerate(array.ravel()):
                text = self._float(item) if isinstance(item, Expression) else number(float(item))
                if array.ndim == 1 or text != number(0.0):
                    written.append((name, place, text))
        for name, place, text in written:
            self.lines.append(f"  store double {text}, ptr {self._address(name, place)}")
        return self.lines

    def _value(self, code: str) -> str:
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {code}")
        return name

    def _address(self, name: str, place: int) -> str:
        if place >= math.prod(self.arguments[name]):
            raise ValueError(f"{name} has no element {place}: it is of shape {self.arguments[name]}")
        return self._value(f"getelementptr double, ptr %{name}, i64 {place}")

    def _name(self, node: Expression) -> str:
        """The name of a node's value; inputs are read where they are first needed."""
        found = self.names.get(node.index)
        if found is None:
            found = self.names[node.index] = self._emit(node)
        return found

    def _float(self, node: Expression) -> str:
        name = self._name(node)
        return self._value(f"uitofp i1 {name} to double") if node.operation in TRUTHS else name

    def _truth(self, node: Expression) -> str:
        name = self._name(node)
        return name if node.operation in TRUTHS else self._value(f"fcmp une double {name}, 0.0")

    def _call(self, function: str, operands: Iterator[str]) -> str:
        return self._value(f"call double @{function}({', '.join(f'double {operand}' for operand in operands)})")

    def _emit(self, node: Expression) -> str:
        operation, operands = node.operation, node.operands
        if operation == "input":
            return self._value(f"load double, ptr {self._address(*operands)}")
        if operation == "constant":
            return number(float(operands[0]))
        if operation == "where":
            first, second = self._float(operands[1]), self._float(operands[2])
            return self._value(f"select i1 {self._truth(operands[0])}, double {first}, double {second}")
        if operation in _LOGIC:
            return self._value(f"{_LOGIC[operation]} i1 {', '.join(map(self._truth, operands))}")
        if operation == "not":
            return self._value(f"xor i1 {self._truth(operands[0])}, true")
        first = self._float(operands[0])
        if operation == "neg":
            return self._value(f"fneg double {first}")
        if operation == "isfinite":  # x − x is not NaN
            rest = self._value(f"fsub double {first}, {first}")
            return self._value(f"fcmp ord double {rest}, {rest}")
        if operation == "**":
            return self._power(first, operands[1])
        if operation in _FUNCTIONS:
            return self._call(_FUNCTIONS[operation], map(self._float, operands))
        code = f"fcmp {_COMPARISONS[operation]}" if operation in _COMPARISONS else _ARITHMETIC[operation]
        return self._value(f"{code} double {first}, {self._float(operands[1])}")

    def _power(self, base: str, exponent: str) -> str:
        """A power with a constant exponent; of a whole number by products, as numba forms it."""
        if not exponent.lstrip("-").isdigit():
            return self._call(_POWER, iter((base, number(float(exponent)))))
        result, rest = "", abs(int(exponent))
        while rest:
            if rest & 1:
                result = self._value(f"fmul double {result}, {base}") if result else base
            rest >>= 1
            if rest:
                base = self._value(f"fmul double {base}, {base}")
        result = result or number(1.0)
        return self._value(f"fdiv double {number(1.0)}, {result}") if exponent.startswith("-") else result
