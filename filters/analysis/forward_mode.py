"""Forward-mode differentiation with dual numbers: scalars that carry their gradient.

This is for formulas whose derivatives by hand would be long. A :class:`Dual` holds a value ``(...)`` and its
derivatives ``(..., n)`` with respect to n variables; arithmetic and the functions below keep both exact. The values may
be NumPy arrays, torch tensors or traced expressions. A model written with them is compiled like any other, and zeros in
a gradient cost nothing there.

A. Griewank, A. Walther, "Evaluating Derivatives", SIAM 2008, chapter 3.
"""

from __future__ import annotations

import math
from typing import Any

from ..core.backend import Array, constant, namespace

Scalar = Any
"""A :class:`Dual`, an array ``(...)``, or a number."""


def _column(value: Any) -> Any:
    """A factor ``(...)``, reshaped to scale a gradient ``(..., n)``."""
    return value[..., None] if getattr(value, "ndim", 0) > 0 else value


class Dual:
    """A scalar ``(...)`` with its gradient ``(..., n)``."""

    __slots__ = ("gradient", "value")
    # NumPy arrays on the left defer to this class
    __array_ufunc__ = None

    def __init__(self, value: Array, gradient: Array) -> None:
        self.value, self.gradient = value, gradient

    def __add__(self, other: Scalar) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.gradient + other.gradient)
        return Dual(self.value + other, self.gradient)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.gradient)

    def __sub__(self, other: Scalar) -> Dual:
        return self + (-other)

    def __rsub__(self, other: Scalar) -> Dual:
        return (-self) + other

    def __mul__(self, other: Scalar) -> Dual:
        if isinstance(other, Dual):
            gradient = _column(other.value) * self.gradient + _column(self.value) * other.gradient
            return Dual(self.value * other.value, gradient)
        return Dual(self.value * other, _column(other) * self.gradient)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Dual:
        if isinstance(other, Dual):
            value = self.value / other.value
            gradient = (self.gradient - _column(value) * other.gradient) / _column(other.value)
            return Dual(value, gradient)
        return Dual(self.value / other, self.gradient / _column(other))

    def __rtruediv__(self, other: Scalar) -> Dual:
        value = other / self.value
        return Dual(value, -_column(value / self.value) * self.gradient)


def variables(x: Array) -> list[Dual]:
    """The elements of ``x`` ``(..., n)`` as n scalars, each an independent variable."""
    n = x.shape[-1]
    zero = 0.0 * x
    return [
        Dual(x[..., index], zero + constant([float(index == other) for other in range(n)], x)) for index in range(n)
    ]


def value(x: Scalar) -> Scalar:
    """The value without its gradient."""
    return x.value if isinstance(x, Dual) else x


def gradient(x: Scalar, like: Array) -> Array:
    """The gradient ``(..., n)``; zeros shaped as ``like`` ``(..., n)`` for a constant."""
    return x.gradient if isinstance(x, Dual) else 0.0 * like


def sin(x: Scalar) -> Scalar:
    """Sine."""
    if isinstance(x, Dual):
        xp = namespace(x.value)
        return Dual(xp.sin(x.value), _column(xp.cos(x.value)) * x.gradient)
    return math.sin(x) if isinstance(x, float) else namespace(x).sin(x)


def cos(x: Scalar) -> Scalar:
    """Cosine."""
    if isinstance(x, Dual):
        xp = namespace(x.value)
        return Dual(xp.cos(x.value), _column(-xp.sin(x.value)) * x.gradient)
    return math.cos(x) if isinstance(x, float) else namespace(x).cos(x)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the point (x, y)."""
    xp = namespace(value(y), value(x))
    angle = xp.atan2(value(y), value(x))
    if not isinstance(y, Dual) and not isinstance(x, Dual):
        return angle
    squared = _column(value(x) * value(x) + value(y) * value(y))
    total: Any = 0.0
    if isinstance(y, Dual):
        total = total + _column(value(x)) * y.gradient
    if isinstance(x, Dual):
        total = total - _column(value(y)) * x.gradient
    return Dual(angle, total / squared)
