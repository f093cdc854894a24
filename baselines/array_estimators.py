"""Filters for accelerometer arrays are told the array that a recording was made with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ..envs.data.trajectory import Trajectory
from ..filters.arrays.files import read_array
from ..filters.registry import Entry


def array_parameters(entry: Entry, trajectory: Trajectory) -> dict[str, Any]:
    """What an entry of the catalogue is told of the device in ``metadata["device"]``; empty where there is none.

    ``array``, if the equations have such a field that the entry leaves open, and ``gyroscope``: whether there is one.
    """
    device = trajectory.metadata.get("device")
    # recordings of one IMU may name their sensor here
    described = device.get("array") if isinstance(device, Mapping) else None
    own = {item.name for item in fields(entry.load()) if item.init} - set(entry.fixed)
    if described is None or "array" not in own:
        return {}
    told: dict[str, Any] = {"array": read_array(described)}
    if "gyroscope" in own:
        told["gyroscope"] = "imu/gyr" in trajectory.measurements
    return told
