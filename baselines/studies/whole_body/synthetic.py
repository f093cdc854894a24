"""The whole-body filter on rides whose kinematics are exact: variants, ablations, wrong starts, shocks and bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ....envs.bicycle.sensors.measured_geometry import measured
from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.constraints import limb_frame, shoulder_angles
from ....filters.bicycle.whole_body.filter import WholeBody
from ....filters.bicycle.whole_body.linkage import ERROR_SIZE, ROLL, SHOULDER, SIDES, SIGNS, TRUNK, true_angles
from ....filters.core import rotation
from ..averages import mean_of, windowed
from ..claims import Claim
from ..kit import Study
from ..model_draws import within_bounds
from ..report import Report
from ..ride_study import Variant
from .angles import STATES, short
from .consistency import consistencies
from .motion import IDEAL, ExactRide, SensorErrors
from .rides import NO_GUARD, PUBLISHED_FORMS, RIDES
from .states import true_angles_state, true_states

GEOMETRY = RiderGeometry()
SEAT = {"seat_share": 1.0}
"""These riders do not lean on their hands."""
TIGHT = SEAT | {"swivel_noise": 0.3}
FULL_BIASES = replace(SensorErrors(), gyroscope_bias=math.radians(1.0), accelerometer_bias=0.147)
"""Over the whole range of table I."""
SENSORS = {
    "bicycle_gyroscope_noise": math.radians(0.05),
    "trunk_gyroscope_noise": math.radians(0.05),
    "limb_gyroscope_noise": math.radians(0.03),
    "lateral_noise": 0.05,
    "trunk_noise": 0.05,
    "torque_noise": 3.0,
}
"""White noises of the synthetic sensors; accelerations with what differences of the gyroscope add."""
FORGOTTEN = 3.0
"""deg from the estimate of a right start: a wrong one has then been forgotten"""
MIRRORED = 30.0
"""deg: farther apart than that are two solutions of the same constraints"""
ABSENT = 1e3
"""Deviation of a constraint that is as good as not there."""
ABLATIONS: dict[str, dict[str, Any]] = {
    "all": {},
    "no C1, C5": {"length_noise": ABSENT},
    "no C2, C6": {"hinge_noise": ABSENT},
    "no C3, C7": {"swivel_noise": ABSENT},
    "none of them": {"length_noise": ABSENT, "hinge_noise": ABSENT, "swivel_noise": ABSENT},
}


def errors_of(ride: Trajectory, geometry: RiderGeometry | None = None, **options: Any) -> dict[str, np.ndarray]:
    """Angle → error of the tightly tuned filter over an exact ride, deg."""
    known = None if geometry is None else lambda *_: geometry
    return RIDES.errors(RIDES.estimate(ride, Variant(TIGHT | options, geometry=known)).pose, true_angles(ride.truth))


def case_scores(course: str, seed: int, duration: float) -> dict[str, dict[str, float]]:
    """RMS errors (deg) of one exact ride, first 5 s left out, for every case of the table."""
    exact = ExactRide(GEOMETRY, course, seed=seed)  # type: ignore[arg-type]
    ride = exact.record(duration, sampling="interval")
    hard = exact.record(duration, errors=FULL_BIASES, sampling="interval")
    wrong = measured(GEOMETRY, np.random.default_rng(seed))
    cases = {
        "filter, swivel 0.3": errors_of(ride),
        "swivel 0.1": errors_of(ride, swivel_noise=0.1),
        "swivel 1": errors_of(ride, swivel_noise=1.0),
        "swivel 3 (default)": errors_of(ride, swivel_noise=3.0),
        "no C3, C7": errors_of(ride, swivel_noise=ABSENT),
        "no information from the seat (seat_share 0)": errors_of(ride, seat_share=0.0, torque_noise=ABSENT),
        "lengths ±2 %, positions ±1 cm, full biases": errors_of(hard, wrong),
        "(3), (9), C7, C8 as published": errors_of(ride, **PUBLISHED_FORMS),
    }
    cases |= RIDES.baselines(ride.time, true_angles(ride.truth))
    integrated = RIDES.errors(RIDES.estimate(ride, RIDES.variants["integration"]).pose, true_angles(ride.truth))
    return {name: windowed(errors, ride.time, 5.0) for name, errors in cases.items()} | {
        "integration, to 25 s": windowed(integrated, ride.time, 15.0, 25.0),
        "integration, last 10 s": windowed(integrated, ride.time, duration - 10.0),
    }


def ablation_scores(course: str, seed: int, duration: float) -> dict[str, dict[str, float]]:
    """RMS errors (deg) of the second half of a ride without some constraints."""
    ride = ExactRide(GEOMETRY, course, seed=seed).record(duration, sampling="interval")  # type: ignore[arg-type]
    return {
        name: windowed(errors_of(ride, **changed), ride.time, 0.5 * duration) for name, changed in ABLATIONS.items()
    }


def start_scores(seed: int, offset: float, kind: str) -> dict[str, float]:
    """A ride that starts ``offset`` (deg) off, against the same ride started at the truth.

    Args:
        seed: of the ride and of the signs of the offsets.
        offset: of every angle, deg.
        kind: ``every angle``, or ``trunk and roll``: limbs then follow by inverse kinematics, as the filter starts.

    Returns:
        ``settled``: s until no angle is farther than :data:`FORGOTTEN` from that of the right start; ``at the end``:
        the largest difference in the last 5 s, deg.
    """
    ride = ExactRide(GEOMETRY, "indoor", seed=seed).record(15.0, sampling="interval")
    wide = math.radians(20.0)
    kalman = RIDES.estimator(ride, Variant({**TIGHT, "roll_prior": wide, "trunk_prior": wide, "limb_prior": wide}))
    read = {channel.name: ride.measurements[channel.name] for channel in kalman.channels}
    first = {name: values[0] for name, values in read.items()}
    rest = {name: values[1:] for name, values in read.items()}
    state, _ = kalman.step(kalman.init(first), first)
    right, wrong = state.x.copy(), state.x.copy()
    right[:ERROR_SIZE] = true_angles_state(ride.truth)[0]
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], ERROR_SIZE)
    signs[[1, 5, 6, 7]] = 0.0
    off = right[:ERROR_SIZE] + math.radians(offset) * signs
    if kind == "every angle":
        wrong[:ERROR_SIZE] = off
    else:
        wrong[ROLL], wrong[TRUNK] = off[ROLL], off[TRUNK]
        R, model = rotation.euler_matrix("zxy", off[TRUNK]), WholeBody.for_rider(GEOMETRY)
        for side in SIDES:
            root = model.point(model.trunk_pivot, "left", wrong) + R @ model.point(model.shoulder, side, wrong)
            outward, hand = np.array([0.0, 0.0, -SIGNS[side]]), model.hand(side, first["steer/angle"])
            frame, _ = limb_frame(root, hand, model.upper_arm, model.forearm, outward, "arm")
            wrong[SHOULDER[side]] = shoulder_angles(R, frame)
    reference, found = (kalman.run_from(state._replace(x=x), rest)[0].pose for x in (right, wrong))
    apart = RIDES.errors(found, reference)
    largest = np.max([np.abs(apart[angle]) for angle in STATES], axis=0)
    late = np.flatnonzero(largest > FORGOTTEN)
    return {"settled": float(ride.time[late[-1] + 1]) if late.size else 0.0, "at the end": float(largest[-500:].max())}


def bump_scores(seed: int) -> dict[str, dict[str, float]]:
    """Largest error (deg) that shocks of 40 m/s² at 13 to 15 s add, with and without the guard."""
    calm = ExactRide(GEOMETRY, "indoor", seed=seed).record(25.0, sampling="interval")
    rough = ExactRide(GEOMETRY, "indoor", seed=seed, bumps=(13.0, 15.0)).record(25.0, sampling="interval")
    found = {}
    for name, threshold in (("with the guard", 1.5), ("without", NO_GUARD)):
        one, other = (errors_of(ride, shock_threshold=threshold) for ride in (rough, calm))
        found[name] = {column: float(np.abs(one[column] - other[column])[1300:].max()) for column in one}
    return found


def bound_scores(seed: int, duration: float = 15.0) -> dict[str, Any]:
    """Posterior Cramér–Rao bounds and errors of rides without biases and swivel, deg, for two sets of noises.

    Returns:
        Set → column → RMS over time of bound, of the filter's own standard deviation and of its error.
    """
    ride = ExactRide(GEOMETRY, "indoor", swivel=0.0, seed=seed)
    ideal = ride.record(duration, errors=IDEAL, sampling="interval")
    noisy = ride.record(duration, errors=SensorErrors().without_biases(), sampling="interval")
    read, found = {channel.name: ideal.measurements[channel.name] for channel in WholeBody.channels}, {}
    for name, noises in {"filter's noises": {}, "sensors' noises": SENSORS}.items():
        model = WholeBody.for_rider(GEOMETRY, **(TIGHT | noises))
        x = true_states(model, read, ideal.truth)
        bound = np.degrees(np.sqrt(np.linalg.diagonal(posterior_bound(model, x, read))))
        estimate = RIDES.estimate(noisy, Variant(TIGHT | noises))
        assert estimate.covariance is not None
        reported = np.degrees(np.sqrt(np.linalg.diagonal(estimate.covariance)))
        error = RIDES.errors(estimate.pose, true_angles(noisy.truth))
        part = slice(int(5.0 / model.dt), None)
        found[name] = {
            angle: [
                float(np.sqrt(np.mean(np.square(values))))
                for values in (bound[part, index], reported[part, index], error[angle][part])
            ]
            for angle, index in STATES.items()
        }
    return found


def synthetic(study: Study, report: Report) -> None:
    """Every table on exact rides."""
    seeds = [study.seed_of("exact", index) % 10_000 for index in range(2 if study.quick else 5)]
    duration = 30.0 if study.quick else 60.0
    for course in ("indoor", "outdoor"):
        scores = study.map(f"exact {course}", case_scores, [(course, seed, duration) for seed in seeds])
        rows = [{"case": name, **short(mean_of(score[name] for score in scores))} for name in scores[0]]
        report.table(
            f"Exact rides, {course}",
            rows,
            f"RMS error, deg, mean of {len(seeds)} rides; biases within 30 % of table I, swivels 3° ± 3°.",
        )
    claims = []
    for course, title in (("held", "Figure 9: held posture on a straight line"), ("indoor", "Figure 9: riding")):
        scores = study.map(f"ablation {course}", ablation_scores, [(course, seed, duration) for seed in seeds[:2]])
        rows = [{"constraints": name, **short(mean_of(score[name] for score in scores))} for name in scores[0]]
        report.table(
            title,
            rows,
            "RMS error in the second half, deg. In a ride the line from joint to hand or pedal turns, which excites "
            "what a held posture does not.",
        )
        limbs = {name: limb_error(mean_of(score[name] for score in scores)) for name in scores[0]}
        claims += [
            Claim.less(
                f"Figure 9, {course}: {name} makes the limbs' errors larger by a tenth", 1.1 * limbs["all"], limb
            )
            for name, limb in limbs.items()
            if name != "all"
        ]
    kinds = [(offset, kind) for kind in ("every angle", "trunk and roll") for offset in (10.0, 20.0, 30.0)]
    more = [study.seed_of("start", index) % 10_000 for index in range(6)]
    scores = study.map("wrong starts", start_scores, [(seed, *kind) for kind in kinds for seed in more])
    rows, lost = [], []
    for number, (offset, kind) in enumerate(kinds):
        found = scores[number * len(more) : (number + 1) * len(more)]
        good = [score for score in found if score["at the end"] < FORGOTTEN]
        lost += [score["at the end"] for score in found if score["at the end"] >= FORGOTTEN]
        statement = f"Robust against wrong initial values: every start with {kind} {offset:g}° off recovers"
        claims.append(Claim(statement, f"{len(good)} of {len(found)}", len(good) == len(found)))
        rows.append(
            {
                "off at the start": kind,
                "by": f"±{offset:g}°",
                "recovered": f"{len(good)} of {len(found)}",
                "s until forgotten, median": float(np.median([score["settled"] for score in good])) if good else None,
                "largest of those in the end": max((score["at the end"] for score in good), default=None),
            }
        )
    mirrored = sum(apart > MIRRORED for apart in lost)
    statement = f"Of the wrong starts that are not forgotten some end beyond {MIRRORED:g}°, in the mirrored arm"
    claims.append(Claim(statement, f"{mirrored} of {len(lost)}", mirrored > 0))
    report.table(
        "Wrong initial values",
        rows,
        f"Random signs; deg. Forgotten: within {FORGOTTEN:g}° of the same ride started at the truth. The mirrored arm "
        "meets the constraints too. *Trunk and roll*: limbs start by inverse kinematics.",
    )
    scores = study.map("exact bumps", bump_scores, [(seed,) for seed in seeds[:2]])
    report.table(
        "Shocks of 40 m/s² at 13 to 15 s",
        [{"filter": name, **short(mean_of(score[name] for score in scores))} for name in scores[0]],
        "Largest difference from the same ride without shocks, deg; the bicycle's accelerometer is clipped at 2 g.",
    )
    scores = study.map("bounds", bound_scores, [(seed,) for seed in seeds[:2]])
    rows = [
        {"angle": column}
        | {
            f"{what}, {name}": float(np.mean([score[name][column][i] for score in scores]))
            for name in scores[0]
            for i, what in enumerate(("bound", "own deviation", "error"))
        }
        for column in scores[0]["filter's noises"]
    ]
    report.table(
        "Posterior Cramér–Rao bound",
        rows,
        "RMS over 5 to 15 s, deg, exact indoor rides without biases and swivel. The filter's noises are larger than "
        "the sensors', to cover biases. A bound averages over motions drawn from the filter's processes (yaw "
        "acceleration of 0.5 rad/s², relative acceleration): the error in a calmer motion may lie below it.",
    )
    for name in scores[0]:
        ratios = {
            angle: float(np.mean([score[name][angle][2] / score[name][angle][0] for score in scores]))
            for angle in scores[0][name]
        }
        below = sum(ratio < 1.0 for ratio in ratios.values())
        statement = f"{name}: no error lies below the bound"
        claims.append(Claim(statement, f"{below} of {len(ratios)} lie below", below == 0))
    found = study.cached("consistency", consistencies, GEOMETRY, 50, seeds[0], 1.5)
    claims += within_bounds(found)
    report.claims("Exact rides: what holds", claims)


def limb_error(row: dict[str, float]) -> float:
    """RMS over the twelve angles of arms and legs, deg."""
    return float(np.sqrt(np.mean([row[angle] ** 2 for angle in STATES if angle[0] in "φψ" and angle != "φ"])))
