"""Sensors on rider and bicycle, placed, clocked and disturbed as in the papers; suites named after them.

Sensor axes are x forward, y left, z up along their body, also where a paper uses others: signs change, nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...filters import rotation
from ...filters.quantity import Channel
from ..noise_model import NoiseModel
from ..placed_sensor import Kind, Sensor
from ..sensors import STANDARD_GRAVITY, BodyState, Mounting, Sampling
from ..suite import SensorSuite
from .contact_forces import LoadCells
from .posture import SIDES, Posture
from .ride_log import RideLog

DEG, G = math.pi / 180.0, STANDARD_GRAVITY
ENCODER = 2.0 * math.pi / 1024.0
"""rad: 256 lines, four edges each"""
IMU_PLACE = (0.37, 0.0, 0.71)
"""m in the bicycle frame: p_x and p_z of the papers"""
IMU_TILT = 10.0 * DEG
"""rad, nose up: α (ξ) of the papers"""
SEAT_TILT = 20.0 * DEG
"""rad: γ between bicycle frame and seat sensor"""

IMU_GYRO = NoiseModel(0.05 * DEG, turn_on_bias=0.5 * DEG, bandwidth=100.0, full_scale=300.0 * DEG)
"""inertial unit 605 of the papers: 0.05 °/s/√Hz, bias below 1 °/s (taken as two sigma), bandwidth 100 Hz; range ours"""
IMU_ACCELEROMETER = NoiseModel(100e-6 * G, turn_on_bias=7.5e-3 * G, full_scale=2.0 * G)
"""unit 605: 100 µg/√Hz, bias below 15 mg (two sigma); it clips at 2 g in the whole-body paper's bumps"""
LIMB_GYRO = NoiseModel(0.03 * DEG, turn_on_bias=0.05 * DEG, resolution=0.1 * DEG, full_scale=1000.0 * DEG)
"""limb gyroscopes: 0.1 °/s resolution, 200 °/h; white noise and range are ours (not published)"""
FORCE = NoiseModel(0.3, full_scale=3000.0)
"""seat and handlebar forces: 3 N a sample at 100 Hz (ours; not published)"""
MOMENT = NoiseModel(0.05, full_scale=1000.0)
"""seat moments: 0.5 N·m a sample at 100 Hz (ours; not published)"""
CELL = NoiseModel(0.2, full_scale=3000.0)
"""load cells: 2 N a sample at 100 Hz (ours; not published)"""
WHEEL = NoiseModel(0.002, full_scale=20.0)
"""wheel speed from its encoder: 0.02 m/s a sample at 100 Hz (ours; the encoder has 256 lines)"""
ANGLE = NoiseModel(resolution=ENCODER, full_scale=math.pi)
"""steering and crank encoders with 256 lines"""
COMPASS = NoiseModel(0.05, turn_on_bias=0.5, full_scale=800.0)
"""magnetometer, µT: 0.5 µT a sample at 100 Hz and hard iron of 0.5 µT (ours)"""
RELATIVE = NoiseModel(full_scale=1.0)
"""relative orientation: its errors are rotations, see :class:`CameraErrors`"""


@dataclass(frozen=True)
class CameraErrors:
    """Errors of the camera that sees the trunk's marker: rotations before the quaternion is formed.

    The two-gyro paper names the camera but no errors; these are what its reported 2° of trunk angles suggest.
    """

    noise: float = 0.5 * DEG
    """rad an axis and sample"""
    alignment: float = 2.0 * DEG
    """rad an axis: standard deviation of the slowly varying misalignment"""
    correlation_time: float = 20.0
    """s"""


@dataclass(frozen=True)
class _Entry:
    """One channel of the catalogue."""

    name: str
    size: int
    unit: str
    kind: Kind
    noise: NoiseModel
    body: str = "bicycle"
    rate: float = 100.0


