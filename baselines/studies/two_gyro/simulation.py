"""The two-gyroscope filter on exact motions: errors, consistency, and what wrong starts, bumps and rests do to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles, true_states
from ....filters.core import rotation
from ....filters.core.consistency import consistency, nees
from ....filters.core.kalman import KalmanFilter
from ....filters.core.metrics import rms
from ....filters.core.quantity import DEG, Estimate
from ...plots import legend_above, time_figure
from ..averages import rounded, windowed
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_figures import DRAWN, with_band
from .motion import MOTIONS, Errors, filter_of, simulate
from .rides import RIDES

RATE = 50.0
"""Hz of the simulated studies"""
ROUGH = 10.0 * (1.0 / RATE) ** 0.5
"""°/s/√Hz: 10 °/s a sample at 50 Hz"""


@dataclass(frozen=True)
class Case:
    """One simulated study."""

    motion: str = "circle"
    model: Literal["sigma1", "sigma2"] = "sigma2"
    integration: Literal["euler", "midpoint"] = "midpoint"
    duration: float = 120.0
    rate: float = RATE
    start: float = 4.0
    """deg: error of the roll at the start"""
    prior: float = 5.0
    """deg: what the filter believes of it"""
    guard: float = 0.0
    """°/s"""
    inflation: tuple[float, float] = (0.0, 0.0)
    """°/s/√Hz of pitch rate and roll rate"""
    errors: Errors = field(default_factory=Errors)

    def filter(self) -> TwoGyro:
        """The filter, without the roll at the start."""
        return replace(
            filter_of(self.errors, 1.0 / self.rate, self.model, self.prior * DEG),
            integration=self.integration,
            zero_yaw_guard=self.guard * DEG,
            pitch_rate_noise=self.inflation[0] * DEG,
            roll_rate_noise=self.inflation[1] * DEG,
        )

    def run(self, seed: int) -> tuple[Trajectory, Estimate, TwoGyro]:
        """Simulate and estimate once."""
        ride = simulate(MOTIONS[self.motion], self.duration, 1.0 / self.rate, self.errors, np.random.default_rng(seed))
        model = replace(self.filter(), initial_roll=float(ride.truth["bicycle/roll"][0, 0]) + self.start * DEG)
        return ride, KalmanFilter(model).run(ride.measurements), model


def angle_errors(estimate: Estimate, truth: Mapping[str, np.ndarray]) -> np.ndarray:
    """Errors ``(T, 4)`` of θ₁, θ₂, θ₃ and φ, deg."""
    return np.stack(list(RIDES.errors(estimate.pose, truth).values()), axis=-1)


def outcome(case: Case, seed: int) -> dict[str, Any]:
    """Errors of one run: RMS (deg) of θ and φ over the first 60 s, the rest, after 30 s; peak of φ after 10 s."""
    ride, estimate, _ = case.run(seed)
    errors, time = angle_errors(estimate, true_angles(ride.truth)), ride.time
    deviation = np.sqrt(estimate.covariance[:, 0, 0]) / DEG  # type: ignore[index]
    late = time >= 60.0 if case.duration > 60.0 else time >= 30.0
    return {
        "first": rms(errors[time < 60.0]),
        "late": rms(errors[late]),
        "peak": float(np.abs(errors[time > 10.0, 3]).max()),
        "ratio": float(rms(errors[late, 3] / deviation[late])),
    }


def final_consistency(case: Case, seed: int) -> dict[str, float]:
    """NEES of all states at the end of one run whose start is drawn from the prior; mean NIS of the run."""
    rng = np.random.default_rng([seed, 1])
    ride, estimate, model = replace(case, start=case.prior * float(rng.standard_normal())).run(seed)
    signs = np.array([1.0, -1.0, -1.0])
    found = np.concatenate(
        [
            estimate.pose["bicycle/roll"],
            estimate.pose["two-gyro/relative_angles"],
            estimate.pose["trunk_imu/gyroscope_bias"] * signs,
            estimate.pose["two-gyro/platform_bias"] * signs[list(model.used_axes)],
        ],
        axis=-1,
    )
    error = (found - true_states(ride.truth, model))[-1]
    error[:4] = rotation.wrap(error[:4])
    covariance = estimate.covariance[-1]  # type: ignore[index]
    roll = float(error[0] ** 2 / covariance[0, 0])
    assert estimate.nis is not None
    seen = np.isfinite(ride.measurements["relative/orientation"][1:, 0])
    return {"nees": float(nees(error, covariance)), "roll": roll, "nis": float(np.mean(estimate.nis[1:][seen]))}


def simulations(study: Study, report: Report) -> None:
    """Errors on exact motions, and figures of single runs."""
    count = 3 if study.quick else 10
    cases = [
        Case(motion, model, step)
        for motion in ("circle", "sine", "vibration", "pulses", "straight")
        for model in ("sigma2", "sigma1")
        for step in ("midpoint", "euler")
    ]
    found = averaged(study, "simulations", cases, count)
    rows: list[dict[str, Any]] = [
        {
            "motion": case.motion,
            "model": case.model,
            "step": case.integration,
            **angles(result["first"]),
            "φ 60 to 120 s": round(float(result["late"][3]), 2),
            "error / σ of φ": round(result["ratio"], 2),
        }
        for case, result in zip(cases, found, strict=True)
    ]
    for motion in dict.fromkeys(case.motion for case in cases):
        ride = simulate(MOTIONS[motion], 120.0, 1.0 / RATE)
        for name, errors in RIDES.baselines(ride.time, true_angles(ride.truth)).items():
            late = windowed(errors, ride.time, 60.0)["φ"]
            row = rounded({**windowed(errors, ride.time, 0.0, 60.0), "φ 60 to 120 s": late})
            rows.append({"motion": motion, "model": name, **row})
    report.table(
        "Simulated motions",
        rows,
        f"RMS in deg over 60 s, from a roll that is 4° off, {count} runs at 50 Hz: 0.1 °/s a gyroscope sample, 1° a "
        "camera frame at every sample, biases of 0.3 °/s. The last column is 1 where the covariance is right.",
    )
    by_case = {(case.motion, case.model, case.integration): result for case, result in zip(cases, found, strict=True)}
    claims = claims_of_motions(by_case) + disturbed(study, report, count)
    report.claims("Simulated motions: what holds", claims)
    report.figure(
        "simulated-roll", roll_figure(), "Roll error of single simulated runs", "Thin: three standard deviations."
    )


def claims_of_motions(found: Mapping[Any, dict[str, Any]]) -> list[Claim]:
    """What the table of motions says of both models and steps."""
    late = {key: float(result["late"][3]) for key, result in found.items()}
    cases = [(motion, "sigma2") for motion in ("circle", "sine", "vibration", "pulses", "straight")]
    claims = [
        Claim.less(
            f"{motion}: {model} converges to less than 0.5° of φ from 60 s on", late[motion, model, "midpoint"], 0.5
        )
        for motion, model in (*cases, ("circle", "sigma1"))
    ]
    claims += [
        Claim.less(
            f"(23), {motion}: with the published step Σ2 converges to less than 0.5°",
            late[motion, "sigma2", "euler"],
            0.5,
        )
        for motion in ("circle", "sine")
    ]
    for step in ("midpoint", "euler"):
        statement = f"circle: the error of sigma2 is as large as its covariance says, {step} step"
        claims.append(Claim.within(statement, found["circle", "sigma2", step]["ratio"], 0.8, 1.2))
    return claims


def disturbed(study: Study, report: Report, count: int) -> list[Claim]:
    """Wrong starts, no yaw rate, pitch, a camera that is off; returns what holds of them."""
    bump = Case("bump", duration=45.0)
    inflated = (ROUGH, ROUGH)
    offset = replace(Errors(), camera_offset=2.0 * DEG)
    named = {
        **{f"start {start}° wrong": Case(start=float(start), prior=15.0, duration=60.0) for start in (10, 20, 30)},
        "start 30° wrong, prior 5°": Case(start=30.0, duration=60.0),
        "no yaw rate": Case("straight", duration=60.0),
        "no yaw rate, guard 0.5 °/s": Case("straight", duration=60.0, guard=0.5),
        "no yaw rate, Σ1": Case("straight", "sigma1", duration=60.0),
        "pulses of yaw, guard 0.5 °/s": Case("pulses", duration=60.0, guard=0.5),
        "20° of pitch in 4 s": bump,
        "20° of pitch in 4 s, inflation 10/10": replace(bump, inflation=inflated),
        "20° of pitch in 2 s, slow turn, inflation 10/5": Case(
            "slow bump", duration=45.0, inflation=(ROUGH, 0.5 * ROUGH)
        ),
        "5° of pitch in 4 s, inflation 10/10": Case("small bump", duration=45.0, inflation=inflated),
        "20° of pitch in 4 s, Σ1": replace(bump, model="sigma1"),
        "vibration, inflation 5/0": Case("vibration", duration=60.0, inflation=(0.5 * ROUGH, 0.0)),
        "camera off by 2° (sd), moving body": Case(duration=60.0, errors=offset),
        "camera off by 2° (sd), nothing moves": Case("frozen", duration=60.0, errors=offset),
    }
    found = averaged(study, "disturbed", list(named.values()), count)
    rows = [
        {
            "case": name,
            **angles(result["first"]),
            "peak of φ after 10 s": round(result["peak"], 1),
            "φ after 30 s": round(float(result["late"][3]), 2),
        }
        for name, result in zip(named, found, strict=True)
    ]
    report.table(
        "What disturbs the filter",
        rows,
        "RMS in deg over the first 60 s. Inflation a/b: extra process noise for a pitch rate of a °/s a sample at "
        "50 Hz and for sin χ dψ/dt of b °/s.",
    )
    peak = {name: result["peak"] for name, result in zip(named, found, strict=True)}
    late = {name: float(result["late"][3]) for name, result in zip(named, found, strict=True)}
    bumps = ("20° of pitch in 4 s", "20° of pitch in 4 s, inflation 10/10")
    guarded, other = late["no yaw rate, guard 0.5 °/s"], late["no yaw rate, Σ1"]
    still, moving = (late[f"camera off by 2° (sd), {what}"] for what in ("nothing moves", "moving body"))
    starts = {name: value for name, value in peak.items() if name.startswith("start")}
    return [
        Claim.every("A start up to 30° wrong leaves less than 1° after 10 s", starts, 1.0),
        Claim.less("No yaw rate: the guard keeps Σ2 from being worse than Σ1", guarded, other, factor=1.1),
        *(Claim.less(f"{name}: φ is never off by 5°", peak[name], 5.0) for name in bumps),
        *(Claim.less(f"{name}: forgotten, less than 1° after 30 s", late[name], 1.0) for name in bumps),
        Claim.less("A constant camera error of 2° passes to φ by at least half where nothing moves", 1.0, still),
        Claim.less("A moving body separates the camera's error: less of it passes to φ", moving, still),
    ]


def averaged(study: Study, key: str, cases: list[Case], count: int) -> list[dict[str, Any]]:
    """Root mean squares over runs of the outcome of each case; peaks are averaged."""
    jobs = [(case, study.seed_of(key, index)) for case in cases for index in range(count)]
    results = study.map(key, outcome, jobs)
    rows = []
    for index in range(len(cases)):
        part = results[index * count : (index + 1) * count]
        row: dict[str, Any] = {name: rms(np.array([r[name] for r in part])) for name in ("first", "late")}
        row["ratio"] = float(rms(np.array([r["ratio"] for r in part])))
        row["peak"] = float(np.mean([r["peak"] for r in part]))
        rows.append(row)
    return rows


def angles(values: Any) -> dict[str, float]:
    """Four errors as columns."""
    return {name: round(float(value), 2) for name, value in zip(("θ1", "θ2", "θ3", "φ"), values, strict=True)}


def ideal_consistency(study: Study, report: Report) -> None:
    """NEES and NIS where every assumption of the filter holds, against chi-square."""
    count = 50 if study.quick else 100
    camera = {100.0: 4, 500.0: 20, 50.0: 2}
    named = {
        f"{model}, {step}, {rate:g} Hz": Case(
            model=model,  # type: ignore[arg-type]
            integration=step,  # type: ignore[arg-type]
            rate=rate,
            duration=20.0,
            errors=replace(Errors(), camera_interval=camera[rate]),
        )
        for model, step, rate in (
            ("sigma2", "midpoint", 100.0),
            ("sigma2", "euler", 50.0),
            ("sigma2", "euler", 100.0),
            ("sigma2", "euler", 500.0),
            ("sigma1", "midpoint", 100.0),
            ("sigma1", "euler", 100.0),
        )
    }
    claims = []
    for name, case in named.items():
        jobs = [(case, study.seed_of("consistency", index)) for index in range(count)]
        results = study.map(f"consistency {name}", final_consistency, jobs)
        frames = int(case.duration * case.rate / case.errors.camera_interval)
        for what, found in (
            ("NEES", consistency([result["nees"] for result in results], case.filter().state_size)),
            ("NEES of φ", consistency([result["roll"] for result in results], 1)),
            ("NIS", consistency([result["nis"] * frames for result in results], 3 * frames)),
        ):
            claims.append(Claim.within(f"{name}: {what} is right", found.ratio, found.lower, found.upper))
    report.claims(
        "Consistency with ideal assumptions",
        claims,
        f"{count} runs of 20 s, errors of all states at the end, for each degree of freedom, with the 95 % bounds of "
        "chi-square.",
    )


def roll_figure() -> Any:
    """Roll errors of single runs."""
    figure, axes = time_figure(7.5, 8.0, 3)
    straight, bump = Case("straight", duration=60.0), Case("bump", duration=60.0)
    shown = (
        ("turning, about 30 °/s", {"Σ1": Case(model="sigma1"), "Σ2": Case()}, 12.0),
        ("no yaw rate", {"Σ2 with guard": replace(straight, guard=0.5), "Σ2": straight}, 25.0),
        ("20° of pitch at 15 s", {"Σ2, inflated": replace(bump, inflation=(ROUGH, ROUGH)), "Σ2": bump}, 30.0),
    )
    for ax, (title, cases, limit) in zip(axes, shown, strict=True):
        for (label, case), color in zip(cases.items(), DRAWN[1::2], strict=True):
            ride, estimate, _ = case.run(1)
            error = angle_errors(estimate, true_angles(ride.truth))[:, 3]
            with_band(ax, ride.time[ride.time <= 60.0], error, estimate, color, label)
        ax.set_title(title, loc="left", fontsize=10)
        ax.set(ylabel="error of φ, deg", ylim=(-limit, limit))
        legend_above(ax)
    return figure
