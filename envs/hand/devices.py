"""Hand-held devices with an array of accelerometers, as data: geometry, other sensors, errors, body.

A device of one's own is a :class:`HandDevice`, or a JSON file that describes its array.

Numbers are from P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements",
thesis, Université Laval, where a name says ``paper``. Its standard deviations belong to samples at 100 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from ...filters.arrays.array import CONTROLLER, OCTA, PLANAR, AccelerometerArray, PlanarArray
from ...filters.arrays.files import load_array
from ...filters.arrays.planar.orientation import PLANAR_GYROSCOPE
from ...filters.core import rotation
from ...filters.core.quantity import GRAVITY, GYROSCOPE, Channel
from ...filters.support.parameters import check_positive
from ..sensors.ideal import Mounting, Sampling, vector
from ..sensors.kinds import SensorKind, SiteMotion, sensor_kind
from ..sensors.magnetics import Magnetics
from ..sensors.noise import NoiseModel
from ..sensors.presets import SensorPreset, list_sensor_presets, sensor_preset
from ..sensors.sensor import Sensor
from ..sensors.suite import SensorSuite
from ..sensors.timing import Timings, check_sites, timing_of
from .drivers import Device
from .gestures import GestureConfig

PAPER_RATE = 100.0
"""Hz, of the thesis' simulations."""


def per_sample(std: float, full_scale: float, **others: Any) -> NoiseModel:
    """White noise of a given standard deviation per sample at 100 Hz."""
    return NoiseModel(white_noise=std / math.sqrt(PAPER_RATE), full_scale=full_scale, **others)


@dataclass(frozen=True)
class ArrayPreset(SensorPreset):
    """Errors of a device with an array: noise, and deviations of the array from the nominal one that filters use.

    The accelerometer's noise is that of each uniaxial accelerometer.

    Raises:
        ValueError: a negative or not finite error of the geometry.
    """

    axis_error: float = 0.0
    """standard deviation by which each axis is rotated, about each of two normals, rad"""
    position_error: float = 0.0
    """standard deviation of each coordinate of each position, m"""

    def __post_init__(self) -> None:
        check_positive(self, or_zero=("axis_error", "position_error"))

    def scaled(self, noise_scale: float) -> Self:
        """The same device with errors ``noise_scale`` times as large."""
        larger = {name: noise_scale * getattr(self, name) for name in ("axis_error", "position_error")}
        return replace(super().scaled(noise_scale), **larger)


ARRAY_PRESETS = (
    ArrayPreset(
        "paper-array",
        "thesis, section 5.3: σ_a = 0.1 g, σ_ω = 0.1 rad/s, σ_m 1 % of a field of 50 µT; no range is given",
        per_sample(0.1, 100.0),
        per_sample(0.1 * GRAVITY, 1000.0),
        per_sample(0.5, 1000.0),
    ),
    ArrayPreset(
        "paper-planar",
        "thesis, section 3: σ_a = 0.3 m/s², σ_ω = 0.6 rad/s; no range is given",
        per_sample(0.6, 100.0),
        per_sample(0.3, 1000.0),
        per_sample(0.5, 1000.0),
    ),
    ArrayPreset(
        "array-data-sheet",
        "white noise of 0.022 m/s² per sample (ADXL320 and ADXL345 at 100 Hz), 0.03 °/s/√Hz (L3G4200D), 0.25 µT; "
        "ranges wide enough for shaking",
        NoiseModel(white_noise=math.radians(0.03), full_scale=100.0),
        per_sample(0.022, 1000.0),
        per_sample(0.25, 1000.0),
    ),
    ArrayPreset(
        "array-calibrated",
        "white noise of 0.05 m/s² and what a calibration leaves: bias of 0.1 m/s², axes 0.5°, positions 1 mm (with "
        "which Table 2.1 of the thesis comes out); gyroscope 0.1 °/s and magnetometer 0.3 % likewise (our choice)",
        NoiseModel(white_noise=math.radians(0.03), turn_on_bias=math.radians(0.1), full_scale=100.0),
        per_sample(0.05, 1000.0, turn_on_bias=0.1),
        per_sample(0.25, 1000.0, turn_on_bias=0.15),
        axis_error=math.radians(0.5),
        position_error=1e-3,
    ),
)
"""Errors for devices with an array; those of :mod:`poise.envs.sensors.presets` may be used as well."""


