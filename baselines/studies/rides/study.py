"""``poise rides``: every scenario with every rider, numbers of each ride, and whether the papers' riders rode so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import product
from typing import Any

from ....envs.bicycle.course.scenarios import list_scenarios
from ....envs.bicycle.rider.anthropometry import SUBJECTS
from ....filters.support.seeds import child_seeds
from ...evaluation import COLUMNS
from ..kit import Study
from ..report import Report
from .checks import all_checks
from .inclinations import inclination_rows
from .plots import example_ride, ride_signals
from .reports import comparison
from .statistics import RideStatistics, ride

SHOWN = {
    "scenario": "scenario",
    "subject": "subject",
    "upright": "upright",
    "speed_mean": "speed m/s",
    "speed_max": "max m/s",
    "roll_sd": "roll std deg",
    "roll_max": "max deg",
    "lean_mean": "lean mean deg",
    "lean_sd": "lean std deg",
    "yaw_rate_mean": "yaw deg/s",
    "acceleration_max": "acc max m/s²",
    "seat_force_mean": "seat mean N",
    "seat_force_max": "seat max N",
    "handlebar_force_mean": "hand mean N",
    "handlebar_force_max": "hand max N",
    "gap_max": "gap max mm",
}
"""Field → column of the table."""
DRAWN = 20.0
"""s of a ride at most in the figure"""
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
"""Quantity → unit."""


def ride_numbers(scenario: str, subject: int, duration: float, fidelity: str, seed: int) -> dict[str, Any]:
    """:func:`.ride` as JSON knows it."""
    return asdict(ride(scenario, subject, duration, fidelity, seed))


def ride_seeds(seed: int) -> dict[tuple[str, int], int]:
    """Seed of every scenario and rider, whichever of them ride."""
    pairs = list(product(list_scenarios(), range(len(SUBJECTS))))
    return dict(zip(pairs, child_seeds(seed, len(pairs)), strict=True))


def rides(study: Study, report: Report, scenarios: Sequence[str], fidelity: str) -> list[RideStatistics]:
    """Ride, and report the numbers of every ride, what agrees with the papers, and the signals of one ride."""
    seeds, which = ride_seeds(study.seed), list(product(scenarios, study.subjects))
    jobs = [(*pair, study.duration, fidelity, seeds[pair]) for pair in which]
    found = [RideStatistics(**numbers) for numbers in study.map("rides", ride_numbers, jobs)]
    report.numbers(results(found))
    shown = {field: title for field, title in SHOWN.items() if fidelity == "full" or field != "gap_max"}
    report.table(
        f"{len(found)} rides of {study.duration:g} s, {fidelity} rider",
        [{title: asdict(each)[field] for field, title in shown.items()} for each in found],
    )
    report.claims("Beside the papers, range over riders", comparison(found))
    draw(study, report, scenarios, fidelity, seeds)
    return found


def draw(
    study: Study, report: Report, scenarios: Sequence[str], fidelity: str, seeds: Mapping[tuple[str, int], int]
) -> None:
    """The beginning of one of the rides with the papers' sensors."""
    scenario, subject = "outdoor" if "outdoor" in scenarios else scenarios[0], study.subjects[0]
    seconds = min(study.duration, DRAWN)
    ride = example_ride(scenario, subject, seeds[scenario, subject], seconds, fidelity)
    title = f"{scenario}, subject {subject}: {seconds:g} s"
    report.figure("signals", ride_signals(ride, title), title)


def checks(study: Study, report: Report) -> None:
    """Physical checks, and what filters of a single IMU make of some rides (minutes)."""
    report.table("Physical checks", [each._asdict() for each in all_checks()])
    report.table("RMS errors of inclination, deg, of filters of one IMU", list(inclination_rows()))


def results(found: Sequence[RideStatistics]) -> list[dict[str, Any]]:
    """Rows of ``results.csv``; what is true of a ride has the estimator ``truth``."""
    rows = []
    for each in found:
        name = f"{each.scenario}-{each.subject}"
        rows.append(dict(zip(COLUMNS, ("truth", name, "ride", "upright", float(each.upright), "1"), strict=True)))
        for quantity, unit in UNITS.items():
            for metric in ("mean", "sd", "min", "max"):
                value = getattr(each, f"{quantity}_{metric}", None)
                if value is not None:
                    rows.append(dict(zip(COLUMNS, ("truth", name, quantity, metric, value, unit), strict=True)))
    return rows
