"""Whether the force/inertial filter's covariance tells the truth where its model does.

Runs are drawn from the model itself: the gyroscopes' samples are given, the true angles move as these say plus the
process noise, and forces are such that the residual at the truth is the measurement noise. Level shoulders cannot be
drawn that way, so that row is switched off.
"""

from __future__ import annotations

import numpy as np

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.core.consistency import consistency, nees
from ....filters.core.kalman import FilterState, KalmanFilter
from ....filters.core.sampling import join
from .motion import DEG, NO_ERRORS, draw_motion, simulate

UNUSED = 1e3
"""Deviation of the shoulders' tilt that switches the row off."""
FREE = (3, 4, 1)
"""Elements of ``seat/wrench`` that set τ̂_φh, τ̂_θ and φ̂_b: moments about x and y, force along y."""
PRIOR = {"lean_prior": 3.0 * DEG, "pitch_prior": 3.0 * DEG, "spin_prior": 3.0 * DEG, "roll_prior": 2.0 * DEG}


def forces_for(model: ForceInertial, x: np.ndarray, z: dict[str, np.ndarray], wanted: np.ndarray) -> np.ndarray:
    """The seat's wrench ``(..., 6)`` with which the first three residuals at ``x`` are ``wanted`` ``(..., 3)``."""
    wrench = z["seat/wrench"].copy()
    for _ in range(2):
        missing = wanted - model.residual(x, {**z, "seat/wrench": wrench})[0][..., :3]
        columns = []
        for element in FREE:
            step = np.zeros(6)
            step[element] = 1e-3
            moved = [model.residual(x, {**z, "seat/wrench": wrench + sign * step})[0][..., :3] for sign in (1, -1)]
            columns.append((moved[0] - moved[1]) / 2e-3)
        change = np.linalg.solve(np.stack(columns, axis=-1), missing[..., None])[..., 0]
        wrench[..., FREE] += change
    return wrench


def ideal_consistency(
    runs: int = 50, duration: float = 6.0, seed: int = 0, level: float = 0.95
) -> dict[str, dict[str, float]]:
    """NEES of the angles and of all seven states at the end of each run, and NIS of every tick.

    Args:
        runs: how many.
        duration: s.
        seed: of all draws.
        level: probability between the bounds of a consistent filter.

    Returns:
        Name → ratio to the degrees of freedom, its two bounds, number of samples.
    """
    model = ForceInertial.published(shoulder_noise=UNUSED, **PRIOR)
    rng = np.random.default_rng(seed)
    inputs, truth = simulate(draw_motion(rng, "indoor", NO_ERRORS), NO_ERRORS, ForceInertial.published(), duration, rng)
    ticks = len(inputs["wheel/speed"])
    data = {name: np.repeat(array[:, None], runs, axis=1) for name, array in inputs.items()}
    first = {name: array[0] for name, array in data.items()}
    x0, P0 = model.prior(first)
    P0 = np.broadcast_to(P0, (runs, 7, 7)).copy()
    x0[:, :3], x0[:, 3:4] = truth["force-inertial/trunk_angles"][0], truth["bicycle/roll"][0]
    x = model.retract(x0, np.sqrt(np.diagonal(P0, axis1=-2, axis2=-1)) * rng.standard_normal((runs, 7)))
    deviations = np.array([model.torque_noise, model.torque_noise, model.roll_noise])
    for k in range(1, ticks):
        now, before = ({name: array[j] for name, array in data.items()} for j in (k, k - 1))
        x, _, Q = model.predict(x, now, before)
        roots, axes = np.linalg.eigh(Q)
        spread = axes * np.sqrt(np.maximum(roots, 0.0))[..., None, :]
        x = model.retract(x, (spread @ rng.standard_normal((runs, 7, 1)))[..., 0])
        data["seat/wrench"][k] = forces_for(model, x, now, deviations * rng.standard_normal((runs, 3)))
    start = FilterState(x0, P0, join(first, model.channels), np.ones(runs, dtype=bool))
    rest = {name: array[1:] for name, array in data.items()}
    estimate, end = KalmanFilter(model).run_from(start, rest)
    difference = x[:, :7] - end.x[:, :7]
    covariance = end.covariance
    found = {
        "NEES of the angles": consistency(nees(difference[:, :4], covariance[:, :4, :4]), 4, level=level),
        "NEES of all states": consistency(nees(difference, covariance), 7, level=level),
        # shoulders tell nothing: three rows
        "NIS": consistency(estimate.nis, 3, level=level),
    }
    return {
        name: {"ratio": each.ratio, "lower": each.lower, "upper": each.upper, "samples": each.samples}
        for name, each in found.items()
    }
