r"""Orientation in a vertical plane without a Kalman filter: integration, tilt, and their minimum-variance mean.

P. He, thesis, Université Laval; sections 3.3.1 to 3.3.3 (see :mod:`.planar.orientation` for frames and symbols).

    integration  φ̃_k = φ̂_{k−1} + ½ Δt (ω_{k−1} + ω_k)
    tilt         φ̄_k = atan2(c̈_x, c̈_y)                                                                     (3.20)
    weighted     φ̂_k = ρ φ̃_k + (1 − ρ) φ̄_k                                                                (3.22)

(3.23) does not give ρ. The errors of φ̃ and φ̄ are independent (b̈ is white, gyroscope and accelerometers are separate
sensors). With their variances P̃ and R, the variance ρ² P̃ + (1 − ρ)² R is smallest for

    ρ = R / (P̃ + R),   P̃_k = P_{k−1} + ½ Δt² σ_ω² (1 + ρ_{k−1}),   P = ρ² P̃ + (1 − ρ)² R

1 + ρ_{k−1} accounts for the error of the last gyroscope sample in φ̂_{k−1}. With 2 in its place (``correlated=False``)
this is the linear Kalman filter of :class:`.PlanarOrientation`. The mean is formed with the wrapped difference φ̄ − φ̃,
because angles (``wrapped=False``, as published) cannot be averaged across half a turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from ...core.backend import Array, expand, namespace
from ...core.held_inputs import HeldInput
from ...core.model import Recurrence
from ...core.quantity import Channel, Measurement
from ...core.rotation import wrap
from .orientation import PLANAR_ANGLE, TURNED_IN_A_PLANE, PlanarEquations

Method = Literal["weighted", "integration", "tilt"]


@dataclass(frozen=True)
class PlanarMean(PlanarEquations, Recurrence):
    """The weighted mean, or integration or tilt alone. State: φ, its variance P, ρ."""

    method: Method = "weighted"
    """which of the three methods"""
    wrapped: bool = True
    """wrap the difference of angles to half a turn"""
    correlated: bool = True
    """account for the error of the last gyroscope sample in the last estimate"""

    state_size: ClassVar[int] = 3

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """Gyroscope and readings of the array; tilt needs no gyroscope."""
        return super().channels[1:] if self.method == "tilt" else super().channels

    @property
    def held_inputs(self) -> tuple[HeldInput, ...]:  # type: ignore[override]
        """The gyroscope; tilt needs none."""
        return () if self.method == "tilt" else (TURNED_IN_A_PLANE,)

    def prior(self, z: Measurement) -> Array:
        """Angle and variance of the start, ρ = 1."""
        angle, variance = self.first(z)
        return namespace(angle).concat([angle, variance, 1.0 + 0.0 * angle], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """φ̃ and P̃; no prediction for tilt."""
        if self.method == "tilt":
            return x
        share = 0.5 * (1.0 + x[..., 2:]) if self.correlated else 1.0
        variance = x[..., 1:2] + expand(self.dt**2 * self.gyroscope_noise**2, 1) * share
        return namespace(x).concat([self.integrated(x, z, previous), variance, x[..., 2:]], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Combine with the tilt angle; without readings keep the prediction."""
        xp, angle, variance = namespace(x), x[..., :1], x[..., 1:2]
        one = 1.0 + 0.0 * angle
        if self.method == "integration":
            return xp.concat([angle, variance, one], axis=-1)
        tilt, R = self.tilt(z), self.tilt_variance(x)
        there = xp.isfinite(tilt)
        difference = xp.where(there, tilt, angle) - angle
        if self.wrapped or self.method == "tilt":
            difference = wrap(difference)
        rho = 0.0 * one if self.method == "tilt" else R / (variance + R)
        rho = xp.where(there, rho, one)
        spread = rho**2 * variance + (1.0 - rho) ** 2 * R
        return xp.concat([angle + (1.0 - rho) * difference, spread, rho], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """The angle, unwrapped."""
        return {PLANAR_ANGLE.name: x[..., :1]}
