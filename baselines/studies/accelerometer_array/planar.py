"""Orientation in a vertical plane: the comparison of chapter 3 of the thesis, on the environment's planar controller.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval. Motions are ``planar-walk`` and ``infinity``, noises the thesis'; functions return rows that JSON can hold, for
:class:`~poise.baselines.studies.kit.Study`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.controller_gestures import Walk
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.planar.orientation import PLANAR_ANGLE
from ....filters.arrays.planar.pose import PLANAR_RATE
from ....filters.core import metrics
from ....filters.core.estimator import Estimator, run
from ....filters.core.rotation import wrap
from ....filters.registry import make

RATE = 100.0
"""Hz"""
DURATION = 100.0
"""s of a run, as in the thesis"""
DROPPED = 5.0
"""s at the start that are not scored"""
WITHIN = np.deg2rad(10.0)
"""the share of samples whose error is below is reported"""

WALK_ACCELERATION = float(np.sqrt(Walk(planar=True).acceleration_variance))
"""m/s² per axis (3.58)"""
MOTIONS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    "planar-walk": {
        "planar-mean": {"inertial_acceleration": WALK_ACCELERATION},
        "planar-orientation": {"inertial_acceleration": WALK_ACCELERATION},
        "planar-unscented": {"inertial_acceleration": WALK_ACCELERATION},
        "planar-pose": {"jerk": WALK_ACCELERATION * RATE, "acceleration_decay": 3.0 * RATE},
    },
    "infinity": {"planar-mean": {"inertial_acceleration": 30.0}},
}
"""Gesture → name of the zoo → what a filter is told of the motion. The walk's acceleration is white. That of the ∞ is
correlated (3.5 and 7 m/s² rms), so what takes it for white is told more: by default 10 m/s²; the mean 30."""
THESIS_POSE = {"angular_jerk": 100.0, "jerk": 1000.0, "acceleration_decay": 0.0}
"""The thesis' model of the complete pose, with jerks of our choice: it gives none"""


@dataclass(frozen=True)
class Way:
    """One way of estimating: a name for tables, a name of the zoo, and parameters."""

    name: str
    estimator: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    told_as: str = ""
    """of which name of the zoo it takes what it is told of the motion; empty for its own"""

    def estimator_for(self, motion: str, **parameters: Any) -> Estimator[Any]:
        """The estimator, told what :data:`MOTIONS` says unless told otherwise."""
        told = dict(MOTIONS[motion].get(self.told_as or self.estimator, {})) | dict(self.parameters) | parameters
        return make(self.estimator, dt=1.0 / RATE, **told)


WAYS = (
    Way("time integration", "planar-mean", {"method": "integration"}),
    Way("tilt", "planar-mean", {"method": "tilt"}),
    Way("mean, literal", "planar-mean", {"wrapped": False}),
    Way("mean, wrapped difference", "planar-mean"),
    Way("linear filter, literal", "planar-orientation", {"method": "linear", "wrapped": False}, "planar-mean"),
    Way("linear filter, wrapped difference", "planar-orientation", {"method": "linear"}, "planar-mean"),
    Way("extended filter", "planar-orientation"),
    Way("unscented filter", "planar-unscented"),
    Way("complete pose, thesis", "planar-pose", THESIS_POSE),
    Way("complete pose, thesis, jerks of 10", "planar-pose", THESIS_POSE | {"angular_jerk": 10.0, "jerk": 10.0}),
    Way("complete pose, thesis, printed R", "planar-pose", THESIS_POSE | {"form": "printed-noise"}),
    Way("complete pose, thesis, printed H", "planar-pose", THESIS_POSE | {"form": "printed-jacobian"}),
    Way("complete pose, acceleration returns to zero", "planar-pose"),
)
"""What is compared"""
INFLATIONS = (10.0, 30.0, 100.0, 300.0, 1000.0)
"""(m/s²)²: values of R on the ∞"""


def moved(seed: int, motion: str, duration: float = DURATION) -> Trajectory:
    """The planar controller on a motion, from a second at rest."""
    return simulate_hand(motion, seed, rate=RATE, duration=duration, device="planar")


