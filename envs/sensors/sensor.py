"""One sensor of a suite: kind, mounting, rate and errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...filters.core.quantity import Channel
from .ideal import SAMPLINGS, Mounting, Sampling
from .kinds import SensorKind, sensor_kind
from .noise import FORMS, Form, NoiseModel, NoiseProcess, error_size
from .timing import PUNCTUAL, ClockKey, Timing

FIXED = Mounting()
"""A sensor in the body frame's origin, along its axes."""
Placement = tuple[str, Mounting, Sampling, float, ClockKey | None]
"""Body, mounting, sampling, rate (Hz) and clock: sensors that have them in common see the same motion. The clock is the
site of a device and its timing; None for one that is punctual."""


@dataclass(frozen=True)
class Sensor:
    """A channel with its kind of sensor, mounting, rate and errors.

    Raises:
        ValueError: a field out of its range, or a channel of another size than the kind has.
    """

    channel: Channel
    kind: str | SensorKind
    """a name of :data:`poise.envs.sensors.kinds.KINDS`, or a user-defined kind"""
    rate: float
    """Hz"""
    noise: NoiseModel
    """its full scale must be finite: it bounds the observation"""
    body: str = "body"
    """name of the body on which it is mounted"""
    mounting: Mounting = FIXED
    sampling: Sampling = "interval"
    device: str = ""
    """preset or product, for the record"""
    form: Form = "additive"
    """the error model; vectors have additive errors"""
    units: tuple[float, ...] = ()
    """size of one unit of ``noise`` on each axis of the error, for axes of different units; empty for ones"""
    timing: Timing = PUNCTUAL
    """when samples are taken and lost; sensors of one site share the clock"""

    def __post_init__(self) -> None:
        kind, name, size = self.sensing, self.channel.name, self.channel.size
        if self.sampling not in SAMPLINGS:
            raise ValueError(f"sampling must be one of {list(SAMPLINGS)}, got {self.sampling!r}")
        if not 0.0 < self.rate < math.inf:
            raise ValueError(f"rate of {name!r} must be positive and finite (Hz), got {self.rate}")
        if kind.size is not None and size != kind.size:
            raise ValueError(f"a sample of a {kind.name} has {kind.size} values, but channel {name!r} has {size}")
        if self.form not in FORMS or (self.form != "additive" and kind.vector):
            raise ValueError(f"form must be 'additive', or where no vector is read one of {FORMS}, got {self.form!r}")
        if self.form == "rotation" and size != 4:
            raise ValueError(f"a rotation has 4 values, but channel {name!r} has {size}")
        width = error_size(self.form, size)
        if self.units and not (len(self.units) == width and all(0.0 < unit < math.inf for unit in self.units)):
            raise ValueError(f"units must be {width} positive and finite numbers or none, got {self.units}")

    @property
    def sensing(self) -> SensorKind:
        """The kind itself, where ``kind`` is its name."""
        return sensor_kind(self.kind)

    @property
    def placement(self) -> Placement | None:
        """Key of sensors whose motion is computed together; None if the sensor does not measure its own motion."""
        if not self.sensing.on_body:
            return None
        return self.body, self.mounting, self.sampling, float(self.rate), self.clock

    @property
    def site(self) -> str:
        """The part of the channel's name before the slash: sensors that have it in common are one device."""
        return self.channel.name.partition("/")[0]

    @property
    def clock(self) -> ClockKey | None:
        """Site and timing; None where every sample is punctual."""
        return None if self.timing.punctual else (self.site, self.timing)

    @property
    def limit(self) -> float | np.ndarray:
        """Largest magnitude of a reading, of each axis ``(size,)`` where they differ."""
        if self.form == "rotation":
            return 1.0
        return self.noise.full_scale * np.array(self.units) if self.units else self.noise.full_scale

    def errors(self, generator: np.random.Generator) -> NoiseProcess:
        """Errors of an episode, drawn from ``generator``."""
        return NoiseProcess(self.noise, self.channel.size, self.rate, generator, self.form, self.units)

    @property
    def truth_name(self) -> str:
        """Name of its bias in the truth: ``gyroscope_bias`` at the site ``imu``, else ``<site>/gyroscope_bias``."""
        site, _, rest = self.channel.name.partition("/")
        bias = self.sensing.bias_name
        if not bias:
            return f"{self.channel.name}_bias"
        return bias if site == "imu" and rest else f"{site}/{bias}"

    def describe(self) -> dict[str, Any]:
        """Everything about it, for JSON."""
        return {
            "channel": self.channel.name,
            "size": self.channel.size,
            "unit": self.channel.unit,
            "kind": self.sensing.name,
            "device": self.device,
            "rate": float(self.rate),
            "body": self.body,
            "lever_arm": list(self.mounting.lever_arm),
            "rotation": list(self.mounting.rotation),
            "sampling": self.sampling,
            "noise": self.noise.describe(),
            "form": self.form,
            "units": list(self.units),
            **({} if self.timing.punctual else {"timing": self.timing.describe()}),
        }


def due(rate: float, steps: np.ndarray, step_rate: float) -> np.ndarray:
    """Time steps ``(T,)`` at which a sensor is sampled: those that follow a multiple of its own interval.

    Args:
        rate: of the sensor, Hz.
        steps: counted from 0, when every sensor is due.
        step_rate: time steps per second, Hz, at least ``rate``.

    Returns:
        Indices into ``steps``.
    """
    ratio = rate / step_rate
    # the small number keeps exact ratios exact
    return np.flatnonzero(np.floor(steps * ratio + 1e-9) > np.floor((steps - 1) * ratio + 1e-9))
