"""Training data of networks for riders: rides recorded once, on which devices and measured geometry are drawn anew.

Most of what such a network corrects is constant in a ride and differs from ride to ride: alignment, zeros, lengths of
limbs. So every ride is used several times, each with another draw of errors and half of them with left and right
exchanged; without that, networks learn the few draws by heart.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.episodes import EpisodeStore
from ...envs.recipes.recipe import Recipe
from ...envs.recipes.registry import described_recipe, recipe
from ...filters.support.parallel import in_parallel
from .data import SequenceData, sequence_of
from .head import Head
from .inputs.front_end import FrontEnd

ON_DISK = 4 * 10**9
"""bytes of rides that are kept"""
SETTLED = 5.0
"""s of a ride that are not scored: filters settle"""


@dataclass(frozen=True)
class RideSource:
    """Rides of the ``rider`` recipe.

    Raises:
        ValueError: no rides or no draws.
    """

    rides: int = 80
    """how many are ridden"""
    draws: int = 6
    """of devices and geometry on each ride"""
    duration: float = 40.0
    """s"""
    changes: dict[str, Any] = field(default_factory=dict)
    """fields of the recipe that differ"""

    def __post_init__(self) -> None:
        for name in ("rides", "draws"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")

    def recipe(self) -> Recipe:
        """The distribution of the rides."""
        described = recipe("rider").describe() | {"duration": self.duration} | self.changes
        return described_recipe(described)


def ride(source: RideSource, seed: int, index: int) -> Trajectory:
    """A ride with ideal sensors; kept in the user's cache folder for all networks that train on it.

    Args:
        source: which rides.
        seed: root seed; rides of different seeds share neither riders nor courses.
        index: of the ride.
    """
    made: Any = source.recipe()
    store = EpisodeStore("training-rides", made.describe(), in_memory=1, on_disk=ON_DISK)
    sequence = np.random.SeedSequence(seed, spawn_key=(index,))
    return store.episode((seed, index), lambda: made.ride(sequence, f"ride-{seed}-{index}"))


def drawn(source: RideSource, seed: int, index: int) -> list[Trajectory]:
    """The draws of devices and geometry on one ride; what is not settled is left out of the mask."""
    made: Any = source.recipe()
    ridden = ride(source, seed, index)
    children = np.random.SeedSequence(seed, spawn_key=(index, 1)).spawn(source.draws)
    return [made.sensed(ridden, child).replace(mask=ridden.time > SETTLED) for child in children]


def ride_data(
    source: RideSource, seed: int, front_end: FrontEnd, head: Head, *, processes: int = 1, label: str = ""
) -> SequenceData:
    """Sequences of all draws on all rides; a ride of less than twice :data:`SETTLED` seconds is left out.

    Args:
        source: which rides.
        seed: root seed.
        front_end: what the network sees.
        head: what it should say.
        processes: how many ride at a time; the numbers do not depend on it.
        label: words before a progress bar; empty for none.

    Raises:
        ValueError: no ride is long enough.
    """
    jobs = [(source, seed, index, front_end, head) for index in range(source.rides)]
    done: dict[int, list[tuple[np.ndarray, ...]]] = dict(
        in_parallel(ride_sequences, jobs, processes, label=label, unit="ride")
    )
    parts = [part for index in range(source.rides) for part in done[index]]
    if not parts:
        raise ValueError(f"none of the {source.rides} rides lasts {2.0 * SETTLED:g} s: the riders fell")
    names = [f"ride-{seed}-{index}" for index in range(source.rides) for _ in done[index]]
    return SequenceData.joined(parts, names)


def ride_sequences(
    source: RideSource, seed: int, index: int, front_end: FrontEnd, head: Head
) -> tuple[int, list[tuple[np.ndarray, ...]]]:
    """The index, and the sequences of one ride's draws, for parallel processes."""
    draws = drawn(source, seed, index)
    if float(draws[0].time[-1]) < 2.0 * SETTLED:
        return index, []
    return index, [sequence_of(each, front_end, head) for each in draws]


def held_out(source: RideSource, **changes: Any) -> RideSource:
    """The same distribution but for some fields of the recipe, such as ``styles=("aggressive",)``."""
    return replace(source, changes={**source.changes, **{name: list(value) for name, value in changes.items()}})
