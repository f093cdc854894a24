"""Data sets and estimators of the standard comparison, which ``poise benchmark`` runs."""

from __future__ import annotations

import json
import statistics
from collections.abc import Collection, Sequence
from typing import Any

from ...envs.data.trajectory import REFERENCE_CLOCK, Trajectory
from ...filters.core.estimator import Estimator
from ..registry import list_estimators, make_estimator

GESTURES = ("slow", "fast", "severe", "mixed")
"""Gestures of the simulated part: tests A, B, C of the external-acceleration paper, and changing intensity."""

RIDES = ("outdoor", "slalom", "bumps")
"""Scenarios of the simulated rides."""

DATA_SETS = {"broad": "BROAD", "repoimu": "RepoIMU", "smartphones": "phones", "senslogs": "phones", "euroc": "EuRoC"}
"""Format, or folder of archives, in lower case → data set."""

NORTH = ("BROAD", "simulated hand")
"""Data sets whose truth has its heading from north; that of the others is arbitrary."""

CLOCK_DIFFERS = 5e-4
"""s: median offset of the reference's clock from which a data set is compared on the corrected clock as well."""

HAND_CHANNELS = ("imu/gyr", "imu/acc", "imu/mag")
"""What ``poise/HandMotion-v0`` measures."""

PLAIN_PYTHON = ("ahrs-mahony", "ahrs-mahony-9", "ahrs-ekf", "ahrs-ekf-9")
"""Slow wrapped loops in plain Python, which take minutes on recordings: left out by default."""


def hand_episode(gesture: str, number: int, seed: int, **options: Any) -> list[Trajectory]:
    """One episode of ``poise/HandMotion-v0``, named ``slow-1``; the gesture is ``metadata["group"]``.

    Args:
        gesture: its name.
        number: of the episode among those of the gesture.
        seed: of the episode.
        options: further arguments of the environment.
    """
    import gymnasium

    from ...envs.record import record_once

    trajectory = record_once(gymnasium.make("poise/HandMotion-v0", gesture=gesture, **options), seed)
    return [trajectory.replace(metadata={**trajectory.metadata, "name": f"{gesture}-{number}", "group": gesture})]


def ride_imus(scenario: str, subject: int, seed: int) -> list[Trajectory]:
    """40 s of a scenario of ``poise/RiderBicycle-v0``; the IMUs of bicycle and trunk become separate trajectories."""
    from ...envs.bicycle.environment import RiderBicycleEnv
    from ...envs.bicycle.sensors.single_imu import SITES, imu_of
    from ...envs.record import record_once

    env = RiderBicycleEnv(scenario, subject=subject, suite="whole-body", fidelity="lumped", duration=40.0)
    ride = record_once(env, seed)
    ride = ride.replace(metadata={**ride.metadata, "name": scenario})
    return [imu_of(ride, site) for site in SITES if f"{site}/acc" in ride.measurements]


def dataset_of(trajectory: Trajectory) -> str:
    """The data set that a trajectory belongs to: a benchmark's name, a simulation, or its group or format."""
    metadata = trajectory.metadata
    group, origin = str(metadata.get("group") or ""), metadata.get("environment")
    known = DATA_SETS.get(str(metadata.get("format", "")).lower()) or DATA_SETS.get(group.lower())
    if known is None and origin is not None:
        known = "simulated rides" if "bicycle" in json.dumps(origin).lower() else "simulated hand"
    return known or group or str(metadata.get("format") or "recordings")


def with_other_clocks(trajectories: Sequence[Trajectory]) -> list[Trajectory]:
    """The recordings of data sets whose reference runs on another clock than the gyroscope, by the median offset."""
    offsets: dict[str, list[float]] = {}
    for trajectory in trajectories:
        offset = trajectory.metadata.get(REFERENCE_CLOCK)
        offsets.setdefault(dataset_of(trajectory), []).append(0.0 if offset is None else abs(float(offset)))
    return [one for one in trajectories if statistics.median(offsets[dataset_of(one)]) > CLOCK_DIFFERS]


def groups_of(trajectories: Sequence[Trajectory]) -> dict[str, str]:
    """Trajectory → ``metadata["group"]``, or its own name."""
    return {trajectory.name: str(trajectory.metadata.get("group") or trajectory.name) for trajectory in trajectories}


def contenders(names: Sequence[str] = (), channels: Collection[str] = HAND_CHANNELS) -> dict[str, str | Estimator[Any]]:
    """Label → estimator: those that are named, or all that the data are sufficient for, with all modes of the paper.

    Args:
        names: which ones; empty for all that are installed and read no other channels than those of the data.
        channels: of the data.

    Raises:
        ValueError: an unknown name.
    """
    if names:
        for name in names:
            if name not in list_estimators():
                make_estimator(name)  # raises, with the names that there are
        return {name: name for name in names}
    known = [
        name
        for name, info in list_estimators().items()
        if name not in PLAIN_PYTHON and set(info.channels) <= set(channels) and is_available(name)
    ]
    chosen: dict[str, str | Estimator[Any]] = {name: name for name in known}
    for mode in (2, 3):
        chosen[f"external-acceleration (mode {mode})"] = make_estimator("external-acceleration", mode=mode)
    return chosen


def is_available(name: str) -> bool:
    """Whether an estimator can be made; the package that it wraps may be missing."""
    try:
        make_estimator(name)
    except ImportError:
        return False
    return True