TWO_GYRO = ("bicycle_imu/gyr", "trunk_imu/gyr", "relative/orientation")
IMUS = ("bicycle_imu/gyr", "bicycle_imu/acc", "trunk_imu/gyr", "trunk_imu/acc")
SEAT = ("seat/force", "seat/moment")
CATALOGUE = {
    entry.name: entry
    for entry in (
        _Entry("bicycle_imu/gyr", 3, "rad/s", "gyroscope", IMU_GYRO),
        _Entry("bicycle_imu/acc", 3, "m/s²", "accelerometer", IMU_ACCELEROMETER),
        _Entry("bicycle_imu/mag", 3, "µT", "magnetometer", COMPASS),
        _Entry("trunk_imu/gyr", 3, "rad/s", "gyroscope", IMU_GYRO, "trunk"),
        _Entry("trunk_imu/acc", 3, "m/s²", "accelerometer", replace(IMU_ACCELEROMETER, full_scale=6.0 * G), "trunk"),
        *(
            _Entry(f"{part}_{side}/gyr", 3, "rad/s", "gyroscope", LIMB_GYRO, f"{part}_{side}")
            for part in ("upper_arm", "thigh")
            for side in SIDES
        ),
        _Entry("seat/force", 3, "N", "given", FORCE),
        _Entry("seat/moment", 3, "N·m", "given", MOMENT),
        _Entry("seat/load_cells", 3, "N", "given", CELL),
        _Entry("handlebar/force", 6, "N", "given", FORCE),
        _Entry("wheel/speed", 1, "m/s", "given", WHEEL),
        _Entry("steer/angle", 1, "rad", "given", ANGLE),
        _Entry("crank/angle", 1, "rad", "given", ANGLE),
        _Entry("relative/orientation", 4, "1", "given", RELATIVE, rate=25.0),
    )
}
"""All channels that exist."""
SUITES: dict[str, tuple[tuple[str, ...], float]] = {
    "two-gyro": (TWO_GYRO, 100.0),
    "force-inertial": ((*IMUS, *SEAT, "seat/load_cells", "handlebar/force", "wheel/speed"), 50.0),
    "whole-body": (
        (
            *IMUS,
            *(f"{part}_{side}/gyr" for part in ("upper_arm", "thigh") for side in SIDES),
            *SEAT,
            "wheel/speed",
            "steer/angle",
            "crank/angle",
        ),
        100.0,
    ),
    "all": (tuple(name for name in CATALOGUE if name != "bicycle_imu/mag"), 100.0),
}
"""Suite name → channels and rate (Hz)."""


def list_suites() -> list[str]:
    """Names of suites."""
    return list(SUITES)


def choose_channels(suite: str | Sequence[str]) -> tuple[tuple[str, ...], float]:
    """Channels and rate of a suite by name, or of a list of channels at 100 Hz.

    Raises:
        ValueError: an unknown suite or channel, or a channel twice.
    """
    if isinstance(suite, str):
        if suite not in SUITES:
            raise ValueError(f"suite must be one of {list_suites()} or a list of channels, got {suite!r}")
        return SUITES[suite]
    names = tuple(suite)
    unknown = [name for name in names if name not in CATALOGUE]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"channels must be different ones of {list(CATALOGUE)}, got {list(names)}")
    return names, 100.0


def tilt(angle: float) -> tuple[float, float, float, float]:
    """Mounting of a sensor whose nose points up by an angle (rad)."""
    return math.cos(0.5 * angle), 0.0, -math.sin(0.5 * angle), 0.0


