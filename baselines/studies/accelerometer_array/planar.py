"""Chapter 3 of the thesis: orientation in a vertical plane, on the environment's planar controller.

Motions are ``planar-walk`` and ``infinity``, noises the thesis'.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.controller_gestures import Walk
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.planar.orientation import PLANAR_ANGLE
from ....filters.arrays.planar.pose import PLANAR_RATE
from ....filters.core import metrics
from ....filters.core.estimator import Estimator, run
from ....filters.core.rotation import wrap
from ....filters.registry import make
from ..claims import Claim
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from ..ride_study import MEAN, ZERO
from .tables import Row, grouped, mean_of, results_of, values_of

RATE = 100.0
"""Hz"""
DURATION = 100.0
"""s of a run, as in the thesis"""
SETTLED = 5.0
"""s at the start that are not scored"""
LIMIT = np.deg2rad(10.0)
"""rad: the share of samples whose error is smaller is reported"""

WALK_ACCELERATION = float(np.sqrt(Walk(planar=True).acceleration_variance))
"""m/s² per axis (3.58)"""
INFINITY_ACCELERATION = (3.5, 7.0)
"""m/s² rms of the two axes on the ∞"""
MOTIONS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "planar-walk": {
        "planar-mean": {"inertial_acceleration": WALK_ACCELERATION},
        "planar-orientation": {"inertial_acceleration": WALK_ACCELERATION},
        "planar-unscented": {"inertial_acceleration": WALK_ACCELERATION},
        "planar-pose": {"jerk": WALK_ACCELERATION * RATE, "acceleration_decay": 3.0 * RATE},
    },
    "infinity": {"planar-mean": {"inertial_acceleration": 30.0}},
}
"""Gesture → registered name → parameters for that motion. The walk's acceleration is white. That of the ∞ is
correlated, so what takes it for white gets a larger one: by default 10 m/s²; the mean 30."""
THESIS_POSE = {"angular_jerk": 100.0, "jerk": 1000.0, "acceleration_decay": 0.0}
"""The thesis' model of the complete pose, with jerks of our choice: it gives none"""

EXTENDED, INTEGRATION, POSE = "extended filter", "time integration", "complete pose, thesis"
LITERAL, WRAPPED = "linear filter, literal", "linear filter, wrapped difference"
RETURNING = "complete pose, acceleration returns to zero"
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    INTEGRATION: ("planar-mean", {"method": "integration"}),
    "tilt": ("planar-mean", {"method": "tilt"}),
    "mean, literal": ("planar-mean", {"wrapped": False}),
    "mean, wrapped difference": ("planar-mean", {}),
    LITERAL: ("planar-orientation", {"method": "linear", "wrapped": False}),
    WRAPPED: ("planar-orientation", {"method": "linear"}),
    EXTENDED: ("planar-orientation", {}),
    "unscented filter": ("planar-unscented", {}),
    POSE: ("planar-pose", THESIS_POSE),
    "complete pose, thesis, jerks of 10": ("planar-pose", THESIS_POSE | {"angular_jerk": 10.0, "jerk": 10.0}),
    "complete pose, thesis, published R": ("planar-pose", THESIS_POSE | {"form": "published-noise"}),
    "complete pose, thesis, published H": ("planar-pose", THESIS_POSE | {"form": "published-jacobian"}),
    RETURNING: ("planar-pose", {}),
}
"""Name in tables → registered name and parameters"""
INFLATIONS = (10.0, 30.0, 100.0, 300.0, 1000.0)
"""(m/s²)²: values of R on the ∞"""

PUBLISHED: tuple[tuple[str, str, str], ...] = (
    ("planar-walk", INTEGRATION, "about 50 (Fig. 3.5)"),
    ("planar-walk", EXTENDED, "about 10 (Fig. 3.6)"),
    ("planar-walk", LITERAL, "200 (Fig. 3.12)"),
    ("infinity", INTEGRATION, "drifts (Fig. 3.9)"),
    ("infinity", EXTENDED, "about 10 (Fig. 3.10)"),
)
"""Motion, method, largest error that the figure shows, deg"""


def estimator(method: str, motion: str, **parameters: Any) -> Estimator[Any]:
    """The estimator of that name with the parameters of the motion, unless others are given."""
    name, own = METHODS[method]
    # A linear filter averages as the mean does, and gets the acceleration of the mean.
    like = "planar-mean" if own.get("method") == "linear" else name
    return make(name, dt=1.0 / RATE, **{**MOTIONS[motion].get(like, {}), **own, **parameters})


def moved(seed: int, motion: str, duration: float = DURATION) -> Trajectory:
    """The planar controller on a motion, from a second at rest."""
    return simulate_hand(motion, seed, rate=RATE, duration=duration, device="planar")


