"""``poise rides``: every scenario with every rider, numbers of each ride, and whether the papers' riders rode so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ....envs.bicycle.course.scenarios import list_scenarios
from ....envs.bicycle.rider.anthropometry import SUBJECTS
from ....envs.data.trajectory import Trajectory
from ....filters.support.seeds import child_seeds
from ...plots import TRUTH_COLOR, time_figure
from ..kit import Study
from ..report import Report, result
from .checks import all_checks
from .inclinations import inclination_rows
from .saddle import ACROSS, ALONG, PULL, SITTING, saddle_rows
from .statistics import KINDS, UNITS, comparison, ride, trunk_lean
from .steering import SETTLED, long_rides, steering_rows
from .vibration import levels, vibration_checks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def rides(study: Study, report: Report, scenarios: Sequence[str], fidelity: str) -> list[dict[str, Any]]:
    """Ride, and report the numbers of every ride, what agrees with the papers, and the signals of one ride."""
    # the seed of a scenario and rider does not depend on which of them ride
    pairs = list(product(list_scenarios(), range(len(SUBJECTS))))
    seeds = dict(zip(pairs, child_seeds(study.seed, len(pairs)), strict=True))
    which = list(product(scenarios, study.subjects))
    jobs = [(*pair, study.duration, fidelity, seeds[pair]) for pair in which]
    found = study.map("rides", ride, jobs)
    report.numbers(results(found))
    shown = {field: title for field, title in SHOWN.items() if field in found[0]}
    report.table(
        f"{len(found)} rides of {study.duration:g} s, {fidelity} rider",
        [{title: each[field] for field, title in shown.items()} for each in found],
    )
    saddles = {name: [each["saddle"] for each in found if each["scenario"] == name] for name in scenarios}
    accepted = (
        f"Off the saddle: less than {SITTING:g} N on it. Accepted: no cell below -{PULL:g} N while it carries more; "
        f"±{ALONG:g} mm along and ±{ACROSS:g} mm across."
    )
    report.table(f"Saddle by scenario, worst of the riders, {fidelity} rider", list(saddle_rows(saddles)), accepted)
    if claims := comparison(found):
        report.claims("Beside the papers, range over riders", claims)
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


def pilots(study: Study, report: Report, scenarios: Sequence[str], fidelity: str) -> list[dict[str, Any]]:
    """How riders of every skill steer, and whether they stay up."""
    found = long_rides(study, scenarios, fidelity)
    report.table(
        f"{len(found)} rides of {study.duration:g} s by pilots of all skills, {fidelity} rider",
        list(steering_rows(found)),
        f"Means over rides, torques the largest of all; after {SETTLED:g} s.",
    )
    return found


def checks(study: Study, report: Report) -> None:
    """Physical checks, and what filters of a single IMU make of some rides (minutes)."""
    report.table("Physical checks", [each._asdict() for each in (*all_checks(), *vibration_checks(levels()))])
    report.table("RMS errors of inclination, deg, of filters of one IMU", list(inclination_rows()))


def results(found: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of ``results.csv``; what is true of a ride has the estimator ``truth``."""
    rows = []
    for each in found:
        name = f"{each['scenario']}-{each['subject']}"
        numbers = [("ride", "upright", float(each["upright"]), "1")]
        numbers += [
            (quantity, kind, each[f"{quantity}_{kind}"], unit)
            for quantity, unit in UNITS.items()
            for kind in KINDS
            if f"{quantity}_{kind}" in each
        ]
        rows += [result("truth", name, *number) for number in numbers]
    return rows


SIGNALS = (
    ("bicycle_imu/gyr", "bicycle gyr, rad/s", ("forward", "left", "up")),
    ("bicycle_imu/acc", "bicycle acc, m/s²", ("forward", "left", "up")),
    ("trunk_imu/acc", "trunk acc, m/s²", ("forward", "left", "up")),
    ("seat/load_cells", "load cells, N", ("front", "rear left", "rear right")),
)
"""Channel, label of its axis, names of its columns."""


def example_ride(scenario: str, subject: int, seed: int, duration: float, fidelity: str) -> Trajectory:
    """One ride of ``duration`` s with every sensor of the papers, errors included."""
    from ....envs.bicycle.environment import RiderBicycleEnv
    from ....envs.record import record_once

    options = {"suite": "all", "duration": duration, "fidelity": fidelity}
    return record_once(RiderBicycleEnv(scenario, subject, **options), seed)  # type: ignore[arg-type]


def ride_signals(trajectory: Trajectory, title: str = "") -> Figure:
    """Speed, true angles, inertial sensors, load cells and hands' forces of a ride with the suite ``all`` over time."""
    figure, axes = time_figure(8.5, 10.0, rows=len(SIGNALS) + 3)
    time, truth = trajectory.time - trajectory.time[0], trajectory.truth
    speed, angles, *inertial, hands = axes
    speed.plot(time, trajectory.measurements["wheel/speed"], color="#b9bec6", linewidth=0.7, label="wheel/speed")
    speed.plot(time, truth["bicycle/speed"], color=TRUTH_COLOR, linewidth=1.0, label="true")
    speed.set_ylabel("speed, m/s")
    for name, values in (
        ("roll", truth["bicycle/roll"][:, 0]),
        ("pitch", truth["bicycle/pitch"][:, 0]),
        ("steer", truth["bicycle/steer"][:, 0]),
        ("trunk lean", trunk_lean(truth)),
    ):
        angles.plot(time, np.degrees(values), linewidth=0.9, label=name)
    angles.set_ylabel("true angles, deg")
    for ax, (channel, label, columns) in zip(inertial, SIGNALS, strict=True):
        for column, name in enumerate(columns):
            ax.plot(time, trajectory.measurements[channel][:, column], linewidth=0.7, label=name)
        ax.set_ylabel(label)
    grips = trajectory.measurements["handlebar/force"]
    for begin, name in ((0, "left"), (3, "right")):
        hands.plot(time, np.linalg.norm(grips[:, begin : begin + 3], axis=1), linewidth=0.7, label=name)
    hands.set_ylabel("hands, N")
    for ax in axes:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
        ax.yaxis.label.set_size(8.5)
    figure.align_ylabels(axes)
    if title:
        speed.set_title(title, loc="left", fontsize=10.5)
    return figure
