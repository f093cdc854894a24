"""Limits of networks: errors of filters and networks as conditions leave those of the training."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.recipes.rides import SETTLED, ride
from ....filters.core import rotation
from ....filters.support.parallel import in_parallel
from ....filters.support.ranges import Range
from ...learned.presets import RIDES, seeds_of
from ...plots import legend_above, new_figure, save
from ...registry import make_estimator
from ..report import result
from .errors import errors_of, score
from .suite import RiderSuite, estimators_of, names_of, scored_samples

BURST = 0.2
"""s: mean length of a gap"""
AVERAGED = ("gyr", "acc")
"""Kinds of channels whose samples are means of the interval that they end"""


@dataclass(frozen=True)
class Sweep:
    """One condition that is varied.

    Attributes:
        label: of the axis, with unit.
        values: in order; those of the training first or inside.
        trained: smallest and largest value of the training.
        apply: recipe, ride with ideal sensors, seed of the draw, value → ride.
    """

    label: str
    values: tuple[float, ...]
    trained: Range
    apply: Callable[[Any, Trajectory, np.random.SeedSequence, float], Trajectory]


def usual(recipe: Any, ridden: Trajectory, seed: np.random.SeedSequence, **sensors: Any) -> Trajectory:
    """A draw of sensors as in training but for some fields of :class:`.RideSensors`."""
    drawn: Trajectory = replace(recipe, sensors=replace(recipe.sensors, **sensors)).sensed(ridden, seed)
    return drawn


def of_grade(recipe: Any, ridden: Trajectory, seed: np.random.SeedSequence, value: float) -> Trajectory:
    """All sensor errors ``value`` times as large as those of the devices."""
    return usual(recipe, ridden, seed, noise_scale=(value, value))


def measured_by(recipe: Any, ridden: Trajectory, seed: np.random.SeedSequence, value: float) -> Trajectory:
    """Lengths and mass of the rider with ``value`` times the errors of a tape measure."""
    tape = recipe.sensors.tape
    wrong = {name: value * getattr(tape, name) for name in ("lengths", "places", "mass")}
    return usual(recipe, ridden, seed, tape=replace(tape, **wrong))


def with_gaps(recipe: Any, ridden: Trajectory, seed: np.random.SeedSequence, value: float) -> Trajectory:
    """Every site loses a share ``value`` of its samples in gaps, one site independently of the other."""
    drawn, own = usual(recipe, ridden, seed), np.random.default_rng((*seed.spawn_key, 7))
    measurements, ends = dict(drawn.measurements), drawn.dt / BURST
    begins = ends * value / (1.0 - value)
    for site in dict.fromkeys(name.split("/")[0] for name in measurements):
        chances, lost = own.random(len(drawn)), np.zeros(len(drawn), bool)
        for step in range(1, len(drawn)):
            lost[step] = chances[step] >= ends if lost[step - 1] else chances[step] < begins
        for name in [name for name in measurements if name.split("/")[0] == site]:
            measurements[name] = np.where(lost[:, None], np.nan, measurements[name])
    return drawn.replace(measurements=measurements)


def turned(recipe: Any, ridden: Trajectory, seed: np.random.SeedSequence, value: float) -> Trajectory:
    """The trunk's inertial sensor turned by ``value`` degrees about a random axis, unknown to the filter."""
    drawn, own = usual(recipe, ridden, seed), np.random.default_rng((*seed.spawn_key, 8))
    axis = own.standard_normal(3)
    turn = rotation.exp(math.radians(value) * axis / np.linalg.norm(axis))
    measurements = dict(drawn.measurements)
    for name in [name for name in measurements if name.split("/")[0] == "trunk_imu"]:
        measurements[name] = np.asarray(rotation.rotate_back(turn, measurements[name]))
    return drawn.replace(measurements=measurements)


def at_rate(recipe: Any, ridden: Trajectory, seed: np.random.SeedSequence, value: float) -> Trajectory:
    """Sampled at ``value`` Hz: means of gyroscopes and accelerometers, of all others the last sample that came."""
    drawn = usual(recipe, ridden, seed)
    every = round(1.0 / (value * drawn.dt))
    count = (len(drawn) - 1) // every
    last = every * np.arange(count + 1)
    measurements = {}
    for name, values in drawn.measurements.items():
        kept, blocks = values[last].copy(), values[1 : 1 + count * every].reshape(count, every, -1)
        if name.split("/")[1] in AVERAGED:
            kept[1:] = blocks.mean(axis=1)
        else:
            for row in np.moveaxis(blocks, 1, 0):
                kept[1:] = np.where(np.isfinite(row).all(axis=1, keepdims=True), row, kept[1:])
        measurements[name] = kept
    truth = {name: values[last] for name, values in drawn.truth.items()}
    return drawn.replace(time=drawn.time[last], measurements=measurements, truth=truth, mask=drawn.mask[last])


