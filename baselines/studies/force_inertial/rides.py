"""The force/inertial filter on simulated rides of a full rider: table II, figures 6 to 10, where errors come from."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.bicycle.sensors.devices import MODEL_605_GYROSCOPE
from ....envs.bicycle.sensors.measured_geometry import measured
from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound
from ....filters.analysis.lasting_errors import Lasting, lasting_and_white, lasting_bound
from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.bicycle.force_inertial.integration import ForceInertialIntegration
from ....filters.bicycle.force_inertial.kinematics import true_angles
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.core.quantity import DEG, Estimate
from ..averages import mean_of, mean_rms, rounded, windowed
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_figures import ride_figure
from ..ride_study import MEAN, SETTLED, ZERO, Less, RideStudy, Variant
from ..sensors import without_errors
from .figures import course_figures
from .states import from_the_truth, smoothed_torques, true_states

ANGLES = ("φ_h", "θ", "φ", "φ_b")
OURS, CELLS, SIMPLE = "this filter", "without load cells", "no pedals, no pelvis, sum of the hands"
STANDING, EXACT = "saddle carries nothing", "both exact"
POINT_MASS = {
    "carried_mass": 0.0,
    "pedal_share": 0.0,
    "trunk_across": 0.0,
    "trunk_along": 0.0,
    "wheelbase": 0.0,
    "handlebar_load": "sum",
}
"""The paper's rider, with our lengths."""
TABLE_II = {
    ("indoor_circle", OURS): ("3.42 ± 1.34", "1.62 ± 1.06", "5.56 ± 1.45", "0.82 ± 0.31"),
    ("indoor_circle", "no bias model"): ("3.73 ± 1.46", "1.84 ± 1.09", "5.81 ± 1.42", "0.84 ± 0.33"),
    ("outdoor", OURS): ("4.46 ± 1.62", "4.01 ± 1.61", "6.18 ± 2.43", "2.31 ± 0.89"),
    ("outdoor", "no bias model"): ("4.42 ± 1.75", "4.18 ± 1.63", "6.24 ± 2.39", "2.30 ± 0.88"),
}
"""Published, deg."""
FORCES, GYROSCOPES = ("seat/wrench", "handlebar/force"), ("trunk_imu/gyr", "bicycle_imu/gyr")
TORQUES = ("τ_φh mean", "τ_θ mean", "τ_φh std", "τ_θ std", "τ_φh − read, rms", "τ_θ − read, rms")


def _from_first_whole_sample(ride: Trajectory) -> Trajectory:
    """The ride from the first time at which every channel has a sample."""
    names = [channel.name for channel in ForceInertial.channels]
    whole = np.all([np.isfinite(ride.measurements[name]).all(axis=-1) for name in names], axis=0)
    return ride[int(np.argmax(whole)) :]


def _truth(truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: truth[name] for name in ("bicycle/roll", "trunk_imu/gyroscope_bias")} | true_angles(truth)


def _tape_measure(geometry: RiderGeometry, ride: Trajectory) -> RiderGeometry:
    return measured(geometry, np.random.default_rng(zlib.crc32(ride.name.encode())))


def _without_cells(ride: Trajectory) -> dict[str, np.ndarray]:
    """Load cells that read nothing that depends on the rider."""
    cells = ride.measurements["seat/load_cells"]
    return {**ride.measurements, "seat/load_cells": np.full_like(cells, 200.0)}


def _standing(ride: Trajectory) -> dict[str, np.ndarray]:
    """Force sensors of a saddle that carries nothing, as under a rider who stands on the pedals."""
    empty = {name: np.zeros_like(ride.measurements[name]) for name in ("seat/wrench", "seat/load_cells")}
    return {**ride.measurements, **empty, "seat/load_cells": empty["seat/load_cells"] + 1.0}


def _windows(time: np.ndarray) -> dict[str, tuple[float, float]]:
    """Before and after 50 s, as in figure 6, to see a drift."""
    return {"settled": (SETTLED, np.inf), "before 50 s": (SETTLED, 50.0), "after 50 s": (50.0, np.inf)}


