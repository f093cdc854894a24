"""Summary statistics of simulated rides: speed, roll, lean, accelerations, forces, gaps; and what papers report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.core import rotation
from ..averages import mean
from ..claims import Claim
from .saddle import saddle_statistics

SUITE = ("bicycle_imu/acc", "trunk_imu/acc", "seat/load_cells")
"""Channels that are recorded, without errors: what the papers' accelerometers and load cells would have to measure."""


UNITS = {
    "speed": "m/s",
    "roll": "deg",
    "pitch": "deg",
    "lean": "deg",
    "yaw_rate": "deg/s",
    "acceleration": "m/s²",
    "seat_force": "N",
    "handlebar_force": "N",
    "gap": "mm",
}
"""Quantity → unit. Roll is positive to the right; the trunk's lean is against the vertical, towards the middle of the
turn; the yaw rate is without sign; the acceleration is the specific force on the axes of the bicycle's IMU; forces are
magnitudes, of the rider on the saddle and of each hand; a gap is the distance of a hand from its grip or of a foot from
its pedal."""
KINDS: dict[str, Callable[[Any], Any]] = {
    "mean": np.nanmean,
    "sd": np.nanstd,
    "min": np.nanmin,
    "max": lambda values: np.nanmax(np.abs(values)),
}
"""Statistic → what it is of the samples of a ride; ``max`` is the largest magnitude."""


def trunk_lean(truth: Mapping[str, np.ndarray]) -> np.ndarray:
    """Lean of the trunk's axis to the side ``(T,)``, rad, to the right positive.

    The angle φ_h of the force-inertial paper: about the horizontal axis in which the bicycle heads.
    """
    axis = rotation.rotate(truth["trunk/orientation"], np.array([0.0, 0.0, 1.0]))
    heading = truth["bicycle/yaw"][:, 0]
    rightwards = axis[:, 0] * np.sin(heading) - axis[:, 1] * np.cos(heading)
    return np.arctan2(rightwards, axis[:, 2])


def ride_statistics(
    trajectory: Trajectory, *, scenario: str, subject: int, gaps: np.ndarray | None = None
) -> dict[str, Any]:
    """Numbers of one recorded ride, of JSON's types.

    Args:
        trajectory: of ``poise/RiderBicycle-v0`` with the channels ``bicycle_imu/acc`` and ``seat/load_cells``.
        scenario: its name.
        subject: number of the rider.
        gaps: ``(T, 4)`` m, see :func:`.loop_closure_error`; None if they are not known.

    Returns:
        ``scenario``, ``subject``, ``seed``, ``duration`` (s that were ridden), ``upright`` (whether the rider got to
        the end), and ``<quantity>_<statistic>`` of :data:`UNITS` and :data:`KINDS`; no gaps if they are not known;
        ``saddle`` with :func:`.saddle_statistics`.
    """
    truth = trajectory.truth
    speed, roll, pitch = (truth[f"bicycle/{name}"][:, 0] for name in ("speed", "roll", "pitch"))
    turning = rotation.rotate(truth["bicycle/orientation"], truth["bicycle/angular_rate"])[:, 2]
    lean = trunk_lean(truth)
    # turning left is a positive rate, leaning left a negative angle
    inwards = -math.copysign(1.0, float(turning.mean()))
    seat = np.linalg.norm(truth["seat/force"], axis=1)
    hands = np.stack([np.linalg.norm(truth[f"handlebar/force_{side}"], axis=1) for side in ("left", "right")])
    series = {
        "speed": (speed, ("mean", "min", "max")),
        "roll": (np.degrees(roll), ("mean", "sd", "max")),
        "pitch": (np.degrees(pitch), ("max",)),
        "lean": (inwards * np.degrees(lean), ("mean", "sd")),
        "yaw_rate": (np.degrees(np.abs(turning)), ("mean", "max")),
        "acceleration": (trajectory.measurements["bicycle_imu/acc"], ("max",)),
        "seat_force": (seat, ("mean", "max")),
        "handlebar_force": (hands, ("mean", "max")),
    } | ({} if gaps is None else {"gap": (1e3 * gaps, ("max",))})
    return {
        "scenario": scenario,
        "subject": subject,
        "seed": int(trajectory.metadata["seed"]),
        "duration": float(trajectory.time[-1] - trajectory.time[0]),
        "upright": trajectory.metadata.get("ended") != "terminated",
        "saddle": saddle_statistics(trajectory.measurements["seat/load_cells"]),
    } | {f"{name}_{kind}": float(KINDS[kind](values)) for name, (values, kinds) in series.items() for kind in kinds}


