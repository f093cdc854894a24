"""Consistency of the force/inertial filter's covariance where its model is exact.

The gyroscopes' samples are given, the true angles move as these say plus the process noise, and the residual at the
truth is measurement noise.
"""

from __future__ import annotations

import numpy as np

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.core.consistency import Consistency
from ....filters.core.quantity import DEG
from ..model_draws import consistencies
from .motion import NO_ERRORS, draw_motion, simulate

PRIOR = {"lean_prior": 3.0 * DEG, "pitch_prior": 3.0 * DEG, "spin_prior": 3.0 * DEG, "roll_prior": 2.0 * DEG}
PARTS = {"NEES of the angles": slice(0, 4), "NEES of all states": slice(0, 7)}


def ideal_consistency(
    runs: int = 50, duration: float = 6.0, seed: int = 0, level: float = 0.95
) -> dict[str, Consistency]:
    """NEES of the angles and of all seven states at the end of each run, and NIS of every sample.

    Args:
        runs: how many.
        duration: s.
        seed: of all draws.
        level: probability between the bounds of a consistent filter.
    """
    model = ForceInertial.published(**PRIOR)
    rng = np.random.default_rng(seed)
    inputs, truth = simulate(draw_motion(rng, "indoor", NO_ERRORS), NO_ERRORS, ForceInertial.published(), duration, rng)
    data = {name: np.repeat(array[:, None], runs, axis=1) for name, array in inputs.items()}

    def move(_: int, x: np.ndarray, Q: np.ndarray) -> np.ndarray:
        roots, axes = np.linalg.eigh(Q)
        noise = axes @ (np.sqrt(np.maximum(roots, 0.0))[..., None] * rng.standard_normal((runs, 7, 1)))
        return model.retract(x, noise[..., 0])

    start = np.zeros((runs, 7))
    start[:, :3], start[:, 3:4] = truth["force-inertial/trunk_angles"][0], truth["bicycle/roll"][0]
    return consistencies(model, data, start, move, PARTS, rng, level)