def array_preset(preset: str | SensorPreset) -> SensorPreset:
    """The errors of a name (:data:`ARRAY_PRESETS` or a sensor preset), or a preset itself.

    Raises:
        ValueError: there is none of that name.
    """
    if isinstance(preset, SensorPreset):
        return preset
    known = {one.name: one for one in ARRAY_PRESETS}
    if preset in known:
        return known[preset]
    if preset in list_sensor_presets():
        return sensor_preset(preset)
    raise ValueError(f"sensors must be one of {[*known, *list_sensor_presets()]}, got {preset!r}")


def actual_array(array: AccelerometerArray, preset: SensorPreset, generator: np.random.Generator) -> AccelerometerArray:
    """The array as it is built: with the errors of the geometry of ``preset``, drawn from ``generator``."""
    shift, turn = generator.standard_normal((2, array.size, 3))
    if not isinstance(preset, ArrayPreset) or not (preset.axis_error or preset.position_error):
        return array
    n = array.dimension
    axes = array.e
    if n == 2:
        angle = preset.axis_error * turn[:, :1]
        axes = axes * np.cos(angle) + np.stack([-axes[:, 1], axes[:, 0]], axis=-1) * np.sin(angle)
    else:
        across = turn - np.sum(turn * axes, axis=-1, keepdims=True) * axes
        axes = rotation.rotate(rotation.exp(preset.axis_error * across), axes)
    positions = np.array(array.positions) + preset.position_error * shift[:, :n]
    return type(array)(positions.tolist(), rotation.normalize(axes).tolist(), array.name, array.reference)


@dataclass(frozen=True)
class HandDevice:
    """A device with an array of accelerometers.

    Channels: ``array/acc``; with a gyroscope ``imu/gyr`` (planar devices: ``planar/gyr``, one axis); with a
    magnetometer ``imu/mag``. All sit at the array's reference point, along the axes in which the array is given. A
    planar array makes a planar device: it moves in the vertical plane of east and up, with its x and y axes in it.

    Raises:
        ValueError: an empty name, no array, or a field that is not three finite numbers.
    """

    name: str
    array: AccelerometerArray
    noise: str | SensorPreset = "paper-array"
    """a name of :data:`ARRAY_PRESETS`, of a sensor preset, or a preset"""
    gyroscope: bool = True
    magnetometer: bool = True
    body: Device = field(default_factory=lambda: Device(0.25, (0.04, 0.30, 0.04)))
    """mass and size of the box that the hand moves with ``drive="dynamic"``, centred in the reference point"""
    magnetic_field: tuple[float, ...] | None = None
    """in the world (east, north, up), µT; None for that of :func:`poise.envs.sensors.ideal.magnetic_field`"""

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("name of a device must not be empty")
        if not isinstance(self.array, AccelerometerArray):
            raise ValueError(f"array must be an AccelerometerArray, got {self.array!r}")
        array_preset(self.noise)
        if self.magnetic_field is not None:
            object.__setattr__(self, "magnetic_field", vector("magnetic_field", self.magnetic_field, 3))

    @property
    def planar(self) -> bool:
        """Whether the device moves in the vertical plane."""
        return isinstance(self.array, PlanarArray)

    def describe(self) -> dict[str, Any]:
        """Everything about it but the errors, for JSON."""
        return {
            "name": self.name,
            "array": self.array.describe(),
            "noise": array_preset(self.noise).name,
            "gyroscope": self.gyroscope,
            "magnetometer": self.magnetometer,
        }


OCTA_BODY = Device(0.4, (0.25, 0.25, 0.25))

DEVICES: Mapping[str, HandDevice] = MappingProxyType(
    {
        device.name: device
        for device in (
            HandDevice("controller", CONTROLLER),
            HandDevice("octa", OCTA, gyroscope=False, body=OCTA_BODY),
            HandDevice("octa-gyroscope", OCTA, body=OCTA_BODY),
            HandDevice("planar", PLANAR, "paper-planar", magnetometer=False),
        )
    }
)
"""Name → device; ``imu`` is not a device of this kind."""


def hand_device(device: str | Path | HandDevice) -> HandDevice | None:
    """The device of a name, or of a JSON file that describes its array; None for ``imu``.

    Raises:
        ValueError: unknown name, no such file, or a file that describes no array.
    """
    if isinstance(device, HandDevice):
        return device
    if device == "imu":
        return None
    if device in DEVICES:
        return DEVICES[str(device)]
    if not isinstance(device, str | Path) or not Path(device).is_file():
        raise ValueError(
            f"device must be imu, {', '.join(DEVICES)}, a JSON file of an array or a HandDevice, got {device!r}"
        )
    array = load_array(device)
    return HandDevice(array.name, array, "paper-planar" if array.dimension == 2 else "paper-array")