def planar_errors(seed: int, motion: str, duration: float = DURATION) -> list[Row]:
    """Errors of every method on one motion.

    Returns:
        A row for each of :data:`METHODS`: ``method``, ``motion``, ``seed``; ``rms`` and ``largest`` in degrees,
        ``within``, the share of samples within 10°; ``rate``, the rms error of ω in rad/s (None if it is not
        estimated); ``nees`` of the angle (None without a covariance). The last two rows are the baselines
        :data:`~.ride_study.ZERO` and :data:`~.ride_study.MEAN`.
    """
    trajectory = moved(seed, motion, duration)
    common = {"motion": motion, "seed": seed}
    rows = [common | {"method": name} | errors_of(trajectory, estimator(name, motion)) for name in METHODS]
    scored = trajectory.time >= SETTLED
    angle = trajectory.truth[PLANAR_ANGLE.name][scored, 0]
    middle = np.angle(np.mean(np.exp(1j * angle)))
    for name, constant in ((ZERO, 0.0), (MEAN, middle)):
        rows.append(common | {"method": name} | numbers(np.abs(wrap(angle - constant))) | {"rate": None, "nees": None})
    return rows


def inflation_errors(seed: int) -> list[Row]:
    """Rows as above of the extended filter on the ∞, for each value of R in :data:`INFLATIONS` (``R``)."""
    trajectory, rows = moved(seed, "infinity"), []
    for R in INFLATIONS:
        filter = estimator(EXTENDED, "infinity", inertial_acceleration=float(np.sqrt(R)))
        rows.append({"motion": "infinity", "seed": seed, "R": R} | errors_of(trajectory, filter))
    return rows


def errors_of(trajectory: Trajectory, filter: Estimator[Any]) -> Row:
    """The numbers of a row."""
    estimate, scored = run(filter, trajectory.measurements), trajectory.time >= SETTLED
    pose = estimate.pose

    def error(quantity: Any) -> np.ndarray:
        return metrics.error(quantity, pose[quantity.name], trajectory.truth[quantity.name])[scored]

    angle = error(PLANAR_ANGLE)
    variance = None if estimate.covariance is None else np.asarray(estimate.covariance)[scored, 0, 0]
    return numbers(angle) | {
        "rate": float(metrics.rms(error(PLANAR_RATE))) if PLANAR_RATE.name in pose else None,
        "nees": None if variance is None else float(np.mean(angle**2 / variance)),
    }


def numbers(angle: np.ndarray) -> Row:
    """RMS and largest of sizes of errors ``(T,)``, rad, in degrees, and the share of those within 10°."""
    return {
        "rms": float(np.rad2deg(metrics.rms(angle))),
        "largest": float(np.rad2deg(angle.max())),
        "within": float(np.mean(angle < LIMIT)),
    }


def unscented_difference(seed: int, motion: str, duration: float = 20.0) -> float:
    """Largest difference between the unscented and the extended filter, degrees."""
    trajectory = moved(seed, motion, duration)
    one, other = (
        run(estimator(name, motion), trajectory.measurements).pose[PLANAR_ANGLE.name]
        for name in (EXTENDED, "unscented filter")
    )
    return float(np.rad2deg(np.abs(wrap(one - other)).max()))


def planar_table(rows: list[Row], key: str = "method") -> list[Row]:
    """Means over the seeds, a row for each motion and each method (or another ``key`` of the rows)."""
    columns: dict[str, tuple[str, Any]] = {
        "rms (°)": ("rms", np.mean),
        "largest rms of a seed (°)": ("rms", max),
        "largest error (°)": ("largest", np.mean),
        "within 10°": ("within", np.mean),
        "ω (rad/s)": ("rate", np.mean),
        "NEES": ("nees", np.mean),
    }
    return grouped(rows, {"motion": "motion", key: key}, columns)


def claims(rows: list[Row], inflated: list[Row], difference: float) -> list[Claim]:
    """What chapter 3 says, and what one would read off the tables."""
    found = []
    for motion, figure in (("planar-walk", "3.6"), ("infinity", "3.10")):
        rms = {method: mean_of(rows, "rms", motion=motion, method=method) for method in METHODS}
        largest = max(values_of(rows, "largest", motion=motion, method=EXTENDED))
        share = mean_of(rows, "within", motion=motion, method=EXTENDED)
        literal, wrapped, extended = rms[LITERAL], rms[WRAPPED], rms[EXTENDED]
        found += [
            Claim.less(f"{motion}: the extended filter never errs by more than 10° (Figure {figure})", largest, 10.0),
            Claim.within(f"{motion}: it is within 10° in at least four of five samples", share, 0.8, 1.0),
            Claim.less(f"{motion}: the linear filter fails by averaging raw angles", wrapped, literal, factor=0.5),
            Claim.less(
                f"{motion}: a linear filter cannot be near the extended one, at least twice as wrong",
                extended,
                wrapped,
                factor=0.5,
            ),
            Claim.less(f"{motion}: wrapped, it is near the extended filter", wrapped, extended, factor=1.5),
            Claim.less(f"{motion}: the thesis' complete pose is worse than that", extended, rms[POSE]),
        ]
    rms = {method: mean_of(rows, "rms", motion="infinity", method=method) for method in METHODS}
    by_R = {R: mean_of(inflated, "rms", R=R) for R in INFLATIONS}
    names, best = ("variance", "best R"), min(by_R, key=by_R.__getitem__)
    for letter, equation in (("R", "3.44"), ("H", "3.45")):
        statement = f"infinity: the published {letter} ({equation}) is worse than the corrected one"
        found.append(Claim.less(statement, rms[POSE], rms[f"complete pose, thesis, published {letter}"]))
    statement = "infinity: misprints alone make the complete pose fail: corrected, it beats the extended filter"
    wide = "infinity: the correlated acceleration wants an R larger than its variance"
    return [
        *found,
        Claim.less(statement, rms[POSE], rms[EXTENDED]),
        Claim.best("infinity: a complete pose whose acceleration returns to zero (ours) is the best", RETURNING, rms),
        Claim.less(wide, INFINITY_ACCELERATION[1] ** 2, best, "(m/s²)²", names=names),
        Claim.less("Unscented and extended filter are about equal (Figure 3.12)", difference, 0.1),
        *likenesses(rows),
    ]


