"""Noise models of named devices.

White noise, in-run bias stability, ranges and bandwidths are data-sheet values, typical, as named with each preset.
Three things are choices of this project, because data sheets do not give them:

* In-run bias stability is the floor of the Allan deviation. It becomes a Gauss-Markov bias whose Allan deviation peaks
  there (standard deviation = stability / 0.617), with a correlation time of 200 s.
* A tolerance or repeatability that a data sheet gives as ± x is taken as one standard deviation.
* Where a data sheet is silent, the value is an assumption by the grade of the device, never 0
  (:mod:`poise.envs.sensors.assumptions`); :attr:`SensorPreset.assumed` names these fields.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from ...filters.core.quantity import DEG, STANDARD_GRAVITY
from ...filters.support.names import look_up
from .assumptions import CONSUMER, DEG_PER_HOUR, INDUSTRIAL, MICRO_G, Grade, completed, model
from .kinds import KINDS
from .noise import NoiseModel
from .timing import PUNCTUAL, Timing

G = STANDARD_GRAVITY
GAUSS = 100.0
"""µT"""


@dataclass(frozen=True)
class SensorPreset:
    """A device: noise of its gyroscope (rad/s), accelerometer (m/s²) and magnetometer (µT)."""

    name: str
    source: str
    """where the numbers come from"""
    gyroscope: NoiseModel
    accelerometer: NoiseModel
    magnetometer: NoiseModel | None = None
    """None for a device without one"""
    others: Mapping[str, NoiseModel] = field(default_factory=dict, hash=False)
    """further sensors of the device: kind (:data:`poise.envs.sensors.kinds.KINDS`) → noise, in the kind's unit"""
    timing: Timing = PUNCTUAL
    """when its samples are taken and lost"""
    assumed: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)
    """kind → fields of its noise that no data sheet states, but that are assumed by the grade of the device"""

    @property
    def is_device(self) -> bool:
        """Whether it follows a data sheet and assumptions where that is silent; others are ideal, or as in a paper."""
        return bool(self.assumed)

    def noise_of(self, kind: str) -> NoiseModel | None:
        """The noise of its sensor of a kind; None where it has none."""
        own = {"gyroscope": self.gyroscope, "accelerometer": self.accelerometer, "magnetometer": self.magnetometer}
        return own[kind] if kind in own else self.others.get(kind)

    def scaled(self, noise_scale: float) -> Self:
        """The same device with errors ``noise_scale`` times as large (:meth:`NoiseModel.scaled`).

        Raises:
            ValueError: ``noise_scale`` is negative or not finite.
        """
        return replace(
            self,
            gyroscope=self.gyroscope.scaled(noise_scale),
            accelerometer=self.accelerometer.scaled(noise_scale),
            magnetometer=None if self.magnetometer is None else self.magnetometer.scaled(noise_scale),
            timing=self.timing.scaled(noise_scale),
            others={kind: noise.scaled(noise_scale) for kind, noise in self.others.items()},
        )


def device(
    grade: Grade,
    name: str,
    source: str,
    gyroscope: NoiseModel,
    accelerometer: NoiseModel,
    magnetometer: NoiseModel | None = None,
) -> SensorPreset:
    """A device by its data sheet, with what the sheet does not state assumed by its grade."""
    stated = {"gyroscope": gyroscope, "accelerometer": accelerometer, "magnetometer": magnetometer}
    filled = {kind: completed(noise, getattr(grade, kind)) for kind, noise in stated.items() if noise is not None}
    models, assumed = {kind: pair[0] for kind, pair in filled.items()}, {kind: pair[1] for kind, pair in filled.items()}
    source = f"{source}; what it does not state as of {grade.name} grade"
    return SensorPreset(
        name, source, models["gyroscope"], models["accelerometer"], models.get("magnetometer"), assumed=assumed
    )


