"""The whole-body filter on simulated rides: table III, figures 6, 8, 10 and 11, and where the errors come from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ....envs.bicycle.sensors.measured_geometry import measured
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body import constraints as limb_constraints
from ....filters.bicycle.whole_body.filter import WholeBody
from ....filters.bicycle.whole_body.linkage import SHOULDER, SIDES, true_angles
from ..kit import Study, load_ride
from ..report import DEVIATION, Report
from .scores import (
    COLUMNS,
    averaged,
    consistency_of,
    errors,
    filter_of,
    integration_of,
    printed,
    rms,
    samples,
    short,
    with_trunk_on_the_seat,
    without_biases,
)

SETTLED = 10.0
"""s from which errors count"""
COURSES = {"indoor": "indoor_circle", "outdoor": "outdoor"}
"""The paper's → the environment's."""
WINDOWS = ((15.0, 25.0), (50.0, 60.0))
"""s in which the integration's drift is looked at"""
PRINTED_FORMS: dict[str, Any] = {"lateral": "printed", "torque": "printed", "knee_axis": "y", "printed_knee": True}
NO_GUARD = 1e9
"""m/s²: a threshold that no shock reaches"""


def ride_scores(path: Path, windows: tuple[tuple[float, float], ...]) -> dict[str, Any]:
    """What the filter and its relatives make of one ride, deg by column of table III; the sections say what each is."""
    ride = load_ride(path)
    geometry = RiderGeometry.read(ride.metadata["geometry"])
    time, read = ride.time, samples(ride)

    def score(data: dict[str, np.ndarray], known: RiderGeometry = geometry, **parameters: Any) -> dict[str, float]:
        return rms(errors(filter_of(known, **parameters).run(data), ride.truth), time, SETTLED)

    estimate = filter_of(geometry).run(read)
    error = errors(estimate, ride.truth)
    found: dict[str, Any] = {"filter": rms(error, time, SETTLED), "later": rms(error, time, 0.75 * time[-1])}
    found["consistency"] = consistency_of(estimate, ride.truth, int(np.searchsorted(time, SETTLED)))
    assert estimate.covariance is not None
    deviations = np.degrees(np.sqrt(np.linalg.diagonal(estimate.covariance)))
    found["deviations"] = [
        deviations[np.searchsorted(time, at - 1e-9) - 1, SHOULDER["right"]].tolist() for at in (10.0, time[-1])
    ]
    integrated = errors(integration_of(geometry).run(read), ride.truth)
    found["integration"] = [rms(integrated, time, *window) for window in windows]
    rng = np.random.default_rng([int(ride.metadata["subject"]), int(ride.metadata["index"])])
    found["measured geometry"] = score(read, measured(geometry, rng))
    found["no biases"] = score(without_biases(ride))
    heavy = WholeBody.for_rider(geometry, seat_share=1.0)
    found["seat that carries the trunk"] = score(with_trunk_on_the_seat(ride, heavy), seat_share=1.0)
    found["seat_share 1"] = score(read, seat_share=1.0)
    found["swivel 0.3"] = score(read, swivel_noise=0.3)
    found["printed forms"] = score(read, **PRINTED_FORMS)
    found["hinge residuals"] = [float(value) for value in hinge_residuals(ride, estimate, geometry)]
    found["swivel residuals"] = [float(value) for value in true_swivels(ride, geometry)]
    return found


def hinge_residuals(ride: Any, estimate: Any, geometry: RiderGeometry) -> np.ndarray:
    """99th percentile of |C2| (sine of an angle) of right and left arm at the estimates."""
    model, steer, begin = WholeBody.for_rider(geometry), ride.measurements["steer/angle"], round(SETTLED / ride.dt)
    residuals = [_arm(model, side, estimate.pose, steer).residuals[begin:, 1] for side in SIDES]
    return np.nanpercentile(np.abs(residuals), 99.0, axis=1)


