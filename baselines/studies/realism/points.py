"""What once was not believable of the simulators, point by point: before, now, and what is asked.

Figures of before are those of a check from outside at the commit :data:`BEFORE`, on rides of 40 to 60 s.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import Any

import numpy as np

from ....envs.bicycle.course.scenarios import list_scenarios
from ....envs.bicycle.ride.pilot import PILOTS
from ....envs.bicycle.rider.anthropometry import SUBJECTS
from ....envs.recipes.registry import recipe
from ....envs.recipes.rider import RIDDEN
from ....envs.sensors.allan import allan_floors
from ..kit import Study
from ..report import Report
from ..rides.saddle import APART
from ..rides.steering import by_speed
from ..rides.vibration import MEASURED
from . import probes
from .containment import simulated_summaries
from .environments import medians, rides
from .ranges import BELIEVABLE, Believable, Covered
from .ranks import ranked
from .roles import Recorded
from .simulators import saddle_values, vibrations

BEFORE = "188cca9"
TITLE = "Fifteen points"
BROAD_RATE = 285.714
"""Hz"""
RIDE, BROAD = "chest sensor of a recorded ride of 307 s", "trials of BROAD"
TARGETS = {
    "centre of pressure, full and lumped": Believable(0.0, APART, "mm", "one distribution for both riders"),
    "upright": Believable(100.0, 100.0, "%", "nobody falls in the preset scenarios"),
    "delay of the eyes": Believable(0.1, 0.3, "s", "delays of vestibular and visual senses (Dialynas et al. 2023)"),
    "force above 2 Hz": Covered(1.23, 1.23, "m/s²", RIDE),
    "force above 10 Hz": Covered(0.33, 0.33, "m/s²", RIDE),
    "sinusoids": Covered(0.44, 0.44, "", f"{RIDE}: at most 0.44 an axis"),
    "force sample": Believable(0.0, 0.5, "N", "a sample is a mean over its interval, as of the inertial sensors"),
    "field": Covered(0.8, 13.8, "µT", f"{BROAD}, undisturbed and with magnets"),
    "delay": Covered(2.4, 2.7, "ms", f"gyroscope of {BROAD} behind its optical reference"),
    "packets": Believable(0.01, 0.5, "", "radio links lose packets; how often is assumed"),
    "arm": Believable(1.0, 100.0, "mm", "an arm of finite stiffness makes a difference that is seen"),
    "fast hands": Covered(9.0, 30.0, "Hz", BROAD),
    "power above 10 Hz": Covered(0.7, 10.0, "%", BROAD),
    "order": Believable(0.5, 1.0, "", "of three pairs of estimators in four, the better one is the same"),
    "time 0": Believable(0.0, 1e-6, "mm", "one physical instant"),
    "cadence": Covered(60.0, 90.0, "1/min", "cadences of 50 to 100 a minute, drawn evenly"),
    "coasting": Believable(5.0, 50.0, "%", "legs rest now and then in traffic; how long is assumed"),
    "stops": Believable(-0.1, 0.1, "m/s", "at rest, with a foot on the ground"),
    "standing": Believable(20.0, 200.0, "mm", "riders out of the saddle; how high is assumed"),
    "side": Believable(15.0, 100.0, "N", "gusts and pushes of 15 to 40 N and more"),
    "bicycles": Believable(3.0, inf, "", "several geometries, masses and tyres"),
    "mass": Covered(50.0, 100.0, "kg", "adults of 45 to 110 kg"),
    "stature": Covered(1.55, 1.90, "m", "adults of 1.50 to 1.95 m"),
    "women": Believable(45.0, 55.0, "%", "both sexes evenly"),
    "placement": Believable(5.0, 50.0, "mm", "sensors are strapped on by eye"),
    "gravity": Believable(0.0, 1e-9, "m/s²", "rounding: the sum is exact as documented"),
    "picture": Believable(20.0, inf, "", "a picture that is not empty"),
}
"""Quantity → what is asked, besides :data:`.BELIEVABLE`"""
TAU_BEFORE = {"broad": 0.86, "repoimu": 0.79, "smartphones": 0.79}
"""group of recordings → Kendall's τ at :data:`BEFORE`: of 60 episodes, ``HandTrajectories().draw_many(0, 60)`` there"""


