"""Kinds of sensors as data: ideal reading, unit, size and range, in the table :data:`KINDS`.

A further kind is one more entry, or a user-defined :class:`SensorKind`: given to a
:class:`~poise.envs.sensors.sensor.Sensor` directly, or by name after :func:`register_sensor_kind`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...filters.core import rotation
from .ideal import BodyState, Mounting, Sampling, instant_readings, magnetometer_reading, mean_motion, mounted


@dataclass(frozen=True)
class SiteMotion:
    """Motion of a sensor site at n consecutive samples, from which an ideal sensor is computed.

    Attributes:
        now: states ``(n, …)`` of the site at the samples; its axes are those of the sensor.
        path: ``interval``: the same after the sample before the first one, where that is known, without accelerations.
        earlier: ``instant``: states ``(n, …)`` one physics step before each sample; None where accelerations are known.
        sampling: ``interval`` or ``instant``.
        gravity: m/s².
        field: ``(3,)`` the Earth's magnetic field in the world, µT.
        surroundings: further quantities of the environment, for kinds that read them.
        disturbed: states → magnetic field there ``(n, 3)``, µT; None where it is ``field`` everywhere.
    """

    now: BodyState
    path: BodyState
    earlier: BodyState | None
    sampling: Sampling
    gravity: float
    field: tuple[float, ...]
    surroundings: Any = None
    disturbed: Callable[[BodyState], np.ndarray] | None = None

    @property
    def local_field(self) -> np.ndarray:
        """Magnetic field at the sensor, ``(3,)`` or ``(n, 3)``, world axes, µT."""
        return np.array(self.field) if self.disturbed is None else self.disturbed(self.now)

    @cached_property
    def _mean(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angular rate, attitude and mean acceleration over each interval of the path."""
        return mean_motion(self.path.at(slice(None, -1)), self.path.at(slice(1, None)))

    @cached_property
    def angular_rate(self) -> np.ndarray:
        """``(m, 3)`` rad/s, sensor axes; of the last m samples: the first has no interval where nothing came before."""
        if self.sampling == "instant":
            return rotation.rotate_back(self.now.orientation, self.now.angular_velocity)
        return self._mean[0]

    @cached_property
    def specific_force(self) -> np.ndarray:
        """``(m, 3)`` m/s², sensor axes, of the last m samples: what an accelerometer reads."""
        return self._force(self.gravity)

    @cached_property
    def external_acceleration(self) -> np.ndarray:
        """``(m, 3)`` m/s², sensor axes, of the last m samples: what an accelerometer reads without gravity.

        With ``interval`` the reading has gravity in the attitude half way through the interval, see
        :func:`.interval_readings`.
        """
        return self._force(0.0)

    def _force(self, gravity: float) -> np.ndarray:
        if self.sampling == "instant":
            return instant_readings(self.now, self.earlier, gravity)[1]
        _, middle, acceleration = self._mean
        return rotation.rotate_back(middle, acceleration + np.array((0.0, 0.0, gravity)))

    def moved(self, mounting: Mounting) -> SiteMotion:
        """The motion of another site that is rigidly attached to this one."""
        earlier = None if self.earlier is None else mounted(self.earlier, mounting)
        return replace(self, now=mounted(self.now, mounting), path=mounted(self.path, mounting), earlier=earlier)


@dataclass(frozen=True)
class SensorKind:
    """A kind of sensor.

    Raises:
        ValueError: an empty name or suffix, or a size or full scale that is not positive.
    """

    name: str
    size: int | None
    """values a sample; None: as many as the channel has"""
    unit: str
    suffix: str
    """last part of channel names, ``gyr`` of ``imu/gyr``"""
    reading: Callable[[Any], np.ndarray] | None
    """Ideal readings. Of a sensor on a body: :class:`SiteMotion` of n samples → ``(m, size)``, those of the last m of
    them. Otherwise: the environment's surroundings at T time steps → ``(T, size)``. None: the environment hands over
    ``(T, size)`` under the channel's name."""
    full_scale: float = 1000.0
    """largest magnitude of an ideal sensor, in ``unit``: observations need bounds"""
    on_body: bool = True
    """whether it senses the motion of its own site"""
    vector: bool = False
    """whether a reading is a vector in sensor axes: its errors are added to it"""
    bias_name: str = ""
    """name of its bias in the truth, after that of the site; empty: the channel's name and ``_bias``"""
    description: str = ""
    """what an ideal sensor reads, and in which axes"""

    def __post_init__(self) -> None:
        if not (self.name and self.suffix):
            raise ValueError(f"name and suffix of a sensor kind must not be empty, got {self.name!r}, {self.suffix!r}")
        if self.size is not None and self.size < 1:
            raise ValueError(f"size of the sensor kind {self.name!r} must be at least 1, got {self.size}")
        if not 0.0 < self.full_scale < np.inf:
            raise ValueError(
                f"full_scale of the sensor kind {self.name!r} must be positive and finite, got {self.full_scale}"
            )


KINDS: dict[str, SensorKind] = {
    kind.name: kind
    for kind in (
        SensorKind(
            "gyroscope",
            3,
            "rad/s",
            "gyr",
            lambda motion: motion.angular_rate,
            100.0,
            vector=True,
            bias_name="gyroscope_bias",
            description="angular rate, sensor axes",
        ),
        SensorKind(
            "accelerometer",
            3,
            "m/s²",
            "acc",
            lambda motion: motion.specific_force,
            1000.0,
            vector=True,
            bias_name="accelerometer_bias",
            description="specific force, sensor axes: +g on an axis that points up at rest",
        ),
        SensorKind(
            "magnetometer",
            3,
            "µT",
            "mag",
            lambda motion: magnetometer_reading(motion.now, motion.local_field),
            1000.0,
            vector=True,
            bias_name="magnetometer_bias",
            description="magnetic field, sensor axes",
        ),
        SensorKind(
            "given",
            None,
            "",
            "value",
            None,
            on_body=False,
            description="what the environment hands over under the channel's name",
        ),
    )
}
"""Name → kind; ``given``: the environment hands the reading over."""


def register_sensor_kind(kind: SensorKind) -> SensorKind:
    """Register a kind by its name, for sensors and presets.

    Returns:
        The kind.

    Raises:
        ValueError: another kind has this name.
    """
    if KINDS.setdefault(kind.name, kind) != kind:
        raise ValueError(f"there is another sensor kind {kind.name!r}")
    return kind


def sensor_kind(kind: str | SensorKind) -> SensorKind:
    """The kind of a name, or the kind itself.

    Raises:
        ValueError: there is none of that name; the message lists all.
    """
    if isinstance(kind, SensorKind):
        return kind
    if kind not in KINDS:
        raise ValueError(f"kind must be a SensorKind or one of {list(KINDS)}, got {kind!r}")
    return KINDS[kind]
