r"""Orientation in a vertical plane: common parts of the planar methods, and Kalman filters for the angle alone.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; chapter 3; equation numbers are the thesis'. A controller with four accelerometers and a gyroscope moves in a
plane, x to the right, y up; φ is the counter-clockwise angle of its axes. The array measures the specific force
c̈ = b̈ − Qᵀg in body axes, and the filters model b̈ as white noise:

    φ_k = φ_{k−1} + ½ Δt (ω_{k−1} + ω_k) + e,   var e = Δt² σ_ω²                                            (3.30)
    extended   c̈ = g [sin φ, cos φ]ᵀ + n,   R = σ_b̈² 1 + σ_a² B_P,   H = g [cos φ, −sin φ]ᵀ            (3.31), (3.35)
    linear     atan2(c̈_x, c̈_y) = φ + n,     R = min((σ_b̈² + σ_a²/2)/g², π²/3),   H = 1

π²/3 is the variance of a uniformly distributed angle. As R is a multiple of 1, the covariance of the extended filter
does not depend on the data.

Errata: (3.20), (3.61) have an arctangent of one argument; (3.31) adds b̈ in the wrong axes, which has no effect where
its covariance is a multiple of 1. The linear filter uses the wrapped difference of the angles. ``wrapped=False`` is as
published and fails after the first half-turn, for this reason and not because it is linear.

The acceleration of a hand is not white. σ_b̈ should therefore be about three times its standard deviation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ...core.backend import Array, constant, expand, namespace
from ...core.held_inputs import HeldInput
from ...core.matrices import times
from ...core.model import Gain, Model
from ...core.quantity import GRAVITY, Channel, Measurement, Quantity
from ...core.rotation import wrap
from ..array import PLANAR, AccelerometerArray
from ..files import ArrayEquations

PLANAR_GYROSCOPE = Channel("planar/gyr", 1, "rad/s")
"""Angular rate about the normal of the plane, counter-clockwise."""
PLANAR_ANGLE = Quantity("planar/angle", "angle", 1, "rad")
"""Angle φ of the body's axes relative to x (right) and y (up) of the plane, counter-clockwise."""

UNKNOWN_ANGLE = math.pi**2 / 3.0
"""rad²: variance of a uniformly distributed angle"""

TURNED_IN_A_PLANE = HeldInput(
    PLANAR_GYROSCOPE.name, "gyroscope_noise", power=2, spread=0.1, share=0.7, time=0.075, bound=UNKNOWN_ANGLE
)
"""The rate of a controller in a plane, chosen as that of a hand on the gestures planar-walk and infinity."""


