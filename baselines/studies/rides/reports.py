"""What the papers report about the rides of their riders, beside rides of the simulation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from .statistics import RideStatistics


class Reported(NamedTuple):
    """What a paper reports about its riders."""

    scenario: str
    what: str
    reported: str
    source: str
    field: str
    """field of :class:`RideStatistics` that compares"""
    unit: str


FORCE = "force-inertial, section III"
BODY = "whole-body, section V"
GYRO = "two-gyro, section V"
REPORTED = (
    Reported("indoor_circle", "mean speed", "about 1 m/s", BODY, "speed_mean", "m/s"),
    Reported("indoor_circle", "yaw rate", "23 deg/s (1 m/s on a radius of 2.5 m)", BODY, "yaw_rate_mean", "deg/s"),
    Reported(
        "indoor_circle",
        "mean trunk lean to the middle",
        "about 20 deg, an aggressive rider (subject 1)",
        f"{FORCE}, fig. 6",
        "lean_mean",
        "deg",
    ),
    Reported("outdoor", "largest speed", "about 22 km/h = 6.1 m/s", FORCE, "speed_max", "m/s"),
    Reported("outdoor", "lowest speed", "0.5 m/s", BODY, "speed_min", "m/s"),
    Reported(
        "bumps", "largest acceleration", "2 g and beyond: clipped", f"{BODY}, fig. 11", "acceleration_max", "m/s²"
    ),
    Reported("pitch", "largest pitch", "up to about 20 deg", f"{GYRO}, fig. 15", "pitch_max", "deg"),
    Reported(
        "straight",
        "mean yaw rate",
        "nearly straight, zero only intermittently",
        f"{GYRO}, fig. 17",
        "yaw_rate_mean",
        "deg/s",
    ),
)
"""Figures of the papers; forces they show in no number."""


def comparison(rides: Iterable[RideStatistics]) -> list[dict[str, Any]]:
    """Rows: scenario, what is compared, what the paper reports, and the range over the riders here."""
    found = list(rides)
    rows = []
    for line in REPORTED:
        values = [getattr(each, line.field) for each in found if each.scenario == line.scenario]
        if values:
            here = f"{min(values):.3g} to {max(values):.3g} {line.unit}"
            rows.append(
                {
                    "scenario": line.scenario,
                    "what": line.what,
                    "papers": line.reported,
                    "here": here,
                    "source": line.source,
                }
            )
    return rows
