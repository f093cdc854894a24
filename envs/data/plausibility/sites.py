"""Sensors of a recording, and their plausible samples."""

from __future__ import annotations

import numpy as np

from ..trajectory import Trajectory
from .readings import plausible_samples


def sites(trajectory: Trajectory) -> list[str]:
    """Mounting locations with an inertial sensor, ``imu`` of ``imu/gyr`` …, in order of appearance."""
    found = (name.rpartition("/") for name in trajectory.measurements)
    return list(dict.fromkeys(site for site, _, kind in found if kind in ("gyr", "acc", "mag") and site))


def vectors(trajectory: Trajectory, channel: str) -> np.ndarray | None:
    """Samples ``(T, 3)`` of a channel of three axes, or None."""
    values = trajectory.measurements.get(channel)
    return values if values is not None and values.shape[1] == 3 else None


def seen(trajectory: Trajectory, channel: str) -> np.ndarray | None:
    """Plausible samples ``(T, 3)`` of a channel, NaN elsewhere; None if it has none."""
    values = vectors(trajectory, channel)
    found = None if values is None else plausible_samples(channel.rpartition("/")[2], values)
    return found if found is not None and np.isfinite(found).all(axis=1).any() else None
