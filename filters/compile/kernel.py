"""The steps of the Kalman recursion as plain loops, the same for every model.

F and H of most models are mostly zeros, so products run over lists of the elements that can be other: line i has
``column[first[i]:first[i + 1]]``. Sums over several columns or rows at a time stay in registers; each is formed in the
order in which it is written.
"""

from __future__ import annotations

import numpy as np

from ..core.held_inputs import UNCERTAIN_TILT
from .cache import jit


@jit
def fill(array, value):  # type: ignore[no-untyped-def]
    """Every element of a vector ← value; loops compile faster than slices."""
    for i in range(array.shape[0]):
        array[i] = value


@jit
def copy(source, target):  # type: ignore[no-untyped-def]
    """A vector into another."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@jit
def copy_matrix(source, target):  # type: ignore[no-untyped-def]
    """A matrix into another."""
    for i in range(source.shape[0]):
        copy(source[i], target[i])


@jit
def symmetric(matrix):  # type: ignore[no-untyped-def]
    """M ← (M + Mᵀ) / 2."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            matrix[i, j] = matrix[j, i] = 0.5 * (matrix[i, j] + matrix[j, i])


@jit
def finite(array):  # type: ignore[no-untyped-def]
    """Whether every element of a vector is finite."""
    for i in range(array.shape[0]):
        if not np.isfinite(array[i]):
            return False
    return True


@jit
def zeros(rows, columns):  # type: ignore[no-untyped-def]
    """A matrix of zeros; numpy.zeros takes longer to compile."""
    matrix = np.empty((rows, columns))
    for i in range(rows):
        fill(matrix[i], 0.0)
    return matrix


@jit
def scratch(n, e, m, d, p):  # type: ignore[no-untyped-def]
    """Memory of a run, reused at every time step: vectors, matrices of states and of rows, the rows that were used.

    For n states, e error states, m rows, d numbers a sample and p parameters: current, present, before, x1, x0, r, dx,
    grown, blind; P0, F, Q, work; H, R, S, HP, K; rows.
    """
    samples = np.empty(d), np.empty(d), np.empty(d)
    vectors = *samples, np.empty(n), np.empty(n), np.empty(m), np.empty(e), np.empty(p), np.empty(d)
    square = zeros(e, e), zeros(e, e), zeros(e, e), zeros(e, e)
    measured = zeros(m, e), zeros(m, m), zeros(m, m), zeros(m, e), zeros(m, e)
    return vectors, square, measured, np.empty(m, np.int64)


@jit
def take(z, held, age, starts, dt, current, present, before):  # type: ignore[no-untyped-def]
    """A sample with the last one where it is missing (current), with zeros where nothing is known (present, before).

    ``age`` is that of each channel, whose elements are ``starts[c]:starts[c + 1]``. Returns whether anything is held.
    """
    for i in range(z.shape[0]):
        current[i] = z[i] if np.isfinite(z[i]) else held[i]
        present[i] = current[i] if np.isfinite(current[i]) else 0.0
        before[i] = held[i] if np.isfinite(held[i]) else 0.0
        held[i] = current[i]
    missing = False
    for c in range(age.shape[0]):
        age[c] = 0.0 if finite(z[starts[c] : starts[c + 1]]) else age[c] + dt
        missing = missing or age[c] > 0.0
    return missing


@jit
def all_older(age, channels, limit):  # type: ignore[no-untyped-def]
    """Whether the last samples of all of some channels are older than a limit; False of none."""
    for c in channels:
        if age[c] <= limit:
            return False
    return len(channels) > 0


@jit
def all_new(age, channels):  # type: ignore[no-untyped-def]
    """Whether all of some channels have a sample at this time step."""
    for c in channels:
        if age[c] > 0.0:
            return False
    return True


@jit
def is_unsure(P, tilt):  # type: ignore[no-untyped-def]
    """Whether the rotation that begins in row ``tilt`` of the error is uncertain about the horizontal axes; not if −1.

    See :func:`poise.filters.core.held_inputs.tilt_variance`.
    """
    return tilt >= 0 and 0.5 * (P[tilt, tilt] + P[tilt + 1, tilt + 1]) > UNCERTAIN_TILT * UNCERTAIN_TILT


@jit
def without_field(z, field, blind):  # type: ignore[no-untyped-def]
    """Write a sample without the three numbers of the magnetometer, which begin at ``field`` (−1: it has none)."""
    copy(z, blind)
    if field >= 0:
        fill(blind[field : field + 3], np.nan)


@jit
def begin(x0, P0, factor, x, P):  # type: ignore[no-untyped-def]
    """Start from a prior if it is finite, with a factor on its covariance; returns whether it is."""
    if not finite(x0):
        return False
    for i in range(P0.shape[0]):
        if not finite(P0[i]):
            return False
    copy(x0, x)
    for i in range(P0.shape[0]):
        for j in range(P0.shape[0]):
            P[i, j] = factor * P0[i, j]
    return True


@jit
def keep(started, P, pose, covariances, t, b):  # type: ignore[no-untyped-def]
    """Write the covariance of a time step, if covariances are kept; before the start that and the pose are NaN."""
    if not started:
        fill(pose, np.nan)
    if covariances.shape[0] > 0:
        for i in range(P.shape[0]):
            for j in range(P.shape[0]):
                covariances[t, b, i, j] = P[i, j] if started else np.nan