def array_reading(motion: SiteMotion) -> np.ndarray:
    """Ideal readings ``(n, m)`` of m uniaxial accelerometers, each along its own path, without linearisation.

    Args:
        motion: of the array's reference point; its surroundings are the array as it is built. The accelerometers of a
            planar one lie in the x-y plane.
    """
    array: AccelerometerArray = motion.surroundings
    positions, axes = array.spatial.r, array.spatial.e
    readings = np.empty((len(motion.now.position), array.size))
    for position in np.unique(positions, axis=0):
        members = np.flatnonzero((positions == position).all(axis=1))
        force = motion.moved(Mounting(tuple(position.tolist()))).specific_force
        readings[-len(force) :, members] = force @ axes[members].T
    return readings[-len(force) :]


ARRAY = SensorKind("accelerometer-array", None, "m/s²", "acc", array_reading, 1000.0)
"""Uniaxial accelerometers of one array; the surroundings are the array as it is built."""
PLANAR_RATE = SensorKind("planar-gyroscope", 1, "rad/s", "gyr", lambda motion: motion.angular_rate[..., 2:], 100.0)
"""A gyroscope about the z axis of a planar device."""


def device_suite(
    device: HandDevice,
    sensors: str | SensorPreset | SensorSuite | None = None,
    rate: float | None = None,
    magnetometer: bool | float | None = None,
    sampling: Sampling = "instant",
    timing: Timings | None = None,
    magnetics: str | Magnetics | None = None,
) -> SensorSuite:
    """The sensors of a device.

    Args:
        device: which.
        sensors: their errors; None for those of the device.
        rate: Hz; None for 100.
        magnetometer: False, True or its rate in Hz; None for what the device has.
        sampling: ``instant`` or ``interval``.
        timing: of all sensors or for each site (``imu``, ``array``, ``planar``), or a name of :data:`.TIMINGS`; None
            for that of the errors.
        magnetics: disturbances of the field, or their name (:data:`.MAGNETICS`); None for none.

    Raises:
        ValueError: ``sensors`` is a whole suite, or a magnetometer is wanted whose errors the preset does not know.
    """
    if isinstance(sensors, SensorSuite):
        raise ValueError(f"sensors must be errors (a preset) for the device {device.name!r}, not a whole suite")
    preset, rate = array_preset(device.noise if sensors is None else sensors), 100.0 if rate is None else rate

    def sensor(channel: Channel, kind: str | SensorKind, noise: NoiseModel, its_rate: float) -> Sensor:
        late = preset.timing if timing is None else timing_of(timing, channel.name.split("/")[0])
        return Sensor(channel, kind, its_rate, noise, sampling=sampling, device=preset.name, timing=late)

    chosen = [sensor(device.array.channel, ARRAY, replace(preset.accelerometer, g_sensitivity=0.0), rate)]
    if device.gyroscope and device.planar:
        chosen.append(sensor(PLANAR_GYROSCOPE, PLANAR_RATE, replace(preset.gyroscope, g_sensitivity=0.0), rate))
    elif device.gyroscope:
        chosen.append(sensor(GYROSCOPE, "gyroscope", preset.gyroscope, rate))
    wanted = device.magnetometer if magnetometer is None else magnetometer
    if wanted is not False:
        if preset.magnetometer is None:
            raise ValueError(f"magnetometer must be False: the preset {preset.name!r} has none")
        its_rate = rate if wanted is True else float(wanted)
        chosen.append(sensor(Channel("imu/mag", 3, "µT"), "magnetometer", preset.magnetometer, its_rate))
    for name, noise in preset.others.items():
        kind = sensor_kind(name)
        chosen.append(sensor(Channel(f"imu/{kind.suffix}", kind.size or 1, kind.unit), kind, noise, rate))
    check_sites(timing, {one.site for one in chosen})
    return SensorSuite(chosen, rate, field=device.magnetic_field, magnetics=magnetics)


def check_planar(device: HandDevice, config: GestureConfig, mounting: Mounting) -> None:
    """Check that a planar device stays in its plane.

    Raises:
        ValueError: a spatial gesture, or rotated axes.
    """
    if not device.planar:
        return
    if not getattr(config, "planar", False):
        raise ValueError(
            f"gesture of the planar device {device.name!r} must stay in the vertical plane "
            f"(planar-walk, infinity, or a configuration with planar = True), got {config!r}"
        )
    if mounting.rotation != (1.0, 0.0, 0.0, 0.0):
        raise ValueError(f"mounting of the planar device {device.name!r} must be the identity, got {mounting.rotation}")
