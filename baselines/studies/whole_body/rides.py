"""The whole-body filter on simulated rides: table III, figures 6, 8, 10 and 11, and where the errors come from."""

from __future__ import annotations

from collections.abc import Mapping
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
from ...plots import TRUTH_COLOR, legend_above, new_figure
from ..claims import Claim
from ..kit import Study
from ..report import DEVIATION, Report
from ..ride_study import MEAN, SETTLED, ZERO, RideStudy, Variant, mean_of, mean_rms, windowed
from ..sensors import without_errors
from .angles import ANGLES, STATES, TABLE_III, short

COURSES = {"indoor": "indoor_circle", "outdoor": "outdoor"}
"""The paper's → the environment's."""
DRIFT = ((15.0, 25.0), (50.0, 60.0))
"""s in which the integration's drift is looked at, in rides that are long enough"""
PUBLISHED_FORMS: dict[str, Any] = {"lateral": "printed", "torque": "printed", "knee_axis": "y", "printed_knee": True}
NO_GUARD = 1e9
"""m/s²: a threshold that no shock reaches"""
INERTIAL = tuple(channel.name for channel in WholeBody.channels if channel.name.endswith(("/gyr", "/acc")))
LIMBS = {side: [f"{joint}{side[0]}{i}" for joint in "φψ" for i in (1, 2, 3)] for side in SIDES}


def _windows(time: np.ndarray) -> dict[str, tuple[float, float]]:
    spans = {f"{begin:g}–{end:g} s": (begin, end if time[-1] >= end - 1e-6 else -np.inf) for begin, end in DRIFT}
    late = {"second half": (0.5 * time[-1], np.inf), "last quarter": (0.75 * time[-1], np.inf)}
    return {"settled": (SETTLED, np.inf), **spans, **late}


def _tape_measure(geometry: RiderGeometry, ride: Trajectory) -> RiderGeometry:
    rng = np.random.default_rng([int(ride.metadata["subject"]), int(ride.metadata["index"])])
    return measured(geometry, rng)


def with_trunk_on_the_seat(ride: Trajectory) -> dict[str, np.ndarray]:
    """The samples with load cells that feel just what (9*) says: no pedals, and hands that carry nothing."""
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
    """The filter's standard deviations of Φr after 10 s and at the end, deg, and sines of angles that arms must meet.

    Returns:
        ``deviations``; ``hinges``: 99th percentile of |C2| of right and left arm at the estimates; ``swivels``: RMS of
        C3 at the truth, how far elbows stand off their plane.
    """
    model, estimate = study.estimator(ride, Variant()).model, estimates["filter"]
    assert estimate.covariance is not None
    stds = np.degrees(np.sqrt(np.linalg.diagonal(estimate.covariance)))[:, SHOULDER["right"]]

    def arms(pose: Mapping[str, np.ndarray], steer: np.ndarray, which: int) -> np.ndarray:
        return np.stack([_arm(model, side, pose, steer).residuals[:, which] for side in SIDES])

    hinges = arms(estimate.pose, ride.measurements["steer/angle"], 1)[:, round(SETTLED / ride.dt) :]
    swivels = arms(true_angles(ride.truth), ride.truth["bicycle/steer"], 2)
    return {
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
    model=WholeBody,
    variants={
        "filter": Variant(),
        "no biases": Variant(samples=partial(without_errors, unbiased=INERTIAL)),
        "seat that carries the trunk": Variant({"seat_share": 1.0}, with_trunk_on_the_seat),
        "seat_share 1": Variant({"seat_share": 1.0}),
        "swivel 0.3": Variant({"swivel_noise": 0.3}),
        "measured geometry": Variant(geometry=_tape_measure),
        "published forms": Variant(PUBLISHED_FORMS),
        "integration": Variant(model=WholeBodyIntegration),
    },
    ablations={},
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
    windows=_windows,
    extra=_residuals,
)
MEANINGS = {
    "filter": "as in table III",
    "no biases": "true biases of inertial sensors subtracted",
    "seat that carries the trunk": "load cells replaced by (9*) of the true motion, seat_share=1",
    "seat_share 1": "the paper's seat torque, on a rider whose hands carry the lean",
    "swivel 0.3": "C3 and C7 trusted ten times more",
    "measured geometry": "lengths ±2 %, places ±1 cm",
    "published forms": "(3), (9), C7 about y and C8 as published",
    ZERO: "needs no sensor",
    MEAN: "the best constant, known in hindsight",
}


