"""The loops of a filter that gives derivatives, forward and backward, the same for every model."""

from __future__ import annotations

import numpy as np

from .adjoint_kernel import correct_back, gain_times, innovation, propagate_back
from .cache import jit
from .kernel import begin, copy, copy_matrix, correct, fill, propagate, scratch, symmetric, take, zeros
from .native import call
from .plan import DT, FINISH, GROW, POSE, PREDICT, PRIOR, RESIDUAL, RETRACT, part

BACK = ("predict_back", "residual_back", "retract_back", "finish_back", "pose_back")
"""Functions of the way back, in the order of their addresses."""
PREDICT_BACK, RESIDUAL_BACK, RETRACT_BACK, FINISH_BACK, POSE_BACK = range(5)


@jit
def follow(  # type: ignore[no-untyped-def]
    x, P, held, age, started, Z, parameters, poses, covariances, whites, nis, logarithms, records, plan
):
    """Forward; what the way back needs is kept: the state before each sample, and the samples as they were used."""
    stages, xs, Ps, presents, befores, ages = records
    sizes = x.shape[1], P.shape[1], whites.shape[2], Z.shape[2], parameters.shape[2]
    vectors, square, measured, rows = scratch(*sizes)
    current, present, before, x1, x0, r, dx, noise, _ = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured
    starts, F_first, F_column = part(plan, 0), part(plan, 1), part(plan, 2)
    H_first, H_column = part(plan, 3), part(plan, 4)
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white = Z[t, b], x[b], P[b], whites[t, b]
            copy(state, xs[t, b])
            copy_matrix(P1, Ps[t, b])
            take(z, held[b], age[b], starts, p[plan[DT]], current, present, before)
            copy(present, presents[t, b])
            copy(before, befores[t, b])
            copy(age[b], ages[t, b])
            logarithms[t, b] = 0.0
            if started[b]:
                call(plan[GROW], (p, age[b], present, P1, noise))
                call(plan[PREDICT], (state, present, before, noise, x1, F, Q))
                propagate(F, P1, Q, work, F_first, F_column)
                call(plan[RESIDUAL], (x1, z, p, r, H, R))
                for a in range(r.shape[0]):
                    S[a, a] = 1.0
                nis[t, b] = correct(r, H, R, P1, dx, white, rows, S, HP, K, H_first, H_column)
                if nis[t, b] != 0.0:
                    for a in range(r.shape[0]):
                        logarithms[t, b] += 2.0 * np.log(S[a, a])
                call(plan[RETRACT], (x1, dx, p, x0))
                call(plan[FINISH], (x0, z, p, state))
                stages[t, b] = 2
            else:
                call(plan[PRIOR], (current, p, x0, P0))
                nis[t, b] = 0.0
                fill(white, 0.0)
                started[b] = begin(x0, P0, 1.0, state, P1)
                stages[t, b] = 1 if started[b] else 0
            call(plan[POSE], (state, p, poses[t, b]))
            if not started[b]:
                fill(poses[t, b], np.nan)
            copy_matrix(P1, covariances[t, b])


@jit
def back(Z, parameters, records, given, gx, gP, gparameters, plan, own):  # type: ignore[no-untyped-def]
    """Backward; gx and gP, in: of the last state, out: of the first.

    Args:
        Z: samples.
        parameters: of each.
        records: of :func:`follow`.
        given: derivatives with respect to poses, covariances, normalised innovations squared and log det S.
        gx: ``(B, n)``.
        gP: ``(B, e, e)``.
        gparameters: ``(T, B, gains)`` zeros, to which is added.
        plan: of the model.
        own: addresses of the functions of the way back, then pairs: a parameter that grows, and its gain.
    """
    stages, xs, Ps, presents, befores, ages = records
    gposes, gcovariances, gnis, glogarithms = given
    F_first, F_column = part(plan, 1), part(plan, 2)
    n, e, m, w = xs.shape[2], Ps.shape[2], part(plan, 3).shape[0] - 1, parameters.shape[2]
    k = gparameters.shape[2]
    x1, x2, x3, r, dx, noise, y = (
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(m),
        np.empty(e),
        np.empty(w),
        np.empty(m),
    )
    F, Q, P1, square, H, R = zeros(e, e), zeros(e, e), zeros(e, e), zeros(e, e), zeros(m, e), zeros(m, m)
    A, S, W, factor = zeros(e, m), zeros(m, m), zeros(m, m), zeros(m, m)
    rows = np.empty(m, np.int64)
    gr, gH, gR, gdx, gF = np.empty(m), zeros(m, e), zeros(m, m), np.empty(e), zeros(e, e)
    more, passed, gp = np.empty(n), np.empty(n), np.empty(k)
    work = zeros(e, m), zeros(e, m), zeros(m, m), np.empty(m)
    for t in range(Z.shape[0] - 1, -1, -1):
        for b in range(Z.shape[1]):
            if stages[t, b] == 0:
                continue
            if stages[t, b] == 1:
                fill(gx[b], 0.0)
                for i in range(e):
                    fill(gP[b, i], 0.0)
                continue
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, present, before = Z[t, b], presents[t, b], befores[t, b]
            # the sample again
            call(plan[GROW], (p, ages[t, b], present, Ps[t, b], noise))
            call(plan[PREDICT], (xs[t, b], present, before, noise, x1, F, Q))
            copy_matrix(Ps[t, b], P1)
            propagate(F, P1, Q, square, F_first, F_column)
            call(plan[RESIDUAL], (x1, z, p, r, H, R))
            count, _ = innovation(r, H, R, P1, rows, A, S, W, y, factor)
            gain_times(A, y, count, dx)
            call(plan[RETRACT], (x1, dx, p, x2))
            call(plan[FINISH], (x2, z, p, x3))
            # and back
            call(own[POSE_BACK], (x3, p, gposes[t, b], more))
            for i in range(n):
                gx[b, i] += more[i]
            for i in range(e):
                for j in range(e):
                    gP[b, i, j] += gcovariances[t, b, i, j]
            symmetric(gP[b])
            call(own[FINISH_BACK], (x2, z, p, gx[b], passed, gp))
            for i in range(k):
                gparameters[t, b, i] += gp[i]
            call(own[RETRACT_BACK], (x1, dx, p, passed, more, gdx, gp))
            for i in range(k):
                gparameters[t, b, i] += gp[i]
            correct_back(H, P1, rows, count, A, W, y, gdx, gP[b], gnis[t, b], glogarithms[t, b], gr, gH, gR, work)
            if count > 0:
                call(own[RESIDUAL_BACK], (x1, z, p, gr, gH, gR, passed, gp))
                for i in range(n):
                    more[i] += passed[i]
                for i in range(k):
                    gparameters[t, b, i] += gp[i]
            for i in range(e):
                copy(gP[b, i], Q[i])
            propagate_back(F, Ps[t, b], gP[b], gF, square)
            call(own[PREDICT_BACK], (xs[t, b], present, before, noise, more, gF, Q, gx[b], gp))
            for i in range(e):
                fill(Q[i], 0.0)
            for place in range(len(BACK), own.shape[0], 2):
                i = own[place]
                if noise[i] > 0.0:
                    gp[own[place + 1]] *= p[i] / noise[i]
            for i in range(k):
                gparameters[t, b, i] += gp[i]
