"""What a network is trained on: features in the level frame, and the vertical there, for many sequences at once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.core import rotation
from ...filters.core.estimator import run
from ...filters.core.observer import Observer
from ...filters.support.files import replacing
from ...filters.support.parallel import progress_bar
from ...filters.support.version import code_version
from .level_frame import FEATURES, VECTORS, LevelFrame
from .recipe import Curriculum


class Window(NamedTuple):
    """A stretch of several sequences.

    Attributes:
        features: ``(B, N, F)`` float32.
        vertical: ``(B, N, 3)`` float32, the true upward vertical in the level frame.
        scored: ``(B, N)`` bool.
        first: whether the sequences begin here; otherwise the window goes on where the one before ended.
    """

    features: np.ndarray
    vertical: np.ndarray
    scored: np.ndarray
    first: bool


@dataclass(frozen=True, eq=False)
class LearnedDataset:
    """Sequences of intervals of the network, filled up to the longest with intervals that are not scored.

    Attributes:
        features: ``(E, N, F)`` float32.
        vertical: ``(E, N, 3)`` float32, the true upward vertical in the level frame at the end of each interval.
        scored: ``(E, N)`` bool: the truth is known, and the tick lies in the mask of its trajectory.
        names: of the trajectories.
    """

    features: np.ndarray
    vertical: np.ndarray
    scored: np.ndarray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.features)

    @classmethod
    def from_trajectories(cls, trajectories: Iterable[Trajectory], frame: LevelFrame | None = None) -> Self:
        """Features of simulated or recorded trajectories that know the vertical.

        Args:
            trajectories: with the channels ``imu/gyr`` and ``imu/acc`` and the truth ``up`` or ``orientation``.
            frame: front end; the default one if None.

        Raises:
            ValueError: there is no trajectory, one is not sampled evenly, lacks a channel or the truth, or is too
                short for one interval.
        """
        frame = LevelFrame() if frame is None else frame
        names, parts = [], []
        for trajectory in trajectories:
            names.append(trajectory.name)
            parts.append(sequence_of(trajectory, frame))
        if not parts:
            raise ValueError("trajectories must hold at least one, got none")
        longest = max(len(part[0]) for part in parts)
        features = np.zeros((len(parts), longest, FEATURES.size), np.float32)
        vertical = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(parts), longest, 1))
        scored = np.zeros((len(parts), longest), bool)
        for index, part in enumerate(parts):
            for whole, values in zip((features, vertical, scored), part, strict=True):
                whole[index, : len(values)] = values
        return cls(features, vertical, scored, tuple(names))

    @classmethod
    def from_curriculum(
        cls,
        curriculum: Curriculum,
        seed: int,
        episodes: int,
        frame: LevelFrame | None = None,
        *,
        cache: str | Path | None = None,
        progress: str = "",
    ) -> Self:
        """Simulate episodes, one child of ``seed`` each; a larger number keeps the first ones.

        Args:
            curriculum: their distribution.
            seed: root seed; data sets with different seeds share nothing.
            episodes: how many.
            frame: front end; the default one if None.
            cache: folder in which a file of this data set is kept, and looked for.
            progress: words before a progress bar; empty for none.

        Raises:
            ValueError: ``episodes`` is not positive.
        """
        if episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {episodes}")
        frame = LevelFrame() if frame is None else frame
        path = None if cache is None else Path(cache) / f"{recipe_digest(curriculum, seed, episodes, frame)}.npz"
        if path is not None and path.is_file():
            return cls.load(path)
        dataset = cls.from_trajectories(simulate(curriculum, seed, episodes, progress), frame)
        if path is not None:
            dataset.save(path)
        return dataset

    def save(self, path: str | Path) -> Path:
        """Write a NumPy archive in one move."""
        with replacing(path) as part:
            names = np.array(self.names)
            np.savez(part, features=self.features, vertical=self.vertical, scored=self.scored, names=names)
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what :meth:`save` wrote."""
        with np.load(path, allow_pickle=False) as file:
            names = tuple(str(name) for name in file["names"])
            return cls(file["features"], file["vertical"], file["scored"], names)

    def digest(self) -> str:
        """Letters that tell data sets apart."""
        content = hashlib.sha256()
        for array in (self.features, self.vertical, self.scored):
            content.update(np.ascontiguousarray(array))
        return content.hexdigest()[:16]

    def windows(
        self, size: int, length: int, generator: np.random.Generator | None = None, *, turn: bool = True
    ) -> Iterator[Window]:
        """All sequences in batches, each batch from its beginning to its end in consecutive windows.

        Args:
            size: sequences in a batch; a smaller rest is left out if there is a ``generator``.
            length: intervals in a window.
            generator: order of the sequences and headings; None: as they are.
            turn: turn every sequence by a random angle about the vertical: the heading of a level frame means nothing.
        """
        order = np.arange(len(self)) if generator is None else generator.permutation(len(self))
        size = min(size, len(self))
        stop = len(self) if generator is None else len(self) - size + 1
        for start in range(0, stop, size):
            chosen = order[start : start + size]
            features, vertical = self.features[chosen], self.vertical[chosen]
            if generator is not None and turn:
                features, vertical = turned(features, vertical, generator.uniform(-np.pi, np.pi, len(chosen)))
            for begin in range(0, features.shape[1], length):
                part = slice(begin, begin + length)
                yield Window(features[:, part], vertical[:, part], self.scored[chosen, part], begin == 0)


