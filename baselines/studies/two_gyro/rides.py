"""The two-gyroscope filter on simulated rides: table I, figures 9 to 17, and where the errors come from."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ....filters.bicycle.platform_gyro import PlatformGyro, TwoGyroIntegration
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles
from ....filters.core.quantity import DEG
from ..averages import mean_of, mean_rms
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_study import MEAN, SETTLED, ZERO, Less, RideStudy, Variant
from ..sensors import without_errors
from .figures import course_figure
from .ride_bounds import CAMERA, DRAWS, GYROSCOPES, bounds_of_ride

ROUGH = 1.4 * DEG
"""rad/s/√Hz: 10 °/s a sample at 50 Hz"""
ALONE, INTEGRATED, WHITE_CAMERA = "platform gyroscope alone", "integration", "camera: white noise only"
TABLE_I = {"θ1": "2.11 ± 0.45", "θ2": "2.62 ± 0.89", "θ3": "1.98 ± 0.75", "φ": "0.72 ± 0.22"}
"""Published errors, deg."""
EARLIER = {"θ1": 2.21, "θ2": 2.98, "θ3": 3.46, "φ": 0.61}
"""Table I, deg: the earlier method with force sensors, [19] of the paper."""
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


RIDES = RideStudy(
    name="two-gyro",
    suite="two-gyro",
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
        WHITE_CAMERA: Variant(samples=partial(without_errors, unbiased=CAMERA)),
        "camera: no errors": Variant(samples=partial(without_errors, exact=CAMERA)),
        "gyroscopes: no bias": Variant(samples=partial(without_errors, unbiased=GYROSCOPES)),
        "gyroscopes: no errors": Variant(samples=partial(without_errors, exact=GYROSCOPES)),
        "gyroscopes no bias, camera white": Variant(samples=partial(without_errors, unbiased=(*GYROSCOPES, *CAMERA))),
        "no errors": Variant(samples=partial(without_errors, exact=(*GYROSCOPES, *CAMERA))),
    },
    # one ride of each rider outside of the indoor circle
    scenarios={scenario: None if scenario == "indoor_circle" else 1 for scenario in SCENARIOS},
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
        Less("Σ2 is no worse than integration", "φ", "Σ2", INTEGRATED),
        Less("Process noise for pitch lowers the error of φ", "φ", "Σ2, inflated", "Σ2"),
        Less("With process noise for pitch Σ2 is no worse than integration", "φ", "Σ2, inflated", INTEGRATED),
        Less("Exact sensors leave more than half of the error of φ: the model makes it", "φ", "Σ2", "no errors", 2.0),
        Less("Trusting the camera ten times less lowers the error of φ", "φ", "Σ2, camera 20°", "Σ2"),
        Less("The camera's alignment error makes more than half of φ's", "φ", WHITE_CAMERA, "Σ2", 0.5),
    ),
    drawn=(ALONE, "Σ1", INTEGRATED, "Σ2"),
    sampled="relative/orientation",
    windows=_windows,
    extra=bounds_of_ride,
    bound="for the true noises, with the alignment error of the camera's marker (1° constant, 1° over 60 s) to be "
    "estimated too",
)


def rides(study: Study, report: Report) -> None:
    """Table I and the scenarios of figures 9 to 17."""
    results = {}
    for scenario, figures in SCENARIOS.items():
        paths, results[scenario] = RIDES.run(study, scenario)
        found = results[scenario]
        about, fell = mean_of(each["ride"] for each in found), sum(each["ended"] == "terminated" for each in found)
        report.text(
            f"**{scenario}** ({figures}): {len(found)} rides, {fell} ended early; roll {about['φ rms']:.1f}° RMS, "
            f"pitch up to {about['χ largest']:.1f}°, yaw rate {about['|dψ/dt| mean']:.0f} °/s."
        )
        RIDES.report(report, scenario, found, claims(found))
        course_figure(RIDES, report, paths[0], scenario, f"Ride {scenario}: {figures}")
    report.table(
        "Roll on every course, RMS in deg",
        rolls(results),
        f"From {SETTLED:g} s on, mean over rides; in brackets over the last 20 s.",
    )
    beside_the_bound(report, results["indoor_circle"])
    errors = {scenario: mean_rms(found, "Σ2")["φ"] for scenario, found in results.items()}
    statement = "Up to 20° of pitch do not significantly degrade φ (at most twice the error of outdoor rides)"
    report.claims("Pitch", [Claim.less(statement, errors["pitch"], errors["outdoor"], factor=2.0)])


def rolls(results: dict[str, list[dict[str, Any]]]) -> list[dict[str, str]]:
    """Rows of methods and columns of courses: error of φ, and that of the last 20 s."""
    rows = []
    for name in (*RIDES.variants, ZERO, MEAN):
        row = {"filter": name}
        for course, found in results.items():
            settled, late = (mean_rms(found, name, window)["φ"] for window in ("settled", "last 20 s"))
            row[course] = f"{settled:.3g} ({late:.3g})"
        rows.append(row)
    bounds = {course: mean_of(each["bound"] for each in found)["φ"] for course, found in results.items()}
    return [*rows, {"filter": "posterior bound"} | {course: f"{bound:.3g}" for course, bound in bounds.items()}]


def beside_the_bound(report: Report, results: list[dict[str, Any]]) -> None:
    """Errors with a camera whose noise is white beside the bound, and whether chance alone takes them below it."""
    rows, ratios = [], {}
    for name in RIDES.states:
        mean = mean_of(each["white"][name] for each in results)
        deviation = {what: value**0.5 for what, value in mean.items()}
        ratios[name] = deviation["bound"] / deviation["redrawn"]
        rows.append(
            {
                "angle": name,
                "error, these rides": round(deviation["error"], 3),
                f"error, {DRAWS} draws of the noise": round(deviation["redrawn"], 3),
                "bound": round(deviation["bound"], 3),
                "bound / error": round(ratios[name], 2),
            }
        )
    report.table(
        "Beside the bound: a camera with white noise",
        rows,
        "RMS in deg along the indoor rides. The bound and the last filter know the true noises (1° a frame, no "
        "alignment "
        "error). Errors of θ are correlated over seconds: one draw of the noise holds few independent values.",
    )
    statement = "With the noise drawn anew, no angle beats its bound by more than 5 %"
    report.claims("Beside the bound: what holds", [Claim.every(statement, ratios, 1.05, "of the error")])


def claims(results: list[dict[str, Any]]) -> list[Claim]:
    """Whether Σ2 drifts, if the rides are long enough, and how far its roll is off at most."""
    long = min(each["length"] for each in results) >= 40.0
    settled = mean_rms(results, "Σ2")["φ"] if long else float("nan")
    late, peak = mean_rms(results, "Σ2", "last 20 s")["φ"], mean_of(each["peak"]["Σ2"] for each in results)["φ"]
    ours, white = (mean_rms(results, name) for name in ("Σ2", WHITE_CAMERA))
    published = RIDES.published_errors("indoor_circle")
    own_ratio = max(published[angle] / value for angle, value in EARLIER.items())
    earlier = "as accurate as the published method with force sensors ([19]), within the paper's own ratio"
    alone = "A camera with white noise only"
    bound = mean_of(each["bound"] for each in results)["φ"]
    return [
        Claim.shares(f"Σ2 is {earlier}", ours, EARLIER, own_ratio),
        Claim.shares(f"{alone}: {earlier}", white, EARLIER, own_ratio),
        Claim.shares(f"{alone}: every error is at or below table I", white, published),
        Claim.less("The roll is smaller than the posterior bound of its error", mean_rms(results, ZERO)["φ"], bound),
        Claim.less(f"Σ2 does not drift: φ in the last 20 s and from {SETTLED:g} s on", late, settled, factor=1.2),
        Claim.less("The largest error of φ is below 5°", peak, 5.0),
    ]
