"""Domain randomisation: the simulated hand motions, sensors and mountings that the learned estimator is trained on.

The distribution is wider than the test data, so that recordings lie inside it: rests of any length, motions from tremor
to shaking, at 50 to 300 Hz, with random sensor, mounting and motion parameters in each episode.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.hand.motion import Segment, SegmentedGesture
from ...envs.sensors.ideal import Mounting, mounted
from ...envs.sensors.noise import NoiseModel
from ...envs.sensors.presets import SensorPreset
from ...envs.sensors.suite import imu_suite
from ...filters.core import rotation

Range = tuple[float, float]
DEG = math.pi / 180.0


def log_uniform(generator: np.random.Generator, bounds: Range) -> float:
    """Log-uniform random number between two positive bounds."""
    return float(np.exp(generator.uniform(*np.log(bounds))))


@dataclass(frozen=True)
class VariedMotion:
    """Segments of random motion and rests, whose strengths, bands and lengths differ from episode to episode.

    All ranges are log-uniform. The hand stays in place: its position is a band-limited function between rests some
    decimetres apart.
    """

    first_rest: Range = (0.3, 40.0)
    """s at rest at the start"""
    moving_start: float = 0.15
    """share of episodes that start in motion instead"""
    rest_shares: tuple[float, ...] = (0.0, 0.05, 0.2, 0.5)
    """an episode draws one of these probabilities that a segment is a rest"""
    shortest: float = 1.5
    """s, of a segment"""
    longest: Range = (4.0, 60.0)
    """s; an episode draws the length of its longest segments"""
    acceleration: Range = (0.05, 12.0)
    """m/s², root mean square of an episode while it moves"""
    rate: Range = (0.05, 7.0)
    """rad/s, root mean square likewise"""
    single_share: float = 0.1
    """probability that an episode hardly turns, and that it hardly translates"""
    strength_std: float = 0.6
    """largest standard deviation of the logarithm of a segment's strength within an episode"""
    position_band: tuple[Range, Range] = ((0.2, 1.0), (0.8, 4.0))
    """Hz, ranges of the lower and the upper end"""
    angle_band: Range = (0.3, 2.0)
    """Hz, range of the upper end; the lower is 0.1 to 0.5 of it"""

    def draw(self, generator: np.random.Generator, duration: float) -> SegmentedGesture:
        """Draw a motion of ``duration`` seconds."""
        heading, axes = rotation.random(generator), rotation.random(generator)
        moving = generator.random() < self.moving_start
        start = 0.0 if moving else log_uniform(generator, self.first_rest)
        rest_share, longest = generator.choice(self.rest_shares), log_uniform(generator, self.longest)
        acceleration, rate = log_uniform(generator, self.acceleration), log_uniform(generator, self.rate)
        choice, std = generator.random(), generator.uniform(0.0, self.strength_std)
        if choice < 2.0 * self.single_share:
            acceleration, rate = (
                (acceleration, 0.1 * rate) if choice < self.single_share else (0.1 * acceleration, rate)
            )
        segments = []
        while start < duration:
            end = start + log_uniform(generator, (self.shortest, longest))
            strengths = np.exp(generator.normal(0.0, std, 2)) * (acceleration, rate)
            if generator.random() >= rest_share:
                segments.append(self._segment(generator, start, end, *np.minimum(strengths, (15.0, 9.0))))
            start = end
        return SegmentedGesture(duration, heading, np.zeros(3), tuple(segments), axes)

    def _segment(
        self, generator: np.random.Generator, start: float, end: float, acceleration: float, rate: float
    ) -> Segment:
        fastest, turning = log_uniform(generator, self.position_band[1]), log_uniform(generator, self.angle_band)
        slowest, slowly = log_uniform(generator, self.position_band[0]), turning * generator.uniform(0.1, 0.5)
        angle = rate / (np.pi * (slowly + turning)) / np.sqrt(3.0)
        return Segment.draw(
            generator,
            start=start,
            end=end,
            ramp=min(generator.uniform(0.1, 1.0), 0.3 * (end - start)),
            position_band=(min(slowest, 0.6 * fastest), fastest),
            angle_band=(slowly, turning),
            acceleration_rms=acceleration / np.sqrt(3.0),
            angle_rms=angle,
            turn=generator.uniform(-np.pi, np.pi, 3) * min(1.0, rate * (end - start) / 6.0),
        )


