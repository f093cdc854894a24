r"""Attitude of a body that accelerates hard but stays in one place: a hand, a head, a trunk.

A filter of this package, not of a paper. As in the external-acceleration filter, the accelerometer measures gravity
plus an acceleration of the motion. The assumption about this acceleration is physical and holds in the world frame:
its integral, the velocity, stays bounded. A tilt error δ makes the integrated velocity grow by g δ t, and the
pseudo-measurement "velocity = 0" corrects it. There is no threshold and no acceleration model in sensor axes. The
gyroscope bias is estimated.

The state is the attitude q (sensor to world), the gyroscope bias b and the velocity v (world). With the samples ω of
the gyroscope and f of the accelerometer, which describe the interval that they end,

    q ← q ⊗ exp((ω − b) Δt),   v ← v + Δt (q_mid f q_mid* − g e₃)

where q_mid is the attitude in the middle of the interval; using the attitude at its end adds an error of half a degree
at 48 Hz. ``accelerometer_lag`` compensates the delay of the accelerometer's internal filter. F and Q are those of
:mod:`.strapdown`. The pseudo-measurement is

    0 = v + n,   var n = σ_V² / τ   at every ``correction_interval`` τ

Dividing by τ makes σ_V independent of rate and interval. Since the velocity is correlated over time, σ_V is a tuning
constant rather than a sensor noise. Pedestrian navigation uses such pseudo-measurements while the foot is at rest
(E. Foxlin, "Pedestrian tracking with shoe-mounted inertial sensors", IEEE Computer Graphics and Applications 25(6),
2005).

Mean inclination error of ten BROAD trials with the constants below, which are not fitted per trial: 0.76° at 286 Hz
and 0.83° at 48 Hz (VQF 0.84° at 286 Hz). A lag of 3 ms, chosen on these trials, gives 0.71° and 0.77°.

The position is not estimated, and the velocity is not an output. Sustained motion in one direction (a car, a lift)
violates the assumption and appears as growing innovations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..core.backend import Array, expand, namespace
from ..core.held_inputs import HeldInput
from ..core.matrices import covariance_of, identity
from ..core.model import Gain, Model
from ..core.quantity import (
    ACCELEROMETER,
    EXTERNAL_ACCELERATION,
    GRAVITY,
    GYROSCOPE,
    GYROSCOPE_BIAS,
    MAGNETOMETER,
    ORIENTATION,
    RELATIVE_ORIENTATION,
    UP,
    Channel,
    Measurement,
    Quantity,
)
from ..core.rotation import level, normalize, up_in_body
from .magnetic_heading import MagneticHeading
from .relative_delay import STEP, merged, relative_delay
from .strapdown import accelerated, advance, clipped_inflation, corrected, process_noise, transition


@dataclass(frozen=True)
class BoundedMotion(Model):
    """Six axes: inclination, gyroscope bias and external acceleration. The heading starts at zero and drifts.

    State: q (4), b (3), v (3), external acceleration in sensor axes (3, remembered), seconds since the last correction,
    seconds since the last sample of both accelerometer and gyroscope.

    If samples of accelerometer or gyroscope are missing for longer than ``hold``, the velocity is unknown. It is reset
    to zero with its prior variance, and its updates are skipped until both return.
    """

    gyroscope_noise: float = 5e-3
    """σ_g, rad/s/√Hz; larger than in a data sheet, to cover scale and alignment errors in motion"""
    bias_noise: float = 2e-5
    """σ_b, rad/s²/√Hz"""
    acceleration_noise: float = 0.05
    """σ_a, m/s²/√Hz"""
    velocity_bound: float = 0.2
    """σ_V, m/s·√s: expected magnitude of the velocity"""
    correction_interval: float = 0.0175
    """τ, s: five samples at 286 Hz; in seconds, so that it is independent of the rate"""
    accelerometer_range: float = 156.0
    """m/s²: samples with a component beyond this count as saturated"""
    gyroscope_range: float = 34.8
    """rad/s (1994 °/s), likewise: what is beyond the range was turned, but nobody measured it"""
    clipped_inflation: float = 100.0
    """factor on σ_a or σ_g for saturated samples"""
    accelerometer_lag: float = 0.0
    """s: delay of the accelerometer relative to the gyroscope (filters inside the sensor), negative if it is ahead"""
    tilt_prior: float = 0.05
    """rad"""
    bias_prior: float = 8.727e-3
    """rad/s (0.5 °/s)"""
    velocity_prior: float = 0.5
    """m/s"""
    hold: float = 0.05
    """s: longest time for which the last sample of accelerometer or gyroscope replaces missing ones"""
    gravity: float = GRAVITY
    """g, m/s²"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP, RELATIVE_ORIENTATION, GYROSCOPE_BIAS, EXTERNAL_ACCELERATION)
    state_size: ClassVar[int] = 15
    error_size: ClassVar[int] = 9
    residual_size: ClassVar[int] = 3
    error_parts: ClassVar[dict[str, tuple[int, int]]] = {"relative_orientation": (0, 3), "gyroscope_bias": (3, 6)}
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("gyroscope_noise", description="process variance σ_g² of the attitude"),
        "bias": Gain("bias_noise", description="process variance σ_b² of the gyroscope bias"),
        "velocity": Gain("velocity_bound", description="variance σ_V² of the pseudo-measurement of velocity"),
    }

    held_inputs: ClassVar[tuple[HeldInput, ...]] = (HeldInput("imu/gyr", "gyroscope_noise"),)

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Sensor at rest: inclination from the first accelerometer sample, heading, bias and velocity zero."""
        xp, f = namespace(z["imu/acc"]), z["imu/acc"]
        q, zero = level(f), 0.0 * f
        x = xp.concat([q, zero, zero, self._external(q, f), zero[..., :2]], axis=-1)
        deviations = [*[self.tilt_prior] * 3, *[self.bias_prior] * 3, *[self.velocity_prior] * 3]
        return x, covariance_of(deviations, 0.0 * f[..., :1])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Strapdown integration in the attitude of the middle of the interval."""
        xp = namespace(x)
        q, b, v, f = x[..., :4], x[..., 4:7], x[..., 7:10], z["imu/acc"]
        dt = expand(self.dt, 1)
        after, force = advance(q, dt * (z["imu/gyr"] - b), f, 0.5 - expand(self.accelerometer_lag / self.dt, 1))
        known = xp.less(x[..., 14:15], expand(self.hold, 1))
        one = xp.where(known, 1.0 + 0.0 * q[..., :1], 0.0 * q[..., :1])
        v = one * accelerated(v, force, dt, self.gravity)
        keep = one[..., None]
        F = transition(q, force, expand(self.dt, 2), keep, keep)
        inflation = clipped_inflation(f, self.accelerometer_range, self.clipped_inflation)
        spread = expand(self.acceleration_noise**2 * self.dt, 1) * inflation
        lost = expand(self.velocity_prior**2, 1) + 0.0 * spread
        spread = xp.where(known, spread, lost)
        turned = clipped_inflation(z["imu/gyr"], self.gyroscope_range, self.clipped_inflation)[..., 0]
        Q = process_noise(self.gyroscope_noise**2 * self.dt * turned, self._bias_variance(x, z), spread)
        return xp.concat([after, b, v, x[..., 10:13], x[..., 13:14] + dt, x[..., 14:]], axis=-1), F, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """0 = v + n, if the interval is over and there is a sample; else NaN: the update is skipped."""
        xp = namespace(x)
        v = x[..., 7:10]
        r = xp.where(self._is_due(x, z), -v, xp.nan + 0.0 * v)
        unit = identity(3, x)
        H = xp.concat([0.0 * unit, 0.0 * unit, unit], axis=-1)
        return r, H, unit * (expand(self.velocity_bound**2, 1) / self._elapsed(x))[..., None]

    def retract(self, x: Array, dx: Array) -> Array:
        """The attitude is corrected by a rotation in the world frame, the rest additively."""
        return corrected(x, dx)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Normalise, remember the external acceleration, reset or advance the clocks."""
        xp = namespace(x)
        q, f = normalize(x[..., :4]), z["imu/acc"]
        present = xp.all(xp.isfinite(f), axis=-1)[..., None]
        both = xp.logical_and(present, xp.all(xp.isfinite(z["imu/gyr"]), axis=-1)[..., None])
        zero = 0.0 * x[..., 13:14]
        elapsed = xp.where(self._is_due(x, z), zero, x[..., 13:14])
        age = xp.where(both, zero, x[..., 14:15] + expand(self.dt, 1))
        forgotten = xp.greater_equal(age, expand(self.hold, 1))
        remembered = xp.where(forgotten, 0.0 * x[..., 10:13], x[..., 10:13])
        acceleration = xp.where(present, self._external(q, f), remembered)
        elapsed = xp.where(forgotten, zero, elapsed)
        return xp.concat([q, x[..., 4:10], acceleration, elapsed, age, x[..., 15:]], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Inclination vector, orientation, bias (rad/s) and external acceleration (m/s²), in sensor axes."""
        q = x[..., :4]
        return {
            "up": up_in_body(q),
            "relative_orientation": q,
            "gyroscope_bias": x[..., 4:7],
            "external_acceleration": x[..., 10:13],
        }

    def fitted(self, measurements: Measurement, nis: Callable[[Model, Measurement], Any]) -> Self:
        """The delay of the accelerometer by :func:`.relative_delay`, unless one was given; six axes tell it."""
        if self.accelerometer_lag != 0.0:
            return self
        samples, dt = merged(measurements, self.correction_interval, self.dt)
        constants = {each.name: getattr(self, each.name) for each in fields(BoundedMotion)}
        model = BoundedMotion(**constants | {"dt": dt})
        before, now, after = (
            np.asarray(nis(replace(model, accelerometer_lag=lag), samples)) for lag in (-STEP, 0.0, STEP)
        )
        return replace(self, accelerometer_lag=relative_delay(before, now, after, dt))

    def _bias_variance(self, x: Array, z: Measurement) -> Any:
        """Of the change of the bias in an interval, (rad/s)², a number or ``(...)``."""
        return self.bias_noise**2 * self.dt

    def _external(self, q: Array, f: Array) -> Array:
        return f - expand(self.gravity, 1) * up_in_body(q)

    def _elapsed(self, x: Array) -> Array:
        """Time since the last correction ``(..., 1)``, one correction interval at least."""
        xp = namespace(x)
        interval = expand(self.correction_interval, 1) + 0.0 * x[..., 13:14]
        return xp.where(xp.greater(x[..., 13:14], interval), x[..., 13:14], interval)

    def _is_due(self, x: Array, z: Measurement) -> Array:
        """Whether the velocity is updated now ``(..., 1)``: at the end of the interval, if there is a sample."""
        xp = namespace(x)
        present = xp.all(xp.isfinite(z["imu/acc"]), axis=-1)[..., None]
        over = xp.greater(x[..., 13:14], expand(self.correction_interval - 0.5 * self.dt, 1))
        return xp.logical_and(present, over)


@dataclass(frozen=True)
class BoundedMotion9(MagneticHeading, BoundedMotion):
    """Nine axes: orientation in the world (x east, y north, z up), gyroscope bias and external acceleration.

    State: as for six axes (15), expected norm and dip of the magnetic field (2).
    """

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP, GYROSCOPE_BIAS, EXTERNAL_ACCELERATION)
    state_size: ClassVar[int] = 17
    residual_size: ClassVar[int] = 4
    gains: ClassVar[dict[str, Gain]] = BoundedMotion.gains | {
        "heading": Gain("magnetometer_noise", description="variance σ_m² of the magnetic heading")
    }
