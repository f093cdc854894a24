"""Reverse-mode derivatives of the Kalman recursion as plain loops, the same for every model.

In all functions a name that begins with g is the derivative of the final number with respect to what follows. The
covariance after an update is P − K S Kᵀ: for the optimal gain this and the form of :func:`.kernel.correct` are the same
function of P, H and R, so their derivatives are the same.
"""

from __future__ import annotations

import numpy as np

from .cache import jit
from .kernel import fill, finite, symmetric


@jit
def invert(S, count, W, work):  # type: ignore[no-untyped-def]
    """W ← S⁻¹ of the leading ``(count, count)`` block, S positive definite; returns log det S."""
    logarithm = 0.0
    for a in range(count):
        for b in range(a + 1):
            total = S[a, b]
            for k in range(b):
                total -= work[a, k] * work[b, k]
            work[a, b] = np.sqrt(total) if a == b else total / work[b, b]
        logarithm += 2.0 * np.log(work[a, a])
    for c in range(count):
        for a in range(count):
            total = 1.0 if a == c else 0.0
            for k in range(a):
                total -= work[a, k] * W[k, c]
            W[a, c] = total / work[a, a]
        for a in range(count - 1, -1, -1):
            total = W[a, c]
            for k in range(a + 1, count):
                total -= work[k, a] * W[k, c]
            W[a, c] = total / work[a, a]
    return logarithm


@jit
def innovation(r, H, R, P, rows, A, S, W, y, work):  # type: ignore[no-untyped-def]
    """A = P Hᵀ ``(e, count)``, S = H A + R, W = S⁻¹, y = W r of the rows that are finite.

    Returns their number and log det S.
    """
    e, count = P.shape[0], 0
    for a in range(r.shape[0]):
        if np.isfinite(r[a]) and np.isfinite(R[a, a]) and finite(H[a]):
            rows[count] = a
            count += 1
    for i in range(e):
        for a in range(count):
            total = 0.0
            for k in range(e):
                total += P[i, k] * H[rows[a], k]
            A[i, a] = total
    for a in range(count):
        for b in range(count):
            total = 0.5 * (R[rows[a], rows[b]] + R[rows[b], rows[a]])
            for k in range(e):
                total += H[rows[a], k] * A[k, b]
            S[a, b] = total
    logarithm = invert(S, count, W, work)
    for a in range(count):
        y[a] = 0.0
        for b in range(count):
            y[a] += W[a, b] * r[rows[b]]
    return count, logarithm


@jit
def gain_times(A, y, count, dx):  # type: ignore[no-untyped-def]
    """Correction dx = K r = A y."""
    for i in range(dx.shape[0]):
        dx[i] = 0.0
        for a in range(count):
            dx[i] += A[i, a] * y[a]


@jit
def correct_back(H, P, rows, count, A, W, y, gdx, gP, gnis, glogarithm, gr, gH, gR, work):  # type: ignore[no-untyped-def]
    """Derivatives of an update; the rows that were left out have none.

        dx = A y,   P⁺ = P − A W Aᵀ,   nis = rᵀ y,   with A = P Hᵀ, S = H A + R, W = S⁻¹, y = W r

    In: gdx ``(e,)``, gP ``(e, e)`` symmetric, of P⁺; gnis, glogarithm of the normalised innovation squared and of log
    det S. Out: gr, gH, gR, and gP of P. Scratch: work, a tuple of matrices ``(e, m)``, ``(e, m)``, ``(m, m)`` and a
    vector ``(m,)``.
    """
    e, m = P.shape[0], gr.shape[0]
    K, gA, gS, gy = work
    fill(gr, 0.0)
    for a in range(m):
        fill(gH[a], 0.0)
        fill(gR[a], 0.0)
    for i in range(e):
        for a in range(count):
            total = 0.0
            for b in range(count):
                total += A[i, b] * W[b, a]
            K[i, a] = total
    # gA = gdx yᵀ − 2 gP K
    for i in range(e):
        for a in range(count):
            total = gdx[i] * y[a]
            for k in range(e):
                total -= 2.0 * gP[i, k] * K[k, a]
            gA[i, a] = total
    # gr = W gy + 2 gnis y,  gS = −(W gy) yᵀ + Kᵀ gP K − gnis y yᵀ + glogarithm W
    for a in range(count):
        gy[a] = 0.0
        for i in range(e):
            gy[a] += A[i, a] * gdx[i]
    for a in range(count):
        passed = 0.0
        for b in range(count):
            passed += W[a, b] * gy[b]
        gr[rows[a]] = passed + 2.0 * gnis * y[a]
        for b in range(count):
            total = -passed * y[b] - gnis * y[a] * y[b] + glogarithm * W[a, b]
            for i in range(e):
                # half of −gA's second part is gP K
                total += 0.5 * K[i, a] * (gdx[i] * y[b] - gA[i, b])
            gS[a, b] = total
    for a in range(count):
        for b in range(a + 1):
            gS[a, b] = gS[b, a] = 0.5 * (gS[a, b] + gS[b, a])
    # S = H A + R
    for a in range(count):
        for b in range(count):
            gR[rows[a], rows[b]] = gS[a, b]
            for k in range(e):
                gH[rows[a], k] += gS[a, b] * A[k, b]
    for i in range(e):
        for a in range(count):
            for b in range(count):
                gA[i, a] += H[rows[b], i] * gS[b, a]
    # A = P Hᵀ
    for a in range(count):
        for k in range(e):
            for i in range(e):
                gH[rows[a], k] += gA[i, a] * P[i, k]
    for i in range(e):
        for j in range(e):
            for a in range(count):
                gP[i, j] += gA[i, a] * H[rows[a], j]
    symmetric(gP)


@jit
def propagate_back(F, P, gP, gF, work):  # type: ignore[no-untyped-def]
    """Derivatives of F P Fᵀ: gF = 2 gP F P and gP ← Fᵀ gP F, in place; that of Q is gP as it was."""
    e = P.shape[0]
    for i in range(e):
        for j in range(e):
            total = 0.0
            for k in range(e):
                total += gP[i, k] * F[k, j]
            work[i, j] = total
    for i in range(e):
        for j in range(e):
            total = 0.0
            for k in range(e):
                total += work[i, k] * P[k, j]
            gF[i, j] = 2.0 * total
    for i in range(e):
        for j in range(e):
            total = 0.0
            for k in range(e):
                total += F[k, i] * work[k, j]
            gP[i, j] = total
    symmetric(gP)
