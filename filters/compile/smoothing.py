"""One step back of fixed-interval (Rauch–Tung–Striebel) smoothing as plain loops, the same for every model.

The smoothed state is that of the filter, corrected by a smoothed error: ``x = finish(retract(updated, δ))``. So no
model needs a difference of two states, and where nothing is to be corrected (δ = 0) the filter is its own smoother.
"""

from __future__ import annotations

import numpy as np

from .cache import jit

SINGULAR = 1e-13
"""share of its variance, given the states before it, below which a state counts as determined by them"""


@jit
def smooth_step(P, F, predicted, error, smoothed, M, work, scale):  # type: ignore[no-untyped-def]
    """Carry the smoothed error and covariance one sample back, in place.

        G = P Fᵀ P⁻⁻¹,   δ ← G δ⁻,   Pˢ ← P + G (Pˢ − P⁻) Gᵀ

    Inner loops run along rows, so that they are vectorised.

    Args:
        P: ``(e, e)`` covariance after the measurement update of this sample.
        F: ``(e, e)`` error transition from this sample to the next.
        predicted: ``(e, e)`` P⁻ of the next sample.
        error: ``(e,)`` in: smoothed minus predicted state of the next sample; out: smoothed minus updated of this one.
        smoothed: ``(e, e)`` in: Pˢ of the next sample; out: of this one.
        M: ``(e, e)`` scratch, becomes Gᵀ.
        work: ``(e, e)`` scratch.
        scale: ``(e,)`` scratch.
    """
    e = P.shape[0]
    # Cholesky factor of P⁻ scaled to a unit diagonal. A state that the others determine gets a zero column, which makes
    # the solution that of a pseudo-inverse.
    for i in range(e):
        scale[i] = 1.0 / np.sqrt(predicted[i, i]) if predicted[i, i] > 0.0 else 0.0
    for i in range(e):
        for j in range(i + 1):
            total = predicted[i, j] * scale[i] * scale[j]
            for k in range(j):
                total -= work[i, k] * work[j, k]
            if i > j:
                work[i, j] = total * work[j, j]
            else:
                work[i, i] = 1.0 / np.sqrt(total) if total > SINGULAR else 0.0
    # M = P⁻⁻¹ F P by two triangular solves; the diagonal of the factor is kept inverted.
    for i in range(e):
        for c in range(e):
            M[i, c] = 0.0
        for k in range(e):
            f = F[i, k] * scale[i]
            if f != 0.0:
                for c in range(e):
                    M[i, c] += f * P[k, c]
        for k in range(i):
            f = work[i, k]
            for c in range(e):
                M[i, c] -= f * M[k, c]
        for c in range(e):
            M[i, c] *= work[i, i]
    for i in range(e - 1, -1, -1):
        for k in range(i + 1, e):
            f = work[k, i]
            for c in range(e):
                M[i, c] -= f * M[k, c]
        for c in range(e):
            M[i, c] *= work[i, i]
    for i in range(e):
        for c in range(e):
            M[i, c] *= scale[i]
    for c in range(e):
        scale[c] = 0.0
    for i in range(e):
        for c in range(e):
            scale[c] += M[i, c] * error[i]
    for c in range(e):
        error[c] = scale[c]
    # Pˢ = P + Mᵀ (Pˢ − P⁻) M
    for i in range(e):
        for c in range(e):
            work[i, c] = 0.0
        for k in range(e):
            f = smoothed[i, k] - predicted[i, k]
            for c in range(e):
                work[i, c] += f * M[k, c]
    for i in range(e):
        for c in range(e):
            smoothed[i, c] = P[i, c]
    for k in range(e):
        for i in range(e):
            f = M[k, i]
            for c in range(e):
                smoothed[i, c] += f * work[k, c]
    for i in range(e):
        for c in range(i):
            smoothed[i, c] = smoothed[c, i] = 0.5 * (smoothed[i, c] + smoothed[c, i])