def points(study: Study, report: Report, episodes: int, count: int, groups: Sequence[Recorded] = ()) -> None:
    """The table of all points; whether each holds is computed.

    Args:
        study: where rides and results are kept.
        report: what is found.
        episodes: of the recipe of hands.
        count: rides of riders; a fifth of it in every scenario, full and lumped.
        groups: recordings on which estimators are ranked.
    """
    each = max(2, count // 5)
    full, lumped = (rides(study, list_scenarios(), each, fidelity=fidelity) for fidelity in ("full", "lumped"))
    rows = [
        *saddle(full),
        *body({name: medians(values) for name, values in full.items()}),
        *roads(study),
        *pilot(study, full, lumped, max(len(SUBJECTS), count // 4)),
        *sensors(study, full, lumped),
        *hands(study, episodes),
        *orders(study, episodes, groups),
        *riding(study, full),
        *papers(study),
    ]
    ridden = 2 * each * len(full)
    note = (
        f"Before: commit {BEFORE}. Now: lowest … highest of what is compared; {ridden} rides of 40 s in all scenarios, "
        f"{episodes} episodes of hands."
    )
    report.table(TITLE, rows, note)


def point(
    number: int, claim: str, before: str, found: Mapping[str, float] | Sequence[float], target: str
) -> dict[str, Any]:
    """A row; ``found``: what is compared with :data:`TARGETS` or :data:`.BELIEVABLE` under the name ``target``."""
    asked = TARGETS.get(target) or BELIEVABLE[target]
    named = dict(found) if isinstance(found, Mapping) else {str(index): each for index, each in enumerate(found)}
    values = list(named.values())
    low, high = (float(pick(values)) for pick in (np.min, np.max))
    now = (f"{low:.3g}" if low == high else f"{low:.3g} … {high:.3g}") + f" {asked.unit}".rstrip()
    if isinstance(found, Mapping) and not isinstance(asked, Covered):
        outside = ", ".join(f"{where} ({value:.3g})" for where, value in named.items() if not asked.holds(value))
        now += f"; outside: {outside}" if outside else ""
    return {
        "point": number,
        "claim": claim,
        "before": before,
        "now": now,
        "asked": asked.text,
        "holds": asked.met(values),
        "source": asked.source,
    }


Rides = Mapping[str, Sequence[Mapping[str, float]]]


def saddle(full: Rides) -> Iterator[dict[str, Any]]:
    """Point 1: the saddle presses."""
    said = (
        ("samples in which a cell of a seated rider is below -5 N", "18 … 24 %"),
        ("least force of a cell, seated", "-475 N"),
        ("centre of pressure across, 5 to 95 %", "±220 … 298 mm"),
        ("centre of pressure along, 5 to 95 %", "±220 … 298 mm"),
    )
    for (claim, before), (target, values) in zip(said, saddle_values(full).items(), strict=True):
        yield point(1, claim, before, values, target)


def body(middle: Mapping[str, Mapping[str, float]]) -> Iterator[dict[str, Any]]:
    """Point 2: the body moves broadly and by chance; medians by scenario."""
    for claim, before, statistic, target in (
        ("trunk gyroscope, rms", "12 … 22 deg/s", "gyr_rms", "trunk gyroscope rms"),
        ("trunk gyroscope, 95 % of its power below", "0.9 … 1.4 Hz", "gyr_f95", "trunk gyroscope 95 % frequency"),
        ("trunk accelerometer above 2 Hz", "0.11 … 0.71 m/s²", "force_above_2", "force above 2 Hz"),
        ("trunk accelerometer above 10 Hz", "0.008 … 0.16 m/s²", "force_above_10", "force above 10 Hz"),
        ("share of variance in four sinusoids, accelerometer", "0.51 … 0.95", "force_sinusoids", "sinusoids"),
    ):
        found = {name: each[f"trunk_imu/{statistic}"] for name, each in middle.items()}
        yield point(2, claim, before, found, target)


def roads(study: Study) -> Iterator[dict[str, Any]]:
    """Point 3: roads shake."""
    found = vibrations(study)
    for name, before in (("pavers", "0.80 m/s²"), ("tarmac", "–")):
        claim = f"vertical acceleration on {name} at 12 km/h"
        yield point(3, claim, before, [found[name][0]], f"vertical acceleration on {name}")
    widths = [found[name][1] for name in MEASURED]
    yield point(3, "95 % of it below, pavers and tarmac", "8.8 Hz", widths, "bandwidth of vertical acceleration")


def pilot(study: Study, full: Rides, lumped: Rides, count: int) -> Iterator[dict[str, Any]]:
    """Point 4: riders steer as people do, and stay up."""
    found = by_speed(study, count)
    growth = [found[5.0]["steer"] / found[20.0]["steer"]]
    yield point(4, "steering at 5 km/h, times that at 20", "3.7", growth, "steering at 5 km/h, times that at 20")
    offsets = [each["offset"] for each in found.values()]
    yield point(4, "distance from the path, std, 5 to 25 km/h", "3.5 … 5.5 cm", offsets, "distance from the path")
    torques = [each["torque_99"] for each in found.values()]
    yield point(4, "torque, 99 %, 5 to 25 km/h", "–", torques, "torque, 99 %")
    late = [each.visual_delay for each in PILOTS.values()]
    yield point(4, "delay of the eyes", "0 s", late, "delay of the eyes")
    for fidelity, all_rides in (("full", full), ("lumped", lumped)):
        ended = [100.0 * each["upright"] for found in all_rides.values() for each in found]
        yield point(4, f"{len(ended)} rides upright, {fidelity}", "100 %", [float(np.mean(ended))], "upright")


def sensors(study: Study, full: Rides, lumped: Rides) -> Iterator[dict[str, Any]]:
    """Points 5 to 9: drift, forces over the interval, field, clock, load cells of a lumped rider."""
    floors = allan_floors()
    for kind, before, unit in (("gyroscope", "0.4 … 11.8 °/h", "°/h"), ("accelerometer", "–", "µg")):
        drift = {str(each["name"]): float(each[kind]) for each in floors}
        claim = f"Allan deviation of all devices at 1000 s, {kind}, {unit}"
        yield point(5, claim, before, drift, f"{kind} Allan deviation")
    apart = [float(study.cached("force interval", probes.force_interval))]
    yield point(6, "load cells at 50 Hz against their mean of 20 ms over bumps, rms", "50 N", apart, "force sample")
    groups = ("laboratory", "fixed-magnets", "attached-magnet")
    spreads = [value for name in groups for value in study.cached(f"field {name}", probes.field_spread, name)]
    yield point(7, "standard deviation of the field's magnitude", "0 µT", spreads, "field")
    least, most, lossy = study.cached("delays", probes.delays)
    yield point(8, "delay of late devices", "0 ms", [least, most], "delay")
    yield point(8, "share of devices that lose packets", "0", [lossy], "packets")
    means = {}
    for name in full:
        places = [float(np.mean([each["along_mean"] for each in kind[name]])) for kind in (full, lumped)]
        means[name] = abs(places[0] - places[1])
    claim = "mean centre of pressure of lumped riders, along, from that of full ones"
    yield point(9, claim, "113 mm", means, "centre of pressure, full and lumped")


def hands(study: Study, episodes: int) -> Iterator[dict[str, Any]]:
    """Points 10 and 11: an arm that makes a difference, hands that shake."""
    apart = [float(study.cached("arm", probes.arm_apart))]
    claim = f"an arm pulls the device off its gesture, rms ({probes.default_drive()} by default)"
    yield point(10, claim, "3e-12 mm (dynamic by default)", apart, "arm")
    width = 0.45 * BROAD_RATE
    made = recipe("hand-held")
    found = simulated_summaries(study, made, episodes, ["imu"], [width], BROAD_RATE)["imu"]
    for claim, before, statistic, target in (
        ("99 % of the power of a hand's acceleration below", "1.4 … 5.6 Hz", "acc_f99", "fast hands"),
        ("share of that power above 10 Hz", "≤ 0.02 %", "acc_above_10", "power above 10 Hz"),
    ):
        yield point(11, claim, before, [each.statistics[width][statistic] for each in found], target)


def orders(study: Study, episodes: int, groups: Sequence[Recorded]) -> Iterator[dict[str, Any]]:
    """Point 11, where there are recordings: estimators have the same order on them and on the recipe."""
    for group in groups:
        found = ranked(study, episodes, group)
        if found is not None:
            before = f"{TAU_BEFORE[group.group]}" if group.group in TAU_BEFORE else "–"
            claim = f"order of {len(found.names)} estimators on {group.group} and its recipe, Kendall's τ"
            yield point(11, claim, before, [found.tau], "order")


def riding(study: Study, full: Rides) -> Iterator[dict[str, Any]]:
    """Points 12 and 13: one time 0, and all that riders do."""
    apart = [float(study.cached("start", probes.start_apart))]
    yield point(12, "place at time 0 of rides at 50 and 100 Hz", "10 ms apart", apart, "time 0")
    courses, people = study.cached("courses", probes.courses), study.cached("people", probes.people)
    yield point(13, "cadence that riders prefer", "52 … 56 1/min", courses["cadence"], "cadence")
    yield point(13, "share of coasting, commute", "0 %", courses["coasting"], "coasting")
    slowest = [each["slowest"] for each in full["stop-and-go"]]
    yield point(13, "lowest speed, stop-and-go", "never at rest", slowest, "stops")
    yield point(
        13, "hips of a standing rider off the saddle", "never", [study.cached("risen", probes.risen)], "standing"
    )
    yield point(13, "largest force from the side, gusts", "0 N", courses["gust"], "side")
    yield point(13, "bicycles", "1", [float(len(RIDDEN))], "bicycles")
    yield point(13, "mass of random riders", "–", people["mass"], "mass")
    yield point(13, "stature of random riders", "–", people["stature"], "stature")
    yield point(13, "women among them", "–", people["women"][:1], "women")
    wrong = [float(study.cached("placement", probes.misplaced))]
    yield point(13, "sensor on the trunk, from its place, mean", "0 mm", wrong, "placement")


def papers(study: Study) -> Iterator[dict[str, Any]]:
    """Points 14 and 15: what is documented, and a picture."""
    residual = [float(study.cached("gravity", probes.gravity_residual))]
    claim = "ideal accelerometer from what the class docstring says of gravity, shaken hand"
    yield point(14, claim, "0.5 m/s²", residual, "gravity")
    picture = [float(study.cached("picture", probes.fixture_picture))]
    yield point(15, "picture of poise/BicycleFixture-v0, spread of its colours", "refused", picture, "picture")
