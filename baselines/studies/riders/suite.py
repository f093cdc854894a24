"""The comparison: every method on test rides of three groups, scores of each ride and draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.recipes.rides import ride as simulated
from ....filters.core import rotation
from ....filters.registry import FILTERS, make
from ....filters.support.parallel import in_parallel
from ....filters.support.resume import is_kept, keep, kept
from ...learned.presets import PRESETS, RIDES, seeds_of
from ...learned.rides import UNSEEN, unseen_rides
from ...registry import TRAINED, make_estimator
from ...weights_io import load_card
from .errors import Errors, angle_bounds, angle_names, angles_of, errors_of, score, truth_of
from .learnt import Learnt, learn, moving_averages

PAPERS = ("two-gyro", "force-inertial", "whole-body")
"""Filters of riders that networks correct."""
MEAN, BIAS, RIDGE, TUNED, ORACLE, CONSTANT = (
    "always the mean",
    "one bias per angle",
    "ridge on moving averages",
    "re-tuned",
    "each ride's mean error removed",
    "deviations constant",
)
"""References of the table that are not estimators."""
UPDATE = 0.04
"""s between the updates of a network"""
ROLL_ONLY = ("odometry-aided", "balanced-gyro", "platform-gyro+turning", "two-gyro-level+turning")
"""Estimators of the roll, the first angle of every paper."""


@dataclass(frozen=True)
class RiderSuite:
    """Settings of the comparison.

    Raises:
        ValueError: no ride, no draw or no paper, or a paper that has no network.
    """

    papers: tuple[str, ...] = PAPERS
    """whose filters and networks are compared"""
    rides: int = 12
    """test rides of each group, one rider each"""
    draws: int = 2
    """of devices and measured geometry on each"""
    training: int = 24
    """rides from which references learn; 0 leaves those out"""
    seed: int = 0
    """root seed: that with which the networks were trained, so that test riders are others"""
    estimators: tuple[str, ...] = ()
    """of the papers, to run alone, without references; empty for all"""

    def __post_init__(self) -> None:
        for name, least in (("rides", 1), ("draws", 1), ("training", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        unknown = sorted(set(self.papers) - set(PAPERS))
        if unknown or not self.papers:
            raise ValueError(f"papers must be some of {list(PAPERS)}, got {list(self.papers)}")

    def alone(self, paper: str) -> list[str]:
        """Estimators of a paper that are run alone; empty where everything is compared."""
        return [name for name in estimators_of(paper) if name in self.estimators]


@dataclass(frozen=True)
class Row:
    """One method on one draw of one ride."""

    paper: str
    method: str
    group: str
    ride: int
    draw: int
    angles: tuple[float, ...]
    """deg, root mean square error of each"""
    nees: float
    coverage: float
    over_bound: float
    """mean over the angles of the error in multiples of the posterior bound (:func:`.angle_bounds`)"""

    @property
    def mean(self) -> float:
        """Mean over the angles that the method estimates, deg."""
        return float(np.nanmean(self.angles))


def estimators_of(paper: str) -> list[str]:
    """Names of all estimators of a paper's angles that are compared: published, consistent, networks."""
    own = [paper, f"{paper}-consistent"]
    networks = [f"{paper}+network", f"{paper}-level+noise", f"gru-{paper}", f"gru-{paper}-bicycle"]
    return [name for name in own if name in FILTERS] + [name for name in networks if name in TRAINED]


def roll_errors(ride: Trajectory, scored: np.ndarray) -> dict[str, np.ndarray]:
    """Estimator of the roll alone → its error ``(n, 1)`` on a drawn ride at the samples that count."""
    found = {}
    for name in ROLL_ONLY:
        made: Any = make_estimator(name, dt=ride.dt, metadata=ride.metadata)
        found[name] = (made.run(ride.measurements).pose["bicycle/roll"] - ride.truth["bicycle/roll"])[scored]
    return found


def all_errors(
    paper: str, learnt: Learnt | None, ride: Trajectory, scored: np.ndarray, rolls: Mapping[str, np.ndarray]
) -> dict[str, Errors]:
    """Label → errors of every method on a drawn ride at the samples that count; ``rolls`` as :func:`roll_errors`."""
    published = estimated(paper, ride, scored)
    found = {paper: published} if learnt is None else references(paper, learnt, ride, scored, published)
    for name, roll in rolls.items():
        others = np.full((len(roll), published.values.shape[1] - 1), np.nan)
        found[name] = Errors(wrapped(np.concatenate([roll, others], axis=1)))
    found |= errors_of_named([name for name in estimators_of(paper) if name != paper], ride, scored)
    return found | {f"{paper}, {ORACLE}": Errors(published.values - published.values.mean(axis=0))}


def errors_of_named(names: Sequence[str], ride: Trajectory, scored: np.ndarray) -> dict[str, Errors]:
    """Label → errors of estimators, and of networks with deviations that do not grow."""
    found = {}
    for name in names:
        found[name] = errors = estimated(name, ride, scored)
        constant = constant_deviations(name)
        if constant is not None:
            found[f"{name}, {CONSTANT}"] = Errors(errors.values, np.broadcast_to(constant, errors.values.shape))
    return found


