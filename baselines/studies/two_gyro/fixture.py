"""Figures 6 to 8 of the two-gyroscope paper: a pushed bicycle with a tilted, turning disk on it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.platform_gyro import PlatformGyro
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import DEG, Estimate
from ..averages import mean_of, rounded, windowed
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_study import MEAN, SETTLED, ZERO
from ..sensors import without_errors
from .figures import fixture_figure
from .rides import ALONE, RIDES

CHANNELS = ["bicycle_imu/gyr", "disk/gyr", "relative/distances", "relative/orientation"]
FILTERS: dict[str, dict[str, Any]] = {
    "Σ2, distances": {},
    "Σ1, distances": {"model": "sigma1"},
    "Σ2, orientation": {"sensor": "orientation"},
    "Σ1, orientation": {"sensor": "orientation", "model": "sigma1"},
}
SENSORS: dict[str, dict[str, tuple[str, ...]]] = {
    "paper": {},
    "gyroscopes: no bias": {"unbiased": ("bicycle_imu/gyr", "disk/gyr")},
    "gyroscopes: no errors": {"exact": ("bicycle_imu/gyr", "disk/gyr")},
}
START = 10.0 * DEG
"""rad: standard deviation of the roll at the start, which the filters do not know"""


def estimates(push: Trajectory, samples: dict[str, np.ndarray]) -> dict[str, Estimate]:
    """Every filter on one push."""
    found = {
        name: KalmanFilter(TwoGyro.for_disk(dt=push.dt, roll_prior=START, **options)).run(samples)
        for name, options in FILTERS.items()
    }
    found[ALONE] = KalmanFilter(PlatformGyro(dt=push.dt, roll_prior=START, pitch_rate_noise=0.1 * DEG)).run(samples)
    return found


def fixture(study: Study, report: Report) -> None:
    """Errors over several pushes, and one of them drawn."""
    count = 2 if study.quick else 10
    options = {"suite": CHANNELS, "duration": study.duration}
    pushes = study.episodes("poise/BicycleFixture-v0", count, name="fixture", options=options)
    rows, means = [], {}
    for sensors, changes in SENSORS.items():
        found: dict[str, list[dict[str, float]]] = {}
        for push in pushes:
            truth = true_angles(push.truth, "disk")
            every = estimates(push, without_errors(push, **changes))
            errors = {name: RIDES.errors(each.pose, truth) for name, each in every.items()}
            if sensors == "paper":
                errors |= RIDES.baselines(push.time, truth)
            for name, each in errors.items():
                late = windowed({"φ, last 20 s": each["φ"]}, push.time, max(SETTLED, push.time[-1] - 20.0))
                found.setdefault(name, []).append(windowed(each, push.time, SETTLED) | late)
        means[sensors] = {name: mean_of(parts) for name, parts in found.items()}
        rows += [{"sensors": sensors, "filter": name, **rounded(row)} for name, row in means[sensors].items()]
    angles = ("θ1", "θ2", "θ3", "φ", "φ, last 20 s")
    report.table(
        "Fixture (figures 6 to 8)",
        [{name: row.get(name) for name in ("sensors", "filter", *angles)} for row in rows],
        f"Mean RMS in deg of {count} pushes from {SETTLED:g} s on; the filters start with roll 0 wherever the bicycle "
        "is. Three distances from one camera see two of three rotations at an instant, motion the third; the camera's "
        "orientation has an alignment error of its own (1°). The push has no pitch at all.",
    )
    report.claims("Fixture: what the paper says, and what holds here", claims(means["paper"]))
    drawn = fixture_figure(pushes[0], estimates(pushes[0], pushes[0].measurements), RIDES, "distances")
    report.figure("fixture", drawn, "Figures 6 to 8: one push", "Distances; thin: three standard deviations.")


def claims(means: dict[str, dict[str, float]]) -> list[Claim]:
    """What figures 6 to 8 show."""
    late = {name: row["φ, last 20 s"] for name, row in means.items() if name != MEAN}
    found = []
    for sensor in ("distances", "orientation"):
        ours, other = late[f"Σ2, {sensor}"], late[f"Σ1, {sensor}"]
        theta = max(means[f"Σ2, {sensor}"][f"θ{i}"] for i in (1, 2, 3))
        found += [
            Claim.less(f"{sensor}: Σ2 follows the roll, Σ1 is more than twice as wrong", ours, other, factor=0.5),
            Claim.less(f"{sensor}: θ does not drift, it stays below 3°", theta, 3.0),
            Claim.less(f"{sensor}: Σ2 beats a roll of zero", ours, late[ZERO]),
        ]
    return [*found, Claim.best("The platform's gyroscope alone has the smallest error of the roll", ALONE, late)]
