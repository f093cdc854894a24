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

import numpy as np

from .cache import jit
from .kernel import copy, fill, symmetric, zeros
from .native import call
from .plan import CONSTANTS, FETCH, FINISH, POSE, RETRACT, part


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


@jit
def reduce(A, B, row):  # type: ignore[no-untyped-def]
    """A ← A − A B of square matrices, four columns at a time. Scratch: row ``(n,)``."""
    n = A.shape[0]
    for i in range(n):
        j = 0
        while j + 4 <= n:
            s0, s1, s2, s3 = A[i, j], A[i, j + 1], A[i, j + 2], A[i, j + 3]
            for k in range(n):
                f = A[i, k]
                s0 -= f * B[k, j]
                s1 -= f * B[k, j + 1]
                s2 -= f * B[k, j + 2]
                s3 -= f * B[k, j + 3]
            row[j], row[j + 1], row[j + 2], row[j + 3] = s0, s1, s2, s3
            j += 4
        while j < n:
            s0 = A[i, j]
            for k in range(n):
                s0 -= A[i, k] * B[k, j]
            row[j] = s0
            j += 1
        copy(row, A[i])


@jit
def smooth_sample(P, vector, information, error, work, row):  # type: ignore[no-untyped-def]
    """The smoothed error δ = P λ and covariance P − P Λ P, in place of P, after the measurement update."""
    e = P.shape[0]
    for i in range(e):
        total = 0.0
        for k in range(e):
            total += P[i, k] * vector[k]
        error[i] = total
    multiply(information, e, P, work)
    reduce(P, work, row)
    symmetric(P)


@jit
def predict_back(F, vector, information, moved, work):  # type: ignore[no-untyped-def]
    """Fᵀ λ and Fᵀ Λ F, in place: from before the measurement update of a sample to after that of the one before."""
    e = F.shape[0]
    fill(moved, 0.0)
    for k in range(e):
        for c in range(e):
            moved[c] += F[k, c] * vector[k]
    copy(moved, vector)
    multiply(information, e, F, work)
    multiply(F.T, e, work, information)
    symmetric(information)


@jit
def smooth(Z, parameters, whites, records, later, covariances, poses, plan):  # type: ignore[no-untyped-def]
    """Backward over a recorded stretch; covariances (in: those of the filter) and ``later`` are changed in place."""
    stage, updated, entries, gains, factors, used = records
    vector, information = later
    n, m, e = updated.shape[2], used.shape[2], vector.shape[1]
    x0, x1, error, V, B, y = np.empty(n), np.empty(n), np.empty(e), zeros(m, e), np.empty((2, m, m)), np.empty(m)
    F, H, work, moved = zeros(e, e), zeros(m, e), zeros(e, e), np.empty(e)
    H_first, H_column = part(plan, 3), part(plan, 4)
    call(plan[CONSTANTS], (F, H))
    for back in range(Z.shape[0]):
        t = Z.shape[0] - 1 - back
        for b in range(Z.shape[1]):
            if stage[t, b] == 0:
                fill(poses[t, b], np.nan)
                continue
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            smooth_sample(covariances[t, b], vector[b], information[b], error, work, moved)
            call(plan[RETRACT], (updated[t, b], error, p, x1))
            if stage[t, b] == 2:
                call(plan[FINISH], (x1, Z[t, b], p, x0))
                call(plan[FETCH], (entries[t, b], F, H))
                measured = gains[t, b], factors[t, b], used[t, b], whites[t, b]
                update_back(H, H_first, H_column, *measured, vector[b], information[b], V, B, y)
                predict_back(F, vector[b], information[b], moved, work)
            else:
                copy(x1, x0)
                fill(vector[b], 0.0)
                for i in range(e):
                    fill(information[b, i], 0.0)
            call(plan[POSE], (x0, p, poses[t, b]))
