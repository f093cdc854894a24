"""Random inertial sensors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...filters.core.quantity import DEG
from ...filters.support.ranges import Checked, Range, log_uniform
from ...filters.support.seeds import named_generator
from ..sensors.assumptions import WARM_UP
from ..sensors.noise import NoiseModel
from ..sensors.presets import SensorPreset
from ..sensors.timing import PUNCTUAL, Timing


@dataclass(frozen=True)
class VariedTiming(Checked):
    """Devices that are late or lose packets; ranges of the fields of :class:`~poise.envs.sensors.timing.Timing`."""

    late_share: float = 0.3
    """of devices, which have delay, jitter and a clock of their own"""
    delay: Range = (0.0005, 0.02)
    """s"""
    jitter: Range = (2e-5, 1e-3)
    """s"""
    clock_drift: Range = (5e-6, 5e-5)
    """1"""
    packet_loss_share: float = 0.15
    """of devices, which lose packets in bursts"""
    burst_rate: Range = (0.01, 0.2)
    """1/s"""
    burst_duration: Range = (0.05, 0.5)
    """s"""

    def draw(self, generator: np.random.Generator) -> Timing:
        """Draw the timing of a device from a descendant of ``generator``, which is not used up."""
        own = named_generator(generator, "timing")
        late, loses = own.random(2) < (self.late_share, self.packet_loss_share)
        delay, jitter, drift = (log_uniform(own, each) for each in (self.delay, self.jitter, self.clock_drift))
        burst_rate, duration = log_uniform(own, self.burst_rate), log_uniform(own, self.burst_duration)
        timing = Timing(delay, jitter, drift) if late else PUNCTUAL
        return replace(timing, burst_rate=burst_rate, burst_duration=duration) if loses else timing


@dataclass(frozen=True)
class VariedSensors(Checked):
    """Gyroscopes and accelerometers from laboratory to phone grade, calibrated to small biases.

    Ranges of the fields of :class:`~poise.envs.sensors.noise.NoiseModel`, drawn from log-uniformly.
    """

    gyroscope_noise: Range = (0.003 * DEG, 0.05 * DEG)
    gyroscope_bias: Range = (0.03 * DEG, 0.8 * DEG)
    gyroscope_walk: Range = (1e-4 * DEG, 3e-3 * DEG)
    gyroscope_scale: Range = (5e-4, 1e-2)
    gyroscope_misalignment: Range = (5e-4, 1e-2)
    gyroscope_g_sensitivity: Range | None = None
    """rad/s per m/s²: with it, and with the temperature, the bias at rest is not that in motion; None: neither"""
    gyroscope_temperature: Range | None = None
    """rad/s/K, while the device warms up by :data:`~poise.envs.sensors.assumptions.WARM_UP`"""
    accelerometer_noise: Range = (5e-4, 1e-2)
    accelerometer_bias: Range = (0.01, 0.1)
    accelerometer_scale: Range = (5e-4, 1e-2)
    accelerometer_misalignment: Range = (5e-4, 5e-3)
    bandwidth: Range = (30.0, 300.0)
    gyroscope_full_scale: float = 2000.0 * DEG
    """rad/s"""
    accelerometer_full_scale: float = 156.9
    """m/s²"""
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
    magnetometer_noise: Range = (0.01, 0.3)
    """µT/√Hz"""
    magnetometer_bias: Range = (0.1, 3.0)
    """µT: what a calibration of hard iron leaves"""
    magnetometer_scale: Range = (1e-3, 2e-2)
    """of scale factors and cross-axis sensitivities alike"""
    timing: VariedTiming = field(default_factory=VariedTiming)

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
            full_scale=self.gyroscope_full_scale,
            bandwidth=bandwidth,
            dropout=dropout * float(lossy),
        )
        accelerometer = NoiseModel(
            white_noise=log_uniform(generator, self.accelerometer_noise),
            turn_on_bias=log_uniform(generator, self.accelerometer_bias),
            scale_factor=log_uniform(generator, self.accelerometer_scale),
            misalignment=log_uniform(generator, self.accelerometer_misalignment),
            full_scale=self.accelerometer_full_scale,
            bandwidth=bandwidth,
            dropout=dropout * float(lossy),
            burst_rate=burst_rate * float(silent),
            burst_duration=log_uniform(generator, self.pause),
        )
        # descendants by name, which leave the draws above as they are
        own = named_generator(generator, "bias in motion")
        varying = (self.gyroscope_g_sensitivity, self.gyroscope_temperature)
        force, heat = (0.0 if each is None else log_uniform(own, each) for each in varying)
        gyroscope = replace(
            gyroscope, g_sensitivity=force, temperature_coefficient=heat, warm_up=WARM_UP if heat else 0.0
        )
        own = named_generator(generator, "magnetometer")
        magnetometer = NoiseModel(
            white_noise=log_uniform(own, self.magnetometer_noise),
            turn_on_bias=log_uniform(own, self.magnetometer_bias),
            scale_factor=log_uniform(own, self.magnetometer_scale),
            misalignment=log_uniform(own, self.magnetometer_scale),
            full_scale=4900.0,
        )
        timing = self.timing.draw(generator)
        return SensorPreset("varied", "domain randomisation", gyroscope, accelerometer, magnetometer, timing=timing)
