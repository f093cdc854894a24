"""The whole-body filter on simulated rides: table III, figures 6, 8, 10 and 11, and where the errors come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.bicycle.sensors.measured_geometry import measured
from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body import constraints as limb_constraints
from ....filters.bicycle.whole_body.filter import SEAT_FORCE, WholeBody
from ....filters.bicycle.whole_body.integration import WholeBodyIntegration
from ....filters.bicycle.whole_body.linkage import SHOULDER, SIDES, TRUNK, true_angles
from ....filters.core import rotation
from ....filters.core.quantity import Estimate
from ..averages import largest, mean_of, mean_rms, windowed
from ..claims import Claim
from ..kit import Study
from ..report import Report
from ..ride_figures import offset_shares, ride_figure, spread_claims, spread_figure
from ..ride_study import MEAN, SETTLED, SPACING, STRAPDOWN, Less, RideStudy, Variant
from ..sensors import without_errors
from .angles import ANGLES, STATES, TABLE_III, short
from .figures import CONSTRAINTS, SHOWN, bump_figure, residual_figure, table_i, table_ii
from .reconstruction import reconstruction
from .speed import by_speed, speed_claims, squares_by_speed
from .states import Encoders, bound_of_ride

COURSES = {"indoor": "indoor_circle", "outdoor": "outdoor"}
"""The paper's → the environment's."""
DRIFT = ((15.0, 25.0), (50.0, 60.0))
"""s in which the integration's drift is looked at, in rides that are long enough"""
PUBLISHED_FORMS: dict[str, Any] = {
    "lateral": "published",
    "torque": "published",
    "knee_axis": "y",
    "published_knee": True,
}
ENCODERS, SEATED, LATER = "encoders alone", "seat supports the trunk", "after 20 s"
NO_GUARD = 1e9
"""m/s²: a threshold that no shock reaches"""
INERTIAL = tuple(channel.name for channel in WholeBody.channels if channel.name.endswith(("/gyr", "/acc")))


def _windows(time: np.ndarray) -> dict[str, tuple[float, float]]:
    spans = {f"{begin:g}–{end:g} s": (begin, end if time[-1] >= end - 1e-6 else -np.inf) for begin, end in DRIFT}
    late = {"second half": (0.5 * time[-1], np.inf), "last quarter": (0.75 * time[-1], np.inf), LATER: (20.0, np.inf)}
    return {"settled": (SETTLED, np.inf), **spans, **late}


def _tape_measure(geometry: RiderGeometry, ride: Trajectory) -> RiderGeometry:
    rng = np.random.default_rng([int(ride.metadata["subject"]), int(ride.metadata["index"])])
    return measured(geometry, rng)


def with_trunk_on_the_seat(ride: Trajectory) -> dict[str, np.ndarray]:
    """The samples with load cells that feel just what (9*) gives: no pedals, and hands that carry nothing."""
    model = WholeBody.for_rider(RiderGeometry.of(ride.metadata), seat_share=1.0)
    found = dict(ride.measurements)
    angles = true_angles(ride.truth)["trunk/angles"]
    x = np.zeros((len(ride), model.state_size))
    x[:, TRUNK] = angles
    rate = model.bicycle_axes(found["bicycle_imu/gyr"])
    x[:, SEAT_FORCE] = model._seat_force(found, rate, 0.0 * rate)
    R, J = rotation.euler_matrix("zxy", angles), rotation.euler_axes("zxy", angles)
    half = model._torque(x, R, J)[0][:, 0] / model.cells_wide
    found["seat/load_cells"] = np.stack([0.0 * half + 100.0, 150.0 + half, 150.0 - half], axis=-1)
    return found


