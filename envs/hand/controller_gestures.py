"""Distributions of motions of a hand-held controller: those of a thesis, and of a rate table for calibration.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval: random walk (chapter 3, whose ∞ is in :mod:`.planar_motion`), rate table (chapter 4), pointing at targets
(chapter 5). Where the thesis gives no value, the default is marked as a choice of this project.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...filters.core import rotation
from ...filters.core.model import checked_quaternion
from ...filters.support.parameters import check_positive
from .controller_motion import Knots, PointingGesture, RateTableGesture, ShakingGesture, WalkGesture
from .motion import euler_motion
from .smooth import Series

SHAKING_DRAWS = 20
"""Number of motions from which the one with the peak nearest to the requested one is chosen."""


@dataclass(frozen=True)
class Walk:
    """A filtered random walk of every coordinate of the pose, from rest.

    x_k = (Δt/τ − 1) x_{k−2} + (2 − Δt/τ) x_{k−1} + Δt/τ Δx_k, Δx ~ N(0, σ²): its second differences are taken as the
    accelerations at the knots. Their variance is 2σ²/(τ² Δt² (2 − Δt/τ)); erratum: (3.58) has 3 instead of 2 in the
    bracket.

    Attributes:
        duration: length, s.
        planar: in the vertical plane (east, up, φ), else in space (position and Z-Y-X angles).
        step: σ of each coordinate of the position, m (thesis: 0.3, which gives 30 m/s² rms at the defaults).
        angle_step: σ of each angle, rad (our choice).
        correlation_time: τ, s.
        interval: Δt, s.
        rest: time at rest before, s.
    """

    duration: float = 100.0
    planar: bool = False
    step: float = 0.3
    angle_step: float = 0.05
    correlation_time: float = 1.0
    interval: float = 0.01
    rest: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.interval < self.correlation_time < math.inf:
            raise ValueError(
                f"interval must be positive and below correlation_time {self.correlation_time}, got {self.interval}"
            )

    @property
    def acceleration_variance(self) -> float:
        """Stationary variance of each coordinate's acceleration at the knots, m²/s⁴."""
        dt, tau = self.interval, self.correlation_time
        return 2.0 * self.step**2 / (tau**2 * dt**2 * (2.0 - dt / tau))

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> WalkGesture:
        """Draw the steps."""
        duration = self.duration if duration is None else duration
        heading = rotation.random(generator)
        deviations = np.array(
            [self.step] * 2 + [self.angle_step] if self.planar else [self.step] * 3 + [self.angle_step] * 3
        )
        count = math.ceil(max(duration - self.rest, 0.0) / self.interval) + 2
        pushes = generator.standard_normal((count, len(deviations))) * deviations / self.correlation_time
        kept = 1.0 - self.interval / self.correlation_time
        # the first knot is still at rest
        velocity, velocities = np.zeros(len(deviations)), [np.zeros(len(deviations))] * 2
        for push in pushes[2:]:
            velocity = kept * velocity + push
            velocities.append(velocity)
        acceleration = np.diff(np.array(velocities), axis=0) / self.interval
        return WalkGesture(duration, Knots(self.rest, self.interval, acceleration), heading)


@dataclass(frozen=True)
class Pointing:
    """Pointing with the body's y axis at targets around north that come one after the other.

    A target at azimuth ψ (from north to east) and elevation θ is pointed at by Q = R_z(−ψ) R_x(θ) (5.48, with the sign
    corrected). The turn to the next one is about the normal of both directions, along 6u⁵ − 15u⁴ + 10u³ (fifth order),
    so the body gathers some roll from target to target. (5.52) is the transpose of that turn.

    Attributes:
        duration: length, s.
        spread: largest |ψ| and |θ|, uniformly distributed, rad (thesis: 45°).
        turn: time of a turn, s (our choice).
        acceleration: root mean square of each coordinate, m/s² (our choice).
        band: of the acceleration, Hz (our choice).
        rest: time at rest before, s.
    """

    duration: float = 100.0
    spread: float = math.radians(45.0)
    turn: float = 1.5
    acceleration: float = 5.0
    band: tuple[float, float] = (0.3, 2.0)
    rest: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, "spread", "turn")

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> PointingGesture:
        """Draw targets and motion."""
        duration = self.duration if duration is None else duration
        count = max(1, math.ceil((duration - self.rest) / self.turn))
        azimuth, elevation = generator.uniform(-self.spread, self.spread, (2, count + 1))
        targets = pointing_direction(azimuth, elevation)
        normal = rotation.cross(targets[:-1], targets[1:])
        sine = rotation.norm(normal)
        angles = np.arctan2(sine[:, 0], np.sum(targets[:-1] * targets[1:], axis=-1))
        axes = normal / sine
        attitudes = [pointing_attitude(azimuth[:1], elevation[:1])[0]]
        for axis, angle in zip(axes[:-1], angles[:-1], strict=True):
            attitudes.append(rotation.multiply(rotation.exp(axis * angle), attitudes[-1]))
        starts = self.rest + self.turn * np.arange(count)
        position = shaken(generator, self.band, self.acceleration)
        return PointingGesture(duration, starts, self.turn, np.array(attitudes), axes, angles, position, targets)


