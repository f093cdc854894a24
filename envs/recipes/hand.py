"""Motions of hand-held and carried devices, sensors and mountings, drawn wider than test data: recordings lie inside.

Rests of any length, motions from tremor to shaking and running, at 50 to 300 Hz, with random sensor, mounting and
motion parameters in each episode.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from ...filters.core import rotation
from ...filters.support.ranges import Range, log_uniform
from ...filters.support.seeds import named_generator
from ..data.trajectory import Trajectory, trusted
from ..hand.carried import Carried
from ..hand.gestures import GESTURES, GestureConfig, gesture_config
from ..hand.hand_held import HandHeld
from ..sensors.ideal import Mounting, mounted
from ..sensors.magnetics import MAGNETICS
from ..sensors.suite import imu_suite
from .devices import VariedSensors
from .recipe import Recipe, check_some, chosen, unspawned


@dataclass(frozen=True)
class HandRecipe(Recipe):
    """A distribution of hand motions, devices and mountings; no physics engine is used.

    An episode has the channels ``imu/gyr`` (rad/s) and ``imu/acc`` (m/s²), with a magnetometer ``imu/mag`` (µT), NaN
    where a sample is lost, and the truth ``orientation`` (sensor to world) and ``position`` (of the sensor, m).
    """

    kind: ClassVar[str] = "hand"

    duration: float = 150.0
    """s"""
    rates: Range = (50.0, 300.0)
    """Hz"""
    instant_share: float = 0.3
    """of the episodes at ``instant_rate`` or more, whose sensors report instants instead of means"""
    instant_rate: float = 120.0
    """Hz; below it instants alias what means do not"""
    lever_arm: Range = (0.005, 0.2)
    """m, standard deviation per axis of the sensor's position on the hand"""
    held: HandHeld = field(default_factory=lambda: HandHeld(first_rest=(0.3, 40.0), moving_start_share=0.15))
    carried: Carried = field(default_factory=lambda: Carried(first_rest=(0.3, 20.0), running_share=0.15))
    carried_share: float = 0.25
    """of the episodes in which the device is carried, not moved by the hand alone"""
    gestures: tuple[str, ...] = ()
    """names of gestures (:data:`poise.envs.hand.gestures.GESTURES`), of which the hand makes one an episode instead of
    what ``held`` draws"""
    magnetics: tuple[str, ...] = ()
    """names of magnetic surroundings (:data:`poise.envs.sensors.magnetics.MAGNETICS`), of which an episode has one;
    without any, devices have no magnetometer"""
    sensors: VariedSensors = field(default_factory=VariedSensors)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, known in (("magnetics", tuple(MAGNETICS)), ("gestures", tuple(GESTURES))):
            if getattr(self, name):
                check_some(name, getattr(self, name), known)
        if not self.duration * self.rates[0] >= 2.0:
            raise ValueError(f"duration must be two samples at least, got {self.duration} s")

    def draw(self, seed: int | np.random.SeedSequence, name: str = "randomised") -> Trajectory:
        """Simulate one episode; separate children of its seed are used for motion, setting and errors."""
        sequence = unspawned(seed)
        motion, setting, noise = (np.random.default_rng(child) for child in sequence.spawn(3))
        rate = log_uniform(setting, self.rates)
        means = rate < self.instant_rate or setting.random() >= self.instant_share
        sampling: Literal["interval", "instant"] = "interval" if means else "instant"
        lever = tuple(setting.standard_normal(3) * log_uniform(setting, self.lever_arm))
        mounting = Mounting(lever, tuple(rotation.random(setting)))
        device = self.sensors.draw(setting)
        magnetics = chosen(named_generator(setting, "magnetics"), self.magnetics) if self.magnetics else None
        suite = imu_suite(
            device, rate, lever, mounting.rotation, self.magnetics != (), sampling=sampling, magnetics=magnetics
        )
        suite.reset(noise)
        carried = setting.random() < self.carried_share
        moves: GestureConfig = self.carried if carried else self.held
        if self.gestures and not carried:
            moves = gesture_config(chosen(named_generator(setting, "gesture"), self.gestures))
        gesture = moves.draw(motion, self.duration)
        times = np.arange(1, math.floor(self.duration * rate) + 1) / rate
        states = gesture.sample(times)
        before = gesture.sample(times - 1.0 / rate)
        measurements = suite.simulate(states, before=before).measurements
        metadata: dict[str, Any] = {"name": name, "source": "simulation", "rate": rate, "sampling": sampling}
        sensor = mounted(states, mounting)
        truth = {"orientation": sensor.orientation, "position": sensor.position}
        return trusted(Trajectory(times, measurements, truth, metadata=metadata))
