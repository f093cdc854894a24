"""A paper's filter on recorded rides: variants, sensors without some errors, baselines, consistency, and the report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core import rotation
from ...filters.core.consistency import nees
from ...filters.core.kalman import KalmanFilter
from ...filters.core.quantity import Estimate
from ...filters.core.recursion import Observer
from .averages import circular_mean, interval_of_mean, largest, leading, mean_of, mean_rms, rounded, windowed
from .claims import Claim
from .kit import RideJob, Study, load_ride
from .report import STD, Report, result
from .yaw import yaw_claim, yaw_drift

SETTLED = 10.0
"""s: errors count from here, when a filter has forgotten its start"""
ZERO, MEAN = "always zero", "always the ride's mean"
"""Baselines: what needs no sensor, and the best constant, which only hindsight knows."""
STRAPDOWN = "integration"
"""Variant that integrates the gyroscopes alone."""
SHORT = "In short"
"""Title of the tables with two rows a course, which README takes."""
COMMON = ("indoor", "outdoor")
"""Beginnings of the names of courses that every work has."""
ROLL = "bicycle/roll"
SPACING = 0.25
"""s from sample to sample of the errors over time that are kept of a ride"""
Samples = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Variant:
    """One way to estimate a ride."""

    options: Mapping[str, Any] = field(default_factory=dict)
    """of the model"""
    samples: Callable[[Trajectory], Samples] | None = None
    """replaces the recorded samples"""
    geometry: Callable[[RiderGeometry, Trajectory], RiderGeometry] | None = None
    """replaces the rider's geometry"""
    model: Any = None
    """replaces the model of the study"""


class Less(NamedTuple):
    """A claim about every course: one method's error of an angle is less than ``factor`` times another's."""

    statement: str
    angle: str
    method: str
    other: str
    factor: float = 1.0
    window: str = "settled"


def whole_ride(time: np.ndarray) -> dict[str, tuple[float, float]]:
    """Window → begin and end, s: all that counts."""
    return {"settled": (SETTLED, np.inf)}