def _more(study: RideStudy, ride: Trajectory, estimates: dict[str, Estimate]) -> dict[str, Any]:
    """Convergence from a wrong start, torques at the true pose, and the bound for the filter's noises."""
    samples = {channel.name: ride.measurements[channel.name] for channel in ForceInertial.channels}
    truth, kalman = _truth(ride.truth), study.estimator(ride, Variant())
    right, wrong = from_the_truth(kalman, samples, truth), []
    for off in (35.0, -35.0):
        pose = from_the_truth(kalman, samples, truth, off * DEG)
        bad = np.abs(study.errors(pose, right)["φ_h"]) > 1.0
        wrong.append(float(len(bad) - np.argmax(bad[::-1])) * ride.dt if bad.any() else 0.0)
    model = kalman.model
    settled = ride.time >= SETTLED

    def averaged(covariance: np.ndarray) -> dict[str, float]:
        variances = np.diagonal(covariance, axis1=-2, axis2=-1)[settled, :4]
        found = np.degrees(np.sqrt(variances.mean(axis=0))) if settled.any() else np.full(4, np.nan)
        return dict(zip(ANGLES, found.tolist(), strict=True))

    return {
        "wrong start": wrong,
        "torques": torque_numbers(model, samples, truth, ride.time),
        "white bound": averaged(posterior_bound(model, true_states(model, samples, truth), samples)),
        "bound": averaged(bound_of_ride(model, samples, truth)),
    }


