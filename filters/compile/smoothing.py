"""Fixed-interval smoothing of recorded samples as plain loops, the same for every model.

The form of A. E. Bryson and M. Frazier (G. J. Bierman, "Fixed interval smoothing with discrete measurements",
International Journal of Control 18(1), 1973). Instead of smoothed covariances it carries back what the later samples
say, an information vector λ and a matrix Λ, from which the smoothed error and covariance follow at each sample:

    δ = P λ,   Pˢ = P − P Λ P

The numbers are those of Rauch, Tung and Striebel, but no covariance is inverted: states that are known exactly, or that
others determine, need no care. The smoothed state is that of the filter, corrected by the smoothed error:
``x = finish(retract(updated, δ))``. So no model needs a difference of two states, and where nothing is to be corrected
(δ = 0) the filter is its own smoother.
"""

from __future__ import annotations

from .cache import jit


@jit
def remember(K, S, rows, gain, factor, used):  # type: ignore[no-untyped-def]
    """Keep what :func:`poise.filters.compile.kernel.correct` has left behind, for ``carry_back``."""
    for a in range(rows.shape[0]):
        used[a] = rows[a]
        if rows[a] < 0:
            break
        for j in range(K.shape[1]):
            gain[a, j] = K[a, j]
        for b in range(a + 1):
            factor[a, b] = S[a, b]


@jit
def multiply(A, rows, B, C):  # type: ignore[no-untyped-def]
    """C ← A B for the first rows of A, four columns at a time: their sums stay in registers."""
    inner, columns = B.shape
    for i in range(rows):
        j = 0
        while j + 4 <= columns:
            s0 = s1 = s2 = s3 = 0.0
            for k in range(inner):
                f = A[i, k]
                s0 += f * B[k, j]
                s1 += f * B[k, j + 1]
                s2 += f * B[k, j + 2]
                s3 += f * B[k, j + 3]
            C[i, j], C[i, j + 1], C[i, j + 2], C[i, j + 3] = s0, s1, s2, s3
            j += 4
        while j < columns:
            s0 = 0.0
            for k in range(inner):
                s0 += A[i, k] * B[k, j]
            C[i, j] = s0
            j += 1


@jit
def update_back(H, first, column, K, S, rows, white, vector, information, V, B, y):  # type: ignore[no-untyped-def]
    """Carry λ and Λ to before the measurement update of a sample, in place.

        λ ← λ + Hᵀ (S⁻¹ r − K λ),   Λ ← Λ − Hᵀ N − Nᵀ H,   N = K Λ − ½ (K Λ Kᵀ + S⁻¹) H

    with K as rows, one a measured number.

    Args:
        H: ``(m, e)`` Jacobian.
        first: lists of H.
        column: likewise.
        K: ``(m, e)`` gains of the numbers that were used.
        S: ``(m, m)`` Cholesky factor L of the covariance of their innovations r.
        rows: ``(m,)`` their places in H and ``white``, then −1.
        white: ``(m,)`` L⁻¹ r.
        vector: ``(e,)`` λ.
        information: ``(e, e)`` Λ.
        V: ``(m, e)`` scratch.
        B: ``(2, m, m)`` scratch.
        y: ``(m,)`` scratch.
    """
    e, count = vector.shape[0], 0
    while count < rows.shape[0] and rows[count] >= 0:
        count += 1
    inverse, weight = B[0], B[1]
    for a in range(count):
        inverse[a, a] = 1.0 / S[a, a]
        for b in range(a):
            total = 0.0
            for k in range(b, a):
                total += S[a, k] * inverse[k, b]
            inverse[a, b] = -total * inverse[a, a]
    # S⁻¹ = L⁻ᵀ L⁻¹
    for a in range(count):
        for b in range(a + 1):
            total = 0.0
            for k in range(a, count):
                total += inverse[k, a] * inverse[k, b]
            weight[a, b] = weight[b, a] = total
        total = 0.0
        for k in range(a, count):
            total += inverse[k, a] * white[rows[k]]
        for k in range(e):
            total -= K[a, k] * vector[k]
        y[a] = total
    multiply(K, count, information, V)
    for a in range(count):
        for b in range(a + 1):
            total = weight[a, b]
            for k in range(e):
                total += V[a, k] * K[b, k]
            weight[a, b] = weight[b, a] = 0.5 * total
    for b in range(count):
        for t in range(first[rows[b]], first[rows[b] + 1]):
            c = column[t]
            h = H[rows[b], c]
            vector[c] += h * y[b]
            for a in range(count):
                V[a, c] -= weight[a, b] * h
    for a in range(count):
        for t in range(first[rows[a]], first[rows[a] + 1]):
            c = column[t]
            h = H[rows[a], c]
            for j in range(e):
                information[c, j] -= h * V[a, j]
            for j in range(e):
                information[j, c] -= h * V[a, j]
