"""The published sensor suites of rider and bicycle: channels, devices and rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ....filters.core.quantity import STANDARD_GRAVITY, Channel
from ...sensors.ideal import Mounting, Sampling
from ...sensors.kinds import KINDS, SensorKind
from ...sensors.magnetics import Magnetics, magnetics_of
from ...sensors.noise import NoiseModel
from ...sensors.presets import list_sensor_presets, sensor_preset
from ...sensors.sensor import Sensor
from ...sensors.suite import SensorSuite
from ...sensors.timing import Timings, check_sites, timing_of
from ..frame.parameters import MOUNTAIN_BIKE
from ..rider.anthropometry import RiderBody
from ..rider.posture import SIDES, sit
from . import devices as devices
from . import readings as readings
from .devices import Device
from .sites import SensorSites, sensor_sites

CAMERA_RATE = 16.0
"""Hz (force-inertial and whole-body section II-A)"""
HIGHEST_RATE = 1000.0
"""Hz"""


class BicycleChannel(NamedTuple):
    """Definition of a channel."""

    kind: SensorKind
    body: str
    site: str
    """field of :class:`.SensorSites` with its mounting, or empty"""
    device: Device | None
    """None for the wheel's encoder, whose errors depend on wheel and rate"""

    @property
    def size(self) -> int:
        """Number of values per sample."""
        return self.kind.size or 1


def _inertial(kind: str, body: str, site: str, device: Device) -> BicycleChannel:
    return BicycleChannel(KINDS[kind], body, site, device)


LIMBS = tuple(f"{part}_{side}" for part in ("upper_arm", "thigh") for side in reversed(SIDES))
CHANNELS: dict[str, BicycleChannel] = {
    "bicycle_imu/gyr": _inertial("gyroscope", "bicycle", "bicycle_imu", devices.MODEL_605_GYROSCOPE),
    "bicycle_imu/acc": _inertial("accelerometer", "bicycle", "bicycle_imu", devices.MODEL_605_ACCELEROMETER),
    "trunk_imu/gyr": _inertial("gyroscope", "trunk", "trunk_imu", devices.MODEL_605_GYROSCOPE),
    "trunk_imu/acc": _inertial("accelerometer", "trunk", "trunk_imu", devices.MODEL_605_ACCELEROMETER),
    "head_imu/gyr": _inertial("gyroscope", "head", "head_imu", devices.MODEL_605_GYROSCOPE),
    "head_imu/acc": _inertial("accelerometer", "head", "head_imu", devices.MODEL_605_ACCELEROMETER),
    **{f"{limb}/gyr": _inertial("gyroscope", limb, limb.rsplit("_", 1)[0], devices.SLIM_GYROSCOPE) for limb in LIMBS},
    "seat/wrench": BicycleChannel(readings.SEAT_WRENCH, "bicycle", "seat_sensor", devices.SEAT_WRENCH),
    "seat/load_cells": BicycleChannel(readings.SEAT_LOAD_CELLS, "bicycle", "", devices.LOAD_CELL),
    "handlebar/force": BicycleChannel(readings.HANDLEBAR_FORCE, "bicycle", "", devices.STRAIN_GAUGES),
    "wheel/speed": BicycleChannel(readings.WHEEL_SPEED, "bicycle", "", None),
    "steer/angle": BicycleChannel(readings.STEER_ANGLE, "bicycle", "", devices.ANGLE_ENCODER),
    "crank/angle": BicycleChannel(readings.CRANK_ANGLE, "bicycle", "", devices.ANGLE_ENCODER),
    "relative/orientation": BicycleChannel(readings.RELATIVE_ORIENTATION, "trunk", "", devices.CAMERA_POSE),
    "relative/distances": BicycleChannel(readings.RELATIVE_DISTANCES, "trunk", "", devices.CAMERA_DISTANCES),
    "disk/gyr": _inertial("gyroscope", "disk", "", devices.SLIM_GYROSCOPE),
    "bicycle_imu/mag": _inertial("magnetometer", "bicycle", "bicycle_imu", devices.MAGNETOMETER),
    "trunk_imu/mag": _inertial("magnetometer", "trunk", "trunk_imu", devices.MAGNETOMETER),
}
"""All channels that exist."""