class RiderSensing:
    """The sensors of one environment.

    Args:
        suite: name or channels, see :func:`choose_channels`.
        rate: ticks a second, Hz; None for that of the suite.
        grade: all errors times this.
        sampling: of gyroscopes and accelerometers.
        gravity: m/s².
        camera: errors of the relative orientation, before ``grade``.
    """

    def __init__(
        self,
        suite: str | Sequence[str],
        rate: float | None,
        grade: float,
        sampling: Sampling,
        gravity: float,
        camera: CameraErrors | None = None,
    ) -> None:
        self.names, default = choose_channels(suite)
        self.rate = default if rate is None else float(rate)
        if not 1.0 <= self.rate <= 500.0:
            raise ValueError(f"rate must lie in [1, 500] Hz, got {rate}")
        self.grade, self.sampling, self.gravity = grade, sampling, gravity
        errors = CameraErrors() if camera is None else camera
        self.camera = replace(errors, noise=grade * errors.noise, alignment=grade * errors.alignment)
        self.cells = LoadCells()

    def build(self, trunk_imu: tuple[float, float, float]) -> SensorSuite:
        """The suite for a person whose trunk IMU sits at this place of the trunk frame (m)."""
        places = {
            "bicycle_imu": Mounting(IMU_PLACE, tilt(IMU_TILT)),
            "trunk_imu": Mounting(trunk_imu),
        }
        sensors = []
        for name in self.names:
            entry = CATALOGUE[name]
            mounting = places.get(name.split("/")[0], Mounting())
            sensors.append(
                Sensor(
                    Channel(name, entry.size, entry.unit),
                    entry.kind,
                    min(entry.rate, self.rate),
                    entry.noise.scaled(self.grade),
                    entry.body,
                    mounting,
                    self.sampling,
                )
            )
        return SensorSuite(sensors, self.rate, gravity=self.gravity)

    def start(self, rng: np.random.Generator) -> None:
        """Draw what the camera's errors begin with."""
        self._rng = rng
        self._alignment = self.camera.alignment * rng.standard_normal(3)

    def given(self, log: RideLog, posture: Posture, bodies: Mapping[str, BodyState]) -> dict[str, np.ndarray]:
        """Ideal readings of what is no inertial sensor, channel → ``(n, size)``; the camera's errors included."""
        wanted = [name for name in self.names if CATALOGUE[name].kind == "given"]
        back, contact = bodies["bicycle"].orientation, log.contact
        seat_turn = np.array(tilt(-SEAT_TILT))
        force, moment = (rotation.rotate_back(back, part) for part in (contact.seat_force, contact.seat_moment))
        hands = rotation.rotate_back(back[:, None], contact.hands)
        values = {
            # the seat sensor is pitched forward under the saddle
            "seat/force": rotation.rotate_back(seat_turn, force),
            "seat/moment": rotation.rotate_back(seat_turn, moment),
            "seat/load_cells": self.cells.share(-force, -moment),
            "handlebar/force": hands.reshape(len(hands), 6),
            "wheel/speed": posture.bicycle.rear_wheel.radius * log.rates[:, 2:],
            "steer/angle": log.steer[:, None],
            "crank/angle": rotation.wrap(log.crank)[:, None],
        }
        if "relative/orientation" in wanted:
            values["relative/orientation"] = self._seen(bodies)
        return {name: values[name] for name in wanted}

    def _seen(self, bodies: Mapping[str, BodyState]) -> np.ndarray:
        """What the camera says: trunk to bicycle ``(n, 4)``, with noise and a drifting alignment."""
        true = rotation.multiply(rotation.conjugate(bodies["bicycle"].orientation), bodies["trunk"].orientation)
        decay = math.exp(-1.0 / (self.rate * self.camera.correlation_time))
        drive = self.camera.alignment * math.sqrt(1.0 - decay**2) * self._rng.standard_normal((len(true), 3))
        noise = self.camera.noise * self._rng.standard_normal((len(true), 3))
        errors = np.empty((len(true), 3))
        for row in range(len(true)):
            self._alignment = decay * self._alignment + drive[row]
            errors[row] = self._alignment + noise[row]
        return rotation.positive(rotation.multiply(true, rotation.exp(errors)))

    def truth(self) -> dict[str, np.ndarray]:
        """The camera's misalignment now ``(3,)``, rad, trunk axes."""
        return {"relative/alignment": self._alignment.copy()} if "relative/orientation" in self.names else {}

    def save(self) -> Any:
        """Memory of the camera's errors."""
        return self._rng.bit_generator.state, self._alignment.copy()

    def restore(self, saved: Any) -> None:
        """Undo :meth:`save`."""
        state, self._alignment = saved[0], saved[1].copy()
        self._rng = np.random.default_rng(0)
        self._rng.bit_generator.state = state
