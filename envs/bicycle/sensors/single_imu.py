"""Extraction of one inertial measurement unit of a ride, for filters of a single IMU."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....filters.core import rotation
from ...data.trajectory import Trajectory
from ...sensors.kinds import KINDS

SITES = ("bicycle_imu", "trunk_imu", "head_imu")
"""Sensor sites with a gyroscope and an accelerometer."""


def imu_of(trajectory: Trajectory, site: str = "bicycle_imu") -> Trajectory:
    """Measurements of one IMU of a ride, with the true motion of the sensor.

    Args:
        trajectory: an episode of ``poise/RiderBicycle-v0`` or ``poise/BicycleFixture-v0``, recorded, loaded or
            simulated; its metadata contain the sensor sites.
        site: ``bicycle_imu``, ``trunk_imu`` or ``head_imu``.

    Returns:
        The same samples, mask and metadata (``name`` gets the site appended), with

        * measurements ``imu/gyr`` (rad/s), ``imu/acc`` (m/s²) and, where the site has one, ``imu/mag`` (µT), each
          ``(T, 3)`` in sensor axes, and further channels of the site;
        * truth ``orientation`` ``(T, 4)``, sensor to world: that of the body times the sensor's mounting; ``up``
          ``(T, 3)``, gravity direction (upward) in sensor axes; and where the ride knows them ``angular_rate`` (rad/s,
          sensor axes), ``position`` (m, world, of the sensor), ``gyroscope_bias``, ``accelerometer_bias`` and
          ``magnetometer_bias`` (sensor axes).

    Raises:
        ValueError: an unknown site, or a trajectory that lacks the site's gyroscope or accelerometer, its mounting,
            or the orientation of the body that carries it.
    """
    if site not in SITES:
        raise ValueError(f"site must be one of {list(SITES)}, got {site!r}")
    prefix = f"{site}/"
    measurements = {
        f"imu/{name.removeprefix(prefix)}": values
        for name, values in trajectory.measurements.items()
        if name.startswith(prefix)
    }
    missing = [f"{site}/{kind}" for kind in ("gyr", "acc") if f"imu/{kind}" not in measurements]
    if missing:
        raise ValueError(f"trajectory {trajectory.name!r} lacks the channels {missing}")
    sensor = sensor_at(trajectory, f"{site}/gyr")
    return trajectory.replace(
        measurements=measurements,
        truth=sensor_truth(trajectory.truth, sensor, site, trajectory.name),
        metadata=trajectory.metadata | {"name": f"{trajectory.name}-{site}", "site": site},
    )


def sensor_at(trajectory: Trajectory, channel: str) -> Mapping[str, Any]:
    """The metadata of the sensor behind a channel: its ``body``, ``rotation``, ``lever_arm`` and more.

    Raises:
        ValueError: there are none.
    """
    described = trajectory.metadata.get("sensors") or {}
    for sensor in described.get("sensors", ()):
        if sensor["channel"] == channel:
            return sensor
    raise ValueError(f"the metadata of {trajectory.name!r} hold no mounting of {channel!r}")


def sensor_truth(
    truth: Mapping[str, np.ndarray], sensor: Mapping[str, Any], site: str, name: str
) -> dict[str, np.ndarray]:
    """Truth ``(T, size)`` of the body that carries a sensor of :func:`sensor_at` → truth of the sensor.

    ``name`` is that of the ride, for messages.

    Raises:
        ValueError: the orientation of the body is not known.
    """
    body, axes, lever = sensor["body"], np.array(sensor["rotation"]), np.array(sensor["lever_arm"])
    if f"{body}/orientation" not in truth:
        raise ValueError(f"{name!r} knows no '{body}/orientation', which carries {site!r}")
    carrier = truth[f"{body}/orientation"]
    orientation = rotation.multiply(carrier, axes)
    found = {"orientation": orientation, "up": rotation.up_in_body(orientation)}
    if f"{body}/angular_rate" in truth:
        found["angular_rate"] = rotation.rotate_back(axes, truth[f"{body}/angular_rate"])
    if f"{body}/position" in truth:
        found["position"] = truth[f"{body}/position"] + rotation.rotate(carrier, lever)
    kinds = {f"{site}/{kind.bias_name}": kind.bias_name for kind in KINDS.values() if kind.bias_name}
    for bias, values in truth.items():
        if bias.startswith(f"{site}/") and bias.endswith("_bias"):
            found[kinds.get(bias, f"imu/{bias.removeprefix(f'{site}/')}")] = values
    return found
