"""The force/inertial filter on exact synthetic data: effect of each correction, sources of error, offsets (14)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.core import rotation
from ....filters.core.kalman import KalmanFilter
from ....filters.core.metrics import rms
from ....filters.core.quantity import DEG
from ..averages import rounded
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_study import SETTLED
from .motion import Course, Errors, draw_motion, simulate
from .rides import ANGLES, RIDES
from .states import from_the_truth

AS_PUBLISHED: dict[str, Any] = {
    "form": "published",
    "acceleration": "accelerometer",
    "torque_reading": "without-z",
    "roll_model": "published",
    "jacobian": "partial",
}
VARIANTS: dict[str, dict[str, Any]] = {
    "exact: differentiated gyroscopes, apparent vertical": {},
    "same, no bias model": {"bias_model": False},
    "same, (13) as published": {"roll_model": "published"},
    "same, no roll output": {"roll_model": "none"},
    "same, (12) without N_z": {"torque_reading": "without-z"},
    "exact (7), (8) from accelerometers": {"acceleration": "accelerometer"},
    "static torque, (13) as published": {"torque_model": "static", "roll_model": "published"},
    "as published, sign of (12) corrected": AS_PUBLISHED,
    "as published, accelerometers with reversed sign": AS_PUBLISHED,
    "integration from the true start": {},
}
"""Name → options."""
COURSES: tuple[Course, Course] = ("indoor", "outdoor")


def synthetic(
    course: Course, seeds: int, duration: float, root: int, errors: Errors, pitch: float = 60.0 * DEG
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Batches ``(T, seeds, size)`` of samples and truth."""
    rides = []
    for child in np.random.SeedSequence(root).spawn(seeds):
        motion, noise = (np.random.default_rng(each) for each in child.spawn(2))
        ride = simulate(draw_motion(motion, course, errors, pitch), errors, ForceInertial.published(), duration, noise)
        rides.append(ride)
    samples, truth = (
        {name: np.stack([ride[k][name] for ride in rides], axis=1) for name in rides[0][k]} for k in (0, 1)
    )
    return samples, truth


def errors_of(pose: dict[str, np.ndarray], truth: dict[str, np.ndarray], settled: int) -> list[float]:
    """Mean over rides of the RMS of φ_h, θ, φ, φ_b, deg."""
    return [float(rms(error[settled:]).mean()) for error in RIDES.errors(pose, truth).values()]


