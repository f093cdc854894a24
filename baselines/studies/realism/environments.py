"""Statistics of simulated motion by gesture and by scenario, each ride or episode computed once a run folder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.gestures import GESTURES
from ....envs.hand.sensing import simulate_hand
from ....filters.core import rotation
from ..kit import Study
from ..rides.saddle import saddle_statistics
from .motion import motion_statistics
from .pedalling import pedalling

LEFT_OUT = ("rest", "planar-walk", "infinity")
"""Gestures without motion, or in a plane only"""
GESTURE_RATE = 200.0
"""Hz"""
GESTURE_TIME = 60.0
"""s"""
BANDWIDTH = 27.0
"""Hz: of rides, 0.45 of the recorded 60 Hz"""
RIDE_RATE = 100.0
"""Hz"""
PLACES = ("trunk_imu", "head_imu", "bicycle_imu")
CHANNELS = (*(f"{site}/{kind}" for site in PLACES for kind in ("gyr", "acc")), "seat/load_cells")
SHOWN = ("gyr_rms", "gyr_f95", "gyr_f99", "gyr_sinusoids", "force_above_2", "force_above_10", "force_f95", "force_jerk")
"""Statistics of rides in a table"""
SHOWN_OF_HANDS = (
    *("gyr_rms", "gyr_f95", "acc_rms", "acc_f95", "acc_f99"),
    *("acc_above_3", "acc_above_10", "acc_jerk", "acc_sinusoids", "slow_velocity"),
)


def gesture_statistics(gesture: str, seed: int) -> dict[str, float]:
    """Motion statistics of one episode of ``poise/HandMotion-v0``, for :meth:`.Study.map`."""
    return motion_statistics(simulate_hand(gesture, seed, "ideal", GESTURE_RATE, GESTURE_TIME, magnetometer=False))


def gestures(study: Study, episodes: int) -> dict[str, dict[str, float]]:
    """Gesture → medians over episodes, of every gesture that moves in space."""
    names = [name for name in GESTURES if name not in LEFT_OUT]
    jobs = [(name, study.seed_of("gesture", name, index)) for name in names for index in range(episodes)]
    found = study.map("gestures", gesture_statistics, jobs)
    return {name: medians(found[episodes * index :][:episodes]) for index, name in enumerate(names)}


def ride_statistics(scenario: str, subject: int, seed: int, duration: float, fidelity: str) -> dict[str, float]:
    """Statistics of one ride of ``duration`` s with ideal sensors on soft tissue, for :meth:`.Study.map`."""
    from ....envs.bicycle.environment import RiderBicycleEnv
    from ....envs.record import record_once

    env = RiderBicycleEnv(
        scenario,
        subject,
        suite=CHANNELS,
        sensors="ideal",
        rate=RIDE_RATE,
        duration=duration,
        fidelity=fidelity,  # type: ignore[arg-type]
        soft_tissue=1.0,
    )
    ride = record_once(env, seed)
    found = {
        f"{site}/{name}": value
        for site in PLACES
        for name, value in motion_statistics(ride, site, bandwidth=BANDWIDTH).items()
    }
    gyr, force = (ride.measurements[f"trunk_imu/{kind}"] for kind in ("gyr", "acc"))
    found |= pedalling(gyr, force, 1.0 / ride.dt, ride.truth["crank/rate"][:, 0])
    return found | saddle_statistics(ride.measurements["seat/load_cells"]) | control_statistics(ride)


def control_statistics(ride: Trajectory) -> dict[str, float]:
    """How busily a ride is steered: mean speed (m/s), standard deviations of steer rate and roll rate (deg/s)."""
    truth = ride.truth
    forward = np.degrees(truth["bicycle/angular_rate"][:, 0])
    return {
        "speed": float(truth["bicycle/speed"].mean()),
        "slowest": float(truth["bicycle/speed"].min()),
        "steer_rate": float(np.degrees(truth["steer/rate"]).std()),
        "roll_rate": float(forward.std()),
        "roll": float(np.degrees(truth["bicycle/roll"]).std()),
        "upright": float(ride.metadata.get("ended") != "terminated"),
        "heading_rate": float(
            np.degrees(rotation.rotate(truth["bicycle/orientation"], truth["bicycle/angular_rate"])[:, 2]).std()
        ),
    }


def rides(
    study: Study, scenarios: Sequence[str], count: int, duration: float = 40.0, fidelity: str = "full"
) -> dict[str, list[dict[str, float]]]:
    """Scenario → statistics of its rides, by riders in turn."""
    jobs = [
        (name, study.subjects[index % len(study.subjects)], study.seed_of("ride", name, index), duration, fidelity)
        for name in scenarios
        for index in range(count)
    ]
    found = study.map(f"rides {fidelity}", ride_statistics, jobs)
    return {name: found[count * index :][:count] for index, name in enumerate(scenarios)}


def medians(found: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Median of each statistic; NaN where no episode knows it."""
    values = {name: np.array([each[name] for each in found], dtype=float) for name in found[0]}
    return {
        name: float(np.median(each[np.isfinite(each)])) if np.isfinite(each).any() else float("nan")
        for name, each in values.items()
    }
