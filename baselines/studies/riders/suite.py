"""The comparison: every method on test rides of three groups, scores of each ride and draw."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.core import rotation
from ....filters.registry import FILTERS, make
from ....filters.support.parallel import in_parallel
from ...learned.presets import PRESETS, seeds_of
from ...learned.rides import UNSEEN, unseen_rides
from ...registry import TRAINED, make_estimator
from .errors import Errors, angle_names, angles_of, errors_of, score, truth_of
from .learnt import Learnt, learn
from .references import moving_averages

PAPERS = ("two-gyro", "force-inertial", "whole-body")
"""Filters of riders that networks correct."""
MEAN, BIAS, RIDGE, TUNED, ORACLE = (
    "always the mean",
    "one bias per angle",
    "ridge on moving averages",
    "re-tuned",
    "each ride's mean error removed",
)
"""What is no estimator: references of the table."""
ROLL_ONLY = "odometry-aided"
"""Filter of the roll, the first angle of every paper, from the bicycle's sensors."""


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
    """rides from which references learn"""
    seed: int = 0
    """root seed: that with which the networks were trained, so that test riders are others"""

    def __post_init__(self) -> None:
        for name in ("rides", "draws", "training"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        unknown = sorted(set(self.papers) - set(PAPERS))
        if unknown or not self.papers:
            raise ValueError(f"papers must be some of {list(PAPERS)}, got {list(self.papers)}")


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

    @property
    def mean(self) -> float:
        """Mean over the angles that the method estimates, deg."""
        return float(np.nanmean(self.angles))


def estimators_of(paper: str) -> list[str]:
    """Names of all estimators of a paper's angles that are compared: published, consistent, networks."""
    own = [paper, f"{paper}-consistent"]
    networks = [f"{paper}+network", f"gru-{paper}", f"gru-{paper}-bicycle"]
    return [name for name in own if name in FILTERS] + [name for name in networks if name in TRAINED]


def all_errors(paper: str, learnt: Learnt, ride: Trajectory, scored: np.ndarray) -> dict[str, Errors]:
    """Label → errors of every method on a drawn ride at the samples that count ``(T,)``."""
    outputs = learnt.head.outputs
    truth = angles_of(outputs, truth_of(make(paper), ride))
    published = estimated(paper, ride, scored)
    front_end = learnt.front_end.with_dt(ride.dt).configured(ride.metadata)
    seen = front_end.run({c.name: ride.measurements[c.name] for c in front_end.channels})
    due = seen.due == 1.0
    corrected = angles_of(outputs, seen.base)[due] + learnt.ridge.predict(moving_averages(seen.features[due]))
    odometry: Any = make(ROLL_ONLY, dt=ride.dt, metadata=ride.metadata)
    roll = np.full((int(scored.sum()), learnt.head.size), np.nan)
    roll[:, :1] = (odometry.run(ride.measurements).pose["bicycle/roll"] - ride.truth["bicycle/roll"])[scored]
    found = {
        MEAN: Errors(wrapped(learnt.mean - truth[scored])),
        paper: published,
        BIAS: Errors(wrapped(published.values - learnt.bias)),
        RIDGE: Errors(wrapped((corrected - truth[due])[scored[due]])),
        f"{paper} ({TUNED})": estimated(paper, ride, scored, **learnt.tuned),
        ROLL_ONLY: Errors(wrapped(roll)),
    }
    found |= {name: estimated(name, ride, scored) for name in estimators_of(paper) if name != paper}
    return found | {f"{paper}, {ORACLE}": Errors(published.values - published.values.mean(axis=0))}


def estimated(name: str, ride: Trajectory, scored: np.ndarray, **parameters: Any) -> Errors:
    """Errors of an estimator, with deviations."""
    kept = {"keep_covariance": True} if name in FILTERS else {}
    made: Any = make_estimator(name, dt=ride.dt, metadata=ride.metadata, **kept, **parameters)
    return errors_of(made, ride, made.run(ride.measurements), scored)


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles in [−π, π)."""
    return np.asarray(rotation.wrap(angles))


def scored_samples(ride: Trajectory, interval: float = 0.04) -> np.ndarray:
    """Samples ``(T,)`` at the ends of a network's updates that are in the evaluation mask."""
    from ...learned.inputs.front_end import interval_ends

    return np.asarray(ride.mask & interval_ends(0, len(ride), ride.dt, interval))


def ride_rows(settings: RiderSuite, learnt: dict[str, Learnt], group: str, index: int) -> list[Row]:
    """Scores of all methods on all draws of one ride; for parallel processes."""
    source = replace(training_rides(settings), rides=index + 1, draws=settings.draws)
    rows: list[Row] = []
    for _, draw, ride in unseen_rides(source, seeds_of(settings.seed)[3], group, index):
        ride, scored = ride.on_grid(), scored_samples(ride)
        for paper in settings.papers:
            for label, errors in all_errors(paper, learnt[paper], ride, scored).items():
                found = score(errors)
                angles = tuple(float(angle) for angle in found.angles)
                rows.append(Row(paper, label, group, index, draw, angles, found.nees, found.coverage))
    return rows


def training_rides(settings: RiderSuite) -> Any:
    """The source of the rides that the networks are trained on."""
    source = PRESETS[f"{settings.papers[0]}+network"].rides
    assert source is not None
    return source


def learnt_by(settings: RiderSuite, *, quick: bool = False) -> dict[str, Learnt]:
    """What the references of each paper learn."""
    source = replace(training_rides(settings), rides=settings.training, draws=settings.draws)
    seed, effort = seeds_of(settings.seed)[0], {"samples": 8, "refinements": 8} if quick else {}
    starts = {paper: PRESETS[f"{paper}+network"].filter or paper for paper in settings.papers}
    return {paper: learn(paper, starts[paper], source, seed, **effort) for paper in settings.papers}


def compare(
    settings: RiderSuite, learnt: dict[str, Learnt], *, processes: int = 1, progress: bool = False
) -> Iterator[list[Row]]:
    """Rows of one ride after the other, in any order."""
    jobs = [(settings, learnt, group, index) for group in UNSEEN for index in range(settings.rides)]
    yield from in_parallel(ride_rows, jobs, processes, label="compare" if progress else "", unit="ride")


def names_of(paper: str) -> list[str]:
    """Names of a paper's angles."""
    return angle_names(tuple(make(paper).outputs))
