"""Rides of random people on random courses, with random sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ...filters.bicycle.geometry import TapeMeasure
from ...filters.support.ranges import Checked, Range, log_uniform
from ...filters.support.seeds import named_generator
from ..bicycle.course.scenarios import list_scenarios, scenario
from ..bicycle.course.surfaces import list_surfaces
from ..bicycle.frame.bicycles import BICYCLES
from ..bicycle.ride.pilot import PILOTS
from ..bicycle.rider.anthropometry import SUBJECTS
from ..bicycle.rider.style import rider_style
from ..bicycle.sensors.placement import placement_errors
from ..bicycle.sensors.suites import suite_channels
from ..data.trajectory import Trajectory
from ..sensors.presets import list_sensor_presets
from .devices import VariedTiming
from .recipe import Recipe, check_some, chosen, unspawned
from .redraw import redrawn

RIDDEN = tuple(name for name, bicycle in BICYCLES.items() if bicycle.drive is not None)
"""Bicycles with pedals"""


@dataclass(frozen=True)
class RideSensors(Checked):
    """Devices of a ride, and the rider data that filters are configured with."""

    devices: tuple[str, ...] = ("paper", "xsens-mtw-awinda", "bosch-bmi160", "st-lsm6dsox")
    """``paper`` or names of sensor presets, drawn evenly: the inertial sensors"""
    noise_scale: Range = (0.5, 2.0)
    """1: factor on all errors"""
    tape: TapeMeasure = field(default_factory=TapeMeasure)
    """with which the rider's geometry is measured"""
    timing: VariedTiming = field(default_factory=VariedTiming)
    """of each device on rider and bicycle"""
    mirrored_share: float = 0.5
    """of the episodes, in which left and right are exchanged"""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_some("devices", self.devices, ("paper", *list_sensor_presets()))


@dataclass(frozen=True)
class RiderRecipe(Recipe):
    """A distribution of rides in ``poise/RiderBicycle-v0``.

    An episode is a ride with ideal sensors (:meth:`ride`), to which the errors of one draw of devices are added
    (:func:`.redrawn`), so that one ride serves for several draws. Everything else is as the environment describes.
    """

    kind: ClassVar[str] = "rider"

    duration: float = 60.0
    """s"""
    suite: tuple[str, ...] = ("all",)
    """a suite, or channels, see :mod:`poise.envs.bicycle.sensors.suites`"""
    rate: float = 100.0
    """Hz"""
    fidelity: tuple[str, ...] = ("full",)
    """``full``, ``lumped``, or both, drawn evenly like all names below"""
    scenarios: tuple[str, ...] = tuple(list_scenarios())
    """names of scenarios, also composed"""
    subjects: tuple[int | str, ...] = ("random",)
    """numbers of riders, ``random`` among them"""
    styles: tuple[str, ...] = ("random",)
    """names of riding styles, ``random`` among them: one between mild and aggressive"""
    bicycles: tuple[str, ...] = RIDDEN
    """names of bicycles"""
    pilots: tuple[str, ...] = ("expert", "skilled", "novice")
    """names of pilots"""
    surfaces: tuple[str, ...] = ("scenario", "random")
    """names of road surfaces; ``scenario``: that of the scenario, ``random``: any"""
    placement_errors: float = 1.0
    """1: factor on :class:`poise.envs.bicycle.sensors.placement.PlacementErrors`"""
    soft_tissue: Range = (0.5, 2.5)
    """1: factor on the motion of soft tissue below worn sensors; the widest is such that the chest sensor of a recorded
    ride (95 % of its angular rate below 6.9 Hz) lies inside"""
    sensors: RideSensors = field(default_factory=RideSensors)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, known in (
            ("suite", None),
            ("scenarios", None),
            ("styles", None),
            ("fidelity", ("full", "lumped")),
            ("bicycles", RIDDEN),
            ("subjects", ("random", *range(len(SUBJECTS)))),
            ("pilots", ("ideal", "random", *PILOTS)),
            ("surfaces", ("scenario", "random", *list_surfaces())),
        ):
            check_some(name, getattr(self, name), known)
        suite_channels(self.channels)
        for each in self.scenarios:
            scenario(each)
        for each in self.styles:
            rider_style(each, np.random.default_rng(0))
        placement_errors(self.placement_errors)
        if not self.duration >= 0.1:
            raise ValueError(f"duration must be at least 0.1 s, got {self.duration}")

    @property
    def channels(self) -> str | tuple[str, ...]:
        """The suite, as the environment takes it."""
        return self.suite if len(self.suite) > 1 or "/" in self.suite[0] else self.suite[0]

    def options(self, seed: np.random.SeedSequence) -> dict[str, Any]:
        """Draw the arguments of the environment, each from a descendant of the seed by its own name."""
        generator = np.random.default_rng(seed)

        def one(name: str, values: tuple[Any, ...]) -> Any:
            return chosen(named_generator(generator, name), values)

        surface = one("surface", self.surfaces)
        return {
            "scenario": one("scenario", self.scenarios),
            "subject": one("subject", self.subjects),
            "style": one("style", self.styles),
            "bicycle": one("bicycle", self.bicycles),
            "pilot": one("pilot", self.pilots),
            "fidelity": one("fidelity", self.fidelity),
            "surface": None if surface == "scenario" else surface,
            "placement_errors": self.placement_errors,
            "soft_tissue": log_uniform(named_generator(np.random.default_rng(seed), "soft_tissue"), self.soft_tissue),
        }

    def ride(self, seed: int | np.random.SeedSequence, name: str = "ride") -> Trajectory:
        """The ride of an episode with ideal sensors, before any errors."""
        from ..bicycle.environment import RiderBicycleEnv
        from ..record import record_once

        setting, motion, _ = unspawned(seed).spawn(3)
        options = self.options(setting)
        env = RiderBicycleEnv(**options, suite=self.channels, sensors="ideal", rate=self.rate, duration=self.duration)
        trajectory = record_once(env, int(motion.generate_state(1)[0]))
        return trajectory.replace(metadata=trajectory.metadata | options | {"name": name})

    def draw(self, seed: int | np.random.SeedSequence, name: str = "randomised") -> Trajectory:
        """Ride, and add the errors of one draw of sensors; setting, ride and sensors have seeds of their own."""
        return self.sensed(self.ride(seed, name), unspawned(seed).spawn(3)[2])

    def sensed(self, ride: Trajectory, seed: int | np.random.SeedSequence) -> Trajectory:
        """A draw of devices, their errors and the measured geometry on a :meth:`ride`; any number of them a ride."""
        setting, errors = unspawned(seed).spawn(2)
        generator, sensors = np.random.default_rng(setting), self.sensors
        return redrawn(
            ride,
            errors,
            sensors=chosen(generator, sensors.devices),
            noise_scale=log_uniform(generator, sensors.noise_scale),
            mirror=bool(generator.random() < sensors.mirrored_share),
            geometry=sensors.tape,
            timing={
                site: sensors.timing.draw(named_generator(generator, site))
                for site in dict.fromkeys(name.partition("/")[0] for name in ride.measurements)
            },
        )