def planar_errors(seed: int, motion: str, duration: float = DURATION) -> list[dict[str, Any]]:
    """Errors of every way on one motion.

    Returns:
        A row for each of :data:`WAYS`: ``way``, ``motion``, ``seed``; ``rms`` and ``largest`` in degrees, ``within``,
        the share of samples within 10°; ``rate``, the rms error of ω in rad/s (None if it is not estimated).
    """
    trajectory = moved(seed, motion, duration)
    return [_row(trajectory, way, motion, seed) | {"way": way.name} for way in WAYS]


def _row(trajectory: Trajectory, way: Way, motion: str, seed: int, **parameters: Any) -> dict[str, Any]:
    pose = run(way.estimator_for(motion, **parameters), trajectory.measurements).pose
    scored = trajectory.time >= DROPPED
    truth = trajectory.truth
    error = metrics.error(PLANAR_ANGLE, pose[PLANAR_ANGLE.name], truth[PLANAR_ANGLE.name])[scored]
    rate = None
    if PLANAR_RATE.name in pose:
        rate_error = metrics.error(PLANAR_RATE, pose[PLANAR_RATE.name], truth[PLANAR_RATE.name])[scored]
        rate = float(metrics.rms(rate_error))
    return {
        "motion": motion,
        "seed": seed,
        "rms": float(np.rad2deg(metrics.rms(error))),
        "largest": float(np.rad2deg(error.max())),
        "within": float(np.mean(error < WITHIN)),
        "rate": rate,
    }


def inflation_errors(seed: int, duration: float = DURATION) -> list[dict[str, Any]]:
    """Rows as above of the extended filter on the ∞, for each value of R in :data:`INFLATIONS` (``R``)."""
    trajectory, way = moved(seed, "infinity", duration), WAYS[6]
    row = partial(_row, trajectory, way, "infinity", seed)
    return [row(inertial_acceleration=float(np.sqrt(R))) | {"R": R} for R in INFLATIONS]


def unscented_difference(seed: int, motion: str, duration: float = 20.0) -> float:
    """Largest difference between the unscented and the extended filter, degrees."""
    trajectory = moved(seed, motion, duration)
    angles = [
        run(Way(name, name).estimator_for(motion), trajectory.measurements).pose[PLANAR_ANGLE.name]
        for name in ("planar-orientation", "planar-unscented")
    ]
    return float(np.rad2deg(np.abs(wrap(angles[0] - angles[1])).max()))


def planar_table(rows: Iterable[dict[str, Any]], key: str = "way") -> list[dict[str, Any]]:
    """Means over the seeds, a row for each motion and each way (or another ``key`` of the rows)."""
    rows = list(rows)
    table = []
    for motion in MOTIONS:
        for name in dict.fromkeys(row[key] for row in rows):
            found = [row for row in rows if row["motion"] == motion and row[key] == name]
            if found:
                rates = [row["rate"] for row in found if row["rate"] is not None]
                table.append(
                    {
                        "motion": motion,
                        "method" if key == "way" else key: name,
                        "rms (°)": float(np.mean([row["rms"] for row in found])),
                        "largest rms of a seed (°)": max(row["rms"] for row in found),
                        "largest error (°)": float(np.mean([row["largest"] for row in found])),
                        "within 10°": float(np.mean([row["within"] for row in found])),
                        "ω (rad/s)": float(np.mean(rates)) if rates else None,
                    }
                )
    return table


def planar_curves(seed: int, motion: str, duration: float = DURATION, every: int = 10) -> dict[str, Any]:
    """Errors over time as in Figures 3.5, 3.6, 3.9, 3.10 and 3.12: name → list in degrees, for a figure."""
    trajectory = moved(seed, motion, duration)
    curves: dict[str, Any] = {"time": trajectory.time[::every].tolist()}
    for way in WAYS:
        angle = run(way.estimator_for(motion), trajectory.measurements).pose[PLANAR_ANGLE.name]
        error = wrap(angle - trajectory.truth[PLANAR_ANGLE.name])
        curves[way.name] = np.rad2deg(error[::every, 0]).tolist()
    return curves
