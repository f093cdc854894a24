r"""Largest eigenvalue of a symmetric 3 × 3 matrix with its vector, without branches and for every array namespace.

A fixed number of sweeps of Jacobi rotations has no branches and is exact to rounding for every matrix. The
trigonometric formula, in contrast, loses the vectors where two eigenvalues coincide. Each rotation eliminates one
element with

    t = 2 a_pq / (d + sign(d) √(d² + 4 a_pq²)),   d = a_qq − a_pp,   c = 1/√(1 + t²),   s = t c

(G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition 2013, section 8.5); convergence is quadratic.
"""

from __future__ import annotations

from ..core.backend import Array, namespace

SWEEPS = 4
"""Sweeps of three rotations; three sweeps leave up to 10⁻⁵ of the norm off the diagonal, four only rounding errors."""


def largest_eigenpair(matrix: Array) -> tuple[Array, Array]:
    """Largest eigenvalue ``(...)`` and a unit eigenvector ``(..., 3)`` of symmetric matrices ``(..., 3, 3)``.

    The sign of the vector is arbitrary; for a multiple eigenvalue it is one of its vectors. Only the upper
    triangle is used. Non-finite input gives non-finite output.
    """
    xp = namespace(matrix)
    largest = 0.0 * matrix[..., 0, 0]
    for p in range(3):
        for q in range(p, 3):
            largest = xp.maximum(largest, xp.abs(matrix[..., p, q]))
    scale = xp.where(xp.greater(largest, 0.0), largest, 1.0 + 0.0 * largest)
    a = {(p, q): matrix[..., p, q] / scale for p in range(3) for q in range(p, 3)}
    zero = 0.0 * scale
    vectors = [[zero + float(p == q) for q in range(3)] for p in range(3)]
    for _ in range(SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            a, vectors = _rotate(a, vectors, p, q)
    best, vector = a[0, 0], xp.stack(vectors[0], axis=-1)
    for p in (1, 2):
        larger = xp.greater(a[p, p], best)
        vector = xp.where(larger[..., None], xp.stack(vectors[p], axis=-1), vector)
        best = xp.where(larger, a[p, p], best)
    return best * scale, vector


def _rotate(
    a: dict[tuple[int, int], Array], vectors: list[list[Array]], p: int, q: int
) -> tuple[dict[tuple[int, int], Array], list[list[Array]]]:
    """The matrix (upper triangle) with element p, q eliminated, and the rotated vectors."""
    xp = namespace(a[p, q])
    difference, off = a[q, q] - a[p, p], a[p, q]
    radicand = difference * difference + 4.0 * off * off
    some = xp.greater(radicand, 0.0)
    root = xp.sqrt(xp.where(some, radicand, 1.0 + 0.0 * radicand))
    t = 2.0 * off / xp.where(xp.less(difference, 0.0), difference - root, difference + root)
    t = xp.where(some, t, 0.0 * t)
    c = 1.0 / xp.sqrt(1.0 + t * t)
    s = t * c
    r = 3 - p - q
    rp, rq = (min(r, p), max(r, p)), (min(r, q), max(r, q))
    turned = dict(a)
    turned[p, p], turned[q, q], turned[p, q] = a[p, p] - t * off, a[q, q] + t * off, 0.0 * off
    turned[rp], turned[rq] = c * a[rp] - s * a[rq], s * a[rp] + c * a[rq]
    new = list(vectors)
    new[p] = [c * one - s * other for one, other in zip(vectors[p], vectors[q], strict=True)]
    new[q] = [s * one + c * other for one, other in zip(vectors[p], vectors[q], strict=True)]
    return turned, new
