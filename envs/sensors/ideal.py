"""What ideal sensors on a moving body read: gyroscope, accelerometer, magnetometer.

Everything is written over leading dimensions: one state of an environment ``(3,)`` and a whole motion ``(T, 3)`` go
through the same lines. :func:`mounted` carries the state of a body to the site and axes of a sensor; the readings are
functions of that. Positions are never differenced; the only difference is one of velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ...filters.core import rotation
from ...filters.core.quantity import STANDARD_GRAVITY

Sampling = Literal["interval", "instant"]
"""``interval``: delta angle and delta velocity over the sampling interval, divided by its length.
``instant``: the values at the end of the interval."""

SAMPLINGS: tuple[Sampling, ...] = ("interval", "instant")

NO_ACCELERATION = (
    "instant readings need the acceleration (and, with a lever arm, the angular acceleration) or the state one physics "
    "step before, got neither"
)


class BodyState(NamedTuple):
    """Motion of a frame at one time, or (time axis first) along a motion. World axes: east, north, up.

    Attributes:
        time: ``(...)`` s.
        position: ``(..., 3)`` m, world.
        orientation: ``(..., 4)`` unit quaternion w, x, y, z, frame to world.
        velocity: ``(..., 3)`` m/s of the frame's origin, world axes.
        angular_velocity: ``(..., 3)`` rad/s, world axes.
        acceleration: ``(..., 3)`` m/s² of the frame's origin, world axes; None where unknown.
        angular_acceleration: ``(..., 3)`` rad/s², world axes; None where unknown.
    """

    time: float | np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray | None = None
    angular_acceleration: np.ndarray | None = None

    def at(self, index: int | slice | np.ndarray) -> BodyState:
        """The state (or states) at ``index`` of the time axis."""
        known = {name: np.asarray(field)[index] for name, field in self._asdict().items() if field is not None}
        return BodyState(**known)


@dataclass(frozen=True)
class Mounting:
    """Where a sensor sits on its body.

    Attributes:
        lever_arm: ``(3,)`` m, from the body frame's origin to the sensor, body axes.
        rotation: ``(4,)`` unit quaternion w, x, y, z, sensor axes to body axes.

    Raises:
        ValueError: a wrong length, a number that is not finite, or a quaternion whose length is not 1 within 1e-6.
    """

    lever_arm: tuple[float, ...] = (0.0, 0.0, 0.0)
    rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "lever_arm", vector("lever_arm", self.lever_arm, 3))
        object.__setattr__(self, "rotation", vector("rotation", self.rotation, 4))
        length = float(np.linalg.norm(self.rotation))
        if abs(length - 1.0) > 1e-6:
            raise ValueError(
                f"rotation must be a unit quaternion (w, x, y, z), got {self.rotation} of length {length:g}"
            )


def vector(name: str, value: Sequence[float] | np.ndarray, size: int) -> tuple[float, ...]:
    """Return ``value`` as a tuple of ``size`` finite floats.

    Raises:
        ValueError: it is not that; the message names the argument.
    """
    array = np.asarray(value, dtype=float)
    if array.shape != (size,) or not np.all(np.isfinite(array)):
        raise ValueError(f"{name} must hold {size} finite numbers, got {value!r}")
    return tuple(array.tolist())


def mounted(body: BodyState, mounting: Mounting) -> BodyState:
    """Motion of a sensor with a lever arm and rotation on a moving body.

    It is r + Rl, v + ω × Rl and, where both accelerations are known, a + α × Rl + ω × (ω × Rl).
    """
    orientation = body.orientation
    if mounting.rotation != (1.0, 0.0, 0.0, 0.0):
        orientation = rotation.multiply(orientation, np.array(mounting.rotation))
    if not any(mounting.lever_arm):
        return body._replace(orientation=orientation)
    lever = rotation.rotate(body.orientation, np.array(mounting.lever_arm))
    swing = rotation.cross(body.angular_velocity, lever)
    acceleration = None
    if body.acceleration is not None and body.angular_acceleration is not None:
        tangential = rotation.cross(body.angular_acceleration, lever)
        acceleration = body.acceleration + tangential + rotation.cross(body.angular_velocity, swing)
    return BodyState(
        body.time,
        body.position + lever,
        orientation,
        body.velocity + swing,
        body.angular_velocity,
        acceleration,
        body.angular_acceleration,
    )


def interval_readings(
    before: BodyState, after: BodyState, gravity: float = STANDARD_GRAVITY
) -> tuple[np.ndarray, np.ndarray]:
    """Gyroscope and accelerometer as means over an interval.

    With Δq = q₀* ⊗ q₁ and the attitude qₘ half way between q₀ and q₁::

        gyr = log(Δq) / Δt,    acc = Rₘᵀ ((v₁ - v₀) / Δt + g ẑ)

    so that q₁ = q₀ ⊗ exp(gyr Δt) and v₁ = v₀ + (Rₘ acc - g ẑ) Δt hold exactly: strapdown
    integration returns the states.

    Args:
        before: state of the sensor at the beginning of the interval.
        after: state at its end; the rotation in between must be less than 180°.
        gravity: m/s².

    Returns:
        Angular rate (rad/s) and specific force (m/s²), both ``(..., 3)`` in sensor axes.

    Raises:
        ValueError: an interval is not positive.
    """
    dt = np.asarray(after.time - before.time)
    if not (dt > 0.0).all():
        raise ValueError(f"after.time must lie after before.time, got an interval of {np.min(dt):g} s")
    rate, middle, acceleration = mean_motion(before, after)
    return rate, rotation.rotate_back(middle, acceleration + np.array((0.0, 0.0, gravity)))


def mean_motion(before: BodyState, after: BodyState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angular rate (own axes), attitude half way, and mean acceleration (world axes) of :func:`interval_readings`."""
    dt = np.asarray(after.time - before.time)[..., None]
    increment = rotation.multiply(rotation.conjugate(before.orientation), after.orientation)
    # q and -q are one attitude: the half-way point needs the two ends on the same side
    end = np.where(increment[..., :1] < 0.0, -after.orientation, after.orientation)
    middle = rotation.normalize(before.orientation + end)
    with np.errstate(divide="ignore", invalid="ignore"):
        # half a turn exactly: the logarithm takes the right branch in spite of the division
        rate = rotation.log(increment) / dt
    return rate, middle, (after.velocity - before.velocity) / dt


