"""The Kalman recursion as plain loops: the part of the compiled filter that is the same for every model.

The text of this file is put in front of the traced equations of a model and compiled with them
(:mod:`poise.filters.compiled`), so it holds nothing but functions of arrays. It runs without a compiler too.
"""

import numpy as np


def fill(array, value):  # type: ignore[no-untyped-def]
    """Every element of a vector ← value; loops compile faster than slices."""
    for i in range(array.shape[0]):
        array[i] = value


def copy(source, target):  # type: ignore[no-untyped-def]
    """A vector into another."""
    for i in range(source.shape[0]):
        target[i] = source[i]


def finite(array):  # type: ignore[no-untyped-def]
    """Whether every element of a vector is finite."""
    for i in range(array.shape[0]):
        if not np.isfinite(array[i]):
            return False
    return True


def propagate(F, P, Q, work):  # type: ignore[no-untyped-def]
    """P ← F P Fᵀ + Q in place; ``work`` is scratch of the size of P."""
    e = P.shape[0]
    for i in range(e):
        for j in range(e):
            work[i, j] = 0.0
        for k in range(e):
            f = F[i, k]
            if f != 0.0:
                for j in range(e):
                    work[i, j] += f * P[k, j]
    for i in range(e):
        for j in range(i + 1):
            total = 0.0
            for k in range(e):
                total += work[i, k] * F[j, k]
            P[i, j] = total + 0.5 * (Q[i, j] + Q[j, i])
            P[j, i] = P[i, j]


def correct(r, H, R, P, dx, white, rows, S, HP, K):  # type: ignore[no-untyped-def]
    """Condition on one measurement; Joseph form, rows with anything not finite are left out.

    S = H P Hᵀ + R = L Lᵀ,  K = P Hᵀ S⁻¹,  P ← (I − K H) P (I − K H)ᵀ + K R Kᵀ,  dx = K r,  white = L⁻¹ r

    In: residual r ``(m,)``, Jacobian H ``(m, e)``, covariance R ``(m, m)``. Changed in place: P ``(e, e)``. Out: dx
    ``(e,)``, white ``(m,)``. Scratch: rows ``(m,)`` integers, S ``(m, m)``, HP and K ``(m, e)``. Returns the normalised
    innovation squared, 0 if every row was left out.
    """
    m, e = H.shape
    count = 0
    for a in range(m):
        white[a] = 0.0
        usable = np.isfinite(r[a]) and np.isfinite(R[a, a])
        for j in range(e):
            usable = usable and np.isfinite(H[a, j])
        if usable:
            rows[count] = a
            count += 1
    for j in range(e):
        dx[j] = 0.0
    if count == 0:
        return 0.0
    for a in range(count):
        for j in range(e):
            HP[a, j] = 0.0
        for k in range(e):
            h = H[rows[a], k]
            if h != 0.0:
                for j in range(e):
                    HP[a, j] += h * P[k, j]
    for a in range(count):
        for b in range(a + 1):
            total = 0.5 * (R[rows[a], rows[b]] + R[rows[b], rows[a]])
            for k in range(e):
                total += HP[a, k] * H[rows[b], k]
            S[a, b] = total
    # Cholesky factor in the lower triangle of S, then L⁻¹ r and the gain by substitution.
    for a in range(count):
        for b in range(a + 1):
            total = S[a, b]
            for k in range(b):
                total -= S[a, k] * S[b, k]
            S[a, b] = np.sqrt(total) if a == b else total / S[b, b]
    nis = 0.0
    for a in range(count):
        total = r[rows[a]]
        for k in range(a):
            total -= S[a, k] * white[rows[k]]
        total /= S[a, a]
        white[rows[a]] = total
        nis += total * total
        for j in range(e):
            K[a, j] = HP[a, j]
        for k in range(a):
            for j in range(e):
                K[a, j] -= S[a, k] * K[k, j]
        for j in range(e):
            K[a, j] /= S[a, a]
    for a in range(count):
        for j in range(e):
            dx[j] += K[a, j] * white[rows[a]]
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
            for j in range(e):
                K[a, j] -= S[k, a] * K[k, j]
        for j in range(e):
            K[a, j] /= S[a, a]
    # (I − K H) P, then times (I − K H)ᵀ plus K R Kᵀ; both products have the rank of the measurement.
    for i in range(e):
        for a in range(count):
            gain = K[a, i]
            for j in range(e):
                P[i, j] -= gain * HP[a, j]
    for a in range(count):
        for i in range(e):
            total = 0.0
            for k in range(e):
                total += P[i, k] * H[rows[a], k]
            for b in range(count):
                total -= K[b, i] * 0.5 * (R[rows[b], rows[a]] + R[rows[a], rows[b]])
            HP[a, i] = total
    for i in range(e):
        for j in range(i + 1):
            total = 0.5 * (P[i, j] + P[j, i])
            for a in range(count):
                total -= 0.5 * (HP[a, i] * K[a, j] + HP[a, j] * K[a, i])
            P[i, j] = total
            P[j, i] = total
    return nis
