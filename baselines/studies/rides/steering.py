"""How riders steer: steering, roll, path and torque of rides by speed, and long rides by scenario, rider and skill."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ....envs.bicycle.course.scenarios import Scenario, SpeedProfile, scenario
from ....envs.bicycle.frame.bicycles import BICYCLES
from ....envs.bicycle.frame.tyre import TyreParameters
from ....envs.bicycle.ride.pilot import PILOTS
from ....envs.bicycle.ride.source import RideSource
from ....envs.bicycle.rider.anthropometry import SUBJECTS
from ..kit import Study

RATE, PHYSICS_RATE = 100.0, 500.0
"""Hz: of what is looked at, and of the physics"""
SETTLED = 5.0
"""s after which a ride counts"""
SPEEDS = (5.0, 8.0, 12.0, 16.0, 20.0, 25.0)
"""km/h"""
PERSONS = 10
"""random riders"""
DEFAULT = "skilled"
"""pilot of the five preset riders"""


def level(rng: np.random.Generator, duration: float, speed: float) -> SpeedProfile:
    """One speed (m/s), as :data:`.Factory`."""
    return SpeedProfile(np.array([speed]))


def at_speed(speed: float) -> Scenario:
    """A straight on an even plane at a speed (km/h), as on a treadmill; the rider moves mildly."""
    slow = scenario("slow")
    return replace(slow, name=f"{speed:g} km/h", speed=partial(level, speed=speed / 3.6), surface="smooth")


def steered(
    course: str | float, subject: int | str, pilot: str, seed: int, duration: float, fidelity: str = "lumped"
) -> dict[str, Any]:
    """Steering of one ride of a mountain bicycle, for :meth:`.Study.map`; ``course``: a scenario, or a speed (km/h).

    Returns:
        ``scenario``, ``subject``, ``pilot``, ``upright``, ``seconds`` that were ridden, and after :data:`SETTLED`
        standard deviations of ``steer`` and ``roll`` (deg), ``steer_rate`` and ``roll_rate`` (deg/s) and ``offset``
        from the path (cm), and of the torque's size (N·m) ``torque_99``, its 99th percentile, and ``torque_max``.
    """
    chosen = scenario(course) if isinstance(course, str) else at_speed(course)
    source = RideSource(
        BICYCLES["mountain-bike"],
        None,
        duration,
        RATE,
        PHYSICS_RATE,
        fidelity,  # type: ignore[arg-type]
        TyreParameters(),
        pilot=pilot,
    )
    rows, each = [], round(PHYSICS_RATE / RATE)
    try:
        source.begin(chosen, subject, np.random.default_rng(seed))
        ride = source.ride
        assert ride is not None
        for _ in range(round(RATE * duration)):
            for _ in range(each):
                ride.step()
            if ride.fallen:
                break
            s = ride.state
            # at a stop, with a foot down, the hands just hold the bar
            torque = ride.foot.steer(ride.pilot.command[0], s)
            rows.append((s.steer, s.steer_rate, s.roll, s.roll_rate, ride.pilot.offset, torque))
        upright = not ride.fallen
    finally:
        source.close()
    found = np.array(rows)[min(round(RATE * SETTLED), len(rows) // 2) :]
    names = ("steer", "steer_rate", "roll", "roll_rate")
    deviations = dict(zip(names, np.degrees(found[:, :4].std(axis=0)).tolist(), strict=True))
    torques = np.abs(found[:, 5])
    return (
        {"scenario": chosen.name, "subject": subject, "pilot": pilot, "upright": upright, "seconds": len(rows) / RATE}
        | deviations
        | {"offset": float(100.0 * found[:, 4].std())}
        | {"torque_99": float(np.percentile(torques, 99.0)), "torque_max": float(torques.max())}
    )


def by_speed(study: Study, count: int) -> dict[float, dict[str, float]]:
    """Speed (km/h) → means over ``count`` rides of a minute by the preset riders in turn."""
    jobs = [
        (speed, index % len(SUBJECTS), DEFAULT, study.seed_of("speed", index), 60.0)
        for speed in SPEEDS
        for index in range(count)
    ]
    found = study.map("rides by speed", steered, jobs)
    names = ("steer", "steer_rate", "roll", "roll_rate", "offset", "torque_99")
    return {
        speed: {name: math.fsum(each[name] for each in found[count * index :][:count]) / count for name in names}
        for index, speed in enumerate(SPEEDS)
    }


def long_rides(study: Study, scenarios: Sequence[str], fidelity: str) -> list[dict[str, Any]]:
    """Every scenario with the preset riders, and with random riders of each skill."""
    jobs = []
    for name in scenarios:
        riders: list[tuple[int | str, str, int]] = [
            (subject, DEFAULT, study.seed_of("steered", name, subject)) for subject in study.subjects
        ]
        riders += [
            ("random", pilot, study.seed_of("steered", name, "random", index))
            for index in range(PERSONS)
            for pilot in PILOTS
        ]
        jobs += [(name, subject, pilot, seed, study.duration, fidelity) for subject, pilot, seed in riders]
    found: list[dict[str, Any]] = study.map(f"steered {fidelity}", steered, jobs)
    return found


def steering_rows(found: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """One row a scenario and skill: rides that ended upright, mean steering, the largest torque."""
    pairs = dict.fromkeys((each["scenario"], each["pilot"]) for each in found)
    for name, pilot in pairs:
        mine = [each for each in found if (each["scenario"], each["pilot"]) == (name, pilot)]
        yield {
            "scenario": name,
            "pilot": pilot,
            "upright": f"{sum(each['upright'] for each in mine)}/{len(mine)}",
            "steer std deg": float(np.mean([each["steer"] for each in mine])),
            "roll rate std deg/s": float(np.mean([each["roll_rate"] for each in mine])),
            "path std cm": float(np.mean([each["offset"] for each in mine])),
            "99 % of torque N·m": max(each["torque_99"] for each in mine),
            "largest": max(each["torque_max"] for each in mine),
        }