def _residuals(study: RideStudy, ride: Trajectory, estimates: dict[str, Estimate]) -> dict[str, Any]:
    """The bound, the filter's standard deviations of Φr after 10 s and at the end, deg, and residuals of constraints.

    Returns:
        ``bound``: angle → RMS of the posterior bound, deg; ``residuals``: C1 to C3 of the right arm at the estimates,
        over time; ``speeds``: see :func:`.squares_by_speed`; ``deviations``; ``hinges``: 99th percentile of |C2| of
        right and left arm at the estimates; ``swivels``: RMS of C3 at the truth, how far elbows stand off their plane.
    """
    model, estimate = study.estimator(ride, Variant()).model, estimates["filter"]
    assert estimate.covariance is not None
    stds = np.degrees(np.sqrt(np.linalg.diagonal(estimate.covariance)))[:, SHOULDER["right"]]

    def arms(pose: Mapping[str, np.ndarray], steer: np.ndarray, which: int) -> np.ndarray:
        return np.stack([_arm(model, side, pose, steer).residuals[:, which] for side in SIDES])

    hinges = arms(estimate.pose, ride.measurements["steer/angle"], 1)[:, round(SETTLED / ride.dt) :]
    swivels = arms(true_angles(ride.truth), ride.truth["bicycle/steer"], 2)
    read = {channel.name: ride.measurements[channel.name] for channel in model.channels}
    bound = np.degrees(np.sqrt(np.linalg.diagonal(bound_of_ride(model, read, ride.truth))))
    settled, every = ride.time >= min(SETTLED, 0.5 * float(ride.time[-1])), max(1, round(SPACING / ride.dt))
    right = _arm(model, "right", estimate.pose, ride.measurements["steer/angle"]).residuals[::every]
    errors = study.errors(estimate.pose, true_angles(ride.truth))
    return {
        "bound": {angle: float(np.sqrt(np.nanmean(bound[settled, index] ** 2))) for angle, index in STATES.items()},
        "residuals": {name: right[:, index].tolist() for index, name in enumerate(CONSTRAINTS)},
        "speeds": squares_by_speed(ride, errors),
        "deviations": [stds[np.searchsorted(ride.time, at - 1e-9) - 1].tolist() for at in (SETTLED, ride.time[-1])],
        "hinges": np.nanpercentile(np.abs(hinges), 99.0, axis=1).tolist(),
        "swivels": np.sqrt(np.mean(np.square(swivels), axis=1)).tolist(),
    }


def _arm(model: WholeBody, side: str, pose: Mapping[str, np.ndarray], steer: np.ndarray) -> limb_constraints.Limb:
    return limb_constraints.arm(
        pose["trunk/angles"],
        pose[f"shoulder_{side}/angles"],
        model.point(model.trunk_pivot, "left", steer),
        model.point(model.shoulder, side, steer),
        model.hand(side, steer),
        model.upper_arm,
        model.forearm,
    )