IMUS = ("bicycle_imu/gyr", "bicycle_imu/acc", "trunk_imu/gyr", "trunk_imu/acc")
MAGNETOMETERS = ("bicycle_imu/mag", "trunk_imu/mag")
NOT_PUBLISHED = (*MAGNETOMETERS, "disk/gyr", "head_imu/gyr", "head_imu/acc")
"""Channels that no work on riders has, and ``all`` leaves out"""
SUITES: dict[str, tuple[tuple[str, ...], float]] = {
    "two-gyro": (("bicycle_imu/gyr", "trunk_imu/gyr", "relative/orientation"), 100.0),
    "two-gyro-fixture": (("bicycle_imu/gyr", "disk/gyr", "relative/distances"), 100.0),
    "force-inertial": ((*IMUS, "seat/wrench", "seat/load_cells", "handlebar/force", "wheel/speed"), 50.0),
    "whole-body": (
        (*IMUS, *(f"{limb}/gyr" for limb in LIMBS), "seat/load_cells", "wheel/speed", "steer/angle", "crank/angle"),
        100.0,
    ),
    "all": (tuple(name for name in CHANNELS if name not in NOT_PUBLISHED), 100.0),
}
"""Suite → channels and rate in Hz (force-inertial II-A: 50; whole-body II-A: 100; two-gyro gives none, assumed 100)."""


def list_bicycle_suites() -> list[str]:
    """Names that :func:`rider_bicycle_suite` takes."""
    return list(SUITES)


def suite_channels(name: str | Sequence[str | Sensor]) -> tuple[tuple[str, ...], tuple[Sensor, ...], float]:
    """Channels, user-defined sensors, and rate (Hz) of a named suite or of a list (100 Hz).

    Raises:
        ValueError: an unknown suite or channel, a channel twice, or none.
    """
    if isinstance(name, str):
        if name not in SUITES:
            raise ValueError(f"suite must be one of {list_bicycle_suites()} or a list of channels, got {name!r}")
        return SUITES[name][0], (), SUITES[name][1]
    own = tuple(each for each in name if isinstance(each, Sensor))
    names = tuple(each for each in name if not isinstance(each, Sensor))
    if not (names or own) or len(set(names)) < len(names) or any(each not in CHANNELS for each in names):
        raise ValueError(f"channels must be different ones of {list(CHANNELS)} or Sensors, got {list(names)}")
    return names, own, 100.0


def _device(name: str, channel: BicycleChannel, sensors: str, sites: SensorSites, rate: float) -> Device:
    """The device behind a channel at its rate."""
    device = devices.wheel_encoder(sites.wheel_radius, rate) if channel.device is None else channel.device
    if sensors == "ideal":
        # observations need bounds; those of inertial sensors are generous
        wide = NoiseModel(full_scale=channel.kind.full_scale) if channel.kind.on_body else device.noise
        return replace(device, name="ideal", noise=wide.scaled(0.0), per_sample=0.0)
    if sensors == "paper" or not channel.kind.on_body:
        return device
    preset = sensor_preset(sensors)
    noise = preset.noise_of(channel.kind.name)
    if noise is None:
        raise ValueError(f"sensors must be a device with a {channel.kind.name} for {name!r}, got {sensors!r}")
    return Device(preset.name, preset.source, noise)