def likenesses(rows: list[Row]) -> list[Claim]:
    """What the figures say in words: what drifts, what is as bad as the tilt angle, and where rates are poor."""
    found = []
    for motion, figure in (("planar-walk", "3.5"), ("infinity", "3.9")):
        rms = {method: mean_of(rows, "rms", motion=motion, method=method) for method in METHODS}
        drift = mean_of(rows, "largest", motion=motion, method=INTEGRATION)
        tilt, extended = rms["tilt"], rms[EXTENDED]
        rate = mean_of(rows, "rate", motion=motion, method=POSE)
        returning = mean_of(rows, "rate", motion=motion, method=RETURNING)
        found += [
            Claim.within(f"Figure {figure}: integration drifts by tens of degrees in 100 s", drift, 20.0, 90.0, "deg"),
            Claim.less(f"Figure {figure}: the tilt angle is five times as wrong", extended, tilt, factor=0.2),
            Claim.less(f"{motion}: the complete pose estimates ω poorly, above 0.3 rad/s", 0.3, rate, "rad/s"),
            Claim.less(
                f"{motion}: it does so because its acceleration does not return to zero",
                returning,
                rate,
                "rad/s",
                factor=0.5,
            ),
        ]
    own, published = (
        mean_of(rows, "rate", motion="infinity", method=method)
        for method in (POSE, "complete pose, thesis, published H")
    )
    found.append(
        Claim.less("infinity: with H as published, (3.45), ω is poor, above 0.3 rad/s", 0.3, published, "rad/s")
    )
    found.append(Claim.less("infinity: (3.45) is what makes it poor", own, published, "rad/s", factor=0.5))
    walk = {method: mean_of(rows, "rms", motion="planar-walk", method=method) for method in METHODS}
    averaged = walk["mean, literal"] / walk["tilt"]
    linear = max(values_of(rows, "largest", motion="planar-walk", method=LITERAL))
    return [
        *found,
        Claim.within("Figure 3.12: averaging raw angles is close to the tilt angle", averaged, 0.8, 1.25, "times"),
        Claim.less("Figure 3.12: the linear filter's error reaches half a turn", 170.0, linear),
    ]


def planar(study: Study, report: Report) -> None:
    """Errors of figures 3.5 to 3.12."""
    # as long as the thesis' in any case: errors of averaged angles come with whole turns
    seeds = 2 if study.quick else 10
    roots = [study.seed_of("planar", index) for index in range(seeds)]
    jobs = [(seed, motion) for motion in MOTIONS for seed in roots]
    rows = [row for found in study.map("planar", planar_errors, jobs) for row in found]
    report.numbers(results_of(rows, "rms", "{motion} {seed}", PLANAR_ANGLE.name, "angle", "deg"))
    report.compare(
        "Figures 3.5 to 3.12: errors of the angle in the plane",
        [
            {"motion": motion, "method": method, "quantity": "largest error", "published": published, "unit": "deg"}
            | {"values": values_of(rows, "largest", motion=motion, method=method)}
            for motion, method, published in PUBLISHED
        ],
        f"{seeds} motions of {DURATION:g} s.",
        interval=OVER_MOTIONS,
    )
    note = (
        "*NEES* is 1 if the covariance is right; the acceleration of the ∞ is not white. "
        "*Literal* averages raw angles; *published R* and *published H* are (3.44) and (3.45) as in the thesis."
    )
    report.table("Planar methods", planar_table(rows), note)
    found = study.map("planar inflation", inflation_errors, [(seed,) for seed in roots])
    inflated = [row for part in found for row in part]
    report.table("Extended filter on the ∞ by R", planar_table(inflated, "R"), "R in (m/s²)².")
    difference = study.cached("unscented", unscented_difference, roots[0], "planar-walk")
    report.claims("Chapter 3: what holds here", claims(rows, inflated, difference))
