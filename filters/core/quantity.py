"""Channels (measured), quantities (estimated) and estimates.

A measurement is a mapping from channel name to array ``(..., size)``. ``NaN`` means: no valid sample at this time step.
Names are ``site/kind`` (``imu/gyr``, ``bicycle_imu/acc``); the axes are those of the sensor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from .backend import Array
from .frames import SequenceTable

if TYPE_CHECKING:
    import pandas

Measurement = Mapping[str, Array]
"""Channel name → array ``(..., size)``; NaN where a channel has no valid sample at this time step."""


GRAVITY = 9.81
"""m/s²: rounded value of gravity in the papers; the default of the filters."""
STANDARD_GRAVITY = 9.80665
"""m/s²: standard gravity g_n (ISO 80000-3), used in calibration and simulation of sensors."""
DEG = math.pi / 180.0
"""rad in a degree."""


LIMITS = {"rad/s": 100.0, "m/s²": 2000.0}
"""Unit → beyond what any sensor of a body that moves measures: 5700 °/s, 200 g."""
LARGEST_NUMBER = 1e8
"""The same for all other units: the field of the earth is 65 000 nT, a converter of 24 bits counts to 1.7·10⁷."""

SHORTEST = 1e-9
"""What no vector with a direction is shorter than, in any unit: the field of the earth is 2·10⁻⁵ T or more."""


@dataclass(frozen=True)
class Channel:
    """A stream of samples: its name, its width and its unit."""

    name: str
    size: int
    unit: str

    @property
    def kind(self) -> str:
        """Last part of the name, such as ``gyr``, ``acc`` or ``mag``."""
        return self.name.rpartition("/")[2]

    @property
    def limit(self) -> float:
        """Largest absolute value that a sensor can have measured; a larger value counts as missing."""
        return LIMITS.get(self.unit, LARGEST_NUMBER)

    @property
    def is_vector(self) -> bool:
        """Whether the numbers are coordinates of one vector or rotation: one without the others counts as missing."""
        return (self.kind in ("gyr", "acc", "mag") and self.size == 3) or self.has_direction

    @property
    def has_direction(self) -> bool:
        """Whether the direction of the vector is used: what is shorter than any has none, and counts as missing."""
        return (self.kind in ("acc", "mag") and self.size == 3) or (self.kind == "orientation" and self.size == 4)


@dataclass(frozen=True)
class Quantity:
    """A quantity that an estimator outputs and that can be compared with a truth.

    The kind decides how an error is formed (:mod:`poise.filters.core.metrics`): ``rotation`` is a unit quaternion
    w, x, y, z (body to world), ``direction`` a unit vector, ``angle`` radians that wrap, ``vector`` anything else.
    """

    name: str
    kind: Literal["rotation", "direction", "angle", "vector"]
    size: int
    unit: str


@dataclass(frozen=True)
class Layout:
    """Layout of the arrays of an :class:`Estimate`.

    Attributes:
        outputs: the quantities of ``pose``.
        error_parts: quantity → (start, stop) of its part of the error state, whose covariance ``covariance`` is; of a
            rotation it is a rotation vector in world axes.
    """

    outputs: tuple[Quantity, ...]
    error_parts: Mapping[str, tuple[int, int]]


class Estimate(NamedTuple):
    """Output of an estimator for one sample, or (time axis first) for a whole sequence.

    Attributes:
        pose: quantity name → array ``(..., size)``; NaN before the estimator could start.
        covariance: ``(..., e, e)`` of the error state, or None where a method has none.
        innovation: ``(..., m)`` whitened innovation (unit variance if the filter is consistent); 0 where a row of the
            measurement was missing; None where a method has none.
        nis: ``(...,)`` normalised innovation squared, the squared length of ``innovation``; 0 without a measurement.
        time: ``(T,)`` s of the samples, if known to :func:`poise.run`.
        layout: of the arrays, if the estimate is from :func:`poise.run`.
    """

    pose: dict[str, Array]
    covariance: Array | None = None
    innovation: Array | None = None
    nis: Array | None = None
    time: Array | None = None
    layout: Layout | None = None

    def __repr__(self) -> str:
        """One line: leading shape of the arrays, quantities, and what there is besides."""
        shape = next((tuple(values.shape[:-1]) for values in self.pose.values()), ())
        others = [name for name in ("covariance", "nis", "time") if getattr(self, name) is not None]
        return f"Estimate(shape {shape}, {', '.join(self.pose)}; with {', '.join(others) or 'no covariance'})"

    def to_frame(self) -> pandas.DataFrame:
        """A table with one row per sample, angles in degrees: see :meth:`.frames.SequenceTable.frame`."""
        kinds = {
            quantity.name: (quantity.kind, quantity.unit) for quantity in (self.layout.outputs if self.layout else ())
        }
        parts = self.layout.error_parts if self.layout else {}
        return SequenceTable(self.pose, self.time, self.covariance, self.nis, kinds, parts).frame()


GYROSCOPE = Channel("imu/gyr", 3, "rad/s")
ACCELEROMETER = Channel("imu/acc", 3, "m/s²")
MAGNETOMETER = Channel("imu/mag", 3, "any")

UP = Quantity("up", "direction", 3, "1")
"""Gravity direction in the sensor frame (inclination vector): a unit vector that points up."""
ORIENTATION = Quantity("orientation", "rotation", 4, "1")
"""Sensor to world (x east, y north, z up)."""
RELATIVE_ORIENTATION = Quantity("relative_orientation", "rotation", 4, "1")
"""Sensor to a level frame of unknown constant heading, as six axes determine it."""
EXTERNAL_ACCELERATION = Quantity("external_acceleration", "vector", 3, "m/s²")
"""Acceleration of the sensor without gravity, in sensor coordinates."""
GYROSCOPE_BIAS = Quantity("gyroscope_bias", "vector", 3, "rad/s")
"""Constant part of the gyroscope's error, sensor coordinates."""
ANGULAR_RATE = Quantity("angular_rate", "vector", 3, "rad/s")
"""Angular velocity of the sensor relative to the world, sensor coordinates."""
