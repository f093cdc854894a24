"""Block matrices and small systems of equations in straight-line form, for model code that is traced and compiled."""

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
