"""The two-gyroscope filter on simulated rides: table I, figures 9 to 17, and where the errors come from."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound, with_gaps
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.platform_gyro import PlatformGyro, TwoGyroIntegration
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles, true_states
from ....filters.core.quantity import Estimate
from ..averages import mean_of, mean_rms
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_study import MEAN, SETTLED, ZERO, Less, RideStudy, Variant
from ..sensors import without_errors
from ..signals import DEG

ROUGH = 1.4 * DEG
"""rad/s/√Hz: 10 °/s a sample at 50 Hz"""
ALONE, INTEGRATED = "platform gyroscope alone", "integration"
FRAME = 1.0 * DEG
"""rad: white noise of the simulated camera's frames"""
GYROSCOPES, CAMERA = ("bicycle_imu/gyr", "trunk_imu/gyr"), ("relative/orientation",)
TABLE_I = {"θ1": "2.11 ± 0.45", "θ2": "2.62 ± 0.89", "θ3": "1.98 ± 0.75", "φ": "0.72 ± 0.22"}
"""Published errors, deg. The earlier method with force sensors that the paper compares with has 2.21 ± 0.46,
2.98 ± 0.97, 3.46 ± 1.04, 0.61 ± 0.13."""
SCENARIOS = {
    "indoor_circle": "figures 9 to 11",
    "outdoor": "figures 12 to 14",
    "pitch": "figures 15 and 16",
    "straight": "figure 17",
    "slalom": "not in the paper",
}


def _windows(time: np.ndarray) -> dict[str, tuple[float, float]]:
    """Errors count from 10 s on; a drift shows most in the last 20 s."""
    return {"settled": (SETTLED, np.inf), "last 20 s": (max(SETTLED, time[-1] - 20.0), np.inf)}


def _bound(study: RideStudy, ride: Trajectory, estimates: dict[str, Estimate]) -> dict[str, Any]:
    """What the ride was, and mean squares (deg²) of errors and bound of θ and φ with a camera whose noise is white.

    The bound knows white noise and drifting biases, no alignment error of the camera, so that is taken away.
    """
    truth = true_angles(ride.truth)
    model = TwoGyro.for_rider(RiderGeometry.of(ride.metadata), dt=ride.dt, orientation_noise=FRAME)
    white = Variant({"orientation_noise": FRAME}, partial(without_errors, unbiased=CAMERA))
    errors = study.errors(study.estimate(ride, white).pose, truth)
    exact = with_gaps(without_errors(ride, exact=(*GYROSCOPES, *CAMERA)), ride.measurements)
    orientations = {name: ride.truth[name] for name in ("bicycle/orientation", "trunk/orientation")}
    covariance = posterior_bound(model, true_states(orientations, model), exact)
    settled = ride.time >= min(SETTLED, 0.5 * float(ride.time[-1]))
    variances = np.mean(np.diagonal(covariance, axis1=1, axis2=2)[settled, :4], axis=0) / DEG**2
    return {
        "ride": {
            "φ rms": float(np.sqrt(np.mean(truth["bicycle/roll"] ** 2))) / DEG,
            "χ largest": float(np.abs(truth["two-gyro/pitch"]).max()) / DEG,
            "|dψ/dt| mean": float(np.abs(ride.truth["bicycle/angular_rate"][:, 2]).mean()) / DEG,
        },
        "achieved": {name: float(np.mean(errors[name][settled] ** 2)) for name in study.states},
        "bound": dict(zip(study.states, variances.tolist(), strict=True)),
    }