def true_swivels(ride: Any, geometry: RiderGeometry) -> np.ndarray:
    """RMS of C3 (sine of an angle) of right and left arm at the truth: how far elbows stand off their plane."""
    model, steer = WholeBody.for_rider(geometry), ride.truth["bicycle/steer"]
    residuals = [_arm(model, side, true_angles(ride.truth), steer).residuals[:, 2] for side in SIDES]
    return np.sqrt(np.mean(np.square(residuals), axis=1))


def _arm(model: WholeBody, side: str, pose: Any, steer: np.ndarray) -> limb_constraints.Limb:
    return limb_constraints.arm(
        pose["trunk/angles"],
        pose[f"shoulder_{side}/angles"],
        model.point(model.trunk_pivot, "left", steer),
        model.point(model.shoulder, side, steer),
        model.hand(side, steer),
        model.upper_arm,
        model.forearm,
    )


def rides(study: Study, report: Report) -> None:
    """Indoor circle and outdoor course of every rider."""
    windows = tuple(window for window in WINDOWS if window[1] <= study.duration) or (
        (0.5 * study.duration, study.duration),
    )
    for course, scenario in COURSES.items():
        paths = study.ride_files(scenario, "whole-body")
        scores = study.map(f"{course} rides", ride_scores, [(path, windows) for path in paths])
        _table(report, course, scores)
        _drift(report, course, scores, windows)
        _causes(report, course, scores)
        _consistency(report, course, scores)
    for course, scenario in COURSES.items():
        _figure(report, course, study.ride_files(scenario, "whole-body")[0])


def _table(report: Report, course: str, scores: list[dict[str, Any]]) -> None:
    rows = [
        {"quantity": column, "printed": value, "values": [score["filter"][column] for score in scores], "unit": "deg"}
        for column, value in printed(course).items()
    ]
    report.compare(f"Table III, {course}", rows, f"RMS from {SETTLED:g} s on.", interval=DEVIATION)
    means = averaged([score["filter"] for score in scores])
    above = [column for column, value in printed(course).items() if means[column] > float(value.split("±")[0])]
    text = f"above the paper's: {', '.join(above)}" if above else "every angle is at or below the paper's"
    report.text(f"{course}: {text}.")
    report.numbers(
        [
            {
                "estimator": "whole-body",
                "trajectory": f"{course}-{index}",
                "quantity": column,
                "metric": "rms",
                "value": value,
                "unit": "deg",
            }
            for index, score in enumerate(scores)
            for column, value in score["filter"].items()
        ]
    )


def _drift(report: Report, course: str, scores: list[dict[str, Any]], windows: tuple[tuple[float, float], ...]) -> None:
    rows = [
        {
            "method": f"integration, {begin:g}–{end:g} s",
            **short(averaged([score["integration"][i] for score in scores])),
        }
        for i, (begin, end) in enumerate(windows)
    ]
    rows.append({"method": "filter, last quarter", **short(averaged([score["later"] for score in scores]))})
    first, last = (np.mean([score["deviations"][i] for score in scores], axis=0) for i in (0, 1))
    report.table(
        f"Figures 6 and 8, {course}: drift of integrated gyroscopes",
        rows,
        "RMS error, deg, mean over rides; three angles of a joint in a cell. Standard deviations of the filter for Φr: "
        f"{' '.join(f'{value:.1f}' for value in first)} deg after 10 s, "
        f"{' '.join(f'{value:.1f}' for value in last)} deg at the end: bounded, as in figure 8.",
    )


CAUSES = {
    "filter": "as in table III",
    "no biases": "true biases of inertial sensors subtracted",
    "seat that carries the trunk": "load cells replaced by (9*) of the true motion, seat_share=1",
    "seat_share 1": "the paper's seat torque, on a rider whose hands carry the lean",
    "swivel 0.3": "C3 and C7 trusted ten times more",
    "measured geometry": "lengths ±2 %, places ±1 cm",
    "printed forms": "(3), (9), C7 about y and C8 as printed",
}


