"""What a recording stands for: the recipe that should contain it, and the sensor that it is compared with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ....envs.data.formats.load import load_recordings, recording_files
from ....envs.data.trajectory import Trajectory
from ....filters.support.names import look_up
from ...evaluation import distinct


@dataclass(frozen=True)
class Role:
    """A kind of recordings."""

    summary: str
    recipe: str
    """name of the recipe that should contain them"""
    site: str
    """of the simulated sensor"""
    ranked: bool
    """whether estimators of one inertial sensor are ranked on them"""


ROLES = {
    "hand": Role("a sensor or device moved by hand", "hand-held", "imu", True),
    "carried": Role("a phone carried by somebody who walks or runs", "carried", "imu", True),
    "chest": Role("a sensor on the chest of a rider", "rider", "trunk_imu", False),
    "head": Role("a sensor on the head of a rider", "rider", "head_imu", False),
}
"""Name → role."""


@dataclass(frozen=True)
class Recorded:
    """Recordings of one role from one place."""

    role: str
    group: str
    """name of the folder or file that was given"""
    paths: tuple[Path, ...]

    def load(self) -> list[Trajectory]:
        """The recordings, on their grids, under names of their own.

        Raises:
            ValueError: one cannot be read.
        """
        found, sources = [], []
        for path in self.paths:
            for trajectory in load_recordings(path):
                found.append(trajectory.on_grid())
                sources.append(path)
        return distinct(found, sources)


def recorded(given: Iterable[str]) -> list[Recorded]:
    """Recordings from texts ``role=path``, where a path is a file or a folder.

    Raises:
        ValueError: a text without ``=``, an unknown role, or a folder without recordings.
        FileNotFoundError: there is no such file or folder.
    """
    found = []
    for text in given:
        role, sign, place = text.partition("=")
        if not sign or not place:
            raise ValueError(f"recordings must be role=path with a role of {list(ROLES)}, got {text!r}")
        look_up("role", role, ROLES)
        path = Path(place)
        if not path.exists():
            raise FileNotFoundError(f"no recording at {path}: there is no such file or folder")
        files = recording_files([path])
        if not files:
            raise ValueError(f"no recording in {path}")
        found.append(Recorded(role, path.stem, tuple(files)))
    return found


def by_recipe(groups: Sequence[Recorded]) -> dict[str, dict[str, list[Recorded]]]:
    """Recipe → site → the recordings that are compared with it there."""
    found: dict[str, dict[str, list[Recorded]]] = {}
    for group in groups:
        role = ROLES[group.role]
        found.setdefault(role.recipe, {}).setdefault(role.site, []).append(group)
    return found