def references(
    paper: str, learnt: Learnt, ride: Trajectory, scored: np.ndarray, published: Errors
) -> dict[str, Errors]:
    """Label → errors of what learnt from training rides, beside those of the published filter."""
    outputs = learnt.head.outputs
    truth = angles_of(outputs, truth_of(make(paper), ride))
    front_end = learnt.front_end.with_dt(ride.dt).configured(ride.metadata)
    seen = front_end.run({c.name: ride.measurements[c.name] for c in front_end.channels})
    due = seen.due == 1.0
    corrected = angles_of(outputs, seen.base)[due] + learnt.ridge.predict(moving_averages(seen.features[due]))
    return {
        MEAN: Errors(wrapped(learnt.mean - truth[scored])),
        paper: published,
        BIAS: Errors(wrapped(published.values - learnt.bias)),
        RIDGE: Errors(wrapped((corrected - truth[due])[scored[due]])),
        f"{paper} ({TUNED})": estimated(paper, ride, scored, **learnt.tuned),
    }


def estimated(name: str, ride: Trajectory, scored: np.ndarray, **parameters: Any) -> Errors:
    """Errors of an estimator, with deviations."""
    kept = {"keep_covariance": True} if name in FILTERS else {}
    made: Any = make_estimator(name, dt=ride.dt, metadata=ride.metadata, **kept, **parameters)
    return errors_of(made, ride, made.run(ride.measurements), scored)


def constant_deviations(name: str) -> np.ndarray | None:
    """Standard deviations ``(K,)`` rad of a network's errors if they did not grow with the unlikeness of its inputs.

    None where its card does not tell.
    """
    weights = TRAINED[name].fixed.get("weights") if name in TRAINED else None
    card = {} if weights is None else load_card(weights)
    constant = (card.get("calibration") or {}).get("constant")
    return None if constant is None else np.array(constant)


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles in [−π, π)."""
    return np.asarray(rotation.wrap(angles))


def scored_samples(ride: Trajectory) -> np.ndarray:
    """Samples ``(T,)`` at the ends of a network's updates that are in the evaluation mask."""
    from ...learned.inputs.front_end import interval_ends

    return np.asarray(ride.mask & interval_ends(0, len(ride), ride.dt, UPDATE))


def ride_rows(settings: RiderSuite, learnt: Mapping[str, Learnt], group: str, index: int) -> list[Row]:
    """Scores of all methods on all draws of one ride; for parallel processes."""
    source = replace(RIDES, rides=index + 1, draws=settings.draws)
    rows: list[Row] = []
    bounds: dict[str, np.ndarray] = {}
    for _, draw, ride in unseen_rides(source, seeds_of(settings.seed)[3], group, index):
        ride, scored = ride.on_grid(), scored_samples(ride)
        rolls = {} if settings.estimators else roll_errors(ride, scored)
        for paper in settings.papers:
            if paper not in bounds:  # the same, nearly, for all draws of one ride
                bounds[paper] = angle_bounds(paper, ride, scored)
            alone = settings.alone(paper)
            named = errors_of_named(alone, ride, scored) if alone else None
            for label, errors in (named or all_errors(paper, learnt.get(paper), ride, scored, rolls)).items():
                found = score(errors)
                angles = tuple(float(angle) for angle in found.angles)
                ratio = float(np.nanmean(found.angles / bounds[paper]))
                rows.append(Row(paper, label, group, index, draw, angles, found.nees, found.coverage, ratio))
    return rows


def learnt_by(settings: RiderSuite, *, processes: int = 1, progress: bool = False) -> dict[str, Learnt]:
    """What the references of each paper learn; nothing without training rides."""
    if not settings.training:
        return {}
    source = replace(RIDES, rides=settings.training, draws=settings.draws)
    seed = seeds_of(settings.seed)[0]
    label = "ride" if progress else ""
    for _ in in_parallel(simulate, [(source, seed, index) for index in range(source.rides)], processes, label=label):
        pass
    jobs = [(paper, PRESETS[f"{paper}+network"].filter or paper, source, seed) for paper in settings.papers]
    found = in_parallel(learn, jobs, processes, label="learn" if progress else "")
    return {each.paper: each for each in found}


def simulate(source: Any, seed: int, index: int) -> int:
    """Ride once, into the cache; for parallel processes."""
    simulated(source, seed, index)
    return index


def compare(settings: RiderSuite, folder: Path, *, processes: int = 1, progress: bool = False) -> list[Row]:
    """All rows, of groups and rides in their order. Rides whose rows are in the folder already are not ridden again.

    Each ride has a file in the folder, which appears whole or not at all. The rows depend neither on ``processes``, how
    many run at a time, nor on an interruption.
    """
    rides = [(group, index) for group in UNSEEN for index in range(settings.rides)]
    files = {each: folder / f"riders_{each[0].replace(' ', '_')}_{each[1]}.json" for each in rides}
    # how many rides there are changes none of them
    keys = {each: {**asdict(settings), "rides": 0, "group": each[0], "index": each[1]} for each in rides}
    missing = [each for each in rides if not is_kept(files[each], keys[each])]
    if missing:
        learnt = learnt_by(settings, processes=processes, progress=progress)
        jobs = [(settings, learnt, *each, files[each], keys[each]) for each in missing]
        for _ in in_parallel(keep_ride, jobs, processes, label="compare" if progress else "", unit="ride"):
            pass
    return [Row(**{**row, "angles": tuple(row["angles"])}) for each in rides for row in kept(files[each])]


def keep_ride(
    settings: RiderSuite, learnt: Mapping[str, Learnt], group: str, index: int, path: Path, key: Mapping[str, Any]
) -> Path:
    """Write the rows of one ride; for parallel processes."""
    return keep(path, key, [asdict(row) for row in ride_rows(settings, learnt, group, index)])


def names_of(paper: str) -> list[str]:
    """Names of a paper's angles."""
    return angle_names(tuple(make(paper).outputs))