@dataclass(frozen=True)
class VariedSensors:
    """Gyroscopes and accelerometers from laboratory to phone grade, calibrated to small biases.

    Ranges of the fields of :class:`~poise.envs.sensors.noise.NoiseModel`, drawn from log-uniformly.
    """

    gyroscope_noise: Range = (0.003 * DEG, 0.05 * DEG)
    gyroscope_bias: Range = (0.03 * DEG, 0.8 * DEG)
    gyroscope_walk: Range = (1e-4 * DEG, 3e-3 * DEG)
    gyroscope_scale: Range = (5e-4, 1e-2)
    gyroscope_misalignment: Range = (5e-4, 1e-2)
    accelerometer_noise: Range = (5e-4, 1e-2)
    accelerometer_bias: Range = (0.01, 0.1)
    accelerometer_scale: Range = (5e-4, 1e-2)
    accelerometer_misalignment: Range = (5e-4, 5e-3)
    bandwidth: Range = (30.0, 300.0)
    full_scale: tuple[float, float] = (2000.0 * DEG, 156.9)
    """rad/s and m/s²"""
    lossy_share: float = 0.15
    """of devices, which lose single samples"""
    dropout: Range = (0.005, 0.2)
    """share of the samples that they lose"""
    silent_share: float = 0.1
    """of devices, whose accelerometer pauses"""
    pauses: Range = (0.01, 0.2)
    """1/s, how often"""
    pause: Range = (0.05, 2.0)
    """s, mean length"""

    def draw(self, generator: np.random.Generator) -> SensorPreset:
        """Draw a device."""
        bandwidth = log_uniform(generator, self.bandwidth)
        dropout, burst_rate = log_uniform(generator, self.dropout), log_uniform(generator, self.pauses)
        lossy, silent = generator.random(2) < (self.lossy_share, self.silent_share)
        gyroscope = NoiseModel(
            white_noise=log_uniform(generator, self.gyroscope_noise),
            turn_on_bias=log_uniform(generator, self.gyroscope_bias),
            bias_random_walk=log_uniform(generator, self.gyroscope_walk),
            scale_factor=log_uniform(generator, self.gyroscope_scale),
            misalignment=log_uniform(generator, self.gyroscope_misalignment),
            resolution=float(generator.choice([0.0, DEG / 16.4])),
            full_scale=self.full_scale[0],
            bandwidth=bandwidth,
            dropout=dropout * float(lossy),
        )
        accelerometer = NoiseModel(
            white_noise=log_uniform(generator, self.accelerometer_noise),
            turn_on_bias=log_uniform(generator, self.accelerometer_bias),
            scale_factor=log_uniform(generator, self.accelerometer_scale),
            misalignment=log_uniform(generator, self.accelerometer_misalignment),
            full_scale=self.full_scale[1],
            bandwidth=bandwidth,
            dropout=dropout * float(lossy),
            burst_rate=burst_rate * float(silent),
            burst_duration=log_uniform(generator, self.pause),
        )
        return SensorPreset("varied", "domain randomisation", gyroscope, accelerometer)


