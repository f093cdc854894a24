"""Small matrices, block matrices and systems of equations, for model code that is traced and compiled.

Entries may be numbers, traced scalars or arrays ``(*batch,)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .backend import Array, constant, expand, namespace


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


def block_matrix(blocks: list[list[Array]]) -> Array:
    """The matrix ``(..., rows, columns)`` of a table of blocks, which have one batch shape."""
    xp = namespace(blocks[0][0])
    return xp.concat([xp.concat(row, axis=-1) for row in blocks], axis=-2)


def block_diagonal(blocks: list[Array]) -> Array:
    """Square blocks ``(..., n, n)`` of one batch shape along the diagonal of a matrix, zeros elsewhere."""
    xp = namespace(*blocks)
    sizes = [block.shape[-1] for block in blocks]
    rows = []
    for index, block in enumerate(blocks):
        column = 0.0 * block[..., :1]
        rows.append(xp.concat([column] * sum(sizes[:index]) + [block] + [column] * sum(sizes[index + 1 :]), axis=-1))
    return xp.concat(rows, axis=-2)


def identity(size: int, like: Array) -> Array:
    """Identity matrices ``(*batch, size, size)`` for a batch of vectors ``(*batch, n)``."""
    return constant([[float(i == j) for j in range(size)] for i in range(size)], like) + 0.0 * like[..., :1, None]


def zeros(like: Array, rows: int, columns: int) -> Array:
    """Zeros ``(*batch, rows, columns)`` for a batch of vectors ``(*batch, n)``."""
    return 0.0 * like[..., :1, None] + constant([[0.0] * columns] * rows, like)


def vector_of(entries: Sequence[Any], zero: Array) -> Array:
    """Parameters as a vector ``(*batch, n)``; ``zero`` is ``(*batch, 1)``."""
    return namespace(zero).concat([expand(entry, 1) + zero for entry in entries], axis=-1)


def diagonal(entries: Sequence[Any], zero: Array) -> Array:
    """Parameters as a diagonal matrix ``(*batch, n, n)``; ``zero`` is ``(*batch, 1)``."""
    return diagonal_matrix(vector_of(entries, zero))


def diagonal_matrix(vector: Array) -> Array:
    """Diagonal matrices ``(..., n, n)`` of vectors ``(..., n)``."""
    size = vector.shape[-1]
    return vector[..., None] * constant([[float(i == j) for j in range(size)] for i in range(size)], vector)


def covariance_of(deviations: Sequence[Any], zero: Array) -> Array:
    """Diagonal covariance ``(*batch, n, n)`` of standard deviations; ``zero`` is ``(*batch, 1)``."""
    return diagonal([deviation**2 for deviation in deviations], zero)


def times(matrix: Array, vector: Array) -> Array:
    """Product of ``(..., m, n)`` with ``(..., n)``."""
    return (matrix @ vector[..., None])[..., 0]


def zero_where_known(*samples: Array) -> Array:
    """Zeros ``(*batch, 1)`` where all samples ``(*batch, n)`` are valid, else NaN, which delays the prior."""
    xp = namespace(*samples)
    joined = xp.concat(samples, axis=-1)
    found = xp.all(xp.isfinite(joined), axis=-1)[..., None]
    return xp.where(found, xp.zeros_like(joined[..., :1]), xp.nan)
