"""Training data of networks for riders: rides recorded once, on which devices and measured geometry are drawn anew.

Most of what such a network corrects is constant in a ride and differs from ride to ride: alignment, zeros, lengths of
limbs. So every ride is used several times, each with another draw of errors and half of them with left and right
exchanged; without that, networks learn the few draws by heart.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory, load_trajectory
from ...envs.recipes.recipe import Recipe
from ...envs.recipes.registry import described_recipe, recipe
from ...filters.support.parallel import in_parallel
from ...filters.support.version import code_version
from .data import SequenceData, sequence_of
from .front_end import FrontEnd
from .head import Head

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


def ride_files(source: RideSource, seed: int, folder: str | Path, *, processes: int = 1, label: str = "") -> list[Path]:
    """Ride with ideal sensors, each ride once a folder and version of the code; what is finished stays.

    Args:
        source: which rides.
        seed: root seed; rides of different seeds share neither riders nor courses.
        folder: where the files go.
        processes: how many ride at a time; the rides do not depend on it.
        label: words before a progress bar; empty for none.
    """
    origin = {"recipe": source.recipe().describe(), "seed": seed, "code": code_version("filters", "envs")}
    home = Path(folder) / f"rides-{seed}"
    paths = [home / f"ride_{index:04d}.h5" for index in range(source.rides)]
    home.mkdir(parents=True, exist_ok=True)
    note = home / "origin.json"
    if note.is_file() and json.loads(note.read_text(encoding="utf-8")) != json.loads(json.dumps(origin)):
        for path in home.glob("ride_*.h5"):
            path.unlink()
    note.write_text(json.dumps(origin, indent=2), encoding="utf-8")
    missing = [(source, seed, index, path) for index, path in enumerate(paths) if not path.exists()]
    for _ in in_parallel(ride_one, missing, processes, label=label, unit="ride"):
        pass
    return paths


def ride_one(source: RideSource, seed: int, index: int, path: Path) -> Path:
    """One ride with ideal sensors; the file appears whole or not at all."""
    made: Any = source.recipe()
    return made.ride(np.random.SeedSequence(seed, spawn_key=(index,)), path.stem).save(path)


def drawn(source: RideSource, seed: int, index: int, path: Path) -> list[Trajectory]:
    """The draws of devices and geometry on one recorded ride."""
    made: Any = source.recipe()
    ride = load_trajectory(path)
    children = np.random.SeedSequence(seed, spawn_key=(index, 1)).spawn(source.draws)
    return [made.sensed(ride, child).replace(mask=ride.time > SETTLED) for child in children]


def ride_data(
    source: RideSource,
    seed: int,
    folder: str | Path,
    front_end: FrontEnd,
    head: Head,
    *,
    processes: int = 1,
    label: str = "",
) -> SequenceData:
    """Sequences of all draws on all rides; a ride of less than twice :data:`SETTLED` seconds is left out.

    Args:
        source: which rides.
        seed: root seed.
        folder: where rides are kept; filters that see the same rides share them.
        front_end: what the network sees.
        head: what it should say.
        processes: how many ride at a time.
        label: words before a progress bar; empty for none.

    Raises:
        ValueError: no ride is long enough.
    """
    paths = ride_files(source, seed, folder, processes=processes, label=label)
    jobs = [(source, seed, index, path, front_end, head) for index, path in enumerate(paths)]
    done: dict[int, list[tuple[np.ndarray, ...]]] = dict(in_parallel(ride_sequences, jobs, processes))
    parts = [part for index in range(len(paths)) for part in done[index]]
    if not parts:
        raise ValueError(f"none of the {len(paths)} rides lasts {2.0 * SETTLED:g} s: the riders fell")
    names = [f"ride-{seed}-{index}" for index in range(len(paths)) for _ in done[index]]
    return SequenceData.joined(parts, names)


def ride_sequences(
    source: RideSource, seed: int, index: int, path: Path, front_end: FrontEnd, head: Head
) -> tuple[int, list[tuple[np.ndarray, ...]]]:
    """The index, and the sequences of one ride's draws, for parallel processes."""
    if float(load_trajectory(path).time[-1]) < 2.0 * SETTLED:
        return index, []
    return index, [sequence_of(each, front_end, head) for each in drawn(source, seed, index, path)]


def held_out(source: RideSource, **changes: Any) -> RideSource:
    """The same distribution but for some fields of the recipe, such as ``styles=("aggressive",)``."""
    return replace(source, changes={**source.changes, **{name: list(value) for name, value in changes.items()}})
