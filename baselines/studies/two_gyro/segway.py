"""Equation (6) of the two-gyroscope paper: a Segway, whose roll is negligible and whose pitch is estimated.

The paper names the case and shows no result. Here a platform turns and pitches as a person leans on it; the body
moves on it as in the other exact motions. A variant lets it roll a little, which (6) does not allow for.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from ....filters.analysis.bounds import posterior_bound
from ....filters.bicycle.two_gyro.truth import true_angles, true_states
from ....filters.core.consistency import nees
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import DEG
from ....filters.core.rotation import wrap
from ...plots import TRUTH_COLOR, legend_above, time_figure
from ..averages import interval_of_mean, mean_of, rms, rounded
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_figures import DRAWN, with_band
from ..ride_study import MEAN, ZERO
from ..signals import Waves
from .motion import MOTIONS, NOTHING, Errors, Motion, filter_of, simulate

DT, DURATION, LATE = 0.02, 120.0, 60.0
"""s: sampling interval, length of a run, and from when on errors count"""
PITCH = Waves(terms=((5.0 * DEG, 0.8, 0.3), (2.5 * DEG, 2.1, 1.2)))
"""rad: forwards and backwards, within ±7.5°"""
SWAY = Waves(terms=((0.5 * DEG, 1.3, 0.5), (0.3 * DEG, 3.7, 0.2)))
"""rad: a roll that is small but not zero"""
RIDES: dict[str, Motion] = {
    name: replace(MOTIONS[turns], roll=roll, pitch=PITCH)
    for name, turns, roll in (
        ("turning", "circle", NOTHING),
        ("to and fro", "sine", NOTHING),
        ("turning, rolls by 0.8°", "circle", SWAY),
        ("straight", "straight", NOTHING),
    )
}
"""Name → motion; yaw rates are those of the other exact motions"""
MODELS: dict[str, Literal["sigma2", "sigma1"]] = {"Σ2 with (6)": "sigma2", "Σ1": "sigma1"}
START = 4.0
"""deg: error of the pitch at the start"""


def run(motion: str, model: Literal["sigma2", "sigma1"], seed: int) -> tuple[Any, np.ndarray, Any]:
    """One run: the ride, the error of χ ``(T,)`` in deg, and the estimate."""
    ride = simulate(RIDES[motion], DURATION, DT, Errors(), np.random.default_rng(seed))
    pitch = true_angles(ride.truth)["two-gyro/pitch"][:, 0]
    equations = replace(
        filter_of(Errors(), DT, model),
        platform="segway",
        integration="midpoint",
        initial_roll=float(pitch[0]) + START * DEG,
    )
    estimate = KalmanFilter(equations).run(ride.measurements)
    return ride, wrap(estimate.pose["two-gyro/pitch"][:, 0] - pitch) / DEG, estimate


def outcome(motion: str, seed: int) -> dict[str, dict[str, float]]:
    """Method → RMS error of χ (deg) from :data:`LATE` on; with bound and NEES of the filters."""
    found: dict[str, dict[str, float]] = {}
    for name, model in MODELS.items():
        ride, error, estimate = run(motion, model, seed)
        late = ride.time >= LATE
        variance = estimate.covariance[late, :1, :1]
        found[name] = {"χ": rms(error[late]), "NEES": float(np.mean(nees(error[late, None] * DEG, variance)))}
    equations = replace(filter_of(Errors(), DT), platform="segway", integration="midpoint")
    ideal = simulate(RIDES[motion], DURATION, DT)
    bound = posterior_bound(equations, true_states(ideal.truth, equations), ideal.measurements)[:, 0, 0]
    pitch = true_angles(ideal.truth)["two-gyro/pitch"][:, 0] / DEG
    found["posterior bound"] = {"χ": float(np.sqrt(np.mean(bound[late]))) / DEG}
    found[ZERO], found[MEAN] = {"χ": rms(pitch[late])}, {"χ": float(pitch[late].std())}
    return found


def segway(study: Study, report: Report) -> None:
    """Table, claims and a figure."""
    count = 3 if study.quick else 10
    seeds = [study.seed_of("segway", index) for index in range(count)]
    found = study.map("segway", outcome, [(motion, seed) for motion in RIDES for seed in seeds])
    rows, means = [], {}
    for index, motion in enumerate(RIDES):
        part = found[index * count : (index + 1) * count]
        for name in part[0]:
            means[motion, name] = mean_of(each[name] for each in part)
            row = {"motion": motion, "method": name, **rounded({"χ": means[motion, name]["χ"]})}
            values = [each[name]["NEES"] for each in part if "NEES" in each[name]]
            rows.append(row | {"NEES, 95 % interval": interval_of_mean(values) if values else None})
    report.table(
        "Segway: equation (6)",
        rows,
        f"RMS error of the pitch in deg from {LATE:g} to {DURATION:g} s, mean of {count} runs at 50 Hz with the noises "
        f"of the exact motions; the filters start {START:g}° off.",
    )
    error = {key: value["χ"] for key, value in means.items()}
    ours, other = MODELS
    claims = [
        Claim.less(
            f"(6), {motion}: Σ2 does not drift, it is less than a quarter as wrong as Σ1",
            error[motion, ours],
            error[motion, other],
            factor=0.25,
        )
        for motion in ("turning", "to and fro")
    ]
    claims += [
        Claim.less(
            "(6), turning: the error is within twice its bound",
            error["turning", ours],
            error["turning", "posterior bound"],
            factor=2.0,
        ),
        Claim.less(
            "(6), turning: Σ2 beats a pitch of zero", error["turning", ours], error["turning", ZERO], factor=0.25
        ),
        Claim.less("(6), straight: the pitch drifts, more than 2°", 2.0, error["straight", ours]),
        Claim.less("(6) bears a roll of 0.8°: error below 1°", error["turning, rolls by 0.8°", ours], 1.0),
    ]
    report.claims("Segway: what holds", claims)
    report.figure("segway", figure(seeds[0]), "Segway: pitch of one run", "Thin: three standard deviations.")


def figure(seed: int) -> Any:
    """Pitch and its error while the platform turns."""
    drawn, (top, below) = time_figure(7.5, 4.2, 2)
    for (name, model), color in zip(reversed(MODELS.items()), (DRAWN[1], DRAWN[-1]), strict=True):
        ride, error, estimate = run("turning", model, seed)
        pitch = true_angles(ride.truth)["two-gyro/pitch"][:, 0] / DEG
        if not top.lines:
            top.plot(ride.time, pitch, color=TRUTH_COLOR, linewidth=1.2, label="truth")
        top.plot(ride.time, pitch + error, color=color, linewidth=0.8, label=name)
        with_band(below, ride.time, error, estimate, color, name)
    top.set(ylabel="χ, deg", ylim=(-16.0, 16.0))
    below.set(ylabel="error of χ, deg", ylim=(-8.0, 8.0))
    legend_above(top)
    legend_above(below)
    return drawn