SWEEPS: Mapping[str, Sweep] = {
    "grade": Sweep("factor on all sensor errors", (0.5, 1.0, 2.0, 4.0, 8.0), (0.5, 2.0), of_grade),
    "gaps": Sweep("share of samples lost in gaps", (0.0, 0.1, 0.3, 0.5), (0.0, 0.05), with_gaps),
    "mounting": Sweep("trunk's sensor turned further, deg", (0.0, 5.0, 10.0, 20.0), (0.0, 0.0), turned),
    "geometry": Sweep("factor on errors of the tape measure", (0.0, 1.0, 3.0, 6.0), (1.0, 1.0), measured_by),
    "rate": Sweep("sampling rate, Hz", (25.0, 50.0, 100.0), (100.0, 100.0), at_rate),
}
"""Name → condition."""


@dataclass(frozen=True)
class Point:
    """Errors of an estimator under one condition on one ride."""

    sweep: str
    value: float
    paper: str
    estimator: str
    ride: int
    angles: tuple[float, ...]
    """deg, root mean square error of each"""

    @property
    def error(self) -> float:
        """Mean over the angles, deg."""
        return float(np.mean(self.angles))


def ride_points(settings: RiderSuite, index: int) -> list[Point]:
    """All conditions on one ride of an unseen rider; for parallel processes."""
    root = seeds_of(settings.seed)[3]
    ridden, recipe = ride(RIDES, root, index), RIDES.recipe()
    if float(ridden.time[-1]) < 2.0 * SETTLED:
        return []
    points = []
    for name, sweep in SWEEPS.items():
        for value in sweep.values:
            seed = np.random.SeedSequence(root, spawn_key=(index, 2))
            drawn = sweep.apply(recipe, ridden, seed, value).on_grid()
            drawn = drawn.replace(mask=drawn.time > SETTLED)
            for paper in settings.papers:
                for label in estimators_of(paper):
                    points.append(Point(name, value, paper, label, index, angle_errors(label, drawn)))
    return points


def angle_errors(name: str, drawn: Trajectory) -> tuple[float, ...]:
    """Root mean square error of each of a paper's angles, deg."""
    made: Any = make_estimator(name, dt=drawn.dt, metadata=drawn.metadata)
    found = score(errors_of(made, drawn, made.run(drawn.measurements), scored_samples(drawn)))
    return tuple(float(angle) for angle in found.angles)


def sweep_points(settings: RiderSuite, *, processes: int = 1, progress: bool = False) -> Iterator[list[Point]]:
    """Points of one ride after the other, in any order."""
    jobs = [(settings, index) for index in range(settings.rides)]
    yield from in_parallel(ride_points, jobs, processes, label="sweep" if progress else "", unit="ride")


def results(points: list[Point]) -> list[dict[str, Any]]:
    """One number a row, as run folders keep them."""
    return [
        result(each.estimator, f"{each.sweep} {each.value:g}:{each.ride}", each.paper, "angle", each.error, "deg")
        for each in points
    ]


def draw_sweeps(points: list[Point], path: Path) -> Path:
    """A figure: a row for each paper, a column for each condition; what is shaded is the range of the training."""
    papers = list(dict.fromkeys(point.paper for point in points))
    figure, axes = new_figure(3.0 * len(SWEEPS), 2.4 * len(papers), len(papers), len(SWEEPS))
    for row, paper in enumerate(papers):
        for column, (name, sweep) in enumerate(SWEEPS.items()):
            ax = axes[row * len(SWEEPS) + column]
            ax.axvspan(*sweep.trained, color="#eef1f6")
            for cells in sweep_table(points, paper, name):
                label = cells.pop("estimator")
                ax.plot(sweep.values, list(cells.values()), marker="o", markersize=3, linewidth=1.2, label=label)
            ax.set_ylim(bottom=0.0)
            ax.set_xlabel(sweep.label if row == len(papers) - 1 else "")
        axes[row * len(SWEEPS)].set_ylabel("error, deg")
        last = axes[(row + 1) * len(SWEEPS) - 1]
        legend_above(last)
        # as wide as the row: an empty title keeps its place
        last.get_legend().set_in_layout(False)
        last.set_title(" ", fontsize=9)
    return save(figure, path)


def sweep_table(points: list[Point], paper: str, sweep: str) -> list[dict[str, Any]]:
    """Estimator × value: mean over rides, deg."""
    rows = []
    for label in dict.fromkeys(point.estimator for point in points if point.paper == paper):
        cells: dict[str, Any] = {"estimator": label}
        for value in SWEEPS[sweep].values:
            found = [p.error for p in points if (p.estimator, p.sweep, p.value) == (label, sweep, value)]
            cells[f"{value:g}"] = round(float(np.mean(found)), 2)
        rows.append(cells)
    return rows


def angle_rows(points: list[Point], paper: str, sweep: str, value: float) -> list[dict[str, Any]]:
    """Angle × estimator under one condition: mean over rides, deg."""
    here = [p for p in points if (p.paper, p.sweep, p.value) == (paper, sweep, value)]
    means = {
        label: np.mean([p.angles for p in here if p.estimator == label], axis=0)
        for label in dict.fromkeys(p.estimator for p in here)
    }
    return [
        {"angle": name, **{label: round(float(mean[index]), 2) for label, mean in means.items()}}
        for index, name in enumerate(names_of(paper))
    ]