def without_forces(samples: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The samples with the forces missing after the first sample."""
    lost = samples | {"seat/wrench": samples["seat/wrench"].copy()}
    lost["seat/wrench"][1:] = np.nan
    return lost


def variant(name: str, course: Course, seeds: int, duration: float, root: int) -> list[float]:
    """Errors of one row of the table."""
    samples, truth = synthetic(course, seeds, duration, root, Errors())
    settled = round(SETTLED / 0.02)
    if name.startswith("integration"):
        kalman = KalmanFilter(ForceInertial.published(shoulder_noise=1e6), keep_covariance=False)
        pose = from_the_truth(kalman, without_forces(samples), truth)
        return errors_of(pose, {key: array[1:] for key, array in truth.items()}, settled)
    if name.endswith("reversed sign"):
        samples = samples | {key: -samples[key] for key in ("bicycle_imu/acc", "trunk_imu/acc")}
    kalman = KalmanFilter(ForceInertial.published(**VARIANTS[name]), keep_covariance=False)
    return errors_of(kalman.run(samples).pose, truth, settled)


CHANGES: dict[str, tuple[dict[str, Any], dict[str, Any], float]] = {
    "base": ({}, {}, 60.0),
    "filter's m_h + 10 %": ({"trunk_mass": 49.5}, {}, 60.0),
    "shoulders' tilt 5°, unknown moment 15 N·m": ({}, {"tilt": 5.0 * DEG, "disturbance": 15.0}, 60.0),
    "bicycle's gyroscope off by 0.2 °/s": ({}, {"bicycle_offset": 0.2 * DEG}, 60.0),
    "mean θ 75°": ({}, {}, 75.0),
}
"""One change at a time: options of the filter, errors, mean θ (deg)."""


def change(name: str, seeds: int, root: int) -> list[float]:
    """Errors indoors over 30 s."""
    options, errors, pitch = CHANGES[name]
    samples, truth = synthetic("indoor", seeds, 30.0, root, replace(Errors(), **errors), pitch * DEG)
    pose = KalmanFilter(ForceInertial.published(**options), keep_covariance=False).run(samples).pose
    return errors_of(pose, truth, round(SETTLED / 0.02))


def convergence(root: int, seeds: int, loose: bool) -> list[list[float]]:
    """Seconds until φ_h stays within 3° after a start 35° off, for either sign: ``(2, seeds)``; NaN: never."""
    samples, truth = synthetic("indoor", seeds, 30.0, root, Errors())
    options = {"torque_noise": 30.0, "gyroscope_noise": 0.3 * DEG, "lean_prior": DEG, "pitch_prior": DEG}
    model = ForceInertial.published(**(options | {"spin_prior": DEG, "roll_prior": DEG} if loose else {}))
    found = []
    for off in (35.0 * DEG, -35.0 * DEG):
        pose = from_the_truth(KalmanFilter(model, keep_covariance=False), samples, truth, off)
        error = pose["force-inertial/trunk_angles"][..., 0] - truth["force-inertial/trunk_angles"][1:, :, 0]
        bad = np.abs(rotation.wrap(error)) > 3.0 * DEG
        last = np.where(bad.any(axis=0), len(bad) - np.argmax(bad[::-1], axis=0), 0)
        found.append([float(k) * 0.02 if k < len(bad) else float("nan") for k in last])
    return found


def simulations(study: Study, report: Report) -> None:
    """Tables of the synthetic study."""
    seeds, duration = (2, 30.0) if study.quick else (5, 60.0)
    jobs = [(name, course, seeds, duration, study.seed) for name in VARIANTS for course in COURSES]
    found = study.map("synthetic", variant, jobs)
    rows: list[dict[str, Any]] = []
    means: dict[tuple[str, str], dict[str, float]] = {}
    for (name, course, *_), values in zip(jobs, found, strict=True):
        ours = means[name, course] = dict(zip(ANGLES, values, strict=True))
        rows.append({"formulation": name, "course": course, **rounded(ours)})
    for course in COURSES:
        samples, truth = synthetic(course, seeds, duration, study.seed, Errors())
        time = 0.02 * np.arange(len(samples["wheel/speed"]))
        for name, errors in RIDES.baselines(time, truth).items():
            row = {angle: float(rms(error[time >= SETTLED]).mean()) for angle, error in errors.items()}
            rows.append({"formulation": name, "course": course, **rounded(row)})
    report.table(
        "Exact synthetic data, RMS in deg",
        rows,
        f"{seeds} rides of {duration:g} s, errors after {SETTLED:g} s. Data are those of Newton and Euler, not of the "
        "filter's equations.",
    )
    changed = study.map("changes", change, [(name, seeds, study.seed) for name in CHANGES])
    report.table(
        "One change at a time, indoors, 30 s, RMS in deg",
        [
            {"change": name, **rounded(dict(zip(ANGLES, values, strict=True)))}
            for name, values in zip(CHANGES, changed, strict=True)
        ],
        "Not further than θ = 75°: a trunk that leans 20° aside has level shoulders at 90° only if it faces sideways.",
    )
    rows, slowest = [], {}
    for label, loose in (("tuning of this table", False), ("torque 30 N·m, gyroscopes 0.3 °/s, prior 1°", True)):
        times = study.cached(f"convergence {int(loose)}", convergence, study.seed, seeds, loose)
        slowest[label] = float(np.max(times))
        for sign, each in zip(("+35°", "−35°"), times, strict=True):
            rows.append(
                {"tuning": label, "start of φ_h": sign, "s until within 3°": " ".join(f"{t:.2f}" for t in each)}
            )
    report.table("Convergence from a wrong start", rows)
    report.claims("Exact synthetic data: what holds", claims(means, slowest))


def claims(means: dict[tuple[str, str], dict[str, float]], slowest: dict[str, float]) -> list[Claim]:
    """What every correction is worth, and how fast a wrong start is forgotten."""
    exact = next(iter(VARIANTS))
    found = []
    for course in COURSES:
        ours = means[exact, course]
        found.append(Claim.every(f"{course}: the exact formulation keeps every angle within 1.5°", ours, 1.5))
        for name, angle in (
            ("same, (13) as published", "φ_b"),
            ("same, no roll output", "φ_b"),
            ("same, (12) without N_z", "θ"),
            ("static torque, (13) as published", "φ_h"),
            ("exact (7), (8) from accelerometers", "θ"),
            ("as published, sign of (12) corrected", "φ_h"),
            ("as published, accelerometers with reversed sign", "φ_h"),
            ("integration from the true start", "φ_h"),
        ):
            statement = f"{course}: {name} at least doubles the error of {angle}"
            found.append(Claim.less(statement, ours[angle], means[name, course][angle], factor=0.5))
    published = means["as published, sign of (12) corrected", "indoor"]
    raw, ours = means["same, (13) as published", "indoor"], means[exact, "indoor"]
    accelerometers = means["exact (7), (8) from accelerometers", "indoor"]
    tabled = RIDES.published_errors("indoor_circle")
    statement = "indoor: the published (7), (8) are as good as the corrected form in φ_h"
    found += [
        Claim.less(statement, published["φ_h"], ours["φ_h"], factor=1.1),
        Claim.less("indoor: (13) as published is as good in φ_b", raw["φ_b"], ours["φ_b"], factor=1.1),
        Claim.less(
            "indoor: where forces err by noise alone the bias model lowers the mean error",
            float(np.mean(list(ours.values()))),
            float(np.mean(list(means["same, no bias model", "indoor"].values()))),
        ),
        *(
            Claim.shares(f"indoor: {what} every angle within table II", errors, tabled, unit="of the published error")
            for what, errors in (
                ("corrected (7), (8) from accelerometers keep", accelerometers),
                ("the apparent vertical in (13) keeps", ours),
            )
        ),
    ]
    found += [
        Claim.less(f"φ_h that starts 35° off is within 3° after 6 s at most: {label}", time, 6.0, "s")
        for label, time in slowest.items()
    ]
    return found


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
        claims += [
            Claim.shares(
                f"(14), {course}: measured offsets cost at most a fifth", measured, none, 1.2, "of the error without"
            ),
            Claim.less(
                f"(14), {course}: offsets that stay double the error of φ_b", none["φ_b"], kept["φ_b"], factor=0.5
            ),
        ]
    report.claims("Offsets of (14): what holds", claims)