def pointing_direction(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Unit vector ``(..., 3)`` at azimuth ψ (north to east) and elevation θ, rad."""
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)], axis=-1)


def pointing_attitude(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Quaternion ``(..., 4)`` of R_z(−ψ) R_x(θ): the body's y axis points at ψ, θ (rad), without roll."""
    zero = np.zeros_like(azimuth)
    return rotation.from_euler_zyx(-azimuth, zero, elevation)


def shaken(generator: np.random.Generator, band: tuple[float, float], acceleration: float) -> Series:
    """A random position whose acceleration is evenly spread over ``band`` (Hz), of given rms a coordinate, m/s²."""
    position = Series.draw(generator, band, 3, components=30, slope=-2.0)
    return position.scaled(acceleration / position.acceleration)


@dataclass(frozen=True)
class Shaking:
    """Shaking about all axes, for angular rates of every size; the hand nearly stops once in each cycle.

    Attributes:
        duration: length, s.
        rate: root mean square of the angular rate's length after the rest, rad/s.
        peak: its largest value as nearly as some draws allow, rad/s.
        band: of the angles, Hz.
        acceleration: root mean square of each coordinate at full amplitude, m/s².
        cycle: from one lull to the next, s.
        lull: amplitude in a lull, relative to the largest.
        rest: time at rest before, s.
    """

    duration: float = 100.0
    rate: float = 4.3
    peak: float = 15.0
    band: tuple[float, float] = (0.4, 2.5)
    acceleration: float = 5.0
    cycle: float = 12.0
    lull: float = 0.03
    rest: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, "rate", "peak", "cycle")

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> ShakingGesture:
        """Draw some motions of the requested rate and keep the one with the peak nearest to the requested one."""
        duration = self.duration if duration is None else duration
        heading = rotation.random(generator)
        position = shaken(generator, self.band, self.acceleration)
        times = np.arange(min(self.rest, 0.5 * duration), duration, 0.02)
        best: tuple[float, ShakingGesture] | None = None
        for _ in range(SHAKING_DRAWS):
            angles = Series.draw(generator, self.band, 3, components=20, slope=-1.0)
            gesture = ShakingGesture(duration, heading, position, angles, self.rest, self.cycle, self.lull)
            jet, factor = gesture.turning(times), 0.5
            for _ in range(8):
                rates = rotation.norm(euler_motion(tuple(factor * part for part in jet))[1])[:, 0]  # type: ignore[arg-type]
                length = math.sqrt(float(np.mean(rates**2)))
                # too short to have begun
                if length == 0.0 or abs(length / self.rate - 1.0) < 1e-3:
                    break
                factor *= self.rate / length
            distance = abs(float(rates.max()) - self.peak)
            if best is None or distance < best[0]:
                best = distance, replace(gesture, angles=angles.scaled(factor))
        assert best is not None
        return best[1]


def degrees_per_second(*rates: float) -> tuple[float, ...]:
    """The same in rad/s."""
    return tuple(math.radians(rate) for rate in rates)


UPWARDS = degrees_per_second(*range(80, 801, 80))
"""Section 4.1, direction 1: 80 to 800 °/s by 80."""
DOWNWARDS = degrees_per_second(*range(800, 79, -100))
"""Section 4.1, direction 2: from 800 °/s down by 100."""
BOTH_WAYS = degrees_per_second(*range(-325, 351, 25))
"""Section 4.2, gyroscope: −325 to 350 °/s by 25."""


@dataclass(frozen=True)
class RateTable:
    """A one-axis rate table that holds one rate after the other (chapter 4).

    Attributes:
        rates: rad/s, counter-clockwise seen from above; empty for a table that stands still.
        hold: time at each rate, s (thesis: 10 to 20).
        ramp: duration of the change to the next rate, s.
        attitude: ``(4,)`` of the device on the table, whose z axis points up.
        offset: ``(3,)`` of the device's origin from the axis, table axes, m.
        rest: time at rest before, s.
    """

    rates: tuple[float, ...] = UPWARDS
    hold: float = 10.0
    ramp: float = 1.0
    attitude: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    offset: tuple[float, ...] = (0.1, 0.0, 0.0)
    rest: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, "hold", "ramp")
        checked_quaternion("attitude", self.attitude)

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.rest + max(1, len(self.rates)) * (self.ramp + self.hold)

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> RateTableGesture:
        """Draw the azimuth at which the table starts."""
        return RateTableGesture(
            self.duration if duration is None else duration,
            self.rest + (self.ramp + self.hold) * np.arange(len(self.rates)),
            np.array(self.rates),
            self.ramp,
            float(generator.uniform(-math.pi, math.pi)),
            np.array(self.attitude, dtype=float),
            np.array(self.offset, dtype=float),
        )
