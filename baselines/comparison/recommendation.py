"""Recommendation of estimators for a recording, by its channels and by measured errors on similar recordings.

``poise benchmark --save`` writes the errors to a file: for every benchmark recording, numbers that describe its motion
and the error of every estimator. A recording is compared with these by the same numbers, without further rules.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from ...envs.data.plausibility.sites import seen
from ...envs.data.trajectory import Trajectory
from ...filters.core.quantity import GRAVITY
from ..registry import list_estimators
from .data_sets import NORTH, dataset_of

if TYPE_CHECKING:
    import pandas

RESULTS = Path(__file__).parents[1] / "weights" / "benchmark.json"
"""Errors of the shipped benchmark."""
Mounting = Literal["worn", "hand-held", "vehicle", "bicycle"]
MOUNTINGS: dict[str, Mounting] = {
    "BROAD": "hand-held",
    "RepoIMU": "hand-held",
    "phones": "worn",
    "EuRoC": "vehicle",
    "simulated hand": "hand-held",
    "simulated rides": "bicycle",
}
"""Data set → mounting of the sensor."""
NEIGHBOURS = 6
"""Number of recordings used for a recommendation."""
ERRORS = ("inclination", "heading", "total")
CORRECTED = ", clock corrected"
"""Suffix of a data set whose reference was corrected to the clock of the gyroscope."""
SMOOTHING = 1.0
"""s: averaging time of sustained acceleration, which cannot be distinguished from tilt."""


@dataclass(frozen=True)
class Motion:
    """Description of a motion, without any estimator.

    Attributes:
        rate: sampling rate, Hz.
        turning: root mean square angular rate, deg/s.
        shaking: root mean square of the length of the specific force about its median, m/s².
        lasting: the same of means over one second: sustained acceleration.
    """

    rate: float
    turning: float
    shaking: float
    lasting: float

    def distance(self, other: Motion) -> float:
        """Distance of two motions in logarithms; the rate counts for less."""
        floors = {"rate": 1.0, "turning": 1.0, "shaking": 0.05, "lasting": 0.02}
        weights = {"rate": 0.3, "turning": 1.0, "shaking": 1.0, "lasting": 1.0}
        mine, theirs = asdict(self), asdict(other)
        ratios = [weights[key] * np.log((mine[key] + low) / (theirs[key] + low)) for key, low in floors.items()]
        return float(np.linalg.norm(ratios))


def motion_of(trajectory: Trajectory) -> Motion:
    """Describe the motion of the sensor ``imu`` of a recording, over its evaluation mask.

    Raises:
        ValueError: it has no ``imu/gyr`` and ``imu/acc`` with samples.
    """
    gyr, acc = seen(trajectory, "imu/gyr"), seen(trajectory, "imu/acc")
    if gyr is None or acc is None:
        raise ValueError(f"{trajectory.name!r} needs the channels imu/gyr and imu/acc, with samples")
    if len(trajectory) * trajectory.dt < 2.0 * SMOOTHING:
        lasts = f"{len(trajectory) * trajectory.dt:.3g} s"
        raise ValueError(f"{trajectory.name!r} lasts {lasts}; motions are compared from {2.0 * SMOOTHING:g} s on")
    scored = trajectory.mask if trajectory.mask.any() else np.ones(len(trajectory), bool)
    length = np.linalg.norm(acc, axis=1)
    excess = length - np.nanmedian(length)
    width = max(1, round(SMOOTHING / trajectory.dt))
    means = np.convolve(np.nan_to_num(excess), np.ones(width) / width, mode="same")
    rate = np.linalg.norm(gyr - np.nanmedian(gyr[~scored] if (~scored).any() else 0.0 * gyr, axis=0), axis=1)
    rms = [float(np.sqrt(np.nanmean(np.square(values[scored])))) for values in (rate, excess, means)]
    return Motion(1.0 / trajectory.dt, float(np.degrees(rms[0])), rms[1], rms[2])


def results_of(trajectories: Sequence[Trajectory], table: pandas.DataFrame, suffix: str = "") -> list[dict[str, Any]]:
    """Results of a benchmark by recording, as JSON: name, data set, motion, errors of every estimator in deg.

    Args:
        trajectories: the recordings, with truth.
        table: from :func:`poise.evaluate`, over these.
        suffix: put behind the names of the data sets.
    """
    recordings = []
    for trajectory in trajectories:
        part = table[(table["trajectory"] == trajectory.name) & table["metric"].isin(ERRORS)]
        errors: dict[str, dict[str, float]] = {}
        for row in part.itertuples():
            # An arbitrary heading of the truth cannot be compared with that of an estimate.
            comparable = row.metric == "inclination" or dataset_of(trajectory) in NORTH
            if row.quantity in ("up", "orientation") and np.isfinite(row.value) and comparable:
                errors.setdefault(row.estimator, {})[row.metric] = round(row.value, 4)
        motion = {name: round(value, 3) for name, value in asdict(motion_of(trajectory)).items()}
        dataset = f"{dataset_of(trajectory)}{suffix}"
        recordings.append({"name": trajectory.name, "dataset": dataset, "motion": motion, "errors": errors})
    return recordings


def merged(kept: Sequence[dict[str, Any]], new: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Results with the errors of some estimators replaced; what is new of recordings that are not kept is left out."""
    found = {(one["name"], one["dataset"]): one["errors"] for one in new}
    return [{**one, "errors": one["errors"] | found.get((one["name"], one["dataset"]), {})} for one in kept]


