"""The Kalman recursion as plain loops: the part of the compiled filter that is the same for every model.

The text of this file is put in front of the traced equations of a model and compiled with them
(:mod:`poise.filters.compile.run`), so it holds nothing but functions of arrays. It runs without a compiler too.
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


def at(index, i):  # type: ignore[no-untyped-def]
    """Element of an index list; None is the list 0, 1, 2 …, which costs nothing when compiled."""
    if index is None:
        return i
    return index[i]


def begin(first, i):  # type: ignore[no-untyped-def]
    """Where line i of a sparsity pattern starts; None is the pattern without zeros."""
    if first is None:
        return 0
    return first[i]


def end(first, i, n):  # type: ignore[no-untyped-def]
    """Where line i of a sparsity pattern of n columns ends."""
    if first is None:
        return n
    return first[i + 1]


def coupled(P, part):  # type: ignore[no-untyped-def]
    """Whether a covariance links states of different parts; ``part`` ``(e,)`` tells the part of each state."""
    e = P.shape[0]
    for i in range(e):
        for j in range(i):
            if part[i] != part[j] and (P[i, j] != 0.0 or P[j, i] != 0.0):
                return True
    return False


def gather(P, states, local):  # type: ignore[no-untyped-def]
    """The block of a matrix that belongs to some states, put together."""
    n = states.shape[0]
    for i in range(n):
        for j in range(n):
            local[i, j] = P[states[i], states[j]]


def scatter(local, states, P):  # type: ignore[no-untyped-def]
    """Undo :func:`gather`."""
    n = states.shape[0]
    for i in range(n):
        for j in range(n):
            P[states[i], states[j]] = local[i, j]


def propagate(F, P, Q, work, states, first, column):  # type: ignore[no-untyped-def]
    """P ← F P Fᵀ + Q in place, for the states of one part.

    F and Q are the whole matrices ``(e, e)``, P ``(n, n)`` is that of the part, ``states`` ``(n,)`` its place in them.
    F can be other than zero in row i at the part's columns ``column[first[i]:first[i + 1]]``. ``work`` is scratch.
    None for all three lists: one part, no zeros.
    """
    n = P.shape[0] if states is None else states.shape[0]
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for t in range(begin(first, i), end(first, i, n)):
            k = at(column, t)
            f = F[at(states, i), at(states, k)]
            if f != 0.0:
                for j in range(n):
                    work[i, j] += f * P[k, j]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for t in range(begin(first, j), end(first, j, n)):
                k = at(column, t)
                total += work[i, k] * F[at(states, j), at(states, k)]
            a, b = at(states, i), at(states, j)
            P[i, j] = total + 0.5 * (Q[a, b] + Q[b, a])
            P[j, i] = P[i, j]


def correct(  # type: ignore[no-untyped-def]
    r, H, R, P, dx, white, rows, S, HP, K, states, own, first, column, uncorrelated
):
    """Condition the states of one part on its rows of a measurement; those with anything not finite are left out.

    S = H P Hᵀ + R = L Lᵀ,  K = P Hᵀ S⁻¹,  P ← (I − K H) P (I − K H)ᵀ + K R Kᵀ,  dx = K r,  white = L⁻¹ r

    In: residual r ``(m,)``, Jacobian H ``(m, e)``, covariance R ``(m, m)``, all of the whole; the part's ``states``
    ``(n,)`` and rows ``own``; where H can be other than zero (as for :func:`propagate`); whether R is diagonal. Changed
    in place: the part's P ``(n, n)``. Out, at the part's places: dx ``(e,)``, white ``(m,)``. Scratch: rows ``(m,)``
    integers, S ``(m, m)``, HP and K ``(m, e)``. Returns the normalised innovation squared, 0 if every row was left out.
    """
    n = P.shape[0] if states is None else states.shape[0]
    count = 0
    for q in range(r.shape[0] if own is None else own.shape[0]):
        a = at(own, q)
        white[a] = 0.0
        usable = np.isfinite(r[a]) and np.isfinite(R[a, a])
        for t in range(begin(first, q), end(first, q, n)):
            usable = usable and np.isfinite(H[a, at(states, at(column, t))])
        if usable:
            rows[count] = q
            count += 1
    for j in range(n):
        dx[at(states, j)] = 0.0
    if count == 0:
        return 0.0
    for a in range(count):
        q = rows[a]
        for j in range(n):
            HP[a, j] = 0.0
        for t in range(begin(first, q), end(first, q, n)):
            k = at(column, t)
            h = H[at(own, q), at(states, k)]
            if h != 0.0:
                for j in range(n):
                    HP[a, j] += h * P[k, j]
    for a in range(count):
        for b in range(a + 1):
            q = rows[b]
            total = 0.5 * (R[at(own, rows[a]), at(own, q)] + R[at(own, q), at(own, rows[a])])
            for t in range(begin(first, q), end(first, q, n)):
                k = at(column, t)
                total += HP[a, k] * H[at(own, q), at(states, k)]
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
        total = r[at(own, rows[a])]
        for k in range(a):
            total -= S[a, k] * white[at(own, rows[k])]
        total /= S[a, a]
        white[at(own, rows[a])] = total
        nis += total * total
        for j in range(n):
            K[a, j] = HP[a, j]
        for k in range(a):
            for j in range(n):
                K[a, j] -= S[a, k] * K[k, j]
        for j in range(n):
            K[a, j] /= S[a, a]
    for a in range(count):
        for j in range(n):
            dx[at(states, j)] += K[a, j] * white[at(own, rows[a])]
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
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
        q = rows[a]
        for i in range(n):
            total = 0.0
            for t in range(begin(first, q), end(first, q, n)):
                k = at(column, t)
                total += P[i, k] * H[at(own, q), at(states, k)]
            if uncorrelated:
                total -= K[a, i] * R[at(own, q), at(own, q)]
            else:
                for b in range(count):
                    total -= K[b, i] * 0.5 * (R[at(own, rows[b]), at(own, q)] + R[at(own, q), at(own, rows[b])])
            HP[a, i] = total
    for i in range(n):
        for j in range(i + 1):
            total = 0.5 * (P[i, j] + P[j, i])
            for a in range(count):
                total -= 0.5 * (HP[a, i] * K[a, j] + HP[a, j] * K[a, i])
            P[i, j] = total
            P[j, i] = total
    return nis
