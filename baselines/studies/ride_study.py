"""A paper's filter on recorded rides: variants, sensors without some errors, baselines, consistency, tables of all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core import rotation
from ...filters.core.consistency import nees
from ...filters.core.kalman import KalmanFilter
from ...filters.core.observer import Observer
from ...filters.core.quantity import Estimate
from .kit import Study, load_ride
from .report import DEVIATION, Report

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
    """what it gets in the place of the recorded samples"""
    geometry: Callable[[RiderGeometry, Trajectory], RiderGeometry] | None = None
    """what it is configured with in the place of the rider's geometry"""
    model: Any = None
    """class in the place of the study's"""


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
        windows: time → named spans in which errors are averaged, ``settled`` among them.
        prepare: cuts or completes a ride before it is used.
        extra: further numbers of a ride, from the ride and the estimates of its variants.
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
    sampled: str | None = None
    windows: Callable[[np.ndarray], dict[str, tuple[float, float]]] = whole_ride
    prepare: Callable[[Trajectory], Trajectory] | None = None
    extra: Callable[[RideStudy, Trajectory, dict[str, Estimate]], dict[str, Any]] | None = None

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

    def baselines(self, ride: Trajectory, truth: Mapping[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
        """Errors of the two baselines."""
        zero = self.errors({name: np.zeros_like(truth[name]) for name, _ in self.angles.values()}, truth)
        part = ride.time >= (SETTLED if ride.time[-1] >= SETTLED else 0.0)
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
        errors = {name: self.errors(each.pose, truth) for name, each in estimates.items()} | self.baselines(ride, truth)
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
            "peak": {name: windowed(each, ride.time, SETTLED, statistic=_peak) for name, each in errors.items()},
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

    def published_table(
        self, report: Report, title: str, course: str, results: list[dict[str, Any]], note: str
    ) -> None:
        """The paper's errors beside those of every variant and baseline that has the angle."""
        rows = []
        for name in (*self.variants, ZERO, MEAN):
            printed = self.published.get((course, name), {})
            for angle in self.angles:
                values = [each["rms"][name]["settled"].get(angle, float("nan")) for each in results]
                if np.isfinite(values).any():
                    row = {"filter": name, "quantity": angle, "printed": printed.get(angle)}
                    rows.append(row | {"values": values, "unit": "deg"})
        report.compare(title, rows, f"RMS from {SETTLED:g} s on. {BASELINES} {note}".strip(), interval=DEVIATION)

    def results(self, results: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
        """Rows of ``results.csv``: RMS error of every method and angle on every ride."""
        return [
            {
                "estimator": f"{self.name}: {name}",
                "trajectory": each["name"],
                "quantity": angle,
                "metric": "rms",
                "value": value,
                "unit": "deg",
            }
            for each in results
            for name, spans in each["rms"].items()
            for angle, value in spans["settled"].items()
        ]


BASELINES = f"*{ZERO}* needs no sensor; *{MEAN}* is the best constant, known in hindsight only."


def assessed(study: RideStudy, path: Path) -> dict[str, Any]:
    """:meth:`RideStudy.assess` of a recorded ride."""
    return study.assess(study.load(path))


def windowed(
    errors: Mapping[str, np.ndarray],
    time: np.ndarray,
    begin: float,
    end: float = np.inf,
    statistic: Callable[[np.ndarray], float] | None = None,
) -> dict[str, float]:
    """RMS (or another statistic) of each column between two times, both included; NaN where a ride is too short."""
    part = (time >= begin) & (time <= end)
    statistic = statistic or _rms
    return {name: float(statistic(error[part])) if part.any() else float("nan") for name, error in errors.items()}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _peak(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def _circular_mean(angles: np.ndarray) -> float:
    return float(np.arctan2(np.sin(angles).mean(), np.cos(angles).mean()))


def mean_of(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Mean of every column over rides; NaN is left out, and stays where nothing else is."""
    columns: dict[str, list[float]] = {}
    for row in rows:
        for name, value in row.items():
            columns.setdefault(name, []).append(float(value))
    return {name: mean(values) for name, values in columns.items()}


def mean(values: Iterable[float]) -> float:
    """Mean of what is known."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def rounded(row: Mapping[str, float], digits: int = 2) -> dict[str, float]:
    """Cells of a table."""
    return {name: round(value, digits) for name, value in row.items()}


def mean_rms(results: Iterable[Mapping[str, Any]], method: str, window: str = "settled") -> dict[str, float]:
    """Angle → mean over rides of a method's RMS error, deg."""
    return mean_of(each["rms"][method][window] for each in results)