def bound_of_ride(model: ForceInertial, samples: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> np.ndarray:
    """Bound ``(T, 7, 7)`` for the errors of the sensors and of the model as they are in this ride.

    White noise of the gyroscopes and their biases are those of the devices; each output (torques, roll, shoulders) is
    off at the true states by a part that lasts and by white noise.
    """
    device = MODEL_605_GYROSCOPE.noise
    real = replace(model, gyroscope_noise=device.white_noise / model.dt**0.5, bias_std=device.bias_instability)
    output = real.residual(true_states(real, samples, truth), samples)[0]
    errors, whites = lasting_and_white(output, model.dt)
    errors.append(Lasting((device.bias_instability,) * 3, device.bias_correlation_time, channel="bicycle_imu/gyr"))
    return lasting_bound(
        real, lambda changed: true_states(real, changed, truth), samples, errors, white=np.diag(whites**2)
    )


def torque_numbers(
    model: ForceInertial, samples: dict[str, np.ndarray], truth: dict[str, np.ndarray], time: np.ndarray
) -> dict[str, dict[str, float]]:
    """What is read and what the two models predict, smoothed over 0.2 s: :data:`TORQUES` of each, N·m."""
    kept = (time >= 2.0) & (time <= time[-1] - 1.0)
    named = {name: part[kept] for name, part in smoothed_torques(model, samples, truth).items()}
    numbers = {}
    for name, part in named.items():
        off = np.sqrt(np.mean((part - named["read"]) ** 2, axis=0)) if name != "read" else [np.nan, np.nan]
        values = [*part.mean(axis=0), *part.std(axis=0), *off]
        numbers[name] = {label: float(value) for label, value in zip(TORQUES, values, strict=True)}
    return numbers


RIDES = RideStudy(
    name="force-inertial",
    suite="force-inertial",
    model=ForceInertial,
    variants={
        OURS: Variant(),
        "no bias model": Variant({"bias_model": False}),
        "level shoulders (17) only": Variant({"ahead_share": 0.0}),
        "chest ahead counts 0.4": Variant({"ahead_share": 0.4}),
        "static torque": Variant({"torque_model": "static"}),
        "(13) as published": Variant({"roll_model": "published"}),
        "(12) without N_z": Variant({"torque_reading": "without-z"}),
        SIMPLE: Variant(POINT_MASS),
        "geometry measured": Variant(geometry=_tape_measure),
        CELLS: Variant(samples=_without_cells),
        STANDING: Variant(samples=_standing),
        "integration": Variant(model=ForceInertialIntegration),
    },
    ablations={
        "force sensors: zeros known": Variant(samples=partial(without_errors, unbiased=FORCES)),
        "force sensors: exact": Variant(samples=partial(without_errors, exact=FORCES)),
        "gyroscopes: no bias": Variant(samples=partial(without_errors, unbiased=GYROSCOPES)),
        EXACT: Variant(samples=partial(without_errors, unbiased=GYROSCOPES, exact=FORCES)),
    },
    scenarios={"indoor_circle": None, "outdoor": None},
    angles={name: ("force-inertial/trunk_angles", i) for i, name in enumerate(ANGLES[:3])}
    | {"φ_b": ("bicycle/roll", 0)},
    truth=_truth,
    states={name: i for i, name in enumerate(ANGLES)},
    parts={"NEES": ANGLES},
    checked=(OURS,),
    published={key: dict(zip(ANGLES, values, strict=True)) for key, values in TABLE_II.items()},
    table="Table II",
    tabled=(OURS, "no bias model", ZERO, MEAN),
    comparisons=(
        Less("(13) as published doubles the error of φ_b", "φ_b", OURS, "(13) as published", 0.5),
        Less("Leaving out pedals, pelvis and grips doubles the error of φ_h", "φ_h", OURS, SIMPLE, 0.5),
        Less("Level shoulders (17) only double the error of φ", "φ", OURS, "level shoulders (17) only", 0.5),
        Less("Zeros make more than a quarter of φ_h's error", "φ_h", "force sensors: zeros known", OURS, 0.75),
        Less("Zeros make more than a quarter of θ's error", "θ", "force sensors: zeros known", OURS, 0.75),
        Less(
            "Who stands is not covered: a saddle that carries nothing doubles φ_h's error", "φ_h", OURS, STANDING, 0.5
        ),
        Less("After 50 s integration is more than twice as wrong", "φ_h", OURS, "integration", 0.5, "after 50 s"),
    ),
    drawn=("integration", OURS),
    followed=(EXACT,),
    windows=_windows,
    prepare=_from_first_whole_sample,
    extra=_more,
    bound="for white noises and biases of the devices, and for the errors of the outputs on this ride: their means, "
    "and processes of their standard deviations and frequencies",
)


def lively(study: Study, report: Report) -> None:
    """Figure 7: another subject, who moves the trunk a lot, over two minutes as in the paper."""
    other = replace(study, subjects=(study.subjects[1:2] or study.subjects), seeds=1)
    (path,) = other.ride_files(
        "indoor_circle", "force-inertial", style="aggressive", duration=min(120.0, 2.0 * study.duration)
    )
    (found,) = study.map("lively rider", followed, [(path,)])
    ride_figure(RIDES, report, path, "Figure 7: trunk of another subject, who moves a lot", ANGLES[:3])
    ratios = {angle: found[OURS][angle] / found[MEAN][angle] for angle in ANGLES[:3]}
    statement = "Figure 7: the filter follows the trunk better than the best constant"
    worst = max(ratios, key=ratios.__getitem__)
    cause = f"Exact sensors leave more than half of the error of {worst}: the rider makes it"
    report.claims(
        "Figure 7: what holds",
        [
            Claim.every(statement, ratios, 1.0, "of its error"),
            Claim.less(cause, found[OURS][worst], found[EXACT][worst], factor=2.0),
        ],
    )


def followed(path: Path) -> dict[str, dict[str, float]]:
    """RMS errors (deg) of the filter, of the filter with exact sensors, and of the best constant on one ride."""
    ride = RIDES.load(path)
    truth, variants = _truth(ride.truth), {OURS: Variant(), EXACT: RIDES.ablations[EXACT]}
    errors = {name: RIDES.errors(RIDES.estimate(ride, each).pose, truth) for name, each in variants.items()}
    errors |= RIDES.baselines(ride.time, truth)
    return {name: windowed(errors[name], ride.time, SETTLED) for name in (*variants, MEAN)}


def rides(study: Study, report: Report) -> None:
    """Tables, claims and a figure of both courses."""
    report.text(
        "Variants: *geometry measured*: segment lengths within 2 %, joints within 1 cm, trunk mass within 3 %. "
        "*Without load cells*: they read a constant. *No pedals, no pelvis, sum of the hands*: the paper's point mass."
    )
    for scenario in RIDES.scenarios:
        paths, every = RIDES.run(study, scenario)
        mean = {name: mean_of(each["torques"][name] for each in every) for name in ("read", "dynamic", "static")}
        bound = mean_of(each["white bound"] for each in every)
        drawn = course_figures(RIDES, report, paths, every, scenario)
        RIDES.report(report, scenario, every, [*claims(every, mean, bound), *drawn])
        report.table(
            f"Lower bound, {scenario}, deg",
            [rounded(bound)],
            "Cramér–Rao, along the true states, for white noises of the sizes that the filter assumes.",
        )
        report.table(
            f"Torques at the true pose, {scenario}",
            [{"N·m": name, **rounded(torque, 1)} for name, torque in mean.items()],
            "Smoothed over 0.2 s. Means of all rides.",
        )


def claims(every: list[dict[str, Any]], torque: dict[str, dict[str, float]], bound: dict[str, float]) -> list[Claim]:
    """What the paper says of biases, torques and wrong starts, and what one would read off the tables."""
    ours, exact = mean_rms(every, OURS), mean_rms(every, EXACT)
    change = {
        name: 100.0 * max(abs(error / ours[angle] - 1.0) for angle, error in mean_rms(every, name).items())
        for name in ("no bias model", CELLS)
    }
    std, off = ({name: torque[name][f"τ_φh{label}"] for name in torque} for label in (" std", " − read, rms"))
    starts = [time for each in every for time in each["wrong start"]]
    good = [time for time in starts if time <= 6.0]
    recovered = f"{len(good)} of {len(starts)} starts, the slowest of these in {max(good, default=float('nan')):.2g} s"
    lacks = [{name: each["torques"][name]["τ_φh − read, rms"] for name in ("dynamic", "static")} for each in every]
    nearer = sum(ride["dynamic"] < ride["static"] for ride in lacks)
    return [
        *follows(every),
        phi_is_largest("φ has the largest error of the four angles", ours),
        phi_is_largest("With exact sensors φ has the largest error of the four angles", exact),
        bias_within_spread(every),
        Claim.best("φ_b has the smallest error of the four angles", "φ_b", ours),
        Claim.less("With exact sensors φ_b is at its bound", exact["φ_b"], bound["φ_b"], factor=1.1),
        Claim.less("The bias model changes no angle by more than a fifth", change["no bias model"], 20.0, "%"),
        Claim.less(
            "The bias model lowers the mean error of the four angles",
            float(np.mean(list(ours.values()))),
            float(np.mean(list(mean_rms(every, "no bias model").values()))),
        ),
        Claim.less("Without load cells no angle changes by 0.1 %", change[CELLS], 0.1, "%"),
        Claim.less("The static torque underestimates how much τ_φh fluctuates", std["static"], std["read"], "N·m"),
        Claim.less("The dynamic torque is nearer to what is read", off["dynamic"], off["static"], "N·m"),
        Claim("In most rides the dynamic torque is nearer", f"{nearer} of {len(lacks)}", 2 * nearer > len(lacks)),
        Claim.less("The dynamic torque lacks less than half of what is read", off["dynamic"], 0.5 * std["read"], "N·m"),
        Claim("φ_h that starts 35° off is right within 1° after 6 s", recovered, len(good) == len(starts)),
        Claim.within("Nine of ten such starts are right within 1° after 6 s", len(good) / len(starts), 0.9, 1.0),
    ]


def phi_is_largest(statement: str, errors: dict[str, float]) -> Claim:
    """Whether no other angle is as wrong as φ."""
    rival = max((angle for angle in errors if angle != "φ"), key=errors.__getitem__)
    return Claim.less(statement, errors[rival], errors["φ"], names=(rival, "φ"))


def bias_within_spread(every: list[dict[str, Any]]) -> Claim:
    """Whether the bias model's effect is lost in the differences between rides, as the paper means *not significant*.

    The paper prints errors as mean ± standard deviation over riders.
    """
    ratios = {}
    for angle in ANGLES:
        ours, other = (
            np.array([each["rms"][name]["settled"][angle] for each in every]) for name in (OURS, "no bias model")
        )
        spread = ours.std(ddof=1) if len(every) > 1 else np.nan
        ratios[angle] = float(abs(ours.mean() - other.mean()) / spread)
    statement = "The bias model changes no error by more than its standard deviation over rides"
    return Claim.every(statement, ratios, 1.0, "of it")


def follows(every: list[dict[str, Any]]) -> list[Claim]:
    """Whether the trunk of each rider is estimated better than by the best constant of each ride, and if not, why."""
    ratios: dict[str, float] = {}
    constants, exact = dict(ratios), dict(ratios)
    for subject in dict.fromkeys(each["subject"] for each in every):
        rides = [each for each in every if each["subject"] == subject]
        ours, best, without = (mean_rms(rides, name) for name in (OURS, MEAN, EXACT))
        names = {f"{angle} of rider {subject}": angle for angle in ANGLES[:3]}
        ratios |= {name: ours[angle] / best[angle] for name, angle in names.items()}
        exact |= {name: without[angle] / best[angle] for name, angle in names.items()}
        constants |= {name: best[angle] for name, angle in names.items()}
    worst = max(ratios, key=ratios.__getitem__)
    still = f"Where it does so worst ({worst}), the angle stays within 1° of its mean, RMS"
    either = "With exact sensors it does not either: the model of the rider makes the error"
    return [
        Claim.every(
            "The filter follows every rider's trunk better than the best constant", ratios, 1.0, "of its error"
        ),
        Claim.less(still, constants[worst], 1.0),
        Claim.less(either, 1.0, max(exact.values()), "of the constant's error"),
    ]
