"""Parts of the report about the simulators themselves: gestures, rides, saddle, roads, sensors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ....envs.bicycle.course.scenarios import list_scenarios
from ....envs.sensors.allan import FLOOR_TIME, allan_floors
from ...studies.rides.vibration import vibration_checks
from ..kit import Study
from ..report import Report
from .environments import BANDWIDTH, GESTURE_RATE, GESTURE_TIME, SHOWN, SHOWN_OF_HANDS, gestures, medians, rides
from .motion import UNITS, motion_statistics
from .ranges import judged
from .roles import Recorded

ENDS = ((5, "min"), (95, "max"))
"""Percentiles of the centre of pressure, and which of several rides is the worst"""
BUMPY = ("bumps", "pitch")
"""Scenarios in which the wheels leave the ground, or the rider is thrown: their saddle is shown, not judged"""


def titled(names: Iterable[str]) -> dict[str, str]:
    """Statistic → heading of its column."""
    return {name: f"{name} {UNITS[name]}".strip() for name in names}


def recorded_rows(groups: Sequence[Recorded], roles: Sequence[str], first: str, columns: Mapping[str, str]) -> list:
    """One row a recording of the roles."""
    found = []
    for group in groups:
        if group.role not in roles:
            continue
        for each in group.load():
            values = motion_statistics(each, bandwidth=BANDWIDTH if group.role in ("chest", "head") else None)
            found.append({first: f"recorded: {each.name}"} | {title: values[name] for name, title in columns.items()})
    return found


def hand_motion(study: Study, report: Report, episodes: int, groups: Sequence[Recorded]) -> None:
    """Every gesture, above the recordings of hands and carried phones."""
    columns = titled(SHOWN_OF_HANDS)
    rows = [
        {"gesture": name} | {title: values[statistic] for statistic, title in columns.items()}
        for name, values in gestures(study, max(2, episodes // 10)).items()
    ]
    report.table(
        "Gestures of poise/HandMotion-v0",
        rows + recorded_rows(groups, ("hand", "carried"), "gesture", columns),
        f"Medians over {max(2, episodes // 10)} episodes of {GESTURE_TIME:g} s at {GESTURE_RATE:g} Hz with ideal "
        "sensors; recordings at 0.45 of their own rates.",
    )


def ride_motion(study: Study, report: Report, count: int, groups: Sequence[Recorded]) -> None:
    """Trunk, bicycle, saddle and steering of every scenario, above the recordings of riders."""
    each_scenario = max(2, count // 5)
    found = rides(study, list_scenarios(), each_scenario)
    middle = {name: medians(values) for name, values in found.items()}
    for site in ("trunk_imu", "bicycle_imu"):
        columns = titled(SHOWN)
        rows = [
            {"scenario": name} | {title: values[f"{site}/{statistic}"] for statistic, title in columns.items()}
            for name, values in middle.items()
        ]
        recordings = recorded_rows(groups, ("chest", "head"), "scenario", columns) if site == "trunk_imu" else []
        report.table(
            f"Motion at {site} by scenario",
            rows + recordings,
            f"Medians over {each_scenario} rides, up to {BANDWIDTH:g} Hz, ideal sensors, the trunk's on soft tissue.",
        )
    report.table(
        "Trunk, against what is believable",
        [
            judged(quantity, {name: each[f"trunk_imu/{statistic}"] for name, each in middle.items()})
            for quantity, statistic in (
                ("trunk gyroscope rms", "gyr_rms"),
                ("trunk gyroscope 95 % frequency", "gyr_f95"),
            )
        ],
    )
    saddle(report, found)
    report.table(
        "Steering by scenario",
        [
            {
                "scenario": name,
                "speed m/s": each["speed"],
                "steer rate std deg/s": each["steer_rate"],
                "roll rate std deg/s": each["roll_rate"],
                "roll std deg": each["roll"],
                "upright": f"{sum(one['upright'] for one in found[name]):.0f}/{len(found[name])}",
            }
            for name, each in middle.items()
        ],
    )


def saddle(report: Report, found: Mapping[str, Sequence[Mapping[str, float]]]) -> None:
    """Load cells and centre of pressure by scenario, worst of all rides."""

    def worst(name: str, statistic: str, pick: str) -> float:
        return float(getattr(np, pick)([each[statistic] for each in found[name]]))

    report.table(
        "Saddle by scenario",
        [
            {
                "scenario": name,
                "a cell below -5 N, % of samples": worst(name, "pulls", "max"),
                "least N": worst(name, "least", "min"),
                "CoP along mm": f"{worst(name, 'along_5', 'min'):.0f} … {worst(name, 'along_95', 'max'):.0f}",
                "CoP across mm": f"{worst(name, 'across_5', 'min'):.0f} … {worst(name, 'across_95', 'max'):.0f}",
            }
            for name in found
        ],
        "Largest share, least force and widest 5 to 95 % of the centre of pressure over the rides of a scenario.",
    )
    firm = [name for name in found if name not in BUMPY]
    rows = [judged("least force of a load cell", {name: worst(name, "least", "min") for name in firm})]
    for axis in ("across", "along"):
        ends = {f"{name}, {end} %": worst(name, f"{axis}_{end}", pick) for name in firm for end, pick in ENDS}
        rows.append(judged(f"centre of pressure {axis}", ends))
    report.table("Saddle, against what is believable", rows)


def roads(report: Report) -> None:
    """Vertical acceleration of the bicycle on every surface."""
    report.table("Vibration by road surface", [each._asdict() for each in vibration_checks()])


def sensors(report: Report) -> None:
    """Allan deviation of the presets where drift shows."""
    rows = allan_floors()
    report.table(
        f"Allan deviation at {FLOOR_TIME:g} s",
        [
            {
                "preset": each["name"],
                "gyroscope °/h": each["gyroscope"],
                "accelerometer µg": each["accelerometer"],
                "assumed": each["assumed"],
            }
            for each in rows
        ],
        "Expected from the parameters (IEEE Std 952); fields that no data sheet states are named assumptions.",
    )