@dataclass(frozen=True)
class PlanarEquations(ArrayEquations):
    """Common parameters and readings of the planar methods.

    Raises:
        ValueError: an unknown start, or an array that is not planar or does not determine the specific force.
    """

    array: AccelerometerArray = PLANAR
    """the accelerometer array"""
    start: Literal["tilt", "known"] = "tilt"
    """where the first angle comes from: the first readings, or ``initial_angle``"""
    initial_angle: float = 0.0
    """φ₀ of a known start, rad"""
    initial_noise: float = 0.1
    """standard deviation of φ₀ of a known start, rad; with the thesis' P₀ = 10³ rad² the first update can
    shift the angle by whole turns"""
    gyroscope_noise: float = 0.6
    """σ_ω, rad/s per sample (section 3.4.1)"""
    accelerometer_noise: float = 0.3
    """σ_a, m/s² per sample (section 3.4.1)"""
    inertial_acceleration: float = 10.0
    """σ_b̈, m/s² per axis: acceleration of the controller, inflated because it is not white"""
    gravity: float = GRAVITY
    """g, m/s²"""

    outputs: ClassVar[tuple[Quantity, ...]] = (PLANAR_ANGLE,)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.array.dimension != 2 or not self.array.determined[:2].all():
            raise ValueError(
                f"array {self.array.name!r} must be planar and determine the specific force, got dimension "
                f"{self.array.dimension}, rank {self.array.rank}"
            )

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """Gyroscope and readings of the array."""
        return (PLANAR_GYROSCOPE, self.array.channel)

    def specific_force(self, z: Measurement) -> Array:
        """c̈ ``(..., 2)``, m/s², body axes."""
        a = z[self.array.channel.name]
        return times(constant(self.array.pseudo_inverse[:2], a), a)

    def tilt(self, z: Measurement) -> Array:
        """φ̄ ``(..., 1)``: the angle if the specific force is gravity alone (3.20)."""
        force = self.specific_force(z)
        return namespace(force).atan2(force[..., :1], force[..., 1:])

    def tilt_variance(self, like: Array) -> Array:
        """Variance of φ̄ ``(..., 1)``, rad²."""
        xp = namespace(like)
        spread = float(np.trace(self.array.B_P[:2, :2])) / 2.0
        variance = expand((self.inertial_acceleration**2 + spread * self.accelerometer_noise**2) / self.gravity**2, 1)
        return xp.minimum(0.0 * like[..., :1] + variance, 0.0 * like[..., :1] + UNKNOWN_ANGLE)

    def first(self, z: Measurement) -> tuple[Array, Array]:
        """φ₀ and its variance ``(..., 1)``; NaN until every channel has had a valid sample."""
        xp = namespace(*z.values())
        spoken = xp.all(xp.isfinite(xp.concat([z[channel.name] for channel in self.channels], axis=-1)), axis=-1)
        angle = self.tilt(z)
        variance = self.tilt_variance(angle)
        if self.start == "known":
            angle = 0.0 * angle + expand(self.initial_angle, 1)
            variance = 0.0 * variance + expand(self.initial_noise**2, 1)
        return xp.where(spoken[..., None], angle, xp.nan), variance

    def integrated(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """φ ``(..., 1)`` one interval later, by the mean of two samples of the gyroscope."""
        name = PLANAR_GYROSCOPE.name
        return x[..., :1] + 0.5 * expand(self.dt, 1) * (previous[name] + z[name])


@dataclass(frozen=True)
class PlanarOrientation(PlanarEquations, Model):
    """Kalman filters on the angle, section 3.3: ``extended`` on the specific force, ``linear`` on the tilt angle."""

    method: Literal["extended", "linear"] = "extended"
    """the measurement: c̈ or its angle"""
    wrapped: bool = True
    """of the linear filter: wrap the difference of angles to half a turn"""

    state_size: ClassVar[int] = 1
    error_size: ClassVar[int] = 1
    held_inputs: ClassVar[tuple[HeldInput, ...]] = (TURNED_IN_A_PLANE,)
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("gyroscope_noise", description="process variance σ_ω²"),
        "measurement": Gain("inertial_acceleration", description="variance σ_b̈² of the inertial acceleration"),
    }

    @property
    def residual_size(self) -> int:  # type: ignore[override]
        """Size of the residual."""
        return 2 if self.method == "extended" else 1

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Angle and variance of the start."""
        angle, variance = self.first(z)
        return angle, variance[..., None]

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Trapezoidal rule (3.30)."""
        F = 1.0 + 0.0 * x[..., None]
        return self.integrated(x, z, previous), F, expand(self.dt**2 * self.gyroscope_noise**2, 2) * F

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """c̈ − g [sin φ, cos φ]ᵀ (3.31), (3.35), or the difference of the angles."""
        xp = namespace(x)
        if self.method == "linear":
            r = self.tilt(z) - x
            return wrap(r) if self.wrapped else r, 1.0 + 0.0 * x[..., None], self.tilt_variance(x)[..., None]
        force, slope = self.expected(x), self.slope(x)
        R = self.force_covariance(x)
        return self.specific_force(z) - force, slope[..., None], R + 0.0 * xp.sum(slope, axis=-1)[..., None, None]

    def expected(self, x: Array) -> Array:
        """h(φ) = g [sin φ, cos φ]ᵀ ``(..., 2)``."""
        xp = namespace(x)
        return expand(self.gravity, 1) * xp.concat([xp.sin(x), xp.cos(x)], axis=-1)

    def slope(self, x: Array) -> Array:
        """dh/dφ ``(..., 2)``."""
        xp = namespace(x)
        return expand(self.gravity, 1) * xp.concat([xp.cos(x), -xp.sin(x)], axis=-1)

    def force_covariance(self, like: Array) -> Array:
        """R = σ_b̈² 1 + σ_a² B_P ``(2, 2)`` (3.34)."""
        unit, noise = constant(np.eye(2), like), constant(self.array.B_P[:2, :2], like)
        return expand(self.inertial_acceleration**2, 2) * unit + expand(self.accelerometer_noise**2, 2) * noise

    def pose(self, x: Array) -> dict[str, Array]:
        """The angle, unwrapped."""
        return {PLANAR_ANGLE.name: x}
