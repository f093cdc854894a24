"""Record what model code computes, to compile it as straight-line code.

Model code runs once on object arrays of :class:`Expression`. Every operation makes a node; equal operations on equal
operands make the same node (common subexpressions are found while recording), and zeros and ones are folded away, so
the sparsity of Jacobians is known. Operations are kept in the order in which they were written: the printed code
computes what NumPy computes, to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np


class Tape:
    """The nodes of one recording, in order of creation."""

    def __init__(self) -> None:
        self.nodes: dict[tuple[Any, ...], Expression] = {}

    def node(self, operation: str, *operands: Any) -> Expression:
        """The node of an operation: a new one, or the one that was recorded before."""
        key = (operation, *(operand.index if isinstance(operand, Expression) else operand for operand in operands))
        found = self.nodes.get(key)
        if found is None:
            found = self.nodes[key] = Expression(self, len(self.nodes), operation, operands)
        return found

    def constant(self, value: float) -> Expression:
        """The node of a number."""
        return self.node("constant", repr(float(value)))

    def inputs(self, name: str, *shape: int) -> np.ndarray:
        """Object array ``(*shape)`` of the elements of an input array."""
        array = np.empty(shape, dtype=object)
        for index in range(array.size):
            array.flat[index] = self.node("input", name, index)
        return array


def _operator(rule: Callable[[Expression, Expression], Expression]) -> tuple[Any, Any]:
    """An operator and its reflection; both leave what is not a number to the other operand."""

    def forward(self: Expression, other: Any) -> Any:
        right = self._other(other)
        return NotImplemented if right is None else rule(self, right)

    def reflected(self: Expression, other: Any) -> Any:
        left = self._other(other)
        return NotImplemented if left is None else rule(left, self)

    return forward, reflected


def _sum(a: Expression, b: Expression) -> Expression:
    if b.value == 0.0:
        return a
    return b if a.value == 0.0 else a._record("+", lambda a, b: a + b, a, b)


def _difference(a: Expression, b: Expression) -> Expression:
    if b.value == 0.0:
        return a
    return -b if a.value == 0.0 else a._record("-", lambda a, b: a - b, a, b)


def _product(a: Expression, b: Expression) -> Expression:
    for one, two in ((a, b), (b, a)):
        if one.value == 0.0:
            return a.tape.constant(0.0)
        if one.value == 1.0:
            return two
        if one.value == -1.0:
            return -two
    return a._record("*", lambda a, b: a * b, a, b)


def _quotient(a: Expression, b: Expression) -> Expression:
    if a.value == 0.0 or b.value == 1.0:
        return a
    return a._record("/", lambda a, b: a / b, a, b)


class Expression:
    """One recorded scalar; behaves like an array without axes in model code."""

    __slots__ = ("index", "operands", "operation", "tape")

    dtype = np.dtype(object)
    ndim = 0
    shape = ()

    def __init__(self, tape: Tape, index: int, operation: str, operands: tuple[Any, ...]) -> None:
        self.tape, self.index, self.operation, self.operands = tape, index, operation, operands

    @property
    def value(self) -> float | None:
        """The number that this node is, or None."""
        return float(self.operands[0]) if self.operation == "constant" else None

    def _other(self, other: Any) -> Expression | None:
        if isinstance(other, Expression):
            return other
        return self.tape.constant(float(other)) if isinstance(other, int | float | np.number) else None

    def _record(self, operation: str, function: Callable[..., float], *operands: Expression) -> Expression:
        """The node of an operation, or its result where every operand is a number."""
        values = [operand.value for operand in operands]
        if None not in values:
            return self.tape.constant(function(*values))
        return self.tape.node(operation, *operands)

    __add__, __radd__ = _operator(_sum)
    __sub__, __rsub__ = _operator(_difference)
    __mul__, __rmul__ = _operator(_product)
    __truediv__, __rtruediv__ = _operator(_quotient)

    def __neg__(self) -> Expression:
        if self.operation == "neg":
            return self.operands[0]
        return self._record("neg", lambda a: -a, self)

    def __pos__(self) -> Expression:
        return self

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, int) and exponent == 1:
            return self
        if isinstance(exponent, int) and exponent == 2:
            return self * self
        if isinstance(exponent, (int, float)):
            if self.value is not None:
                return self.tape.constant(self.value**exponent)
            return self.tape.node("**", self, repr(exponent))
        return NotImplemented

    def __getitem__(self, key: Any) -> np.ndarray:
        array = np.empty((), dtype=object)
        array[()] = self
        return array[key]

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        raise TypeError("model code must not compare values: use xp.where, xp.greater, xp.less, xp.isfinite …")

    __hash__ = object.__hash__

    def __len__(self) -> int:
        raise TypeError("a traced scalar has no length")

    def __bool__(self) -> bool:
        raise TypeError("model code must not branch on values: use xp.where, xp.greater, xp.less, xp.logical_and …")

    def __float__(self) -> float:
        raise TypeError("model code must not turn values into Python numbers")

    def __repr__(self) -> str:
        return f"<{self.operation} {self.index}>"


def _call(name: str, function: Callable[..., float] | None, arity: int) -> Callable[..., Any]:
    """An elementwise function that records ``name`` (and is computed at once on plain numbers)."""

    def scalar(*operands: Any) -> Any:
        tape = next((operand.tape for operand in operands if isinstance(operand, Expression)), None)
        if tape is None:
            if function is None:
                raise TypeError(f"{name} on plain numbers cannot be traced")
            return function(*operands)
        nodes = [operand if isinstance(operand, Expression) else tape.constant(operand) for operand in operands]
        values = [node.value for node in nodes]
        if function is not None and None not in values:
            return tape.constant(function(*values))
        return tape.node(name, *nodes)

    vectorised = np.frompyfunc(scalar, arity, 1)

    def apply(*arrays: Any) -> Any:
        return vectorised(*(_objects(array) for array in arrays))

    return apply


def _objects(array: Any) -> np.ndarray:
    if isinstance(array, Expression):
        return array[...]
    return np.asarray(array, dtype=object)


def _on_first(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of NumPy whose first argument may be a single expression."""
    return lambda array, *arguments, **named: function(_objects(array), *arguments, **named)