@dataclass(frozen=True)
class Shaking:
    """Vibration and taps, added to the accelerometer, without net velocity or rotation."""

    vibrating_share: float = 0.3
    """of episodes"""
    frequency: Range = (15.0, 120.0)
    """Hz"""
    vibration: Range = (0.3, 8.0)
    """m/s²"""
    tapped_share: float = 0.25
    """of episodes"""
    taps: Range = (0.1, 1.5)
    """1/s"""
    tap: Range = (3.0, 60.0)
    """m/s², peak"""
    width: Range = (0.004, 0.03)
    """s"""

    def draw(self, generator: np.random.Generator, times: np.ndarray, *, mean: bool) -> np.ndarray:
        """Acceleration ``(T, 3)`` in sensor axes at even ``times``, or (``mean``) over the intervals that they end."""
        dt = times[1] - times[0]
        grid = np.concatenate([[times[0] - dt], times])
        velocity, acceleration = np.zeros((2, len(grid), 3))
        if generator.random() < self.vibrating_share:
            for _ in range(generator.integers(1, 4)):
                w, strength = (
                    2.0 * np.pi * log_uniform(generator, self.frequency),
                    log_uniform(generator, self.vibration),
                )
                start, duration = generator.uniform(0.0, times[-1]), log_uniform(generator, (2.0, 60.0))
                window = strength * np.clip(np.minimum(grid - start, start + duration - grid) / 0.2, 0.0, 1.0)[:, None]
                phase = w * grid + np.cumsum(generator.normal(0.0, 0.5 * np.sqrt(dt), len(grid)))
                axis = rotation.normalize(generator.standard_normal(3))
                acceleration += window * np.sin(phase)[:, None] * axis
                velocity -= window / w * np.cos(phase)[:, None] * axis
        if generator.random() < self.tapped_share:
            count = int(times[-1] * log_uniform(generator, self.taps))
            for time in generator.uniform(0.0, times[-1], count):
                width, peak = log_uniform(generator, self.width), log_uniform(generator, self.tap)
                axis = rotation.normalize(generator.standard_normal(3))
                near = slice(*np.searchsorted(grid, (time - 6.0 * width, time + 6.0 * width)))
                u = (grid[near] - time)[:, None] / width
                acceleration[near] += peak * u * np.exp(0.5 - 0.5 * u * u) * axis
                velocity[near] -= peak * width * np.exp(0.5 - 0.5 * u * u) * axis
        return np.diff(velocity, axis=0) / dt if mean else acceleration[1:]


@dataclass(frozen=True)
class DomainRandomisation:
    """The distribution of training episodes.

    Attributes:
        duration: s.
        rates: Hz, drawn from log-uniformly.
        instant_share: share of episodes, among those at ``instant_rate`` or more, whose sensors report instants instead
            of means.
        instant_rate: Hz; below it instants alias what means do not.
        lever_arm: m, standard deviation per axis of the sensor's position, log-uniform.
        motion, sensors, shaking: see there.
    """

    duration: float = 150.0
    rates: Range = (50.0, 300.0)
    instant_share: float = 0.3
    instant_rate: float = 120.0
    lever_arm: Range = (0.005, 0.2)
    motion: VariedMotion = field(default_factory=VariedMotion)
    sensors: VariedSensors = field(default_factory=VariedSensors)
    shaking: Shaking = field(default_factory=Shaking)

    def draw(self, seed: int | np.random.SeedSequence, name: str = "randomised") -> Trajectory:
        """Simulate one episode.

        Args:
            seed: separate children are used for motion, setting, shaking and sensor errors.
            name: for the metadata.

        Returns:
            Channels ``imu/gyr`` (rad/s) and ``imu/acc`` (m/s²), NaN where a sample is lost; truth ``orientation``
            (sensor to world).
        """
        sequence = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        motion, setting, shaking, noise = (np.random.default_rng(child) for child in sequence.spawn(4))
        rate = log_uniform(setting, self.rates)
        means = rate < self.instant_rate or setting.random() >= self.instant_share
        sampling: Literal["interval", "instant"] = "interval" if means else "instant"
        lever = tuple(setting.standard_normal(3) * log_uniform(setting, self.lever_arm))
        mounting = Mounting(lever, tuple(rotation.random(setting)))
        suite = imu_suite(self.sensors.draw(setting), rate, lever, mounting.rotation, sampling=sampling)
        suite.reset(noise)
        gesture = self.motion.draw(motion, self.duration)
        times = np.arange(1, math.floor(self.duration * rate) + 1) / rate
        states = gesture.sample(times)
        before = gesture.sample(times - 1.0 / rate)
        measurements = suite.simulate(states, before=before).measurements
        shaken = measurements["imu/acc"] + self.shaking.draw(shaking, times, mean=means)
        limit = self.sensors.full_scale[1]
        measurements["imu/acc"] = np.clip(shaken, -limit, limit)
        metadata: dict[str, Any] = {"name": name, "source": "simulation", "rate": rate, "sampling": sampling}
        return Trajectory(
            times, measurements, {"orientation": mounted(states, mounting).orientation}, metadata=metadata
        )
