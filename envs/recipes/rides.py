"""Rides for training: recorded once, with several draws of devices and measured geometry on each.

Riding costs time; drawing sensors anew on a ride does not. What a learner corrects is mostly constant in a ride and
differs from ride to ride: alignment, zeros, lengths of limbs. So every ride is used several times, each with another
draw of errors and half of them with left and right exchanged. A lasting fault of a sensor is what a filter with
constant noises does not expect.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ...filters.bicycle.geometry import GEOMETRY_STD, TapeMeasure
from ...filters.support.names import look_up
from ..data.trajectory import Trajectory
from ..episodes import EpisodeStore
from .recipe import Recipe
from .redraw import TRUE_GEOMETRY, turned_anew
from .registry import described_recipe, recipe
from .slopes import sloped

ON_DISK = 4 * 10**9
"""bytes of rides that are kept"""
SETTLED = 5.0
"""s of a ride that are not scored: filters settle"""


@dataclass(frozen=True)
class RideSource:
    """Rides of the ``rider`` recipe.

    Raises:
        ValueError: no rides or no draws, a share outside [0, 1], or an unknown fault.
    """

    rides: int = 80
    """how many are ridden"""
    draws: int = 6
    """of devices and geometry on each ride"""
    duration: float = 40.0
    """s"""
    changes: dict[str, Any] = field(default_factory=dict)
    """fields of the recipe that differ"""
    sloped_share: float = 0.0
    """of draws whose ground rises and falls, see :func:`.slopes.sloped`: those have no other channels"""
    exact_draws: int = 0
    """further draws on each ride, whose rider is measured exactly, not with a tape"""
    fault: str | None = None
    """one of :data:`.rides.FAULTS` in every draw, at the same time in all of a ride"""

    def __post_init__(self) -> None:
        for name, least in (("rides", 1), ("draws", 1), ("exact_draws", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        if not 0.0 <= self.sloped_share <= 1.0:
            raise ValueError(f"sloped_share must lie in [0, 1], got {self.sloped_share}")
        if self.fault is not None:
            look_up("fault", self.fault, FAULTS)

    def recipe(self) -> Recipe:
        """The distribution of the rides."""
        described = recipe("rider").describe() | {"duration": self.duration} | self.changes
        return described_recipe(described)


def ride(source: RideSource, seed: int, index: int) -> Trajectory:
    """Ride ``index`` with ideal sensors; kept in the user's cache folder for all networks that train on it.

    Rides of different root seeds share neither riders nor courses.
    """
    made: Any = source.recipe()
    store = EpisodeStore("training-rides", made.describe(), in_memory=1, on_disk=ON_DISK)
    sequence = np.random.SeedSequence(seed, spawn_key=(index,))
    return store.episode((seed, index), lambda: made.ride(sequence, f"ride-{seed}-{index}"))


def drawn(source: RideSource, seed: int, index: int, turned: bool = False) -> list[Trajectory]:
    """The draws of devices and geometry on one ride; what is not settled is left out of the mask.

    With ``turned`` the bicycle's IMU is turned otherwise in every draw but the first (:func:`.turned_anew`).
    """
    made: Any = source.recipe()
    ridden = ride(source, seed, index)
    children = np.random.SeedSequence(seed, spawn_key=(index, 1)).spawn(source.draws + source.exact_draws)
    placing = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, 4)))
    placed = [turned_anew(ridden, placing) if turned and place else ridden for place in range(len(children))]
    draws = [
        made.sensed(each, child).replace(mask=ridden.time > SETTLED)
        for each, child in zip(placed, children, strict=True)
    ]
    draws[source.draws :] = map(measured_exactly, draws[source.draws :])
    if source.fault is not None:
        sequence = np.random.SeedSequence(seed, spawn_key=(index, 3))
        draws = [FAULTS[source.fault].applied(each, np.random.default_rng(sequence)) for each in draws]
    ground = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, 2)))
    return [sloped(each, ground) if ground.random() < source.sloped_share else each for each in draws]


def measured_exactly(drawn: Trajectory) -> Trajectory:
    """The same draw with the geometry itself in place of what was measured of it."""
    exact = {"geometry": drawn.metadata[TRUE_GEOMETRY], GEOMETRY_STD: asdict(TapeMeasure(0.0, 0.0, 0.0))}
    return drawn.replace(metadata={**drawn.metadata, **exact})


def held_out(source: RideSource, **changes: Any) -> RideSource:
    """The same distribution but for some fields of the recipe, such as ``styles=("aggressive",)``; tapes alone."""
    changed = {**source.changes, **{name: list(value) for name, value in changes.items()}}
    return replace(source, changes=changed, exact_draws=0)


EARLIEST = 5.0
"""s after the start of the ride"""
LEAST = 15.0
"""s that a fault lasts at least, where the ride is long enough"""


@dataclass(frozen=True)
class Fault:
    """A number of a channel that is off for a while."""

    channel: str
    column: int
    size: float
    """in the channel's unit"""
    longest: float = math.inf
    """s after which it is over"""

    def applied(self, ride: Trajectory, generator: np.random.Generator) -> Trajectory:
        """The ride with this fault from a random time on.

        Raises:
            ValueError: the ride lacks the channel.
        """
        if self.channel not in ride.measurements:
            raise ValueError(f"ride {ride.name!r} lacks the channel {self.channel!r} of the fault")
        time = ride.time - ride.time[0]
        start = generator.uniform(EARLIEST, max(EARLIEST, time[-1] - min(self.longest, LEAST)))
        values = ride.measurements[self.channel].copy()
        values[(time >= start) & (time < start + self.longest), self.column] += self.size
        return ride.replace(measurements={**ride.measurements, self.channel: values})


FAULTS = {
    "bias step": Fault("bicycle_imu/gyr", 0, math.radians(1.0)),
    "seat offset": Fault("seat/wrench", 1, 40.0, 20.0),
}
"""Name → fault: 1 °/s more of the bicycle's roll rate until the end; 40 N of side force below the saddle for 20 s."""
