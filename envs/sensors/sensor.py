"""One sensor of a suite: :class:`Sensor` says what it senses, where, how often and how badly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...filters.core.quantity import Channel
from .error_forms import FORMS, Form, FormedNoise, error_size
from .ideal import SAMPLINGS, BodyState, Mounting, Sampling
from .noise import NoiseProcess
from .noise_model import NoiseModel

Kind = Literal["gyroscope", "accelerometer", "magnetometer", "given"]
"""What an ideal sensor reads; ``given``: the caller says (wheel encoder, force sensor …)."""

FIXED = Mounting()
"""A sensor in the body frame's origin, along its axes."""
WIDTHS = {"gyroscope": 3, "accelerometer": 3, "magnetometer": 3}


@dataclass(frozen=True)
class Sensor:
    """One sensor: a channel, what it senses, where, how often and how badly.

    Raises:
        ValueError: a field out of its range, or a channel of another width than the kind has.
    """

    channel: Channel
    kind: Kind
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
    """how errors meet the reading; other forms are for given readings"""
    units: tuple[float, ...] = ()
    """size of one unit of ``noise`` on each axis of the error, for axes of different kinds; empty for ones"""

    def __post_init__(self) -> None:
        if self.kind not in (*WIDTHS, "given"):
            raise ValueError(f"kind must be one of {[*WIDTHS, 'given']}, got {self.kind!r}")
        if self.sampling not in SAMPLINGS:
            raise ValueError(f"sampling must be one of {list(SAMPLINGS)}, got {self.sampling!r}")
        if not 0.0 < self.rate < math.inf:
            raise ValueError(f"rate of {self.channel.name!r} must be positive and finite (Hz), got {self.rate}")
        if self.channel.size != WIDTHS.get(self.kind, self.channel.size):
            raise ValueError(f"a {self.kind} has 3 axes, but channel {self.channel.name!r} has {self.channel.size}")
        if self.form not in FORMS or (self.form != "additive" and self.kind != "given"):
            raise ValueError(f"form must be 'additive', or for a given reading one of {list(FORMS)}, got {self.form!r}")
        if self.form == "rotation" and self.channel.size != 4:
            raise ValueError(f"a rotation has 4 values, but channel {self.channel.name!r} has {self.channel.size}")
        size = error_size(self.form, self.channel.size)
        if self.units and not (len(self.units) == size and all(0.0 < unit < math.inf for unit in self.units)):
            raise ValueError(f"units must be {size} positive and finite numbers or none, got {self.units}")

    @property
    def placement(self) -> tuple[str, Mounting, Sampling, float] | None:
        """What sensors have in common whose readings are computed together; None for a given reading."""
        return None if self.kind == "given" else (self.body, self.mounting, self.sampling, float(self.rate))

    @property
    def limit(self) -> float | np.ndarray:
        """Largest magnitude of a reading, of each axis ``(size,)`` where they differ."""
        if self.form == "rotation":
            return 1.0
        return self.noise.full_scale * np.array(self.units) if self.units else self.noise.full_scale

    def errors(self, generator: np.random.Generator) -> NoiseProcess:
        """Errors of an episode, drawn from ``generator``."""
        size = self.channel.size
        if self.form == "additive" and not self.units:
            return NoiseProcess(self.noise, size, self.rate, generator)
        return FormedNoise(self.noise, size, self.rate, generator, self.form, self.units)

    def due(self, tick: int | np.ndarray, tick_rate: float) -> Any:
        """Whether it is sampled at ``tick`` (a number or ``(T,)``): whether its own clock struck since the tick before.

        Args:
            tick: counted from 0, when every sensor is due.
            tick_rate: ticks a second, Hz, at least ``rate``.
        """
        ratio = self.rate / tick_rate
        # the small number keeps exact ratios exact
        return np.floor(tick * ratio + 1e-9) > np.floor((tick - 1) * ratio + 1e-9)

    @property
    def truth_name(self) -> str:
        """Name of its bias in the truth: ``gyroscope_bias`` at the place ``imu``, else ``<place>/gyroscope_bias``."""
        place, _, rest = self.channel.name.partition("/")
        if self.kind == "given":
            return f"{self.channel.name}_bias"
        return f"{self.kind}_bias" if place == "imu" and rest else f"{place}/{self.kind}_bias"

    def describe(self) -> dict[str, Any]:
        """Everything about it, for JSON."""
        return {
            "channel": self.channel.name,
            "size": self.channel.size,
            "unit": self.channel.unit,
            "kind": self.kind,
            "device": self.device,
            "rate": float(self.rate),
            "body": self.body,
            "lever_arm": list(self.mounting.lever_arm),
            "rotation": list(self.mounting.rotation),
            "sampling": self.sampling,
            "noise": self.noise.describe(),
            "form": self.form,
            "units": list(self.units),
        }


def pick(bodies: BodyState | Mapping[str, BodyState], name: str) -> BodyState:
    """The state of the body ``name``.

    Raises:
        ValueError: there is none.
    """
    if isinstance(bodies, BodyState):
        return bodies
    if name not in bodies:
        raise ValueError(f"bodies must hold {name!r}, got {sorted(bodies)}")
    return bodies[name]
