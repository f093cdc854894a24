"""What the papers report about the rides of their riders, beside rides of the simulation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from ..averages import mean
from ..claims import Claim


class Reported(NamedTuple):
    """What a paper reports about its riders, and what counts as the same here."""

    scenario: str
    what: str
    reported: str
    source: str
    field: str
    """statistic of :func:`.ride_statistics` that compares"""
    unit: str
    low: float
    high: float
    """between these the mean over riders agrees with the paper"""


FORCE = "force-inertial, section III"
BODY = "whole-body, section V"
GYRO = "two-gyro, section V"
INF = float("inf")
REPORTED = (
    Reported("indoor_circle", "mean speed", "about 1 m/s", BODY, "speed_mean", "m/s", 0.8, 1.25),
    Reported(
        "indoor_circle", "yaw rate", "23 deg/s (1 m/s on a radius of 2.5 m)", BODY, "yaw_rate_mean", "deg/s", 18.0, 28.0
    ),
    Reported(
        "indoor_circle",
        "mean trunk lean to the middle",
        "about 20 deg, an aggressive rider (subject 1)",
        f"{FORCE}, fig. 6",
        "lean_mean",
        "deg",
        15.0,
        25.0,
    ),
    Reported("outdoor", "largest speed", "about 22 km/h = 6.1 m/s", FORCE, "speed_max", "m/s", 5.0, 7.2),
    Reported("outdoor", "lowest speed", "0.5 m/s", BODY, "speed_min", "m/s", 0.0, 1.0),
    Reported(
        "bumps",
        "largest acceleration",
        "2 g and beyond: clipped",
        f"{BODY}, fig. 11",
        "acceleration_max",
        "m/s²",
        19.6,
        INF,
    ),
    Reported("pitch", "largest pitch", "up to about 20 deg", f"{GYRO}, fig. 15", "pitch_max", "deg", 15.0, 22.0),
    Reported(
        "straight",
        "mean yaw rate",
        "nearly straight, zero only intermittently",
        f"{GYRO}, fig. 17",
        "yaw_rate_mean",
        "deg/s",
        0.0,
        5.0,
    ),
)
"""Figures of the papers; forces they show in no number. Speeds depend on how long one rides."""


def comparison(rides: Iterable[dict[str, Any]]) -> list[Claim]:
    """What each paper reports and whether the mean over the riders here agrees, for scenarios that were ridden."""
    found = list(rides)
    claims = []
    for line in REPORTED:
        values = [each[line.field] for each in found if each["scenario"] == line.scenario]
        if values:
            text = f"{line.scenario}: {line.what}, {line.reported} ({line.source})"
            here = f"{min(values):.3g} to {max(values):.3g} {line.unit}"
            bounds = f"from {line.low:g}" if line.high == INF else f"{line.low:g} … {line.high:g}"
            number = f"{here}; the mean agrees if {bounds}"
            claims.append(Claim(text, number, line.low <= mean(values) <= line.high))
    return claims
