"""Which gyroscope biases the force/inertial outputs (18) observe, as ranks along exact rides.

The paper's filter has the biases of the trunk's gyroscope; it says that those of both gyroscopes are not observable.
Here the outputs of the filter's own equations are differentiated by four angles and six biases at the start of a ride:
small changes of each run through the model without any update, and the changes of all outputs are stacked.

Whether the covariance is right where the model is exact: samples of the gyroscopes are given, the true angles move as
these say plus the process noise, and the residual at the truth is measurement noise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.core.consistency import Consistency
from ....filters.core.quantity import DEG
from ..claims import Claim
from ..kit import Study
from ..model_draws import consistencies
from ..report import Report
from .motion import NO_ERRORS, draw_motion, simulate
from .simulation import COURSES, synthetic
from .states import true_states

STATES = ("φ_h", "θ", "φ", "φ_b", "b_x", "b_y", "b_z", "c_x", "c_y", "c_z")
"""Angles, biases of the trunk's gyroscope, biases of the bicycle's"""
STEP = 1e-5
"""rad and rad/s: change of each"""
RELATIVE = 1e-7
"""singular value, relative to the largest, from which a direction counts as observed; rounding leaves 1e-10"""
SECONDS = 20.0


def sensitivities(course: str, root: int) -> np.ndarray:
    """Changes of all outputs over a ride, each over its noise, by :data:`STATES`: ``(4 T, 10)``."""
    samples, truth = (
        {name: values[:, 0] for name, values in part.items()}
        for part in synthetic(course, 1, SECONDS, root, NO_ERRORS)  # type: ignore[arg-type]
    )
    model = ForceInertial.published(gyroscope_sample="current")
    start = true_states(model, samples, truth)[0]
    # central differences: + and − of every state side by side
    count = len(STATES)
    changes = STEP * np.concatenate([np.eye(count), -np.eye(count)])
    x = np.repeat(start[None], 2 * count, axis=0)
    x[:, :7] += changes[:, :7]
    shift = changes[:, 7:]
    length = len(samples["wheel/speed"])
    wide = {name: np.repeat(values[:, None], 2 * count, axis=1) for name, values in samples.items()}
    wide["bicycle_imu/gyr"] = wide["bicycle_imu/gyr"] + shift
    x[:, 10:13] = wide["bicycle_imu/gyr"][0]
    rows = []
    for k in range(length):
        now = {name: values[k] for name, values in wide.items()}
        if k > 0:
            x = model.predict(x, now, {name: values[k - 1] for name, values in wide.items()})[0]
        r, _, R = model.residual(x, now)
        weighted = r / np.sqrt(np.diagonal(R, axis1=-2, axis2=-1))
        rows.append((weighted[:count] - weighted[count:]).T / (2.0 * STEP))
    return np.concatenate(rows)


def observed(course: str, root: int) -> dict[str, Any]:
    """Ranks with the biases of the trunk's gyroscope and of both, and what is known of each state (deg, deg/s).

    Returns:
        ``rank``: number of states → rank; ``deviation``: state → standard deviation without process noise and prior;
        NaN where nothing is known.
    """
    J = sensitivities(course, root)
    found: dict[str, Any] = {"rank": {}, "deviation": {}}
    for count in (7, 10):
        part = J[:, :count]
        sizes = np.linalg.norm(part, axis=0)
        scaled = part / np.where(sizes > 0.0, sizes, 1.0)
        values = np.linalg.svd(scaled, compute_uv=False)
        found["rank"][str(count)] = int(np.sum(values > RELATIVE * values[0]))
    known = np.linalg.norm(J, axis=0) > RELATIVE * np.linalg.norm(J)
    covariance = np.linalg.pinv(J[:, known].T @ J[:, known])
    deviations = np.full(len(STATES), np.nan)
    deviations[known] = np.sqrt(np.diag(covariance)) / DEG
    found["deviation"] = dict(zip(STATES, deviations.tolist(), strict=True))
    found["seen"] = dict(zip(STATES, np.linalg.norm(J, axis=0).tolist(), strict=True))
    return found


def observability(study: Study, report: Report) -> None:
    """Ranks and standard deviations of both courses."""
    rows, claims = [], []
    for course in COURSES:
        found = study.cached(f"observability {course}", observed, course, study.seed)
        rank, seen = found["rank"], found["seen"]
        rows.append(
            {"course": course, "rank of 7": rank["7"], "rank of 10": rank["10"]}
            | {name: None if np.isnan(value) else float(f"{value:.2g}") for name, value in found["deviation"].items()}
        )
        claims += [
            Claim(
                f"{course}: the angles and the trunk gyroscope's biases are observable",
                f"{rank['7']} of 7",
                rank["7"] == 7,
            ),
            Claim(
                f"{course}: the biases of both gyroscopes are not observable", f"{rank['10']} of 10", rank["10"] < 10
            ),
            Claim(
                f"{course}: the bicycle's bias about y is what is not seen",
                f"sensitivity {seen['c_y']:.1g}, of the others at least "
                f"{min(v for k, v in seen.items() if k != 'c_y'):.1g}",
                seen["c_y"] < RELATIVE * max(seen.values()),
            ),
        ]
    report.table(
        "Observability of gyroscope biases",
        rows,
        f"Along {SECONDS:g} s of exact motion: rank with the biases b of the trunk's gyroscope (7 states) and with "
        "those of the bicycle's, c, too (10), and the standard deviation of each without prior and process noise, deg "
        "or °/s, for output noises as the filter assumes them.",
    )
    report.claims("Observability: what holds", claims)


PRIOR = {"lean_prior": 3.0 * DEG, "pitch_prior": 3.0 * DEG, "spin_prior": 3.0 * DEG, "roll_prior": 2.0 * DEG}
PARTS = {"NEES of the angles": slice(0, 4), "NEES of all states": slice(0, 7)}


def ideal_consistency(
    runs: int = 50, duration: float = 6.0, seed: int = 0, level: float = 0.95
) -> dict[str, Consistency]:
    """NEES of the angles and of all seven states at the end of each run of ``duration`` s, and NIS of every sample."""
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
