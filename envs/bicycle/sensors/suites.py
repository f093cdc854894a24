"""What the papers mount where on rider and bicycle: places, axes, rates; sensor suites named after the papers.

Sensor axes are x forward, y left, z up along the body that carries them (the papers' point down or to the right: signs
change, nothing else). Bodies and frames, as the environment must name them: ``bicycle`` (rear frame; origin on the
ground under the rear hub), ``trunk`` (origin in the lumbar joint, z up the trunk), ``upper_arm_left``,
``upper_arm_right``, ``thigh_left``, ``thigh_right`` (origin in the proximal joint, z from the distal joint to it).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ....filters.core.quantity import Channel
from ...sensors.ideal import STANDARD_GRAVITY, Mounting, Sampling
from ...sensors.presets import list_sensor_presets, sensor_preset
from ...sensors.sensor import Kind, Sensor
from ...sensors.suite import SensorSuite
from ..frame.parameters import MOUNTAIN_BIKE, Vector3
from ..ride.contact_forces import LoadCells
from ..rider.anthropometry import RiderBody
from ..rider.posture import SIDES, Posture, sit
from . import devices as devices
from .devices import DEG, Device

BICYCLE_IMU_PLACE, BICYCLE_IMU_TILT = (0.37, 0.0, 0.71), 10.0 * DEG
"""m ahead of the rear contact and above ground, rad nose up: p_x, p_z, α (force-inertial table I; whole-body's ξ)"""
POST_TILT, POST_LENGTH = 20.0 * DEG, 0.13
"""rad, backwards, and m from the saddle down to the six-axis sensor: γ, L1 (force-inertial table I)"""
CAMERA_RATE = 16.0
"""Hz (force-inertial and whole-body section II-A)"""
CAMERA_PLACE = (-0.45, 0.0, 1.45)
"""m in the bicycle frame: on a rod behind the rider; the papers give no numbers, so this is assumed"""
MARKERS = ((-0.02, 0.12, 0.10), (-0.02, -0.12, 0.10), (-0.02, 0.0, -0.12))
"""m from the trunk's IMU, trunk axes: the arms of the T-shaped fixture from T4 to T11; assumed"""
SPREAD_VIEWPOINTS = ((-0.45, 0.35, 1.10), (-0.45, -0.35, 1.10), (0.10, 0.35, 1.90))
"""m in the bicycle frame: three range finders apart from each other, which together see every rotation; assumed"""
HIGHEST_RATE = 1000.0
"""Hz"""


def pitched(angle: float) -> tuple[float, ...]:
    """Mounting of axes that are pitched nose up by ``angle`` (rad): unit quaternion w, x, y, z."""
    return math.cos(0.5 * angle), 0.0, -math.sin(0.5 * angle), 0.0


@dataclass(frozen=True)
class SensorPlaces:
    """Where the sensors sit on one rider and bicycle; lengths in m.

    Raises:
        ValueError: a wheel radius that is not positive, or not three markers and three viewpoints.
    """

    bicycle_imu: Mounting
    trunk_imu: Mounting
    upper_arm: Mounting
    """of both gyroscopes on the upper arms"""
    thigh: Mounting
    """of both gyroscopes on the thighs"""
    saddle: Vector3
    """point S where post and saddle meet, bicycle frame"""
    seat_sensor: Mounting
    """of the six-axis sensor, in the bicycle frame"""
    load_cells: LoadCells
    """relative to the saddle point"""
    wheel_radius: float
    """rolling radius of the rear wheel"""
    markers: tuple[Vector3, Vector3, Vector3]
    """in the frame of the body that the camera sees"""
    viewpoints: tuple[Vector3, Vector3, Vector3]
    """from where the distance of each marker is taken, bicycle frame; three times one point for one camera"""
    seen: str = "trunk"
    """the body that the camera sees"""

    def __post_init__(self) -> None:
        if not 0.0 < self.wheel_radius < math.inf:
            raise ValueError(f"wheel_radius must be positive and finite (m), got {self.wheel_radius}")
        for name in ("markers", "viewpoints"):
            if np.shape(getattr(self, name)) != (3, 3) or not np.all(np.isfinite(getattr(self, name))):
                raise ValueError(f"{name} must be three points (m), got {getattr(self, name)}")

    def describe(self) -> dict[str, Any]:
        """All places, for JSON."""
        return asdict(self)


def sensor_places(
    posture: Posture,
    *,
    viewpoints: Sequence[Vector3] = (CAMERA_PLACE,) * 3,
) -> SensorPlaces:
    """Places on a person fitted to a bicycle.

    Args:
        posture: the person on the bicycle.
        viewpoints: three points of the bicycle frame from which markers are seen. From one point (the papers' camera)
            the distances do not change when the trunk turns about the line from its joint to the camera;
            :data:`SPREAD_VIEWPOINTS` do not have this blind direction.
    """
    bicycle, trunk = posture.bicycle, np.array(posture.trunk_imu)
    down_post = POST_LENGTH * np.array([math.sin(POST_TILT), 0.0, -math.cos(POST_TILT)])
    seat = tuple((np.array(bicycle.saddle) + down_post).tolist())
    return SensorPlaces(
        bicycle_imu=Mounting(BICYCLE_IMU_PLACE, pitched(BICYCLE_IMU_TILT)),
        trunk_imu=Mounting(posture.trunk_imu),
        upper_arm=Mounting((0.0, 0.0, -0.5 * posture.arm.upper)),
        thigh=Mounting((0.0, 0.0, -0.5 * posture.leg.upper)),
        saddle=bicycle.saddle,
        seat_sensor=Mounting(seat, pitched(POST_TILT)),
        load_cells=LoadCells(),
        # our tyre touches the ground with its tread where it is lowest, so it rolls on its unloaded radius
        wheel_radius=bicycle.rear_wheel.radius,
        markers=tuple(tuple((trunk + marker).tolist()) for marker in np.array(MARKERS)),  # type: ignore[arg-type]
        viewpoints=tuple(viewpoints),  # type: ignore[arg-type]
    )


def fixture_places(places: SensorPlaces, centre: Vector3, radius: float = 0.15) -> SensorPlaces:
    """The two-gyro paper's fixture instead of a rider: a turning disk, body ``disk``, seen by a camera above it.

    Args:
        places: those of the bicycle.
        centre: of the disk in the bicycle frame, m; origin of the disk's frame, whose z is its normal.
        radius: at which three markers sit, 120° apart (assumed), m.
    """
    angles = np.radians([90.0, 210.0, 330.0])
    rim = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    camera = tuple(np.add(centre, (-0.35, 0.1, 0.35)).tolist())
    markers = tuple(tuple(marker) for marker in rim.tolist())
    return replace(places, seen="disk", markers=markers, viewpoints=(camera,) * 3)  # type: ignore[arg-type]


class Entry(NamedTuple):
    """One channel of the catalogue."""

    size: int
    unit: str
    kind: Kind
    body: str
    place: str
    """field of :class:`SensorPlaces` with its mounting, or empty"""
    device: Device | None
    """None for the wheel's encoder, whose errors depend on wheel and rate"""


def _gyroscope(body: str, place: str, device: Device) -> Entry:
    return Entry(3, "rad/s", "gyroscope", body, place, device)


LIMBS = tuple(f"{part}_{side}" for part in ("upper_arm", "thigh") for side in reversed(SIDES))
CATALOGUE: dict[str, Entry] = {
    "bicycle_imu/gyr": _gyroscope("bicycle", "bicycle_imu", devices.MODEL_605_GYROSCOPE),
    "bicycle_imu/acc": Entry(3, "m/s²", "accelerometer", "bicycle", "bicycle_imu", devices.MODEL_605_ACCELEROMETER),
    "trunk_imu/gyr": _gyroscope("trunk", "trunk_imu", devices.MODEL_605_GYROSCOPE),
    "trunk_imu/acc": Entry(3, "m/s²", "accelerometer", "trunk", "trunk_imu", devices.MODEL_605_ACCELEROMETER),
    **{f"{limb}/gyr": _gyroscope(limb, limb.rsplit("_", 1)[0], devices.SLIM_GYROSCOPE) for limb in LIMBS},
    "seat/wrench": Entry(6, "N, N·m", "given", "bicycle", "seat_sensor", devices.SEAT_WRENCH),
    "seat/load_cells": Entry(3, "N", "given", "bicycle", "", devices.LOAD_CELL),
    "handlebar/force": Entry(6, "N", "given", "bicycle", "", devices.STRAIN_GAUGES),
    "wheel/speed": Entry(1, "m/s", "given", "bicycle", "", None),
    "steer/angle": Entry(1, "rad", "given", "bicycle", "", devices.ANGLE_ENCODER),
    "crank/angle": Entry(1, "rad", "given", "bicycle", "", devices.ANGLE_ENCODER),
    "relative/orientation": Entry(4, "1", "given", "trunk", "", devices.CAMERA_POSE),
    "relative/distances": Entry(3, "m", "given", "trunk", "", devices.CAMERA_DISTANCES),
    "disk/gyr": _gyroscope("disk", "", devices.SLIM_GYROSCOPE),
    "bicycle_imu/mag": Entry(3, "µT", "magnetometer", "bicycle", "bicycle_imu", devices.MAGNETOMETER),
    "trunk_imu/mag": Entry(3, "µT", "magnetometer", "trunk", "trunk_imu", devices.MAGNETOMETER),
}
"""All channels that exist."""

IMUS = ("bicycle_imu/gyr", "bicycle_imu/acc", "trunk_imu/gyr", "trunk_imu/acc")
MAGNETOMETERS = ("bicycle_imu/mag", "trunk_imu/mag")
SUITES: dict[str, tuple[tuple[str, ...], float]] = {
    "two-gyro": (("bicycle_imu/gyr", "trunk_imu/gyr", "relative/orientation"), 100.0),
    "two-gyro-fixture": (("bicycle_imu/gyr", "disk/gyr", "relative/distances"), 100.0),
    "force-inertial": ((*IMUS, "seat/wrench", "seat/load_cells", "handlebar/force", "wheel/speed"), 50.0),
    "whole-body": (
        (*IMUS, *(f"{limb}/gyr" for limb in LIMBS), "seat/load_cells", "wheel/speed", "steer/angle", "crank/angle"),
        100.0,
    ),
    "all": (tuple(name for name in CATALOGUE if name not in (*MAGNETOMETERS, "disk/gyr")), 100.0),
}
"""Suite → channels and rate in Hz (force-inertial II-A: 50; whole-body II-A: 100; two-gyro gives none, assumed 100)."""


def list_bicycle_suites() -> list[str]:
    """Names that :func:`rider_bicycle_suite` takes."""
    return list(SUITES)


def suite_channels(name: str | Sequence[str]) -> tuple[tuple[str, ...], float]:
    """Channels and rate (Hz) of a named suite, or of a list of channels (100 Hz).

    Raises:
        ValueError: an unknown suite or channel, a channel twice, or none.
    """
    if isinstance(name, str):
        if name not in SUITES:
            raise ValueError(f"name must be one of {list_bicycle_suites()} or a list of channels, got {name!r}")
        return SUITES[name]
    names = tuple(name)
    if not names or len(set(names)) < len(names) or any(each not in CATALOGUE for each in names):
        raise ValueError(f"channels must be different ones of {list(CATALOGUE)}, got {list(names)}")
    return names, 100.0


def _device(name: str, entry: Entry, sensors: str, places: SensorPlaces, rate: float) -> Device:
    """The device behind a channel at its rate."""
    device = devices.wheel_encoder(places.wheel_radius, rate) if entry.device is None else entry.device
    if sensors == "ideal":
        # observations need bounds; those of inertial sensors are generous
        wide = device.noise if entry.kind == "given" else getattr(sensor_preset("ideal"), entry.kind)
        return replace(device, name="ideal", noise=wide.scaled(0.0), per_sample=0.0)
    if sensors == "paper" or entry.kind == "given":
        return device
    preset = sensor_preset(sensors)
    noise = getattr(preset, entry.kind)
    if noise is None:
        raise ValueError(f"sensors must be a device with a {entry.kind} for {name!r}, got {sensors!r}")
    return Device(preset.name, preset.source, noise)


def rider_bicycle_suite(
    name: str | Sequence[str] = "all",
    sensors: str = "paper",
    rate: float | None = None,
    grade: float = 1.0,
    *,
    places: SensorPlaces | None = None,
    magnetometer: bool = False,
    relative_rate: float | None = None,
    sampling: Sampling = "interval",
    gravity: float = STANDARD_GRAVITY,
    field: Sequence[float] | np.ndarray | None = None,
) -> SensorSuite:
    """Sensors of a paper on one rider and bicycle; give its ``given`` channels by ``given_readings``.

    Args:
        name: a suite (:func:`list_bicycle_suites`) or a list of channels of :data:`CATALOGUE`.
        sensors: ``paper`` for the papers' devices, ``ideal`` for none of their errors, or the name of a device
            (:func:`poise.envs.sensors.presets.list_sensor_presets`) in place of all inertial sensors.
        rate: ticks a second and rate of all sensors but the camera, Hz; None for that of the paper.
        grade: all errors times this, between 0 (ideal, with the papers' ranges and camera rate) and 1 or beyond.
        places: where they sit, see :func:`sensor_places`; None for the papers' mean rider on their mountain bike.
        magnetometer: add magnetometers to the bicycle's IMU, and to the trunk's where the suite has one.
        relative_rate: of the camera, Hz; None for the papers' 16 Hz (or ``rate``, if that is less), and for ``rate``
            with ideal sensors.
        sampling: ``interval`` or ``instant``.
        gravity: m/s².
        field: magnetic field ``(3,)`` in the world (east, north, up), µT; None for a default.

    Raises:
        ValueError: an unknown suite, channel or device, a rate outside (0, 1000] Hz, a camera faster than the rest, or
            a grade that is negative or not finite.
    """
    names, default = suite_channels(name)
    if sensors not in ("paper", "ideal", *list_sensor_presets()):
        raise ValueError(f"sensors must be 'paper' or one of {list_sensor_presets()}, got {sensors!r}")
    ticks = default if rate is None else float(rate)
    if not 0.0 < ticks <= HIGHEST_RATE:
        raise ValueError(f"rate must lie in (0, {HIGHEST_RATE:g}] Hz, got {rate}")
    if magnetometer:
        places_there = {each.split("/")[0] for each in names}
        extra = [each for each in MAGNETOMETERS if each.split("/")[0] in places_there and each not in names]
        names = (*names, *extra)
    slow = ticks if sensors == "ideal" else min(CAMERA_RATE, ticks)
    slow = slow if relative_rate is None else float(relative_rate)
    if not 0.0 < slow <= ticks:
        raise ValueError(f"relative_rate must lie in (0, {ticks:g}] Hz, the rate of the suite, got {relative_rate}")
    places = sensor_places(sit(MOUNTAIN_BIKE, RiderBody())) if places is None else places
    made = []
    for each in names:
        entry = CATALOGUE[each]
        its_rate = slow if each.startswith("relative/") else ticks
        device = _device(each, entry, sensors, places, its_rate)
        mounting = getattr(places, entry.place) if entry.place else Mounting()
        channel = Channel(each, entry.size, entry.unit)
        body = places.seen if each.startswith("relative/") else entry.body
        noise = device.at_rate(its_rate).scaled(grade)
        made.append(
            Sensor(
                channel, entry.kind, its_rate, noise, body, mounting, sampling, device.name, device.form, device.units
            )
        )
    return SensorSuite(made, ticks, gravity=gravity, field=field)
