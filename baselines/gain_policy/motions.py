"""Motions that shipped policies are trained on: hand-held and carried devices of all grades, and rides."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any, Protocol

from ...envs.data.trajectory import Trajectory
from ...envs.hand.carried import Carried
from ...envs.hand.everyday import ALONE
from ...envs.hand.hand_held import HandHeld
from ...envs.hand.parts.shaking import Vibration
from ...envs.recipes.devices import VariedSensors
from ...envs.recipes.hand import HandRecipe
from ...envs.recipes.rides import RideSource, drawn
from ...filters.core.quantity import DEG
from ...filters.support.ranges import Range
from ...filters.support.seeds import child_seed


class Motions(Protocol):
    """A distribution of trajectories."""

    def draw_many(self, seed: int, count: int) -> list[Trajectory]:
        """The first trajectories of the root seed; a larger ``count`` keeps the first ones."""
        ...

    def describe(self) -> dict[str, Any]:
        """All settings, for JSON."""
        ...


@dataclass(frozen=True)
class GradedMotions:
    """Devices in the hand and carried, of several grades, at a few rates; one of each combination after the other.

    Few rates, because the trajectories of one rate are computed together.
    """

    rates: tuple[float, ...] = (100.0, 286.0)
    """Hz"""
    gyroscope_biases: tuple[Range, ...] = ((0.03 * DEG, 0.8 * DEG), (0.03 * DEG, 0.8 * DEG), (0.5 * DEG, 6.0 * DEG))
    """rad/s of each grade: two thirds of the devices are calibrated, the others as phones without calibration"""
    accelerometer_biases: tuple[Range, ...] = ((0.01, 0.1), (0.01, 0.1), (0.02, 0.2))
    """m/s² of each grade"""
    carried_share: float = 0.25
    """of the episodes"""
    running_share: float = 0.15
    """of the carried devices"""
    first_rest: Range = (0.3, 10.0)
    """s"""
    duration: float = 60.0
    """s"""
    held: HandHeld = field(default_factory=lambda: HandHeld(moving_start_share=0.15))
    """motion of the devices that are not carried; their first rest is that of all"""
    sensors: VariedSensors = field(default_factory=VariedSensors)
    """other errors of the devices"""

    def __post_init__(self) -> None:
        if not self.rates or not self.gyroscope_biases:
            raise ValueError("rates and gyroscope_biases must hold one entry at least")
        if len(self.gyroscope_biases) != len(self.accelerometer_biases):
            raise ValueError(
                f"accelerometer_biases must have the {len(self.gyroscope_biases)} grades of gyroscope_biases, "
                f"got {len(self.accelerometer_biases)}"
            )

    def recipes(self) -> list[HandRecipe]:
        """One for each grade and rate."""
        grades = zip(self.gyroscope_biases, self.accelerometer_biases, strict=True)
        return [
            HandRecipe(
                name="graded",
                duration=self.duration,
                rates=(rate, rate),
                held=dataclasses.replace(self.held, first_rest=self.first_rest),
                carried=Carried(first_rest=self.first_rest, running_share=self.running_share),
                carried_share=self.carried_share,
                sensors=dataclasses.replace(self.sensors, gyroscope_bias=gyroscope, accelerometer_bias=accelerometer),
            )
            for gyroscope, accelerometer in grades
            for rate in self.rates
        ]

    def draw_many(self, seed: int, count: int) -> list[Trajectory]:
        """The first trajectories of the root seed."""
        recipes = self.recipes()
        return [recipes[index % len(recipes)].episode(seed, index) for index in range(count)]

    def describe(self) -> dict[str, Any]:
        """All fields, for JSON."""
        return {"kind": "graded", **dataclasses.asdict(self)}


FLOWN_MOTIONS = GradedMotions(
    gyroscope_biases=((0.03 * DEG, 0.8 * DEG), (0.5 * DEG, 6.0 * DEG)),
    accelerometer_biases=((0.01, 0.1), (0.02, 0.2)),
    carried_share=0.0,
    first_rest=(0.3, 5.0),
    duration=40.0,
    held=HandHeld(
        moving_start_share=0.15,
        rest_shares=(0.0, 0.0, 0.0, 0.1),
        acceleration=(0.3, 4.0),
        largest_acceleration=8.0,
        rate=(0.1, 2.5),
        largest_rate=5.0,
        reach=5.0,
        position_band=((0.03, 0.3), (0.2, 1.5)),
        angle_band=((0.03, 0.3), (0.15, 3.0)),
        rhythmic_share=0.1,
        over=dataclasses.replace(
            ALONE,
            clean_share=0.1,
            vibration_share=0.9,
            vibration=Vibration(frequency=(20.0, 200.0), acceleration=(0.3, 6.0)),
        ),
    ),
    sensors=VariedSensors(gyroscope_noise=(0.005 * DEG, 0.1 * DEG), accelerometer_noise=(5e-3, 0.1)),
)
"""Devices that travel metres with slow accelerations and shake, as on a drone, a vehicle or a running machine; their
levels are our choice."""


@dataclass(frozen=True)
class MixedMotions:
    """Several distributions, from which trajectories are drawn in turn."""

    parts: tuple[Motions, ...]

    def draw_many(self, seed: int, count: int) -> list[Trajectory]:
        """The first trajectories of the root seed."""
        each = -(-count // len(self.parts))
        drawn = [part.draw_many(child_seed(seed, index), each) for index, part in enumerate(self.parts)]
        return [one for turn in zip(*drawn, strict=True) for one in turn][:count]

    def describe(self) -> dict[str, Any]:
        """All fields, for JSON."""
        return {"kind": "mixed", "parts": [part.describe() for part in self.parts]}


UNEVEN = ("indoor_circle", "outdoor", "straight", "slalom", "slow", "gusts", "bumps", "bumps", "pitch", "pitch")
"""Scenarios of rides, drawn evenly: two fifths with bumps or a ramp, where level ground must not be believed."""

PAPER_SENSORS = {
    "devices": ["paper"],
    "noise_scale": [1.0, 1.0],
    "timing": {"late_share": 0.0, "packet_loss_share": 0.0},
}
"""Sensors of the published experiments: filters that assume these noises diverge with noisier gyroscopes."""


def uneven_rides() -> RideSource:
    """Rides of 40 s, half of them on other roads than the scenario's, with the sensors of the publications."""
    return RideSource(24, 2, 40.0, {"scenarios": list(UNEVEN), "sensors": dict(PAPER_SENSORS)})


@dataclass(frozen=True)
class RiddenMotions:
    """Rides with several draws of devices on each; the rides are kept in the user's cache folder."""

    source: RideSource = field(default_factory=uneven_rides)
    """which rides"""

    def draw_many(self, seed: int, count: int) -> list[Trajectory]:
        """The first draws of the first rides of the root seed."""
        return self.devices(seed, count, 0)

    def devices(self, seed: int, count: int, index: int) -> list[Trajectory]:
        """The same rides with other devices: set ``index`` of the draws on each ride."""
        draws = self.source.draws
        source = dataclasses.replace(self.source, draws=(index + 1) * draws)
        rides = range(math.ceil(count / draws))
        return [each for ride in rides for each in drawn(source, seed, ride)[index * draws :]][:count]

    def describe(self) -> dict[str, Any]:
        """All fields, for JSON."""
        return {"kind": "ridden", **dataclasses.asdict(self.source)}