RIDES = RideStudy(
    name="whole-body",
    suite="whole-body",
    model=WholeBody,
    variants={
        "filter": Variant(),
        "no biases": Variant(samples=partial(without_errors, unbiased=INERTIAL)),
        SEATED: Variant({"seat_share": 1.0}, with_trunk_on_the_seat),
        "seat_share 1": Variant({"seat_share": 1.0}),
        "swivel 0.3": Variant({"swivel_noise": 0.3}),
        "measured geometry": Variant(geometry=_tape_measure),
        "published forms": Variant(PUBLISHED_FORMS),
        ENCODERS: Variant(model=Encoders),
        STRAPDOWN: Variant(model=WholeBodyIntegration),
    },
    ablations={},
    scenarios=dict.fromkeys(COURSES.values()),
    angles=ANGLES,
    truth=true_angles,
    states=STATES,
    parts={
        "NEES φ": ("φ",),
        "NEES Θ, Φ": tuple(name for name in STATES if name[0] in "θφ" and name != "φ"),
        "NEES Ψ right": ("ψr1", "ψr2", "ψr3"),
        "NEES Ψ left": ("ψl1", "ψl2", "ψl3"),
    },
    checked=("filter",),
    published={(course, "filter"): values for course, values in TABLE_III.items()},
    table="Table III",
    tabled=("filter",),
    comparisons=(
        Less("Figure 6: integrated roll is more than twice as wrong", "φ", "filter", "integration", 0.5, "second half"),
        Less("Figure 6: integrated θ2 is more than twice as wrong", "θ2", "filter", "integration", 0.5, "second half"),
        Less("Trusting C3 and C7 ten times more lowers the error of θ3", "θ3", "swivel 0.3", "filter"),
        Less("The paper's seat torque lowers the error of θ2", "θ2", "seat_share 1", "filter"),
        Less("The paper's seat torque lowers the error of θ2 if the seat carries the trunk", "θ2", SEATED, "filter"),
        Less(
            "Where the seat carries the trunk integrated θ2 is more than twice as wrong",
            "θ2",
            SEATED,
            "integration",
            0.5,
            "second half",
        ),
        Less(
            "Where the seat carries the trunk the filter halves what the encoders alone give for the elbow",
            "αr",
            SEATED,
            ENCODERS,
            0.5,
        ),
        Less("The published forms double the error of φ", "φ", "filter", "published forms", 0.5),
        Less("The published forms are as good in φ", "φ", "published forms", "filter", 1.1),
        Less("The published forms are as good in β", "βr", "published forms", "filter", 1.1),
        Less("Elbow: the filter halves what the encoders alone give", "αr", "filter", ENCODERS, 0.5),
        Less("Knee: the encoders alone give what the filter gives", "βr", ENCODERS, "filter", 1.01),
        Less("Hip: the filter halves what the encoders alone give", "ψr1", "filter", ENCODERS, 0.5),
    ),
    drawn=("integration", "filter"),
    followed=(SEATED,),
    cells=short,
    windows=_windows,
    extra=_residuals,
    bound="for white noises and biases of the devices, and for the errors of outputs and constraints on this ride: "
    "their means, and processes of their standard deviations and frequencies",
)


def rides(study: Study, report: Report) -> None:
    """Indoor circle and outdoor course of every rider."""
    report.text(
        "Variants: *no biases*: true biases of inertial sensors subtracted. *Seat supports the trunk*: load cells "
        "replaced by (9*) of the true motion. *seat_share 1*: the paper's seat torque, on riders whose hands carry the "
        "lean. *Swivel 0.3*: C3 and C7 trusted ten times more. *Measured geometry*: lengths ±2 %, positions ±1 cm. "
        "*Published forms*: (3), (9), C7 about y and C8 as published. *Encoders alone*: upright, the usual trunk, "
        "limbs by inverse kinematics from steering and crank, without any inertial sensor; the knee (C8) follows from "
        "the crank in the filter too."
    )
    table_i(report)
    table_ii(report)
    for course, scenario in COURSES.items():
        paths, every = RIDES.run(study, scenario)
        first, last = (np.mean([each["deviations"][i] for each in every], axis=0) for i in (0, 1))
        hinge, swivel = np.max([each["hinges"] for each in every]), np.mean([each["swivels"] for each in every])
        claims = [
            Claim.less("Figure 8: standard deviations of Φr are bounded", float(np.max(last / first)), 1.2, "times"),
            Claim.less("Figure 10: |C2| at the estimates is below 0.05 in 99 % of all samples", float(hinge), 0.05, ""),
            Claim.less("Elbows keep to the plane that C3 wants within 0.1 (sine, RMS)", float(swivel), 0.1, ""),
        ]
        ride_figure(RIDES, report, paths[0], f"Figure 6: angles, {course}", SHOWN)
        claims += reconstruction(RIDES, report, paths[0], course, SEATED)
        if len(every) > 1:
            report.figure(f"figure-8-{course}", spread_figure(every, SHOWN), f"Figure 8: errors over time, {course}")
            claims += spread_claims(every, SHOWN, "Figure 8")
            worst, ours, seated = offset_shares(every, SHOWN, SEATED)
            statement = f"Where the seat carries the trunk the mean error of {worst} is less than half"
            claims.append(Claim.less(statement, seated, ours, factor=0.5))
        claims += [
            follows(every),
            no_worse_than_published(
                course, every, "filter", "Corrected (3), (9), C7, C8: φ and β are", ("φ", "βr", "βl")
            ),
            no_worse_than_published(course, every, SEATED, "Where the seat carries the trunk, every error is"),
            Claim.shares(
                "Where the seat carries the trunk every angle is estimated better than by the best constant",
                mean_rms(every, SEATED),
                mean_rms(every, MEAN),
                unit="of its error",
            ),
        ]
        report.figure(f"figure-10-{course}", residual_figure(every), f"Figure 10: residuals of the right arm, {course}")
        speeds = by_speed(every)
        if len(speeds) > 1:
            rows = [{"speed": name, **short(row)} for name, row in speeds.items()]
            report.table(f"Errors by speed, {course}", rows, "RMS in deg over all rides, while the bicycle is so fast.")
            claims += speed_claims(speeds)
        RIDES.report(report, course, every, claims)


