"""The loop over time steps and sequences, the same for every model, whose equations it calls by their addresses."""

from __future__ import annotations

from .cache import jit
from .kernel import (
    all_new,
    all_older,
    begin,
    copy,
    correct,
    fill,
    is_unsure,
    keep,
    propagate,
    remember,
    scratch,
    take,
    without_field,
)
from .native import call
from .plan import (
    DT,
    FIELD,
    FINISH,
    GROW,
    LEVEL,
    LONGEST,
    POSE,
    PREDICT,
    PRIOR,
    REALIGN,
    REJECT,
    RESIDUAL,
    RETRACT,
    STORE,
    TILT,
    WATCH,
    WHERE_LOST,
    part,
)


@jit
def run(  # type: ignore[no-untyped-def]
    x, P, held, age, monitor, started, Z, parameters, restart, poses, covariances, whites, nis, plan, records
):
    """All time steps of all sequences of a batch; the state, x to started, is changed in place.

    ``records`` keeps what the way back needs of every sample, unless it has no place for one: stage, state after the
    update, elements of F and H, gain, factor of the innovations' covariance, and rows that were used.
    """
    stage, updated, entries, gains, factors, used = records
    recorded = stage.shape[0] > 0
    sizes = x.shape[1], P.shape[1], whites.shape[2], Z.shape[2], parameters.shape[2]
    vectors, square, measured, rows = scratch(*sizes)
    current, present, before, x1, x0, r, dx, grown, blind = vectors
    P0, F, Q, work = square
    H, R, S, HP, K = measured
    starts, F_first, F_column = part(plan, 0), part(plan, 1), part(plan, 2)
    H_first, H_column = part(plan, 3), part(plan, 4)
    inputs, longest = part(plan, 5), plan[LONGEST] / 1e6
    watched = restart and plan[WATCH] != 0
    tilt = plan[TILT] if watched else -1
    for t in range(Z.shape[0]):
        for b in range(Z.shape[1]):
            p = parameters[t if parameters.shape[0] > 1 else 0, b if parameters.shape[1] > 1 else 0]
            z, state, P1, white, pose_now = Z[t, b], x[b], P[b], whites[t, b], poses[t, b]
            if watched and started[b]:
                call(plan[REJECT], (z, monitor[b], age[b]))
            outlasted = restart and all_older(age[b], inputs, longest)
            missing = take(z, held[b], age[b], starts, p[plan[DT]], current, present, before)
            lost = watched and monitor[b, plan[WHERE_LOST]] > 0.5
            if started[b] and not lost and not (outlasted and all_new(age[b], inputs)):
                noise, seen = p, z
                if missing:
                    call(plan[GROW], (p, age[b], present, P1, grown))
                    noise = grown
                call(plan[PREDICT], (state, present, before, noise, x1, F, Q))
                if P1.shape[0] > 0:
                    propagate(F, P1, Q, work, F_first, F_column)
                    unsure = is_unsure(P1, tilt)
                    heading = 0.0
                    if unsure:
                        heading = P1[tilt + 2, tilt + 2]
                        seen = blind
                        without_field(z, plan[FIELD], blind)
                        call(plan[LEVEL], (x1, blind, P1, p, r, H, R))
                    else:
                        call(plan[RESIDUAL], (x1, z, p, r, H, R))
                    nis[t, b] = correct(r, H, R, P1, dx, white, rows, S, HP, K, H_first, H_column)
                    if recorded:
                        call(plan[STORE], (F, H, entries[t, b]))
                        remember(K, S, rows, gains[t, b], factors[t, b], used[t, b])
                    if unsure:
                        P1[tilt + 2, tilt + 2] = max(heading, P1[tilt + 2, tilt + 2])
                        # The residual does not write its zeros.
                        fill(H[0], 0.0)
                        fill(H[1], 0.0)
                call(plan[RETRACT], (x1, dx, p, x0))
                if recorded:
                    stage[t, b] = 2
                    copy(x0, updated[t, b])
                call(plan[FINISH], (x0, seen, p, state))
            else:
                factor = 1.0
                if lost:
                    call(plan[REALIGN], (current, monitor[b], p))
                    factor = monitor[b, plan[WHERE_LOST]]
                call(plan[PRIOR], (current, p, x0, P0))
                nis[t, b] = 0.0
                fill(white, 0.0)
                started[b] = begin(x0, P0, factor, state, P1) or started[b]
                if recorded:
                    stage[t, b] = 1 if started[b] else 0
                    copy(x0, updated[t, b])
            call(plan[POSE], (state, p, pose_now))
            if watched and started[b]:
                call(plan[WATCH], (monitor[b], present, z, state, pose_now, age[b], p))
            if covariances.shape[0] > 0 or not started[b]:
                keep(started[b], P1, pose_now, covariances, t, b)
