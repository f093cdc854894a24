"""Offsets c_h, c_b of the gyroscopes in (14): what they cost, and what a measurement at rest leaves of them."""

from __future__ import annotations

import numpy as np

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import DEG
from ..averages import rounded
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_study import SETTLED
from .motion import Errors
from .rides import ANGLES
from .simulation import COURSES, errors_of, synthetic

OFFSET = 1.0 * DEG
"""rad/s: bound of table I of the whole-body paper for the same gyroscope; uniform within"""
REST = 10.0
"""s at rest over which offsets are measured"""
GYROSCOPES = ("trunk_imu/gyr", "bicycle_imu/gyr")
CASES = ("no offsets", "measured at rest and subtracted", "not subtracted")


def offset_errors(case: str, course: str, seeds: int, duration: float, root: int) -> list[float]:
    """RMS of φ_h, θ, φ, φ_b (deg) with offsets on both gyroscopes, mean over rides."""
    errors = Errors()
    samples, truth = synthetic(course, seeds, duration, root, errors)  # type: ignore[arg-type]
    rng = np.random.default_rng([root, 14])
    count = REST / ForceInertial.published().dt
    for name in GYROSCOPES:
        offset = rng.uniform(-OFFSET, OFFSET, (seeds, 3))
        measured = offset + errors.gyroscope / np.sqrt(count) * rng.standard_normal((seeds, 3))
        if name == "trunk_imu/gyr":
            measured = measured + truth["trunk_imu/gyroscope_bias"][0]
        left = {"no offsets": 0.0 * offset, CASES[1]: offset - measured, CASES[2]: offset}[case]
        samples = samples | {name: samples[name] + left}
    pose = KalmanFilter(ForceInertial.published(), keep_covariance=False).run(samples).pose
    return errors_of(pose, truth, round(SETTLED / 0.02))


def offsets(study: Study, report: Report) -> None:
    """Table and claims of (14)."""
    seeds, duration = (2, 30.0) if study.quick else (5, 60.0)
    jobs = [(case, course, seeds, duration, study.seed) for course in COURSES for case in CASES]
    found = dict(zip([job[:2] for job in jobs], study.map("offsets", offset_errors, jobs), strict=True))
    means = {key: dict(zip(ANGLES, values, strict=True)) for key, values in found.items()}
    report.table(
        "Offsets of (14), RMS in deg",
        [{"course": course, "offsets": case, **rounded(row)} for (case, course), row in means.items()],
        f"Exact synthetic data with constant offsets within ±{OFFSET / DEG:g} °/s on every axis of both gyroscopes; "
        f"measured over {REST:g} s at rest, together with the bias that the trunk's gyroscope has at the start.",
    )
    claims = []
    for course in COURSES:
        none, measured, kept = (means[case, course] for case in CASES)
        ratios = {angle: measured[angle] / none[angle] for angle in ANGLES}
        claims += [
            Claim.every(f"(14), {course}: measured offsets cost at most a fifth", ratios, 1.2, "of the error without"),
            Claim.less(
                f"(14), {course}: offsets that stay double the error of φ_b", none["φ_b"], kept["φ_b"], factor=0.5
            ),
        ]
    report.claims("Offsets of (14): what holds", claims)
