r"""Attitude and external acceleration from a six-axis inertial sensor.

J. K. Lee, E. J. Park, S. N. Robinovitch, "Estimation of Attitude and External Acceleration Using Inertial Sensor
Measurement During Various Dynamic Conditions", IEEE Transactions on Instrumentation and Measurement 61(8), 2012,
doi 10.1109/TIM.2012.2187245. Equation numbers are the paper's.

The state is Z, the gravity direction in the sensor frame (a unit vector that points up, also called inclination
vector). The accelerometer measures gravity and the external acceleration a,

    y_A = g Z + a + n_A                                                   (6b)
    a_t = c_a a_{t−1} + ε_t                                               (7)

The filter subtracts the predicted a from the measurement. The measurement variance grows with the last estimate of a:

    a⁻ = c_a a⁺_{t−1},   z = y_A − a⁻,   H = g I                          (16–19)
    M = (c_a² ‖a⁺_{t−1}‖² / 3) I + σ_A² I                                 (20–23)

Errata: (31) has a transposed ω̃ that rotates in the wrong direction, (14) has an index k for t, and (4) has a
single-argument arctangent that is 0/0 at zero roll (:func:`poise.filters.core.rotation.roll_pitch` is the well-defined
form). c_a acts as a gain on the covariance rather than as the correlation of (7): under (7) the variance of (23) would
be that of ε, which falls as c_a grows.

Differences from the paper: the first-order rotation (12) loses 1.9 °/s at 10 rad/s and 100 Hz; ``exact_rotation``
replaces it by the exponential. The paper gives no initial state. Here the sensor starts at rest, with Z₀ = y_A/‖y_A‖
and P₀ = 10⁻² I. Samples of a saturated gyroscope count as uncertain; the paper's experiments have none.

A gain policy must not choose c_a freely. A steady tilt error e appears as an acceleration g e. It reduces the
innovation to (1 − c_a) g e and increases the variance M to at least c_a² g² e² / 3. With the steady-state covariance
P = Δt σ_G √M / g of small gains, the resulting correction

    (1 − c_a) g e · Δt σ_G / √M  ≤  Δt · √3 σ_G (1 − c_a) / c_a

does not grow with e. If the gyroscope drifts faster than √3 σ_G (1 − c_a) / c_a, the attitude error grows without
bound. :meth:`ExternalAcceleration.limited` therefore limits c_a so that the filter can follow a drift of
:data:`FOLLOWED_DRIFT` at the σ_G of the same action, and to :data:`LARGEST_C_A` at most.

Heading and gyroscope bias are not estimated. Sustained acceleration cannot be distinguished from tilt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from ..core.backend import Array, constant, expand, namespace
from ..core.held_inputs import HeldInput
from ..core.matrices import times
from ..core.model import Gain, Model
from ..core.quantity import ACCELEROMETER, EXTERNAL_ACCELERATION, GYROSCOPE, UP, Measurement
from ..core.rotation import exp_matrix, norm, normalize, skew
from .strapdown import clipped_inflation

LARGEST_C_A = 0.5
"""Largest c_a that a gain policy can choose; from 0.7 any gyroscope bias can make the error grow without bound."""
SMALLEST_C_A = 1e-3
"""Smallest c_a that a gain policy can choose; practically zero."""
SMALLEST_NOISE, LARGEST_NOISE = 1e-3, 0.3
"""m/s²: least and largest σ_A that a gain policy can choose. Of hand-held devices the best constant is about 0.1."""
FOLLOWED_DRIFT = math.radians(1.0)
"""rad/s: gyroscope error that the filter must be able to follow whatever a gain policy chooses."""


@dataclass(frozen=True)
class ExternalAcceleration(Model):
    """The paper's filter in its three modes.

    * Mode 1: acceleration model, equations (16)–(29).
    * Mode 2: static assumption, M = σ_A² I; the same as mode 1 with c_a = 0.
    * Mode 3: threshold, mode 2 with updates only if | ‖y_A‖ − g | ≤ ε_A held for all of the last n Δt seconds (30).

    State: Z (3), a⁺ (3, remembered), number of samples for which the threshold has held.
    """

    mode: Literal[1, 2, 3] = 1
    """which of the paper's modes"""
    exact_rotation: bool = True
    """propagate by the exponential instead of the first-order rotation (12)"""
    gyroscope_sample: Literal["current", "previous"] = "current"
    """which sample propagates t−1 to t: ``previous`` as published (12), for samples that hold until the next one;
    ``current`` for samples that describe the interval that they end"""
    gyroscope_noise: float = 1e-2
    """σ_G, rad/s per sample (section IV: σ_G² = 10⁻⁴)"""
    accelerometer_noise: float = 1e-2
    """σ_A, m/s² per sample (section IV: σ_A² = 10⁻⁴)"""
    c_a: float = 0.1
    """constant of the acceleration model (7), 0 to 1; the paper uses 0.1"""
    threshold: float = 0.2
    """ε_A of mode 3, m/s²"""
    window: float = 0.04
    """n Δt of mode 3, s: the paper's n = 4 at 100 Hz; kept in seconds at any rate"""
    gravity: float = 9.8
    """g, m/s² (the paper's experiments; its introduction has 9.81)"""
    gyroscope_range: float = 34.8
    """rad/s (1994 °/s): beyond the range the sensor turned, but nobody measured how far"""
    clipped_inflation: float = 1000.0
    """factor on σ_G for saturated samples: they are wrong by some 10 rad/s"""

    channels: ClassVar = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar = (UP, EXTERNAL_ACCELERATION)
    state_size: ClassVar = 7
    error_size: ClassVar = 3
    error_parts: ClassVar = {"up": (0, 3)}
    residual_size: ClassVar = 3
    gains: ClassVar = {
        "process": Gain("gyroscope_noise", description="process variance σ_G²", acted=False),
        "measurement": Gain(
            "accelerometer_noise", description="measurement variance σ_A²", bounds=(SMALLEST_NOISE, LARGEST_NOISE)
        ),
        "c_a": Gain("c_a", 1.0, 1.0, "constant of the acceleration model", (SMALLEST_C_A, LARGEST_C_A), acted=False),
    }

    # A tenth of a hand's: the published covariance is as many times too certain without gaps, and beside it the whole
    # uncertainty of a held rate would hand the estimate to the accelerometer of a moving sensor. Chosen on simulated
    # gestures (mixed, fast, slow; seeds 1 and 2), by the error in the 3 s after gaps of 0.01 to 10 s.
    held_inputs: ClassVar = (HeldInput("imu/gyr", "gyroscope_noise", power=2, spread=0.02, share=0.06, bound=0.02),)

    def __post_init__(self) -> None:
        """Check the range of c_a."""
        super().__post_init__()
        if not 0.0 <= self.c_a <= 1.0:
            raise ValueError(f"c_a must lie in [0, 1], got {self.c_a}")

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Z₀ along the first accelerometer sample, a₀⁺ = y_A − g Z₀, P₀ = 10⁻² I."""
        y = z["imu/acc"]
        xp = namespace(y)
        up = normalize(y)
        x = xp.concat([up, y - expand(self.gravity, 1) * up, self._is_static(y)], axis=-1)
        return x, constant([[1e-2, 0, 0], [0, 1e-2, 0], [0, 0, 1e-2]], y) + 0.0 * y[..., None]

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equations (10)–(15), (24), (25): Φ, and Q = −Δt² Z̃ Σ_G Z̃ with the corrected Z of the sample before."""
        xp = namespace(x)
        rate = (z if self.gyroscope_sample == "current" else previous)["imu/gyr"]
        turn = expand(self.dt, 1) * rate
        clipped = clipped_inflation(rate, self.gyroscope_range, self.clipped_inflation)[..., None]
        identity = constant([[1, 0, 0], [0, 1, 0], [0, 0, 1]], x)
        phi = exp_matrix(-turn) if self.exact_rotation else identity - skew(turn)
        up = x[..., :3]
        squared = xp.sum(up * up, axis=-1)[..., None, None]
        variance = expand(self.dt**2 * self.gyroscope_noise**2, 2) * clipped
        Q = variance * (squared * identity - up[..., :, None] * up[..., None, :])
        return xp.concat([times(phi, up), x[..., 3:]], axis=-1), phi, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Equations (16)–(23), or the threshold (30): rows beyond it are NaN, and their update is skipped."""
        xp = namespace(x)
        y, up, last = z["imu/acc"], x[..., :3], x[..., 3:6]
        identity = constant([[1, 0, 0], [0, 1, 0], [0, 0, 1]], x) + 0.0 * x[..., :3, None]
        variance = expand(self.accelerometer_noise**2, 2)
        r = y - expand(self.gravity, 1) * up
        if self.mode == 1:
            r = r - expand(self.c_a, 1) * last
            squared = xp.sum(last * last, axis=-1)[..., None, None]
            variance = variance + expand(self.c_a**2, 2) * squared / 3.0
        if self.mode == 3:
            static = xp.greater(self._static_samples(x, y), self.window / self.dt + 0.5)
            r = xp.where(static, r, xp.nan)
        return r, expand(self.gravity, 2) * identity, variance * identity

    def retract(self, x: Array, dx: Array) -> Array:
        """Z is corrected additively, as published (27)."""
        return namespace(x).concat([x[..., :3] + dx, x[..., 3:]], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Normalise Z (28) and form a⁺ = y_A − g Z⁺ (29); without a sample a⁺ stays.

        Were it to decay as (16) expects, a gap would end with the certainty that the sensor is not accelerated.
        """
        xp = namespace(x)
        y = z["imu/acc"]
        up = normalize(x[..., :3])
        acceleration = y - expand(self.gravity, 1) * up
        acceleration = xp.where(xp.isfinite(acceleration), acceleration, x[..., 3:6])
        return xp.concat([up, acceleration, self._static_samples(x, y)], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Inclination vector and external acceleration, in sensor axes."""
        return {"up": x[..., :3], "external_acceleration": x[..., 3:6]}

    def limited(self, gains: dict[str, Any]) -> dict[str, Any]:
        """c_a low enough to follow a drift of the gyroscope, as derived in the module docstring."""
        if "c_a" not in gains or self.c_a <= 0.0:
            return gains
        noise = self.gyroscope_noise * np.exp(self.gains["process"].power * np.asarray(gains.get("process", 0.0)))
        safe = np.minimum(followable_c_a(noise), LARGEST_C_A)
        published = min(followable_c_a(self.gyroscope_noise), LARGEST_C_A)
        # A published tuning beyond the limit remains reachable, since the zero action must not change it.
        safe = safe * max(1.0, self.c_a / published)
        return gains | {"c_a": np.minimum(gains["c_a"], np.log(safe / self.c_a))}

    def _is_static(self, y: Array) -> Array:
        xp = namespace(y)
        deviation = xp.abs(norm(y) - expand(self.gravity, 1))
        one = 1.0 + 0.0 * deviation
        missing = xp.where(xp.isfinite(one), 0.0 * one, xp.zeros_like(one))
        return xp.where(xp.less_equal(deviation, expand(self.threshold, 1)), one, missing)

    def _static_samples(self, x: Array, y: Array) -> Array:
        """Length of the run of static samples that ends now, ``(..., 1)``."""
        return (x[..., 6:] + 1.0) * self._is_static(y)


def followable_c_a(gyroscope_noise: Any) -> Any:
    """c_a at which a drift of :data:`FOLLOWED_DRIFT` is the fastest that σ_G = ``gyroscope_noise`` (rad/s) follows."""
    reach = math.sqrt(3.0) * gyroscope_noise
    return reach / (reach + FOLLOWED_DRIFT)