def follows(every: list[dict[str, Any]]) -> Claim:
    """Whether integration is worse than the filter after 20 s; knees, which C8 gives to both, are the same."""
    ours, other = (mean_rms(every, name, LATER) for name in ("filter", STRAPDOWN))
    shown = {angle: ours[angle] for angle in SHOWN if angle[0] != "β"}
    return Claim.shares("Figure 6: after 20 s every angle is better than integrated", shown, other, unit="of its error")


def no_worse_than_published(
    course: str, every: list[dict[str, Any]], method: str, statement: str, angles: Sequence[str] = tuple(ANGLES)
) -> Claim:
    """Whether a method's error of every angle is at or below that of table III."""
    found = {angle: error for angle, error in mean_rms(every, method).items() if angle in angles}
    return Claim.shares(f"{statement} at or below table III", found, RIDES.published_errors(course))


def bump_errors(path: Path) -> dict[str, dict[str, float]]:
    """Largest errors between 12 and 18 s of a ride over two bumps, with and without the guard."""
    ride, found = RIDES.load(path), {}
    truth = true_angles(ride.truth)
    for name, threshold in (("with the guard", 1.5), ("without", NO_GUARD)):
        errors = RIDES.errors(RIDES.estimate(ride, Variant({"shock_threshold": threshold})).pose, truth)
        found[name] = windowed(errors, ride.time, 12.0, 18.0, statistic=largest)
    return found


def bumps(study: Study, report: Report) -> None:
    """Figure 11: two bumps of 4 cm at about 13 and 15 s."""
    paths = study.ride_files("bumps", "whole-body", duration=20.0)
    scores = study.map("bumps", bump_errors, [(path,) for path in paths])
    means = {name: mean_of(score[name] for score in scores) for name in ("with the guard", "without")}
    report.table(
        "Figure 11: two bumps",
        [{"filter": name, **short(row)} for name, row in means.items()],
        "Largest error between 12 and 18 s, deg, mean over rides.",
    )
    drawn = bump_figure(RIDES, paths[0], Variant({"shock_threshold": NO_GUARD}))
    report.figure("figure-11", drawn, "Figure 11: accelerometer and θ2 over the bumps")
    guarded, plain = ({angle: means[name][angle] for angle in ("φ", "θ1", "θ2", "θ3")} for name in means)
    report.claims(
        "Figure 11: what holds",
        [
            Claim.every("The filter with its guard stays within 5° in φ and Θ", guarded, 5.0),
            Claim.every("Without its guard the filter stays within 5° in φ and Θ", plain, 5.0),
            Claim.less("The guard halves the largest of these", max(guarded.values()), max(plain.values()), factor=0.5),
            *(
                Claim.less(
                    f"θ2, {name}: its largest error is below twice the RMS of table III, outdoors",
                    means[name]["θ2"],
                    RIDES.published_errors("outdoor")["θ2"],
                    factor=2.0,
                )
                for name in means
            ),
        ],
    )
