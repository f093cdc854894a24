"""Random trajectories of a hand-held sensor without an environment, in some milliseconds per episode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from ...filters.core import rotation
from ..data.trajectory import Trajectory
from ..record import record_once
from ..sensors.presets import SensorPreset, sensor_preset
from ..sensors.suite import imu_suite
from .environment import HandMotionEnv
from .gestures import GestureConfig, gesture_config, gesture_name
from .sensing import simulate_hand


@dataclass(frozen=True)
class HandTrajectories:
    """A distribution of hand motions and sensors.

    Where several gestures, rates or sensors are given, each trajectory draws one of each with equal probability. A
    single value stands for a tuple of one.

    Attributes:
        gestures: names of :data:`poise.envs.hand.gestures.GESTURES`, or configurations.
        rates: Hz.
        sensors: names of sensor presets, or presets.
        noise_scale: lowest and highest factor on all errors of the sensor, drawn log-uniformly.
        duration: s.
        lever_arm: standard deviation of the sensor site on the body, m per axis.
        mounting: ``random``: the axes of the sensor are drawn evenly from all rotations; ``aligned``: they are the
        body's.
        drive: ``kinematic``: the body follows the gesture exactly; ``dynamic``: an arm pulls it along.

    Raises:
        ValueError: a name is unknown or a number out of its range.
    """

    gestures: tuple[str | GestureConfig, ...] = ("mixed",)
    rates: tuple[float, ...] = (100.0,)
    sensors: tuple[str | SensorPreset, ...] = ("xsens-mtw-awinda",)
    noise_scale: tuple[float, float] = (1.0, 1.0)
    duration: float = 60.0
    lever_arm: float = 0.05
    mounting: Literal["random", "aligned"] = "random"
    drive: Literal["kinematic", "dynamic"] = "kinematic"

    def __post_init__(self) -> None:
        for name in ("gestures", "rates", "sensors"):
            object.__setattr__(self, name, several(name, getattr(self, name)))
        noise_scale = (
            (self.noise_scale, self.noise_scale)
            if isinstance(self.noise_scale, int | float)
            else tuple(self.noise_scale)
        )
        object.__setattr__(self, "noise_scale", noise_scale)
        for gesture in self.gestures:
            gesture_config(gesture)
        for sensor in self.sensors:
            as_preset(sensor)
        if not all(isinstance(rate, int | float) and 1.0 <= rate < math.inf for rate in self.rates):
            raise ValueError(f"rate must be at least 1 Hz and finite, got {list(self.rates)}")
        if len(noise_scale) != 2 or not 0.0 < noise_scale[0] <= noise_scale[1] < math.inf:
            raise ValueError(f"noise_scale must be a positive number or (lowest, highest), got {self.noise_scale!r}")
        if not 0.0 < self.duration < math.inf:
            raise ValueError(f"duration must be positive seconds, got {self.duration}")
        if not 0.0 <= self.lever_arm < math.inf:
            raise ValueError(f"lever_arm must be metres, 0 or more, got {self.lever_arm}")
        for name, known in (("mounting", ("random", "aligned")), ("drive", ("kinematic", "dynamic"))):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} must be one of {list(known)}, got {getattr(self, name)!r}")

    def draw(self, generator: np.random.Generator, name: str | None = None) -> Trajectory:
        """Draw one trajectory; one child of the generator is used for the setting, another for motion and errors.

        Returns:
            Measurements and truth as of :class:`.HandMotionEnv`; metadata with what was drawn, and the ``name``, which
            is that of gesture and seed if None.
        """
        choice, episode = generator.spawn(2)
        gesture = self.gestures[choice.integers(len(self.gestures))]
        rate = float(self.rates[choice.integers(len(self.rates))])
        device = as_preset(self.sensors[choice.integers(len(self.sensors))])
        noise_scale = float(np.exp(choice.uniform(*np.log(self.noise_scale))))
        turn = rotation.random(choice)
        axes = turn if self.mounting == "random" else np.array([1.0, 0.0, 0.0, 0.0])
        site: dict[str, Any] = {"lever_arm": choice.normal(0.0, self.lever_arm, 3), "mounting": axes}
        suite = imu_suite(device, rate, noise_scale=noise_scale)
        seed = int(episode.integers(2**32))
        if self.drive == "kinematic":
            trajectory = simulate_hand(gesture, seed, suite, duration=self.duration, **site)
        else:
            env = HandMotionEnv(gesture, "dynamic", suite, duration=self.duration, **site)
            trajectory = record_once(env, seed)
        drawn = {
            "gesture": gesture_name(gesture),
            "device": device.name,
            "noise_scale": noise_scale,
            "drive": self.drive,
        }
        metadata = trajectory.metadata | drawn
        return trajectory.replace(metadata=metadata if name is None else metadata | {"name": name})

    def describe(self) -> dict[str, Any]:
        """Everything about it, for JSON."""
        described = {field.name: getattr(self, field.name) for field in fields(self)}
        described["gestures"] = [gesture_name(gesture) for gesture in self.gestures]
        described["sensors"] = [as_preset(sensor).name for sensor in self.sensors]
        return {name: list(value) if isinstance(value, tuple) else value for name, value in described.items()}

    def draw_many(self, seed: int, count: int) -> list[Trajectory]:
        """A reproducible set, named ``hand-<seed>-<index>``; a larger ``count`` keeps the first ones."""
        children = np.random.SeedSequence(seed).spawn(count)
        return [self.draw(np.random.default_rng(child), f"hand-{seed}-{index}") for index, child in enumerate(children)]


def as_preset(sensor: str | SensorPreset) -> SensorPreset:
    """The preset of a name, or the preset itself."""
    return sensor if isinstance(sensor, SensorPreset) else sensor_preset(sensor)


def several(name: str, value: Any) -> tuple[Any, ...]:
    """A tuple of at least one; a single string or number stands for itself."""
    values = tuple(value) if isinstance(value, Sequence) and not isinstance(value, str) else (value,)
    if not values:
        raise ValueError(f"{name} must not be empty")
    return values
