"""Small systems of equations in straight-line form, for model code that is traced and compiled."""

from __future__ import annotations

from .backend import Array, namespace


def solve_positive(matrix: Array, right: Array) -> Array:
    """Solve ``matrix x = right`` for a small symmetric positive definite matrix, by its factors L D Lᵀ.

    Every element is written out, so the size should be a handful; without pivoting, which such matrices do not need.

    Args:
        matrix: ``(..., n, n)``; only the lower triangle is read.
        right: ``(..., n)``.

    Returns:
        ``(..., n)``; not finite where the matrix is singular.
    """
    n = right.shape[-1]
    factor: dict[tuple[int, int], Array] = {}
    diagonal: list[Array] = []
    for i in range(n):
        pivot = matrix[..., i, i]
        for k in range(i):
            pivot = pivot - factor[i, k] * factor[i, k] * diagonal[k]
        diagonal.append(pivot)
        for j in range(i + 1, n):
            entry = matrix[..., j, i]
            for k in range(i):
                entry = entry - factor[j, k] * factor[i, k] * diagonal[k]
            factor[j, i] = entry / pivot
    forward: list[Array] = []
    for i in range(n):
        value = right[..., i]
        for k in range(i):
            value = value - factor[i, k] * forward[k]
        forward.append(value)
    x: list[Array] = [None] * n
    for i in reversed(range(n)):
        value = forward[i] / diagonal[i]
        for k in range(i + 1, n):
            value = value - factor[k, i] * x[k]
        x[i] = value
    return namespace(right).stack(x, axis=-1)