def rider_bicycle_suite(
    name: str | Sequence[str | Sensor] = "all",
    sensors: str = "paper",
    rate: float | None = None,
    noise_scale: float = 1.0,
    *,
    sites: SensorSites | None = None,
    placed: Mapping[str, Mounting] | None = None,
    magnetometer: bool = False,
    relative_rate: float | None = None,
    sampling: Sampling = "interval",
    gravity: float = STANDARD_GRAVITY,
    field: Sequence[float] | np.ndarray | None = None,
    timing: Timings | None = None,
    magnetics: str | Magnetics | None = None,
) -> SensorSuite:
    """Sensors of a published suite on one rider and bicycle; its surroundings are :class:`.RideQuantities`.

    Args:
        name: a suite (:func:`list_bicycle_suites`), or a list of channels of :data:`CHANNELS` and of sensors of one's
            own on the bodies that :mod:`.sites` names.
        sensors: ``paper`` for the papers' devices, ``ideal`` for none of their errors, or the name of a device
            (:func:`poise.envs.sensors.presets.list_sensor_presets`) in place of all inertial sensors.
        rate: time steps per second and rate of all sensors but the camera, Hz; None for that of the paper.
        noise_scale: factor on all errors, between 0 (ideal, with the papers' ranges and camera rate) and 1 or beyond.
        sites: see :func:`.sensor_sites`; None for the papers' mean rider on their mountain bike.
        placed: where inertial sensors really are, by site (``trunk_imu``, ``thigh_left``, …); the others are where
            ``sites`` says.
        magnetometer: add magnetometers to the bicycle's IMU, and to the trunk's where the suite has one.
        relative_rate: of the camera, Hz; None for the papers' 16 Hz (or ``rate``, if that is less), and for ``rate``
            with ideal sensors.
        sampling: ``interval`` or ``instant``.
        gravity: m/s².
        field: magnetic field ``(3,)`` in the world (east, north, up), µT; None for a default.
        timing: of all sensors, or for each site (``trunk_imu``, ``relative``, ``seat`` …); a name of
            :data:`.TIMINGS`, a :class:`.Timing`, or None for none of their errors.
        magnetics: disturbances of the field, or their name (:data:`.MAGNETICS`); None for none.

    Raises:
        ValueError: an unknown suite, channel or device, a rate outside (0, 1000] Hz, a camera faster than the rest, or
            a ``noise_scale`` that is negative or not finite.
    """
    names, own, default = suite_channels(name)
    if sensors not in ("paper", "ideal", *list_sensor_presets()):
        raise ValueError(f"sensors must be 'paper' or one of {list_sensor_presets()}, got {sensors!r}")
    steps = default if rate is None else float(rate)
    if not 0.0 < steps <= HIGHEST_RATE:
        raise ValueError(f"rate must lie in (0, {HIGHEST_RATE:g}] Hz, got {rate}")
    if magnetometer:
        sites_there = {each.split("/")[0] for each in names}
        extra = [each for each in MAGNETOMETERS if each.split("/")[0] in sites_there and each not in names]
        names = (*names, *extra)
    slow = steps if sensors == "ideal" else min(CAMERA_RATE, steps)
    slow = slow if relative_rate is None else float(relative_rate)
    if not 0.0 < slow <= steps:
        raise ValueError(f"relative_rate must lie in (0, {steps:g}] Hz, the rate of the suite, got {relative_rate}")
    sites = sensor_sites(sit(MOUNTAIN_BIKE, RiderBody())) if sites is None else sites
    made = [replace(each, noise=each.noise.scaled(noise_scale)) for each in own]
    for each in names:
        channel = CHANNELS[each]
        its_rate = slow if each.startswith("relative/") else steps
        device = _device(each, channel, sensors, sites, its_rate)
        mounting = getattr(sites, channel.site) if channel.site else Mounting()
        mounting = (placed or {}).get(each.split("/")[0], mounting)
        body = sites.seen if each.startswith("relative/") else channel.body
        noise = device.at_rate(its_rate).scaled(noise_scale)
        signal = Channel(each, channel.size, channel.kind.unit)
        late = timing_of(timing, each.split("/")[0]).scaled(noise_scale)
        made.append(
            Sensor(
                signal,
                channel.kind,
                its_rate,
                noise,
                body,
                mounting,
                sampling,
                device.name,
                device.form,
                device.units,
                late,
            )
        )
    # user-defined sensors come last, so that random numbers of the others do not change
    ordered = [*made[len(own) :], *made[: len(own)]]
    check_sites(timing, {sensor.site for sensor in ordered})
    return SensorSuite(
        ordered, steps, gravity=gravity, field=field, magnetics=magnetics_of(magnetics).scaled(noise_scale)
    )