def instant_readings(
    state: BodyState, before: BodyState | None = None, gravity: float = STANDARD_GRAVITY
) -> tuple[np.ndarray, np.ndarray]:
    """Gyroscope and accelerometer at one instant.

    Args:
        state: state of the sensor at that instant.
        before: state one physics step earlier; needed only where ``state.acceleration`` is unknown. The specific force
            then belongs to the middle of that step, half a physics step before ``state.time``.
        gravity: m/s².

    Returns:
        Angular rate (rad/s) and specific force (m/s²), both ``(..., 3)`` in sensor axes.

    Raises:
        ValueError: neither the acceleration nor an earlier state is known, or the step is not positive.
    """
    rate = rotation.rotate_back(state.orientation, state.angular_velocity)
    if state.acceleration is not None:
        force = state.acceleration + np.array((0.0, 0.0, gravity))
        return rate, rotation.rotate_back(state.orientation, force)
    if before is None:
        raise ValueError(NO_ACCELERATION)
    return rate, interval_readings(before, state, gravity)[1]


def magnetometer_reading(state: BodyState, field: Sequence[float] | np.ndarray) -> np.ndarray:
    """Magnetic field in sensor axes ``(..., 3)``, in the unit of ``field``.

    Args:
        state: state of the sensor.
        field: ``(3,)`` or ``(..., 3)`` field in the world (east, north, up), see :func:`magnetic_field`.
    """
    return rotation.rotate_back(state.orientation, np.asarray(field, dtype=float))


def magnetic_field(strength: float = 50.0, dip_deg: float = 65.0, declination_deg: float = 0.0) -> np.ndarray:
    """The Earth's magnetic field in world axes (east, north, up), ``(3,)``.

    The defaults are round figures for central Europe, except the declination: with zero, north is magnetic north.

    Args:
        strength: total intensity, µT.
        dip_deg: inclination below the horizontal, degrees in [-90, 90].
        declination_deg: magnetic north east of true north, degrees in [-180, 180].

    Raises:
        ValueError: a value out of its range.
    """
    if not (strength > 0.0 and np.isfinite(strength)):
        raise ValueError(f"strength must be positive and finite (µT), got {strength}")
    if not abs(dip_deg) <= 90.0:
        raise ValueError(f"dip_deg must lie in [-90, 90], got {dip_deg}")
    if not abs(declination_deg) <= 180.0:
        raise ValueError(f"declination_deg must lie in [-180, 180], got {declination_deg}")
    dip, declination = np.deg2rad(dip_deg), np.deg2rad(declination_deg)
    level = np.cos(dip)
    return strength * np.array([level * np.sin(declination), level * np.cos(declination), -np.sin(dip)])
