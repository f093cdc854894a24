r"""Observability of a model: rank along a trajectory, and rank of nonlinear equations by Lie derivatives.

Along a trajectory the initial error is measured through O = [H(0); H(1) F(0); H(2) F(1) F(0); …]; the observability
Gramian is Oᵀ R⁻¹ O. Ranks come from the singular values of R^(−½) O, whose squares are the Gramian's eigenvalues:
squaring would lose half of the digits. Every error is in units of its prior standard deviation, so that rad and rad/s
are comparable.

Lie derivatives decide whether *some* inputs distinguish states (R. Hermann, A. J. Krener, "Nonlinear controllability
and observability", IEEE Transactions on Automatic Control 22(5), 1977). The inputs of a given trajectory may not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.model import Model
from .bounds import linearise, start_of

if TYPE_CHECKING:
    import sympy

BLOCK = 200
"""number of samples whose rows are stacked before each reduction"""


@dataclass(frozen=True)
class Observability:
    """Information of the measurements of a trajectory on the initial error.

    Attributes:
        values: ``(e,)`` singular values, largest first; their squares are the eigenvalues of the Gramian.
        directions: ``(e, e)``, rows are the corresponding directions, in units of ``scale``.
        scale: ``(e,)`` units of the error.
    """

    values: np.ndarray
    directions: np.ndarray
    scale: np.ndarray

    def rank(self, tolerance: float = 1e-9) -> int:
        """Number of values above ``tolerance`` times the largest."""
        return int(np.sum(self.values > tolerance * self.values[0]))

    def deviations(self) -> np.ndarray:
        """Standard deviation ``(e,)`` of each error from these measurements alone; infinite where unobservable."""
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(self.values > 1e-9 * self.values[0], 1.0 / self.values, np.inf)
            parts = np.where(np.abs(self.directions) > 1e-6, self.directions * inverse[:, None], 0.0)
        return np.sqrt(np.sum(parts**2, axis=0)) * self.scale


def trajectory_observability(
    model: Model, states: np.ndarray, measurements: Mapping[str, Any], scale: np.ndarray | None = None
) -> Observability:
    """Singular values of a model's observability matrix along a trajectory, without process noise.

    Args:
        model: the equations.
        states: ``(T, n)`` true states.
        measurements: channel → ``(T, size)``; see :func:`poise.filters.analysis.bounds.linearise`.
        scale: ``(e,)`` units of the error; None for the model's prior standard deviations.

    Raises:
        ValueError: shapes do not fit, or units that are not positive.
    """
    F, _, H, R, usable = linearise(model, states, measurements)
    if scale is None:
        scale = np.sqrt(np.diagonal(start_of(model, measurements)[1]))
    scale = np.asarray(scale, dtype=float)
    if scale.shape != (model.error_size,) or not np.all(scale > 0.0):
        raise ValueError(f"scale must be {model.error_size} positive numbers, got {scale}")
    flow, triangle = np.diag(scale), np.zeros((0, model.error_size))
    rows: list[np.ndarray] = []
    for k in range(len(H)):
        if usable[k].any():
            part = usable[k]
            factor = np.linalg.cholesky(R[k][np.ix_(part, part)])
            rows.append(np.linalg.solve(factor, H[k][part] @ flow))
        if k < len(F):
            flow = F[k] @ flow
        if len(rows) >= BLOCK or k == len(H) - 1:
            triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, *rows]), mode="r"))
            rows = []
    _, values, directions = np.linalg.svd(triangle)
    values = np.concatenate([values, np.zeros(model.error_size - len(values))])
    return Observability(values, directions, scale)


def lie_gradients(
    fields: Mapping[str, sympy.Matrix], output: sympy.Matrix, state: sympy.Matrix, words: Sequence[Sequence[str]]
) -> sympy.Matrix:
    """Gradients of Lie derivatives of an output, stacked.

    Args:
        fields: name → vector field (n rows) of control-affine equations, functions of the state.
        output: h, m rows.
        state: n symbols.
        words: each a sequence of field names, applied in order: ``("f0", "f5")`` is ∇(L_f0 h) f5; ``()`` is h.

    Returns:
        Matrix of ``m · len(words)`` rows and n columns. Needs the package sympy.

    Raises:
        ValueError: a word names an unknown field.
    """
    import sympy

    blocks = []
    for word in words:
        unknown = [name for name in word if name not in fields]
        if unknown:
            raise ValueError(f"words must consist of {list(fields)}, got {unknown}")
        derivative = output
        for name in word:
            derivative = derivative.jacobian(state) * fields[name]
        blocks.append(derivative.jacobian(state))
    return sympy.Matrix.vstack(*blocks)


def exact_rank(
    matrix: sympy.Matrix, angles: Mapping[Any, Any], values: Mapping[Any, Any] | None = None
) -> tuple[int, sympy.Matrix]:
    """Rank of a matrix of trigonometric functions at a rational point, without rounding.

    Args:
        matrix: its entries are rational in sines and cosines (of single symbols) and in the other symbols.
        angles: symbol → rational tangent of half the angle, which makes sine and cosine rational.
        values: symbol → rational, for all other symbols.

    Returns:
        The rank, and the matrix of rational numbers.
    """
    import sympy

    table: dict[Any, Any] = {}
    for symbol, half in angles.items():
        t = sympy.Rational(half)
        table[sympy.sin(symbol)] = 2 * t / (1 + t**2)
        table[sympy.cos(symbol)] = (1 - t**2) / (1 + t**2)
        table[sympy.tan(symbol)] = 2 * t / (1 - t**2)
    others = {symbol: sympy.Rational(value) for symbol, value in (values or {}).items()}
    numbers = matrix.xreplace(table).xreplace(others)
    left = numbers.free_symbols
    if left:
        raise ValueError(f"angles and values must set every symbol; {sorted(map(str, left))} are missing")
    return numbers.rank(), numbers