@dataclass(frozen=True)
class RideStudy:
    """What a paper's study does with every ride. Everything in it can be pickled, since rides are assessed in parallel.

    Args:
        name: of the estimator, and of the work.
        suite: of its sensors.
        model: class with ``for_rider(geometry, dt=…, **options)``.
        variants: name → how the filter is run; the first is the one that everything is compared with.
        ablations: name → the same filter with better sensors.
        scenarios: courses of its rides → most rides of each rider (None: as many as the study has).
        angles: name of an angle in the paper → quantity and component.
        truth: truth of a ride → quantities of the model.
        states: angle → element of the error state, of angles that are states.
        parts: name of a statistic → angles whose NEES it is.
        checked: variants whose consistency is looked at.
        sampled: channel whose samples are measurements; innovations count where it has one (None: everywhere).
        published: course and variant → the paper's value of each angle.
        table: what the paper calls its table of them.
        tabled: methods in that table.
        comparisons: what is claimed of every course.
        drawn: methods in the figure of a ride; the last sets the scale.
        followed: further methods whose errors over time are kept, to find what the errors of the first come from.
        windows: time → named spans in which errors are averaged, ``settled`` among them.
        prepare: cuts or completes a ride before it is used.
        extra: further numbers of a ride, from the ride and the estimates of its variants; ``bound`` (angle → deg, RMS
            over time of the posterior bound) goes into the table of skill.
        cells: a row of errors as cells of a table; None rounds them.
        bound: what the posterior bound of ``extra`` is the bound of.
    """

    name: str
    suite: str
    model: Any
    variants: Mapping[str, Variant]
    ablations: Mapping[str, Variant]
    scenarios: Mapping[str, int | None]
    angles: Mapping[str, tuple[str, int]]
    truth: Callable[[Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]
    states: Mapping[str, int]
    parts: Mapping[str, Sequence[str]]
    checked: Sequence[str]
    published: Mapping[tuple[str, str], Mapping[str, str]]
    table: str
    tabled: Sequence[str]
    comparisons: Sequence[Less]
    drawn: Sequence[str]
    followed: Sequence[str] = ()
    sampled: str | None = None
    windows: Callable[[np.ndarray], dict[str, tuple[float, float]]] = whole_ride
    prepare: Callable[[Trajectory], Trajectory] | None = None
    extra: Callable[[RideStudy, Trajectory, dict[str, Estimate]], dict[str, Any]] | None = None
    cells: Callable[[Mapping[str, float]], Mapping[str, Any]] | None = None
    bound: str = "for the noises that the filter assumes, white"

    @property
    def first(self) -> str:
        """The variant that everything is compared with."""
        return next(iter(self.variants))

    def load(self, path: Path) -> Trajectory:
        """A recorded ride, prepared."""
        ride = load_ride(path)
        return ride if self.prepare is None else self.prepare(ride)

    def estimator(self, ride: Trajectory, variant: Variant) -> Any:
        """Filter or integration, configured with the rider's geometry."""
        geometry = RiderGeometry.of(ride.metadata)
        if variant.geometry is not None:
            geometry = variant.geometry(geometry, ride)
        model = (variant.model or self.model).for_rider(geometry, dt=ride.dt, **variant.options)
        return KalmanFilter(model) if hasattr(model, "residual") else Observer(model)

    def estimate(self, ride: Trajectory, variant: Variant) -> Estimate:
        """Estimate of a whole ride."""
        estimator = self.estimator(ride, variant)
        samples = ride.measurements if variant.samples is None else variant.samples(ride)
        return estimator.run({channel.name: samples[channel.name] for channel in estimator.channels})

    def errors(self, pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Angle → signed error ``(T,)``, deg, of those angles that the pose has."""
        return {
            angle: np.degrees(rotation.wrap(pose[name][..., part] - truth[name][..., part]))
            for angle, (name, part) in self.angles.items()
            if name in pose
        }

    def baselines(self, time: np.ndarray, truth: Mapping[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
        """Errors of the two baselines; ``truth`` may hold several rides of the same time, ``(T, rides, size)``."""
        zero = self.errors({name: np.zeros_like(truth[name]) for name, _ in self.angles.values()}, truth)
        part = time >= (SETTLED if time[-1] >= SETTLED else 0.0)
        mean = {
            angle: np.degrees(rotation.wrap(np.radians(error) - circular_mean(np.radians(error[part]))))
            for angle, error in zero.items()
        }
        return {ZERO: zero, MEAN: mean}

    def assess(self, ride: Trajectory) -> dict[str, Any]:
        """All numbers of one ride, as JSON knows them.

        Returns:
            ``name``, ``subject``, ``ended``, ``length`` (s); ``rms`` and ``peak`` (method → window → angle → deg) of
            variants, ablations and baselines; ``consistency`` (variant → statistic → value a degree of freedom);
            ``nees`` of each angle that is a state, of the first variant; ``over time``, errors (deg) every
            :data:`SPACING` s of the first variant and of those that are ``followed``; ``yaw`` (:func:`.yaw_drift`);
            and what ``extra`` gives.
        """
        truth, spans = self.truth(ride.truth), self.windows(ride.time)
        estimates = {name: self.estimate(ride, variant) for name, variant in self.variants.items()}
        errors = {name: self.errors(each.pose, truth) for name, each in estimates.items()} | self.baselines(
            ride.time, truth
        )
        for name, variant in self.ablations.items():
            errors[name] = self.errors(self.estimate(ride, variant).pose, truth)
        found: dict[str, Any] = {
            "name": ride.name,
            "subject": ride.metadata.get("subject"),
            "ended": ride.metadata.get("ended"),
            "length": float(ride.time[-1]),
            "rms": {
                name: {span: windowed(each, ride.time, *ends) for span, ends in spans.items()}
                for name, each in errors.items()
            },
            "peak": {name: windowed(each, ride.time, SETTLED, statistic=largest) for name, each in errors.items()},
            "consistency": {name: self.consistency(ride, estimates[name], errors[name]) for name in self.checked},
        }
        every = max(1, round(SPACING / ride.dt))
        found["over time"] = {
            name: {angle: error[::every].tolist() for angle, error in errors[name].items()}
            for name in (self.first, *self.followed)
        }
        found["yaw"] = yaw_drift(ride, estimates[self.first].pose[ROLL][:, 0])
        found["nees"] = {
            angle: self.normalised(ride, estimates[self.first], errors[self.first], [angle]) for angle in self.states
        }
        return found | ({} if self.extra is None else self.extra(self, ride, estimates))

    def consistency(self, ride: Trajectory, estimate: Estimate, errors: Mapping[str, np.ndarray]) -> dict[str, float]:
        """NEES of every part and NIS, each a degree of freedom: 1 if the filter's covariance is right."""
        assert estimate.innovation is not None
        settled = _settled(ride)
        found = {name: self.normalised(ride, estimate, errors, angles) for name, angles in self.parts.items()}
        if self.sampled is not None:
            settled = settled & np.isfinite(ride.measurements[self.sampled][:, 0])
        return found | {"NIS": float(np.mean(estimate.innovation[settled] ** 2))}

    def normalised(
        self, ride: Trajectory, estimate: Estimate, errors: Mapping[str, np.ndarray], angles: Sequence[str]
    ) -> float:
        """Mean NEES of some angles that are states, each a degree of freedom."""
        assert estimate.covariance is not None
        settled, states = _settled(ride), [self.states[angle] for angle in angles]
        error = np.radians(np.stack([errors[angle][settled] for angle in angles], axis=-1))
        return float(np.mean(nees(error, estimate.covariance[settled][:, states][:, :, states]))) / len(states)

    def part(self, study: Study, scenario: str) -> Study:
        """The study with as many rides as this scenario has."""
        most = self.scenarios[scenario]
        return study if most is None else replace(study, seeds=min(most, study.seeds))

    def jobs(self, study: Study) -> list[RideJob]:
        """What records the rides of all scenarios."""
        return [job for name in self.scenarios for job in self.part(study, name).ride_jobs(name, self.suite)]

    def run(self, study: Study, scenario: str) -> tuple[list[Path], list[dict[str, Any]]]:
        """Record the rides of a scenario and assess each, several at a time; returns their files and their numbers."""
        study = self.part(study, scenario)
        paths = study.ride_files(scenario, self.suite)
        return paths, study.map(f"rides {scenario}", assessed, [(self, path) for path in paths])

    def report(self, report: Report, course: str, results: list[dict[str, Any]], claims: Sequence[Claim] = ()) -> None:
        """Tables of a course (published errors, variants, ablations, windows, consistency), claims, ``results.csv``.

        ``results`` are those of :meth:`run`, ``claims`` further ones of this study.
        """
        rows: list[dict[str, Any]] = []
        compared = self.tabled if any(key[0] == course for key in self.published) else ()
        for name in compared:
            published = self.published.get((course, name), {})
            for angle in self.angles:
                values = [each["rms"][name]["settled"].get(angle, float("nan")) for each in results]
                if np.isfinite(values).any():
                    row = {"filter": name, "quantity": angle, "published": published.get(angle)}
                    rows.append(row | {"values": values, "unit": "deg"})
        if rows:
            report.compare(f"{self.table}, {course}", rows, f"RMS from {SETTLED:g} s on.", interval=STD)
        report.table(f"Skill, {course}, RMS in deg", self.skill(course, results), self.note(results))
        if course.startswith(COMMON):
            report.table(f"{SHORT}, {course}, RMS in deg", self.in_short(course, results))
        cells = self.cells or rounded
        methods = [*self.variants, ZERO, MEAN]
        report.table(
            f"Variants, {course}, mean RMS in deg",
            [{"filter": name, **cells(mean_rms(results, name))} for name in methods],
            f"*{ZERO}* needs no sensor; *{MEAN}* is the best constant, known in hindsight only.",
        )
        if self.ablations:
            rows = [{"sensors": name, **cells(mean_rms(results, name))} for name in (methods[0], *self.ablations)]
            report.table(f"Where errors come from, {course}, mean RMS in deg", rows)
        spans = [name for name in results[0]["rms"][methods[0]] if name != "settled"]
        windows = {(name, span): mean_rms(results, name, span) for name in self.drawn for span in spans}
        windows |= {(name, "largest error"): mean_of(each["peak"][name] for each in results) for name in self.drawn}
        known = {key: row for key, row in windows.items() if np.isfinite(list(row.values())).all()}
        if known:
            rows = [{"method": name, "time": span, **cells(row)} for (name, span), row in known.items()]
            report.table(f"Drift, {course}, mean RMS in deg", rows)
        report.table(
            f"Consistency, {course}",
            [
                {"filter": name, **rounded(mean_of(each["consistency"][name] for each in results))}
                for name in self.checked
            ],
            "For each degree of freedom; 1 if the filter's covariance is right.",
        )
        report.claims(f"What holds, {course}", [*self.claims(course, results), *claims])
        report.numbers(self.results(results))

    def note(self, results: list[dict[str, Any]]) -> str:
        """What stands below the table of skill."""
        length = float(np.median([each["length"] for each in results]))
        return SKILL.format(rides=len(results), length=length, bound=self.bound)

    def skill(self, course: str, results: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """A row for each angle: what is published, the filter, what it must beat, its bound, and its consistency."""
        published = self.published.get((course, self.first), {})
        methods = (self.first, STRAPDOWN, ZERO, MEAN)
        means = {name: mean_rms(results, name) for name in methods if name in results[0]["rms"]}
        bound = mean_of(each.get("bound", {}) for each in results)
        rows = []
        for angle in self.angles:
            row: dict[str, Any] = {"angle": angle, "published": published.get(angle)}
            spread = [each["rms"][self.first]["settled"].get(angle, np.nan) for each in results]
            for name, mean in means.items():
                row[name] = _rounded(mean.get(angle))
                if name == self.first:
                    row["± over rides"] = _rounded(float(np.std(spread, ddof=1))) if len(spread) > 1 else None
            row["posterior bound"] = _rounded(bound.get(angle))
            values = [each["nees"][angle] for each in results if angle in each["nees"]]
            row["NEES, 95 % interval"] = interval_of_mean(values) if values else None
            rows.append(row)
        return rows

    def in_short(self, course: str, results: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """The skill of the filter in two rows: roll of the bicycle, and mean over the other published angles."""
        published = self.published_errors(course)
        tabled = {angle for (_, name), values in self.published.items() if name == self.first for angle in values}
        columns = {
            "published": published,
            "here": mean_rms(results, self.first),
            MEAN: mean_rms(results, MEAN),
            "posterior bound": mean_of(each.get("bound", {}) for each in results),
        }
        angles = {
            "roll of the bicycle": [angle for angle in tabled if self.angles[angle][0] == ROLL],
            "other angles, mean": [angle for angle in self.angles if angle in tabled and self.angles[angle][0] != ROLL],
        }
        return [
            {"error of": name}
            | {
                column: _rounded(float(np.mean([values.get(angle, np.nan) for angle in part])))
                for column, values in columns.items()
            }
            for name, part in angles.items()
        ]

    def published_errors(self, course: str) -> dict[str, float]:
        """Angle → error of the filter that the paper publishes for a course, deg."""
        return {angle: leading(text) for angle, text in self.published.get((course, self.first), {}).items()}

    def claims(self, course: str, results: list[dict[str, Any]]) -> list[Claim]:
        """What holds of the errors of a course: against the paper, the baselines and each other; and of consistency."""
        ours, best = mean_rms(results, self.first), mean_rms(results, MEAN)
        published = self.published_errors(course)
        roll = next(angle for angle, (name, _) in self.angles.items() if name == ROLL)
        found = [Claim.shares("Every error is at or below the published one", ours, published)] if published else []
        found += [
            Claim.shares("Every angle is estimated better than by the best constant", ours, best, unit="of its error"),
            Claim.less("The roll is estimated better than by zero", ours[roll], mean_rms(results, ZERO)[roll]),
        ]
        for each in self.comparisons:
            names = (each.method, each.other)
            one, other = (mean_rms(results, name, each.window)[each.angle] for name in names)
            found.append(Claim.less(each.statement, one, other, factor=each.factor, names=names))
        for name in self.checked:
            for statistic, value in mean_of(each["consistency"][name] for each in results).items():
                found.append(Claim.within(f"{name}: {statistic} is right within a factor of two", value, 0.5, 2.0))
        bound = mean_of(each.get("bound", {}) for each in results)
        if bound:
            statement = "No error lies below its bound by more than 5 %"
            found.append(Claim.shares(statement, bound, ours, 1.05, "of the error"))
        return [*found, yaw_claim(results)]

    def results(self, results: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
        """Rows of ``results.csv``: RMS error of every method and angle on every ride."""
        return [
            result(f"{self.name}: {name}", each["name"], angle, "rms", value, "deg")
            for each in results
            for name, spans in each["rms"].items()
            for angle, value in spans["settled"].items()
        ]


def assessed(study: RideStudy, path: Path) -> dict[str, Any]:
    """:meth:`RideStudy.assess` of a recorded ride."""
    return study.assess(study.load(path))


SKILL = (
    f"{{rides}} rides of {{length:.0f}} s, mean over them from {SETTLED:g} s on. *{STRAPDOWN}*: gyroscopes alone. "
    "*Posterior bound*: {bound}. *NEES*: of the angle alone, 1 if the covariance is consistent; mean over rides with "
    "its 95 % interval over rides."
)


def _settled(ride: Trajectory) -> np.ndarray:
    """Samples ``(T,)`` whose consistency counts."""
    return ride.time >= min(SETTLED, 0.5 * float(ride.time[-1]))


def _rounded(value: float | None) -> float | None:
    return None if value is None or np.isnan(value) else round(value, 2)