def _on_each(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of NumPy that joins arrays, of which some may be single expressions."""
    return lambda arrays, axis=0: function([_objects(array) for array in arrays], axis=axis)


def _choose(condition: Any, first: Any, second: Any) -> Any:
    if not isinstance(condition, Expression):
        return first if condition else second
    if first is second:
        return first
    if condition.value is not None:
        return first if condition.value else second
    tape = condition.tape
    nodes = [part if isinstance(part, Expression) else tape.constant(part) for part in (first, second)]
    return nodes[0] if nodes[0] is nodes[1] else tape.node("where", condition, *nodes)


class TracedNamespace:
    """The array functions that model code may use, on object arrays of expressions; names as in the array API."""

    nan = math.nan
    inf = math.inf
    pi = math.pi

    sin = staticmethod(_call("sin", math.sin, 1))
    cos = staticmethod(_call("cos", math.cos, 1))
    tan = staticmethod(_call("tan", math.tan, 1))
    asin = staticmethod(_call("asin", math.asin, 1))
    acos = staticmethod(_call("acos", math.acos, 1))
    atan2 = staticmethod(_call("atan2", math.atan2, 2))
    sqrt = staticmethod(_call("sqrt", math.sqrt, 1))
    exp = staticmethod(_call("exp", math.exp, 1))
    log = staticmethod(_call("log", math.log, 1))
    abs = staticmethod(_call("fabs", math.fabs, 1))
    floor = staticmethod(_call("floor", math.floor, 1))
    isfinite = staticmethod(_call("isfinite", None, 1))
    greater = staticmethod(_call(">", lambda a, b: float(a > b), 2))
    greater_equal = staticmethod(_call(">=", lambda a, b: float(a >= b), 2))
    less = staticmethod(_call("<", lambda a, b: float(a < b), 2))
    less_equal = staticmethod(_call("<=", lambda a, b: float(a <= b), 2))
    logical_and = staticmethod(_call("and", None, 2))
    logical_or = staticmethod(_call("or", None, 2))
    logical_not = staticmethod(_call("not", None, 1))

    @staticmethod
    def where(condition: Any, first: Any, second: Any) -> Any:
        """Choose elementwise; both sides are computed."""
        return np.frompyfunc(_choose, 3, 1)(_objects(condition), _objects(first), _objects(second))

    @staticmethod
    def minimum(a: Any, b: Any) -> Any:
        """The smaller one, elementwise."""
        return TracedNamespace.where(TracedNamespace.less(b, a), b, a)

    @staticmethod
    def maximum(a: Any, b: Any) -> Any:
        """The larger one, elementwise."""
        return TracedNamespace.where(TracedNamespace.greater(b, a), b, a)

    stack = staticmethod(_on_each(np.stack))
    concat = staticmethod(_on_each(np.concatenate))
    sum = staticmethod(_on_first(np.sum))
    reshape = staticmethod(_on_first(np.reshape))
    broadcast_to = staticmethod(_on_first(np.broadcast_to))
    zeros_like = staticmethod(_on_first(lambda array: 0.0 * array))
    ones_like = staticmethod(_on_first(lambda array: 0.0 * array + 1.0))

    @staticmethod
    def all(array: Any, axis: int = -1) -> Any:
        """Whether all elements along an axis are true."""
        return TracedNamespace._reduce(TracedNamespace.logical_and, array, axis)

    @staticmethod
    def any(array: Any, axis: int = -1) -> Any:
        """Whether any element along an axis is true."""
        return TracedNamespace._reduce(TracedNamespace.logical_or, array, axis)

    @staticmethod
    def _reduce(function: Callable[..., Any], array: Any, axis: int) -> Any:
        parts = np.moveaxis(_objects(array), axis, 0)
        result = parts[0]
        for part in parts[1:]:
            result = function(result, part)
        return result

    @staticmethod
    def matmul(a: Any, b: Any) -> np.ndarray:
        """Matrix product."""
        return _objects(a) @ _objects(b)

    @staticmethod
    def eye(size: int) -> np.ndarray:
        """Identity matrix of plain numbers."""
        return np.eye(size).astype(object)