@jit
def propagate(F, P, Q, work, first, column):  # type: ignore[no-untyped-def]
    """P ← F P Fᵀ + Q in place; all ``(e, e)``, with the lists of F. Scratch: work ``(e, e)``."""
    n = P.shape[0]
    for i in range(n):
        begin, end, j = first[i], first[i + 1], 0
        while j + 4 <= n:
            s0 = s1 = s2 = s3 = 0.0
            for t in range(begin, end):
                k = column[t]
                f = F[i, k]
                s0 += f * P[k, j]
                s1 += f * P[k, j + 1]
                s2 += f * P[k, j + 2]
                s3 += f * P[k, j + 3]
            work[i, j], work[i, j + 1], work[i, j + 2], work[i, j + 3] = s0, s1, s2, s3
            j += 4
        while j < n:
            s0 = 0.0
            for t in range(begin, end):
                s0 += F[i, column[t]] * P[column[t], j]
            work[i, j] = s0
            j += 1
    for j in range(n):
        begin, end, i = first[j], first[j + 1], j
        while i + 3 <= n:
            s0 = s1 = s2 = 0.0
            for t in range(begin, end):
                k = column[t]
                f = F[j, k]
                s0 += work[i, k] * f
                s1 += work[i + 1, k] * f
                s2 += work[i + 2, k] * f
            P[i, j], P[i + 1, j], P[i + 2, j] = s0, s1, s2
            i += 3
        while i < n:
            s0 = 0.0
            for t in range(begin, end):
                s0 += work[i, column[t]] * F[j, column[t]]
            P[i, j] = s0
            i += 1
    for i in range(n):
        for j in range(i + 1):
            P[i, j] = P[j, i] = P[i, j] + 0.5 * (Q[i, j] + Q[j, i])


@jit
def correct(r, H, R, P, dx, white, rows, S, HP, K, first, column):  # type: ignore[no-untyped-def]
    """Condition on a measurement; rows with anything not finite are left out.

    S = H P Hᵀ + R = L Lᵀ,  K = P Hᵀ S⁻¹,  P ← (I − K H) P (I − K H)ᵀ + K R Kᵀ,  dx = K r,  white = L⁻¹ r

    In: residual r ``(m,)``, Jacobian H ``(m, e)`` with its lists, covariance R ``(m, m)``. Changed in place: P
    ``(e, e)``. Out: dx ``(e,)``, white ``(m,)``, rows ``(m,)`` (the count that were used, then −1); of these, the
    Cholesky factor of S ``(m, m)`` and K ``(m, e)``. Scratch: HP ``(m, e)``. Returns the normalised innovation squared,
    0 if every row was left out.
    """
    n = P.shape[0]
    count = 0
    for a in range(r.shape[0]):
        white[a] = 0.0
        if np.isfinite(r[a]) and np.isfinite(R[a, a]) and finite(H[a]):
            rows[count] = a
            count += 1
    for a in range(count, r.shape[0]):
        rows[a] = -1
    fill(dx, 0.0)
    if count == 0:
        return 0.0
    for a in range(count):
        for j in range(n):
            HP[a, j] = 0.0
        for t in range(first[rows[a]], first[rows[a] + 1]):
            k = column[t]
            h = H[rows[a], k]
            for j in range(n):
                HP[a, j] += h * P[k, j]
    for a in range(count):
        for b in range(a + 1):
            total = 0.5 * (R[rows[a], rows[b]] + R[rows[b], rows[a]])
            for t in range(first[rows[b]], first[rows[b] + 1]):
                total += HP[a, column[t]] * H[rows[b], column[t]]
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
        for j in range(n):
            K[a, j] = HP[a, j]
        for k in range(a):
            if S[a, k] != 0.0:
                for j in range(n):
                    K[a, j] -= S[a, k] * K[k, j]
        for j in range(n):
            K[a, j] /= S[a, a]
    for a in range(count):
        for j in range(n):
            dx[j] += K[a, j] * white[rows[a]]
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
            if S[k, a] != 0.0:
                for j in range(n):
                    K[a, j] -= S[k, a] * K[k, j]
        for j in range(n):
            K[a, j] /= S[a, a]
    # (I − K H) P, then times (I − K H)ᵀ plus K R Kᵀ; both products have the rank of the measurement.
    for i in range(n):
        for a in range(count):
            gain = K[a, i]
            for j in range(n):
                P[i, j] -= gain * HP[a, j]
    for a in range(count):
        for i in range(n):
            total = 0.0
            for t in range(first[rows[a]], first[rows[a] + 1]):
                total += P[i, column[t]] * H[rows[a], column[t]]
            HP[a, i] = total
        for b in range(count):
            noise = 0.5 * (R[rows[b], rows[a]] + R[rows[a], rows[b]])
            if noise != 0.0:
                for i in range(n):
                    HP[a, i] -= K[b, i] * noise
    for i in range(n):
        for j in range(i + 1):
            total = 0.5 * (P[i, j] + P[j, i])
            for a in range(count):
                total -= 0.5 * (HP[a, i] * K[a, j] + HP[a, j] * K[a, i])
            P[i, j] = total
            P[j, i] = total
    return nis


@jit
def remember(K, S, rows, gain, factor, used):  # type: ignore[no-untyped-def]
    """Keep what :func:`correct` has left behind, for the way back."""
    for a in range(rows.shape[0]):
        used[a] = rows[a]
        if rows[a] < 0:
            break
        for j in range(K.shape[1]):
            gain[a, j] = K[a, j]
        for b in range(a + 1):
            factor[a, b] = S[a, b]