RIDES = RideStudy(
    name="two-gyro",
    model=TwoGyro,
    variants={
        "Σ2": Variant(),
        "Σ1": Variant({"model": "sigma1"}),
        "Σ2, published step": Variant({"integration": "euler"}),
        "Σ2, guard 0.5 °/s": Variant({"zero_yaw_guard": 0.5 * DEG}),
        "Σ2, inflated": Variant({"pitch_rate_noise": ROUGH, "roll_rate_noise": ROUGH}),
        "Σ1 with (5)": Variant({"model": "sigma1", "constraint": True}),
        "Σ2, camera 20°": Variant({"orientation_noise": 20.0 * DEG}),
        ALONE: Variant(model=PlatformGyro),
        INTEGRATED: Variant(model=TwoGyroIntegration),
    },
    ablations={
        "camera: white noise only": Variant(samples=partial(without_errors, unbiased=CAMERA)),
        "camera: no errors": Variant(samples=partial(without_errors, exact=CAMERA)),
        "gyroscopes: no bias": Variant(samples=partial(without_errors, unbiased=GYROSCOPES)),
        "gyroscopes: no errors": Variant(samples=partial(without_errors, exact=GYROSCOPES)),
        "gyroscopes no bias, camera white": Variant(samples=partial(without_errors, unbiased=(*GYROSCOPES, *CAMERA))),
        "no errors": Variant(samples=partial(without_errors, exact=(*GYROSCOPES, *CAMERA))),
    },
    angles={f"θ{i + 1}": ("two-gyro/relative_angles", i) for i in range(3)} | {"φ": ("bicycle/roll", 0)},
    truth=true_angles,
    states={"φ": 0, "θ1": 1, "θ2": 2, "θ3": 3},
    parts={"NEES": ("φ", "θ1", "θ2", "θ3"), "NEES of φ": ("φ",)},
    checked=("Σ2", "Σ1", "Σ2, inflated", "Σ2, camera 20°"),
    published={("indoor_circle", "Σ2"): TABLE_I},
    table="Table I",
    tabled=("Σ2", "Σ1", "Σ2, published step", "Σ2, inflated", "Σ1 with (5)", ALONE, INTEGRATED, ZERO, MEAN),
    comparisons=(
        Less("Σ1 drifts, Σ2 is less than half as wrong in the end", "φ", "Σ2", "Σ1", 0.5, "last 20 s"),
        Less("θ1 does not drift as integration does", "θ1", "Σ2", INTEGRATED, 0.5, "last 20 s"),
        Less("Σ2 beats the platform's gyroscope alone", "φ", "Σ2", ALONE),
        Less("Process noise for pitch lowers the error of φ", "φ", "Σ2, inflated", "Σ2"),
        Less("Trusting the camera ten times less lowers the error of φ", "φ", "Σ2, camera 20°", "Σ2"),
        Less("The camera's alignment error makes more than half of φ's", "φ", "camera: white noise only", "Σ2", 0.5),
    ),
    drawn=(ALONE, "Σ1", INTEGRATED, "Σ2"),
    sampled="relative/orientation",
    windows=_windows,
    extra=_bound,
)


def rides(study: Study, report: Report) -> None:
    """Table I and the scenarios of figures 9 to 17."""
    results = {}
    for scenario, figures in SCENARIOS.items():
        # one ride of each rider outside of the indoor circle
        part = study if scenario == "indoor_circle" else replace(study, seeds=1)
        paths, results[scenario] = RIDES.run(part, scenario, "two-gyro")
        found = results[scenario]
        about, fell = mean_of(each["ride"] for each in found), sum(each["ended"] == "terminated" for each in found)
        report.text(
            f"**{scenario}** ({figures}): {len(found)} rides, {fell} ended early; roll {about['φ rms']:.1f}° RMS, "
            f"pitch up to {about['χ largest']:.1f}°, yaw rate {about['|dψ/dt| mean']:.0f} °/s."
        )
        RIDES.report(report, scenario, found, claims(found))
        RIDES.figure(report, paths[0], f"ride {scenario}: {figures}")
    achieved, bound = (mean_of(each[key] for each in results["indoor_circle"]) for key in ("achieved", "bound"))
    report.table(
        "Achieved errors beside the bound",
        [
            {
                "angle": name,
                "achieved RMS, deg": round(achieved[name] ** 0.5, 3),
                "bound, deg": round(bound[name] ** 0.5, 3),
                "efficiency (bound / achieved)": round((bound[name] / achieved[name]) ** 0.5, 2),
            }
            for name in achieved
        ],
        "Posterior Cramér–Rao bound along the indoor rides, with the noises that the filter assumes but a camera "
        "without alignment error (1° a frame), and the filter on such samples. Errors of θ are correlated over about "
        "7 s (twice √(R/q) of camera, gyroscopes): rides hold few independent values, and may lie below by chance.",
    )
    errors = {scenario: mean_rms(found, "Σ2")["φ"] for scenario, found in results.items()}
    statement = "Up to 20° of pitch do not significantly degrade φ (at most twice the error of outdoor rides)"
    report.claims("Pitch", [Claim.less(statement, errors["pitch"], errors["outdoor"], factor=2.0)])


def claims(results: list[dict[str, Any]]) -> list[Claim]:
    """Whether Σ2 drifts, if the rides are long enough, and how far its roll is off at most."""
    long = min(each["length"] for each in results) >= 40.0
    settled = mean_rms(results, "Σ2")["φ"] if long else float("nan")
    late, peak = mean_rms(results, "Σ2", "last 20 s")["φ"], mean_of(each["peak"]["Σ2"] for each in results)["φ"]
    return [
        Claim.less(f"Σ2 does not drift: φ in the last 20 s and from {SETTLED:g} s on", late, settled, factor=1.2),
        Claim.less("The largest error of φ is below 5°", peak, 5.0),
    ]