def ride(scenario: str, subject: int, duration: float, fidelity: str, seed: int) -> dict[str, Any]:
    """Ride once for ``duration`` s; :func:`ride_statistics` of it.

    Raises:
        ValueError: an unknown scenario or rider, or a number out of its range.
    """
    from ....envs.bicycle.environment import RiderBicycleEnv
    from ....envs.bicycle.rider.anthropometry import rider_body
    from ....envs.bicycle.rider.posture import loop_closure_error, sit
    from ....envs.record import record_once

    env = RiderBicycleEnv(
        scenario,
        subject,
        suite=SUITE,
        sensors="ideal",
        duration=duration,
        fidelity=fidelity,  # type: ignore[arg-type]
    )
    trajectory = record_once(env, seed)
    gaps = (
        loop_closure_error(trajectory.truth, sit(env.parameters, rider_body(subject))) if fidelity == "full" else None
    )
    return ride_statistics(trajectory, scenario=scenario, subject=subject, gaps=gaps)


class Reported(NamedTuple):
    """What a paper reports about its riders, and what counts as the same here."""

    scenario: str
    what: str
    reported: str
    source: str
    field: str
    """statistic of :func:`.ride_statistics` that compares"""
    unit: str
    low: float
    high: float
    """between these the mean over riders agrees with the paper"""


FORCE = "force-inertial, section III"
BODY = "whole-body, section V"
GYRO = "two-gyro, section V"
INF = float("inf")
REPORTED = (
    Reported("indoor_circle", "mean speed", "about 1 m/s", BODY, "speed_mean", "m/s", 0.8, 1.25),
    Reported(
        "indoor_circle", "yaw rate", "23 deg/s (1 m/s on a radius of 2.5 m)", BODY, "yaw_rate_mean", "deg/s", 18.0, 28.0
    ),
    Reported(
        "indoor_circle",
        "mean trunk lean to the middle",
        "about 20 deg, an aggressive rider (subject 1)",
        f"{FORCE}, fig. 6",
        "lean_mean",
        "deg",
        15.0,
        25.0,
    ),
    Reported("outdoor", "largest speed", "about 22 km/h = 6.1 m/s", FORCE, "speed_max", "m/s", 5.0, 7.2),
    Reported("outdoor", "lowest speed", "0.5 m/s", BODY, "speed_min", "m/s", 0.0, 1.0),
    Reported(
        "bumps",
        "largest acceleration",
        "2 g and beyond: clipped",
        f"{BODY}, fig. 11",
        "acceleration_max",
        "m/s²",
        19.6,
        INF,
    ),
    Reported("pitch", "largest pitch", "up to about 20 deg", f"{GYRO}, fig. 15", "pitch_max", "deg", 15.0, 22.0),
    Reported(
        "straight",
        "mean yaw rate",
        "nearly straight, zero only intermittently",
        f"{GYRO}, fig. 17",
        "yaw_rate_mean",
        "deg/s",
        0.0,
        5.0,
    ),
)
"""Figures of the papers; forces they show in no number. Speeds depend on how long one rides."""


def comparison(rides: Iterable[dict[str, Any]]) -> list[Claim]:
    """What each paper reports and whether the mean over the riders here agrees, for scenarios that were ridden."""
    found = list(rides)
    claims = []
    for line in REPORTED:
        values = [each[line.field] for each in found if each["scenario"] == line.scenario]
        if values:
            text = f"{line.scenario}: {line.what}, {line.reported} ({line.source})"
            here = f"{min(values):.3g} to {max(values):.3g} {line.unit}"
            bounds = f"from {line.low:g}" if line.high == INF else f"{line.low:g} … {line.high:g}"
            number = f"{here}; the mean agrees if {bounds}"
            claims.append(Claim(text, number, line.low <= mean(values) <= line.high))
    return claims