def simulate(curriculum: Curriculum, seed: int, episodes: int, progress: str = "") -> Iterator[Trajectory]:
    """Episodes one after the other, named ``curriculum-<seed>-<index>``."""
    with progress_bar(episodes, progress, "episode", show=bool(progress)) as bar:
        for index, child in enumerate(np.random.SeedSequence(seed).spawn(episodes)):
            yield curriculum.draw(child, f"curriculum-{seed}-{index}")
            bar.update()


def sequence_of(trajectory: Trajectory, frame: LevelFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Features ``(N, F)``, vertical ``(N, 3)`` in the level frame and scored flags ``(N,)`` of one trajectory."""
    if not trajectory.uniform:
        raise ValueError(f"{trajectory.name} is not sampled evenly; resample it first")
    truth = trajectory.truth_of("up")
    if not trajectory.dt <= frame.interval:
        raise ValueError(f"{trajectory.name} is sampled every {trajectory.dt:g} s, more than {frame.interval:g} s")
    seen = run(Observer(frame.with_dt(trajectory.dt)), trajectory.measurements).pose
    due = seen["due"][:, 0] == 1.0
    if not due.any():
        raise ValueError(f"{trajectory.name} is too short: {len(trajectory)} ticks hold no interval of the network")
    vertical = rotation.rotate(seen["relative_orientation"], truth)[due]
    known = np.isfinite(vertical).all(axis=-1)
    vertical[~known] = (0.0, 0.0, 1.0)
    return seen["features"][due], vertical, trajectory.mask[due] & known


def turned(features: np.ndarray, vertical: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same sequences ``(B, N, …)`` in level frames turned by ``angles`` ``(B,)`` about the vertical."""
    cosine, sine = (part.astype(np.float32)[:, None] for part in (np.cos(angles), np.sin(angles)))
    copies = []
    for array, vectors in ((features, VECTORS), (vertical, 1)):
        copy = array.copy()
        for index in range(vectors):
            x, y = array[..., 3 * index], array[..., 3 * index + 1]
            copy[..., 3 * index], copy[..., 3 * index + 1] = cosine * x - sine * y, sine * x + cosine * y
        copies.append(copy)
    return copies[0], copies[1]


def recipe_digest(curriculum: Curriculum, seed: int, episodes: int, frame: LevelFrame) -> str:
    """Name of a data set that depends on its settings and on the code that simulates it."""
    recipe = {"curriculum": asdict(curriculum), "seed": seed, "episodes": episodes, "frame": asdict(frame)}
    recipe["code"] = code_version()
    return hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest()[:16]