def rides(study: Study, report: Report) -> None:
    """Indoor circle and outdoor course of every rider."""
    for course, scenario in COURSES.items():
        paths, every = RIDES.run(study, scenario, "whole-body")
        report.numbers(RIDES.results(every))
        tables(report, course, every)
        report.claims(f"What holds, {course}", claims(course, every))
        figure(report, course, paths[0])


def tables(report: Report, course: str, every: list[dict[str, Any]]) -> None:
    """Published errors, drift, causes, consistency."""
    rows = [
        {"quantity": angle, "printed": value, "values": [each["rms"]["filter"]["settled"][angle] for each in every]}
        | {"unit": "deg"}
        for angle, value in TABLE_III[course].items()
    ]
    report.compare(f"Table III, {course}", rows, f"RMS from {SETTLED:g} s on.", interval=DEVIATION)
    drift = {f"integration, {span}": mean_rms(every, "integration", span) for span in _windows(np.zeros(1))}
    drift = {name: row for name, row in drift.items() if "settled" not in name and np.isfinite(row["φ"])}
    drift["filter, last quarter"] = mean_rms(every, "filter", "last quarter")
    first, last = deviations(every)
    report.table(
        f"Figures 6 and 8, {course}: drift of integrated gyroscopes",
        [{"method": name, **short(row)} for name, row in drift.items()],
        "RMS error, deg, mean over rides; three angles of a joint in a cell. Standard deviations of the filter for Φr: "
        f"{' '.join(f'{value:.1f}' for value in first)} deg after 10 s, "
        f"{' '.join(f'{value:.1f}' for value in last)} deg at the end.",
    )
    report.table(
        f"Where errors come from, {course}",
        [{"what": name, **short(mean_rms(every, name)), "means": meaning} for name, meaning in MEANINGS.items()],
        "RMS error, deg.",
    )
    names = every[0]["consistency"]["filter"]
    report.table(
        f"Consistency with the papers' sensors, {course}",
        [
            {"statistic": name, "mean": float(np.mean(values)), "largest ride": max(values)}
            for name in names
            for values in [[each["consistency"]["filter"][name] for each in every]]
        ],
        "NEES for each degree of freedom and squared whitened innovation for each row, 1 if consistent. Noises are set "
        "larger than the sensors' to cover biases; errors of biases and swivels are slow.",
    )