PRESETS = (
    SensorPreset(
        "ideal",
        "no errors; generous ranges, because observations need bounds",
        NoiseModel(full_scale=KINDS["gyroscope"].full_scale),
        NoiseModel(full_scale=KINDS["accelerometer"].full_scale),
        NoiseModel(full_scale=KINDS["magnetometer"].full_scale),
    ),
    SensorPreset(
        "paper-hand",
        "our simulated analogue of the hand-held trials of J. K. Lee, E. J. Park, S. N. Robinovitch, Estimation of "
        "attitude and external acceleration using inertial sensor measurement during various dynamic conditions, IEEE "
        "Trans. Instrum. Meas. 61 (2012): white noise of 0.01 rad/s and 0.01 m/s² per sample at 100 Hz, bias 0.2 °/s "
        "and 0.02 m/s², scale 0.5 % and 0.2 %, one sigma per axis; ranges ours; no magnetometer",
        NoiseModel(white_noise=1e-3, turn_on_bias=0.2 * DEG, scale_factor=5e-3, full_scale=2000.0 * DEG),
        NoiseModel(white_noise=1e-3, turn_on_bias=0.02, scale_factor=2e-3, full_scale=16.0 * G),
    ),
    device(
        INDUSTRIAL,
        "xsens-mti-100",
        "Xsens MTi 100-series data sheet and user manual MT0605P, typical; bias repeatability 0.5 °/s (gyroscope) and "
        "0.03 m/s² (accelerometer) in one year; magnetometer 0.5 mG rms taken over its band of 100 Hz",
        model(
            10.0 * DEG_PER_HOUR,
            white_noise=0.01 * DEG,
            turn_on_bias=0.5 * DEG,
            g_sensitivity=0.003 * DEG / G,
            bandwidth=415.0,
            full_scale=450.0 * DEG,
        ),
        model(15.0 * MICRO_G, white_noise=60.0 * MICRO_G, turn_on_bias=0.03, bandwidth=375.0, full_scale=20.0 * G),
        model(white_noise=0.5e-3 * GAUSS / math.sqrt(100.0), resolution=0.25e-3 * GAUSS, full_scale=8.0 * GAUSS),
    ),
    device(
        INDUSTRIAL,
        "xsens-mtw-awinda",
        "Xsens MTw Awinda user manual, typical; turn-on biases as of the MTi-100",
        model(
            10.0 * DEG_PER_HOUR,
            white_noise=0.01 * DEG,
            turn_on_bias=0.5 * DEG,
            bandwidth=184.0,
            full_scale=2000.0 * DEG,
        ),
        model(100.0 * MICRO_G, white_noise=200.0 * MICRO_G, turn_on_bias=0.03, bandwidth=184.0, full_scale=160.0),
        model(white_noise=0.2e-3 * GAUSS, full_scale=1.9 * GAUSS),
    ),
    device(
        INDUSTRIAL,
        "vectornav-vn-100",
        "VectorNav VN-100 data sheet, typical: in-run stability below 0.04 mg and 10 °/h (upper bounds)",
        model(10.0 * DEG_PER_HOUR, white_noise=0.0035 * DEG, bandwidth=256.0, full_scale=2000.0 * DEG),
        model(40.0 * MICRO_G, white_noise=140.0 * MICRO_G, bandwidth=260.0, full_scale=16.0 * G),
        model(white_noise=140e-6 * GAUSS, resolution=1.5e-3 * GAUSS, bandwidth=200.0, full_scale=2.5 * GAUSS),
    ),
    device(
        INDUSTRIAL,
        "adis16470",
        "Analog Devices ADIS16470 data sheet, typical: 8 °/h, 0.008 °/s/√Hz, 13 µg, velocity random walk "
        "0.037 m/s/√h, 16-bit registers of 0.1 °/s and 1.25 mg; no magnetometer",
        model(
            8.0 * DEG_PER_HOUR, white_noise=0.008 * DEG, resolution=0.1 * DEG, bandwidth=550.0, full_scale=2000.0 * DEG
        ),
        model(13.0 * MICRO_G, white_noise=0.037 / 60.0, resolution=1.25e-3 * G, bandwidth=600.0, full_scale=40.0 * G),
    ),
    device(
        CONSUMER,
        "bosch-bmi160",
        "Bosch Sensortec BMI160 data sheet BST-BMI160-DS000, typical, ± 2000 °/s and ± 16 g: 0.007 °/s/√Hz, "
        "180 µg/√Hz, offsets ± 3 °/s and ± 40 mg, 16.4 LSB/(°/s), 2048 LSB/g; in-run stability not published; "
        "no magnetometer",
        NoiseModel(
            white_noise=0.007 * DEG, turn_on_bias=3.0 * DEG, resolution=DEG / 16.4, full_scale=32767.0 / 16.4 * DEG
        ),
        NoiseModel(
            white_noise=180.0 * MICRO_G, turn_on_bias=0.04 * G, resolution=G / 2048.0, full_scale=32767.0 / 2048.0 * G
        ),
    ),
    device(
        CONSUMER,
        "invensense-mpu-9250",
        "InvenSense MPU-9250 product specification PS-MPU-9250A-01 rev. 1.0, ± 2000 °/s and ± 16 g, uncalibrated part: "
        "0.01 °/s/√Hz, ± 5 °/s, ± 3 %, cross-axis ± 2 %; 300 µg/√Hz, ± 60 mg, ± 3 %, ± 2 %; magnetometer AK8963 "
        "0.15 µT/LSB, ± 4800 µT, its noise not published; in-run stability not published",
        NoiseModel(
            white_noise=0.01 * DEG,
            turn_on_bias=5.0 * DEG,
            scale_factor=0.03,
            misalignment=0.02,
            resolution=DEG / 16.4,
            bandwidth=250.0,
            full_scale=2000.0 * DEG,
        ),
        NoiseModel(
            white_noise=300.0 * MICRO_G,
            turn_on_bias=0.06 * G,
            scale_factor=0.03,
            misalignment=0.02,
            resolution=G / 2048.0,
            bandwidth=260.0,
            full_scale=16.0 * G,
        ),
        NoiseModel(resolution=0.15, full_scale=4800.0),
    ),
    device(
        CONSUMER,
        "st-lsm6dsox",
        "STMicroelectronics LSM6DSOX data sheet, typical, high-performance mode, ± 2000 °/s and ± 16 g: 3.8 mdps/√Hz, "
        "± 1 °/s, 70 mdps/LSB; 110 µg/√Hz, ± 20 mg, 0.488 mg/LSB; sensitivity ± 1 %; in-run stability not published; "
        "no magnetometer",
        NoiseModel(
            white_noise=3.8e-3 * DEG,
            turn_on_bias=1.0 * DEG,
            scale_factor=0.01,
            resolution=0.07 * DEG,
            full_scale=2000.0 * DEG,
        ),
        NoiseModel(
            white_noise=110.0 * MICRO_G,
            turn_on_bias=0.02 * G,
            scale_factor=0.01,
            resolution=0.488e-3 * G,
            full_scale=16.0 * G,
        ),
    ),
)
"""All presets. Numbers that a data sheet states as limits, or that we chose, are named in ``source``."""


def list_sensor_presets() -> list[str]:
    """Names that :func:`sensor_preset` takes."""
    return [preset.name for preset in PRESETS]


def sensor_preset(name: str) -> SensorPreset:
    """The preset of a device.

    Raises:
        ValueError: there is none of that name; the message names the nearest one and lists all.
    """
    return look_up("sensor preset", name, {preset.name: preset for preset in PRESETS})
