"""What the sensors of a device with an array of accelerometers read, and what is true of it besides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...filters.arrays.array import AccelerometerArray
from ...filters.arrays.planar.orientation import PLANAR_GYROSCOPE
from ...filters.core import rotation
from ...filters.core.quantity import GYROSCOPE, Channel
from ..sensors.ideal import BodyState, Mounting, Sampling, mounted
from ..sensors.presets import SensorPreset
from ..sensors.sensor import Sensor
from ..sensors.suite import SensorSuite
from .devices import HandDevice, array_preset
from .gestures import GestureConfig
from .planar_motion import planar_angle

Force = Callable[[BodyState, BodyState, BodyState], np.ndarray]
"""States now, earlier, and the last one of the block before → specific force ``(n, 3)`` in sensor axes."""


def device_suite(
    device: HandDevice,
    sensors: str | SensorPreset | SensorSuite | None = None,
    rate: float | None = None,
    magnetometer: bool | float | None = None,
    sampling: Sampling = "instant",
) -> SensorSuite:
    """The sensors of a device.

    Args:
        device: which.
        sensors: their errors; None for those of the device.
        rate: Hz; None for 100.
        magnetometer: False, True or its rate in Hz; None for what the device has.
        sampling: ``instant`` or ``interval``.

    Raises:
        ValueError: ``sensors`` is a whole suite, or a magnetometer is wanted whose errors the preset does not know.
    """
    if isinstance(sensors, SensorSuite):
        raise ValueError(f"sensors must be errors (a preset) for the device {device.name!r}, not a whole suite")
    preset, rate = array_preset(device.noise if sensors is None else sensors), 100.0 if rate is None else rate

    def placed(channel: Channel, kind: str, noise: object, its_rate: float) -> Sensor:
        return Sensor(channel, kind, its_rate, noise, sampling=sampling, device=preset.name)  # type: ignore[arg-type]

    chosen = [placed(device.array.channel, "given", replace(preset.accelerometer, g_sensitivity=0.0), rate)]
    if device.gyroscope and device.planar:
        chosen.append(placed(PLANAR_GYROSCOPE, "given", replace(preset.gyroscope, g_sensitivity=0.0), rate))
    elif device.gyroscope:
        chosen.append(placed(GYROSCOPE, "gyroscope", preset.gyroscope, rate))
    wanted = device.magnetometer if magnetometer is None else magnetometer
    if wanted is not False:
        if preset.magnetometer is None:
            raise ValueError(f"magnetometer must be False: the preset {preset.name!r} has none")
        its_rate = rate if wanted is True else float(wanted)
        chosen.append(placed(Channel("imu/mag", 3, "µT"), "magnetometer", preset.magnetometer, its_rate))
    return SensorSuite(chosen, rate, field=device.magnetic_field)


def check_planar(device: HandDevice, config: GestureConfig, mounting: Mounting) -> None:
    """Refuse what would take a planar device out of its plane.

    Raises:
        ValueError: a spatial gesture, or turned axes.
    """
    if not device.planar:
        return
    if not getattr(config, "planar", False):
        raise ValueError(
            f"gesture of the planar device {device.name!r} must stay in the vertical plane "
            f"(planar-walk, infinity, or a configuration with planar = True), got {config!r}"
        )
    if mounting.rotation != (1.0, 0.0, 0.0, 0.0):
        raise ValueError(f"mounting of the planar device {device.name!r} must be no rotation, got {mounting.rotation}")


def array_readings(
    array: AccelerometerArray, states: tuple[BodyState, BodyState, BodyState], force: Force
) -> np.ndarray:
    """Ideal readings ``(n, m)`` of uniaxial accelerometers: each one's own place is moved, nothing is linearised.

    Args:
        array: as it is built; planar ones lie in the x-y plane.
        states: of the reference point: now, earlier, and the last one of the block before.
        force: reading of a triaxial accelerometer.
    """
    padding = ((0, 0), (0, 3 - array.dimension))
    positions, axes = np.pad(array.r, padding), np.pad(array.e, padding)
    readings = np.empty((len(np.atleast_1d(states[0].time)), array.size))
    for place in np.unique(positions, axis=0):
        here = Mounting(tuple(place.tolist()))
        now, earlier, before = (mounted(state, here) for state in states)
        members = np.flatnonzero((positions == place).all(axis=1))
        readings[:, members] = force(now, earlier, before) @ axes[members].T
    return readings


def accelerations(now: BodyState, earlier: BodyState) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration and angular acceleration ``(n, 3)``, world axes; by differences over a physics step if unknown."""
    if now.acceleration is not None and now.angular_acceleration is not None:
        return now.acceleration, now.angular_acceleration
    step = np.asarray(now.time - earlier.time)[:, None]
    return (now.velocity - earlier.velocity) / step, (now.angular_velocity - earlier.angular_velocity) / step


def array_truth(array: AccelerometerArray, now: BodyState, earlier: BodyState) -> dict[str, np.ndarray]:
    """What filters for arrays estimate besides the pose: name → ``(n, size)``."""
    acceleration, turning = accelerations(now, earlier)
    truth = {"acceleration": acceleration, "angular_acceleration": rotation.rotate_back(now.orientation, turning)}
    if array.dimension == 3:
        return truth
    body_rate = rotation.rotate_back(now.orientation, now.angular_velocity)
    plane = [0, 2]
    return truth | {
        "planar/angle": planar_angle(now.orientation)[:, None],
        "planar/angular_rate": body_rate[:, 2:],
        "planar/angular_acceleration": truth["angular_acceleration"][:, 2:],
        "planar/position": now.position[:, plane],
        "planar/velocity": now.velocity[:, plane],
        "planar/acceleration": acceleration[:, plane],
    }