def deviations(every: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Mean standard deviations of Φr after 10 s and at the end, deg."""
    first, last = (np.mean([each["deviations"][i] for each in every], axis=0) for i in (0, 1))
    return first, last


def claims(course: str, every: list[dict[str, Any]]) -> list[Claim]:
    """What the paper says, and what one would read off the tables."""
    rms = {name: mean_rms(every, name) for name in (*RIDES.variants, ZERO, MEAN)}
    ours, late = rms["filter"], mean_rms(every, "filter", "last quarter")
    first, last = deviations(every)
    integrated = mean_rms(every, "integration", "second half")
    trunk = {name: max(rms[name][f"θ{i}"] for i in (1, 2, 3)) for name in rms}
    found = [
        Claim.every(
            "Every angle is at or below the published error",
            {angle: ours[angle] / float(value.split("±")[0]) for angle, value in TABLE_III[course].items()},
            1.0,
            "of it",
        ),
        Claim.every(
            "Every angle is estimated better than by the best constant",
            {angle: ours[angle] / rms[MEAN][angle] for angle in ours},
            1.0,
            "of its error",
        ),
        Claim.less("φ is estimated better than by zero", ours["φ"], rms[ZERO]["φ"]),
        Claim.every(
            "Figure 6: integrated gyroscopes drift, in the end the filter has less than half their error",
            {angle: late[angle] / integrated[angle] for angle in late if angle[0] in "φθ"},
            0.5,
            "of it",
        ),
        Claim.less(
            "Figure 8: the standard deviations of Φr stay bounded (at most 1.2 times those after 10 s)",
            float(np.max(last / first)),
            1.2,
            "times",
        ),
        Claim.less(
            "Figure 10: |C2| at the estimates is below 0.05 in 99 % of all samples",
            float(np.max([each["hinges"] for each in every])),
            0.05,
            "",
        ),
        Claim.less(
            "Elbows keep to the plane that C3 wants within 0.1 (sine, RMS)",
            float(np.mean([each["swivels"] for each in every])),
            0.1,
            "",
        ),
        Claim.less("Trusting C3 and C7 ten times more lowers the error of Θ", trunk["swivel 0.3"], trunk["filter"]),
        Claim.less(
            "The paper's seat torque (seat_share 1) lowers the error of Θ", trunk["seat_share 1"], trunk["filter"]
        ),
        Claim.less(
            "The paper's seat torque lowers the error of Θ if the seat carries the trunk",
            trunk["seat that carries the trunk"],
            trunk["filter"],
        ),
        Claim.less(
            "The published forms at least double the error of φ", ours["φ"], rms["published forms"]["φ"], factor=0.5
        ),
    ]
    for name, value in mean_of(each["consistency"]["filter"] for each in every).items():
        found.append(Claim.within(f"The covariance is right within a factor of two: {name}", value, 0.5, 2.0))
    return found


def figure(report: Report, course: str, path: Path) -> None:
    """Roll, trunk, and one arm and leg of the first ride."""
    ride = RIDES.load(path)
    true = true_angles(ride.truth)
    errors = {
        name: RIDES.errors(RIDES.estimate(ride, RIDES.variants[name]).pose, true) for name in ("integration", "filter")
    }
    shown = ("φ", "θ1", "θ2", "θ3", "φr1", "ψr1", "αr", "βr")
    figure, axes = new_figure(7.5, 14.0, len(shown))
    for ax, angle in zip(axes, shown, strict=True):
        name, part = ANGLES[angle]
        curve = np.degrees(np.unwrap(true[name][:, part]))
        ax.plot(ride.time, curve, color=TRUTH_COLOR, linewidth=1.2, label="truth")
        for label, color in (("integration", "#b08d1a"), ("filter", "#1f5fa8")):
            ax.plot(ride.time, curve + errors[label][angle], color=color, linewidth=0.8, label=label)
        scale = np.concatenate([curve, curve + errors["filter"][angle]])
        low, high = float(np.nanmin(scale)), float(np.nanmax(scale))
        margin = 0.25 * (high - low) + 1.0
        ax.set_ylim(low - margin, high + margin)
        ax.set_ylabel(f"{angle}, deg")
    legend_above(axes[0])
    axes[-1].set_xlabel("time, s")
    note = "Scales are those of truth and filter; what drifts leaves the picture."
    report.figure(f"angles-{course}", figure, f"Figure 6, {course}: angles of one ride", note)


def bump_errors(path: Path) -> dict[str, Any]:
    """Largest errors between 12 and 18 s of a ride over two bumps, with and without the guard; the largest shock."""
    ride = RIDES.load(path)
    truth, found = true_angles(ride.truth), {}
    for name, threshold in (("with the guard", 1.5), ("without", NO_GUARD)):
        errors = RIDES.errors(RIDES.estimate(ride, Variant({"shock_threshold": threshold})).pose, truth)
        found[name] = windowed(errors, ride.time, 12.0, 18.0, statistic=_largest)
    return {**found, "shock": float(np.nanmax(np.abs(ride.measurements["bicycle_imu/acc"])))}


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def bumps(study: Study, report: Report) -> None:
    """Figure 11: two bumps of 4 cm at about 13 and 15 s."""
    paths = study.ride_files("bumps", "whole-body", duration=20.0)
    scores = study.map("bumps", bump_errors, [(path,) for path in paths])
    means = {name: mean_of(score[name] for score in scores) for name in ("with the guard", "without")}
    report.table(
        "Figure 11: two bumps",
        [{"filter": name, **short(row)} for name, row in means.items()],
        "Largest error between 12 and 18 s, deg, mean over rides. The bicycle's accelerometer reads "
        f"{max(score['shock'] for score in scores):.1f} m/s² at most (2 g is its range).",
    )
    guarded, plain = ({angle: means[name][angle] for angle in ("φ", "θ1", "θ2", "θ3")} for name in means)
    report.claims(
        "Figure 11: what holds",
        [
            Claim.every("The filter with its guard stays within 5° in φ and Θ", guarded, 5.0),
            Claim.every("Without its guard the filter stays within 5° in φ and Θ", plain, 5.0),
        ],
    )