def _causes(report: Report, course: str, scores: list[dict[str, Any]]) -> None:
    rows = [
        {"what": name, **short(averaged([score[name] for score in scores])), "means": meaning}
        for name, meaning in CAUSES.items()
    ]
    swivels = np.mean([score["swivel residuals"] for score in scores], axis=0)
    hinges = np.max([score["hinge residuals"] for score in scores], axis=0)
    report.table(
        f"Where errors come from, {course}",
        rows,
        f"RMS error, deg. C3 at the truth is {swivels[0]:.2f} and {swivels[1]:.2f} rms (right, left): elbows of these "
        "riders swing off the plane that the constraint wants. Figure 10: |C2| at the estimates is below "
        f"{max(hinges):.3f} in 99 % of all ticks (the paper: 0.05).",
    )


def _consistency(report: Report, course: str, scores: list[dict[str, Any]]) -> None:
    names = scores[0]["consistency"]
    rows = [
        {
            "statistic": name,
            "mean": float(np.mean([score["consistency"][name] for score in scores])),
            "largest ride": float(np.max([score["consistency"][name] for score in scores])),
        }
        for name in names
    ]
    report.table(
        f"Consistency with real-like sensors, {course}",
        rows,
        "NEES for each degree of freedom and squared whitened innovation for each row, 1 if consistent. Noises are set "
        "larger than the sensors' to cover biases, so innovations are small; errors of biases and swivels are slow, so "
        "NEES may exceed 1.",
    )


def _figure(report: Report, course: str, path: Path) -> None:
    from ...plots import new_figure

    ride = load_ride(path)
    geometry = RiderGeometry.read(ride.metadata["geometry"])
    read = samples(ride)
    both = {"filter": filter_of(geometry).run(read), "integration": integration_of(geometry).run(read)}
    shown = ("φ", "θ1", "θ2", "θ3", "φr1", "ψr1", "αr", "βr")
    figure, axes = new_figure(7.5, 12.0, len(shown))
    true = true_angles(ride.truth)
    for axis, column in zip(axes, shown, strict=True):
        name, i = COLUMNS[column]
        axis.plot(ride.time, np.degrees(true[name][:, i]), color="black", linewidth=1.2, label="truth")
        for label, estimate in both.items():
            axis.plot(ride.time, np.degrees(estimate.pose[name][:, i]), linewidth=0.8, label=label)
        axis.set_ylabel(f"{column} / deg")
    axes[0].legend(fontsize="small")
    report.figure(f"angles-{course}", figure, f"Figure 6, {course}: angles of one ride")


def bump_scores(path: Path) -> dict[str, Any]:
    """Errors between 12 and 18 s of a ride over two bumps, with and without the guard, and how hard the shocks were."""
    ride = load_ride(path)
    geometry = RiderGeometry.read(ride.metadata["geometry"])
    found: dict[str, Any] = {}
    for name, threshold in (("with the guard", 1.5), ("without", NO_GUARD)):
        error = errors(filter_of(geometry, shock_threshold=threshold).run(samples(ride)), ride.truth)
        part = (ride.time >= 12.0) & (ride.time <= 18.0)
        found[name] = {column: float(np.abs(values[part]).max()) for column, values in error.items()}
    found["shock"] = float(np.nanmax(np.abs(ride.measurements["bicycle_imu/acc"])))
    return found


def bumps(study: Study, report: Report) -> None:
    """Figure 11: two bumps of 4 cm at about 13 and 15 s."""
    paths = study.ride_files("bumps", "whole-body", duration=20.0)
    scores = study.map("bumps", bump_scores, [(path,) for path in paths])
    rows = [
        {"filter": name, **short(averaged([score[name] for score in scores]))} for name in ("with the guard", "without")
    ]
    report.table(
        "Figure 11: two bumps",
        rows,
        "Largest error between 12 and 18 s, deg, mean over rides. The bicycle's accelerometer reads "
        f"{max(score['shock'] for score in scores):.1f} m/s² at most (2 g is its range).",
    )
