"""A paper's filter on recorded rides: variants, sensors without some errors, baselines, consistency, and the report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core import rotation
from ...filters.core.consistency import nees
from ...filters.core.kalman import KalmanFilter
from ...filters.core.observer import Observer
from ...filters.core.quantity import Estimate
from ..evaluation import COLUMNS
from ..plots import TRUTH_COLOR, legend_above, new_figure
from .averages import largest, mean_of, mean_rms, rounded, windowed
from .claims import Claim
from .kit import Study, load_ride
from .report import STD, Report

SETTLED = 10.0
"""s: errors count from here, when a filter has forgotten its start"""
ZERO, MEAN = "always zero", "always the ride's mean"
"""Baselines: what needs no sensor, and the best constant, which only hindsight knows."""
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
        name: of the estimator.
        model: class with ``for_rider(geometry, dt=…, **options)``.
        variants: name → how the filter is run; the first is the one that everything is compared with.
        ablations: name → the same filter with better sensors.
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
        windows: time → named spans in which errors are averaged, ``settled`` among them.
        prepare: cuts or completes a ride before it is used.
        extra: further numbers of a ride, from the ride and the estimates of its variants.
        cells: a row of errors as cells of a table; None rounds them.
    """

    name: str
    model: Any
    variants: Mapping[str, Variant]
    ablations: Mapping[str, Variant]
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
    sampled: str | None = None
    windows: Callable[[np.ndarray], dict[str, tuple[float, float]]] = whole_ride
    prepare: Callable[[Trajectory], Trajectory] | None = None
    extra: Callable[[RideStudy, Trajectory, dict[str, Estimate]], dict[str, Any]] | None = None
    cells: Callable[[Mapping[str, float]], Mapping[str, Any]] | None = None

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
            angle: np.degrees(rotation.wrap(np.radians(error) - _circular_mean(np.radians(error[part]))))
            for angle, error in zero.items()
        }
        return {ZERO: zero, MEAN: mean}

    def assess(self, ride: Trajectory) -> dict[str, Any]:
        """All numbers of one ride, as JSON knows them.

        Returns:
            ``name``, ``subject``, ``ended``, ``length`` (s); ``rms`` and ``peak`` (method → window → angle → deg) of
            variants, ablations and baselines; ``consistency`` (variant → statistic → value a degree of freedom); and
            what ``extra`` gives.
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
        return found | ({} if self.extra is None else self.extra(self, ride, estimates))

    def consistency(self, ride: Trajectory, estimate: Estimate, errors: Mapping[str, np.ndarray]) -> dict[str, float]:
        """NEES of every part and NIS, each a degree of freedom: 1 if the filter's covariance is right."""
        assert estimate.covariance is not None
        assert estimate.innovation is not None
        settled = ride.time >= min(SETTLED, 0.5 * float(ride.time[-1]))
        found = {}
        for name, angles in self.parts.items():
            states = [self.states[angle] for angle in angles]
            error = np.radians(np.stack([errors[angle][settled] for angle in angles], axis=-1))
            P = estimate.covariance[settled][:, states][:, :, states]
            found[name] = float(np.mean(nees(error, P))) / len(states)
        if self.sampled is not None:
            settled = settled & np.isfinite(ride.measurements[self.sampled][:, 0])
        return found | {"NIS": float(np.mean(estimate.innovation[settled] ** 2))}

    def run(self, study: Study, scenario: str, suite: str) -> tuple[list[Path], list[dict[str, Any]]]:
        """Record the rides of a scenario and assess each, several at a time; returns their files and their numbers."""
        paths = study.ride_files(scenario, suite)
        return paths, study.map(f"rides {scenario}", assessed, [(self, path) for path in paths])

    def report(self, report: Report, course: str, results: list[dict[str, Any]], claims: Sequence[Claim] = ()) -> None:
        """Tables of a course (published errors, variants, ablations, windows, consistency), claims, ``results.csv``.

        Args:
            report: where they go.
            course: in the titles, and in ``published``.
            results: of :meth:`run`.
            claims: further ones of this study.
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

    def claims(self, course: str, results: list[dict[str, Any]]) -> list[Claim]:
        """What holds of the errors of a course: against the paper, the baselines and each other; and of consistency."""
        first = next(iter(self.variants))
        ours, best = mean_rms(results, first), mean_rms(results, MEAN)
        published = self.published.get((course, first), {})
        ratios = {angle: ours[angle] / float(value.replace("±", " ").split()[0]) for angle, value in published.items()}
        constant = {angle: error / best[angle] for angle, error in ours.items()}
        roll = next(angle for angle, (name, _) in self.angles.items() if name == "bicycle/roll")
        found = [Claim.every("Every error is at or below the published one", ratios, 1.0, "of it")] if ratios else []
        found += [
            Claim.every("Every angle is estimated better than by the best constant", constant, 1.0, "of its error"),
            Claim.less("The roll is estimated better than by zero", ours[roll], mean_rms(results, ZERO)[roll]),
        ]
        for each in self.comparisons:
            names = (each.method, each.other)
            one, other = (mean_rms(results, name, each.window)[each.angle] for name in names)
            found.append(Claim.less(each.statement, one, other, factor=each.factor, names=names))
        for name in self.checked:
            for statistic, value in mean_of(each["consistency"][name] for each in results).items():
                found.append(Claim.within(f"{name}: {statistic} is right within a factor of two", value, 0.5, 2.0))
        return found

    def results(self, results: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
        """Rows of ``results.csv``: RMS error of every method and angle on every ride."""
        return [
            dict(zip(COLUMNS, (f"{self.name}: {name}", each["name"], angle, "rms", value, "deg"), strict=True))
            for each in results
            for name, spans in each["rms"].items()
            for angle, value in spans["settled"].items()
        ]

    def figure(self, report: Report, path: Path, title: str, angles: Sequence[str] | None = None) -> None:
        """Angles of one ride, true and estimated; the scale is that of the truth and of the last method drawn."""
        ride, shown = self.load(path), list(angles or self.angles)
        truth = self.truth(ride.truth)
        errors = {name: self.errors(self.estimate(ride, self.variants[name]).pose, truth) for name in self.drawn}
        figure, axes = new_figure(7.5, 0.6 + 1.9 * len(shown), len(shown))
        for ax, angle in zip(axes, shown, strict=True):
            name, part = self.angles[angle]
            true = np.degrees(np.unwrap(truth[name][:, part]))
            ax.plot(ride.time, true, color=TRUTH_COLOR, linewidth=1.2, label="truth")
            for method, color in zip(self.drawn, DRAWN[-len(self.drawn) :], strict=True):
                if angle in errors[method]:
                    ax.plot(ride.time, true + errors[method][angle], color=color, linewidth=0.9, label=method)
            scale = np.concatenate([true, true + errors[self.drawn[-1]][angle]])
            low, high = np.nanmin(scale), np.nanmax(scale)
            margin = 0.25 * (high - low) + 1.0
            ax.set(ylabel=f"{angle}, deg", ylim=(low - margin, high + margin))
            legend_above(ax)
        axes[-1].set_xlabel("time, s")
        report.figure(title, figure, title, "Scales are those of truth and filter; what drifts leaves the picture.")


DRAWN = ("#2c8c5a", "#c2571a", "#b08d1a", "#1f5fa8")
"""Colours of the methods of a figure; the last is that of the study's filter, the one before that of integration."""


def assessed(study: RideStudy, path: Path) -> dict[str, Any]:
    """:meth:`RideStudy.assess` of a recorded ride."""
    return study.assess(study.load(path))


def _circular_mean(angles: np.ndarray) -> np.ndarray:
    return np.arctan2(np.sin(angles).mean(axis=0), np.cos(angles).mean(axis=0))