def replaced(kept: Sequence[dict[str, Any]], new: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Results with those of some data sets replaced, data sets in their order."""
    order = list(dict.fromkeys(row["dataset"] for row in (*kept, *new)))
    had = {row["dataset"] for row in new}
    rows = [*(row for row in kept if row["dataset"] not in had), *new]
    return sorted(rows, key=lambda row: order.index(row["dataset"]))


def merged_rides(kept: Sequence[dict[str, Any]], new: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of riders with new ones in the places of those that they replace, or after the others of their paper.

    With its own filter, all of a paper is replaced.
    """
    whole = {row["paper"] for row in new if row["method"] == row["paper"]}
    order = list(dict.fromkeys(row["paper"] for row in (*kept, *new)))
    found = {(row["paper"], row["method"], row["group"]): row for row in new}
    rows = [found.pop((row["paper"], row["method"], row["group"]), row) for row in kept if row["paper"] not in whole]
    return sorted([*rows, *found.values()], key=lambda row: order.index(row["paper"]))


def load_results(path: Path = RESULTS) -> dict[str, Any]:
    """Errors of a benchmark.

    Raises:
        ValueError: the file holds none.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if "riders" not in found or found["recordings"]:
            found["recordings"][0]["errors"]
    except (OSError, ValueError, KeyError, IndexError, TypeError) as reason:
        raise ValueError(f"{path} holds no results of poise benchmark --save: {reason}") from None
    return found


@dataclass(frozen=True)
class Recommendation:
    """Estimators for one recording.

    Attributes:
        motion: what its motion is like.
        nearest: names of the recordings that the errors are from.
        sets: data set → how many of these.
        ranking: one row per estimator, best first: estimator, kind, mean and largest inclination error, heading error
            (deg), and the reason.
        notes: further remarks on this recording.
    """

    motion: Motion
    nearest: list[str]
    sets: dict[str, int]
    ranking: list[dict[str, Any]]
    notes: list[str]


def recommend(
    trajectory: Trajectory, mounting: Mounting | None = None, results: Mapping[str, Any] | None = None
) -> Recommendation:
    """Rank the estimators that can be run on a recording by their errors on the nearest benchmark recordings.

    Args:
        trajectory: a recording with ``imu/gyr`` and ``imu/acc``.
        mounting: of the sensor; by default recordings of all mountings are considered.
        results: from :func:`load_results`; the shipped ones by default.

    Raises:
        ValueError: an unknown mounting, or a recording without rates and forces.
    """
    if mounting is not None and mounting not in get_args(Mounting):
        raise ValueError(f"mounting must be one of {get_args(Mounting)}, got {mounting!r}")
    motion = motion_of(trajectory)
    results = load_results() if results is None else results
    found = [one for one in results["recordings"] if not one["dataset"].endswith(CORRECTED)]
    alive = {name for name, values in trajectory.measurements.items() if np.nanmax(np.abs(values), initial=0.0) > 0.0}
    fed = {name: info.kind for name, info in list_estimators().items() if set(info.channels) <= alive}
    # Errors are compared on recordings on which all these were run, such as those with a magnetometer too.
    measured = {name for one in found for name in one["errors"] if name in fed}
    complete = [one for one in found if measured <= set(one["errors"])]
    suited = [one for one in complete if mounting is None or MOUNTINGS.get(one["dataset"]) == mounting]
    if not suited:
        suited = [one for one in found if mounting is None or MOUNTINGS.get(one["dataset"]) == mounting] or found
    near = sorted(suited, key=lambda one: motion.distance(Motion(**one["motion"])))[:NEIGHBOURS]
    sets = dict(Counter(one["dataset"] for one in near))
    ranking = [row for name, kind in fed.items() if (row := ranked_row(name, kind, near, fed)) is not None]
    heading = "imu/mag" in alive
    # With a magnetometer estimators with heading come first: that of the others drifts.
    ranking.sort(key=lambda row: (heading and row["heading"] is None, row["inclination"]))
    return Recommendation(motion, [one["name"] for one in near], sets, ranking, notes_on(trajectory, motion, near))


def ranked_row(name: str, kind: str, near: Sequence[Mapping[str, Any]], fed: Collection[str]) -> dict[str, Any] | None:
    """Errors of one estimator on the nearest recordings; None if it was not run on all of them."""
    errors = [one["errors"][name] for one in near if name in one["errors"] and "inclination" in one["errors"][name]]
    if not near or len(errors) < len(near):
        return None
    inclinations = [each["inclination"] for each in errors]
    headings = [each["heading"] for each in errors if "heading" in each]
    best = sum(name == min(set(fed) & set(one["errors"]), key=lambda other: inclination_of(one, other)) for one in near)
    ranks = [1 + sum(inclination_of(one, other) < inclination_of(one, name) for other in fed) for one in near]
    reason = f"the best on {best} of these {len(near)}" if best else f"mean rank {np.mean(ranks):.1f}"
    return {
        "estimator": name,
        "kind": kind,
        "inclination": float(np.mean(inclinations)),
        "largest": float(max(inclinations)),
        "heading": float(np.mean(headings)) if headings else None,
        "reason": reason,
    }


def inclination_of(recording: Mapping[str, Any], name: str) -> float:
    """Inclination error of an estimator on a benchmark recording; infinite if there is none."""
    return float(recording["errors"].get(name, {}).get("inclination", np.inf))


def notes_on(trajectory: Trajectory, motion: Motion, near: Sequence[Mapping[str, Any]]) -> list[str]:
    """Conditions of this recording under which the measured errors may not hold."""
    from ...envs.data.inspection import inspect_recording

    notes = []
    away = min(motion.distance(Motion(**one["motion"])) for one in near)
    if away > 1.0:
        notes.append(f"no benchmark recording moves like this one (the nearest differs {np.exp(away):.1f}-fold)")
    bias = next((row.get("bias °/s") for row in inspect_recording(trajectory).sensors if row["sensor"] == "imu"), None)
    if bias is not None and bias > 2.0:
        notes.append(f"gyroscope bias {bias:.1f} °/s at rest: subtract it first, vqf follows no more than 2 °/s")
    if motion.lasting > 1.0:
        notes.append(
            f"acceleration of {motion.lasting:.1f} m/s² lasts for a second: "
            f"taken for gravity, it is {np.degrees(np.arctan2(motion.lasting, GRAVITY)):.0f}° of inclination"
        )
    if motion.rate < 40.0:
        notes.append(f"{motion.rate:.0f} Hz is slow: it turns {motion.turning / motion.rate:.1f}° between two samples")
    return notes


def dataset_errors(recordings: Sequence[Mapping[str, Any]], metric: str = "inclination") -> dict[str, dict[str, float]]:
    """Estimator → data set → mean error, deg; estimators in order of their mean ratio to the best of each data set.

    An estimator has a mean where it ran on every recording of the data set; those with more of them come first.

    Args:
        recordings: from :func:`results_of`.
        metric: one of :data:`ERRORS`.
    """
    sizes = Counter(one["dataset"] for one in recordings)
    values: dict[str, dict[str, list[float]]] = {}
    for one in recordings:
        for name, errors in one["errors"].items():
            if metric in errors:
                values.setdefault(name, {}).setdefault(one["dataset"], []).append(errors[metric])
    means = {
        name: {each: float(np.mean(found)) for each, found in sets.items() if len(found) == sizes[each]}
        for name, sets in values.items()
    }
    best = {each: min((sets[each] for sets in means.values() if each in sets), default=1.0) for each in sizes}

    def rank(name: str) -> tuple[int, float]:
        ratios = [np.log(max(error, 1e-6) / max(best[each], 1e-6)) for each, error in means[name].items()]
        return -len(ratios), float(np.mean(ratios)) if ratios else np.inf

    return {name: means[name] for name in sorted(means, key=rank) if means[name]}
