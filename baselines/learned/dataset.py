"""Training data of a network: features and true inclination in the gravity-aligned frame, for many sequences."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.recipes.recipe import Recipe
from ...filters.core import rotation
from ...filters.core.estimator import run
from ...filters.core.observer import Observer
from ...filters.support.files import replacing
from ...filters.support.parallel import progress_bar
from ...filters.support.version import code_version
from .gravity_aligned_frame import FEATURES, VECTORS, GravityAlignedFrame


class Window(NamedTuple):
    """A window of several sequences.

    Attributes:
        features: ``(B, N, F)`` float32.
        up: ``(B, N, 3)`` float32, the true up vector in the gravity-aligned frame.
        mask: ``(B, N)`` bool, evaluation mask.
        first: whether the sequences begin here; otherwise the window continues the one before.
    """

    features: np.ndarray
    up: np.ndarray
    mask: np.ndarray
    first: bool


@dataclass(frozen=True, eq=False)
class LearnedDataset:
    """Sequences of intervals of the network, padded to the longest with intervals that are not scored.

    Attributes:
        features: ``(E, N, F)`` float32.
        up: ``(E, N, 3)`` float32, the true up vector in the gravity-aligned frame at the end of each interval.
        mask: ``(E, N)`` bool, the evaluation mask: the truth is known, and the sample is in the mask of its trajectory.
        names: of the trajectories.
    """

    features: np.ndarray
    up: np.ndarray
    mask: np.ndarray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.features)

    @classmethod
    def from_trajectories(cls, trajectories: Iterable[Trajectory], frame: GravityAlignedFrame | None = None) -> Self:
        """Features of simulated or recorded trajectories with known inclination.

        Args:
            trajectories: with the channels ``imu/gyr`` and ``imu/acc`` and the truth ``up`` or ``orientation``.
            frame: front end; the default one if None.

        Raises:
            ValueError: there is no trajectory, one is not sampled evenly, lacks a channel or the truth, or is too
                short for one interval.
        """
        frame = GravityAlignedFrame() if frame is None else frame
        names, parts = [], []
        for trajectory in trajectories:
            names.append(trajectory.name)
            parts.append(sequence_of(trajectory, frame))
        if not parts:
            raise ValueError("trajectories must hold at least one, got none")
        longest = max(len(part[0]) for part in parts)
        features = np.zeros((len(parts), longest, FEATURES.size), np.float32)
        up = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(parts), longest, 1))
        mask = np.zeros((len(parts), longest), bool)
        for index, part in enumerate(parts):
            for whole, values in zip((features, up, mask), part, strict=True):
                whole[index, : len(values)] = values
        return cls(features, up, mask, tuple(names))

    @classmethod
    def from_simulation(
        cls,
        domain: Recipe,
        seed: int,
        episodes: int,
        frame: GravityAlignedFrame | None = None,
        *,
        cache: str | Path | None = None,
        progress: str = "",
    ) -> Self:
        """Simulate episodes, one child of ``seed`` each; a larger number keeps the first ones.

        Args:
            domain: their distribution.
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
        frame = GravityAlignedFrame() if frame is None else frame
        path = None if cache is None else Path(cache) / f"{simulation_digest(domain, seed, episodes, frame)}.npz"
        if path is not None and path.is_file():
            return cls.load(path)
        dataset = cls.from_trajectories(simulate(domain, seed, episodes, progress), frame)
        if path is not None:
            dataset.save(path)
        return dataset

    def save(self, path: str | Path) -> Path:
        """Write a NumPy archive atomically."""
        with replacing(path) as part:
            names = np.array(self.names)
            np.savez(part, features=self.features, up=self.up, mask=self.mask, names=names)
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what :meth:`save` wrote."""
        with np.load(path, allow_pickle=False) as file:
            names = tuple(str(name) for name in file["names"])
            return cls(file["features"], file["up"], file["mask"], names)

    def digest(self) -> str:
        """Digest that identifies a data set."""
        content = hashlib.sha256()
        for array in (self.features, self.up, self.mask):
            content.update(np.ascontiguousarray(array).data)
        return content.hexdigest()[:16]

    def windows(
        self, size: int, length: int, generator: np.random.Generator | None = None, *, rotate: bool = True
    ) -> Iterator[Window]:
        """All sequences in batches, each batch from its beginning to its end in consecutive windows.

        Args:
            size: sequences in a batch; a smaller rest is left out if there is a ``generator``.
            length: intervals in a window.
            generator: order of the sequences and headings; None: as they are.
            rotate: rotate every sequence by a random angle about the vertical, since the heading of the frame is
                arbitrary.
        """
        order = np.arange(len(self)) if generator is None else generator.permutation(len(self))
        size = min(size, len(self))
        stop = len(self) if generator is None else len(self) - size + 1
        for start in range(0, stop, size):
            chosen = order[start : start + size]
            features, up = self.features[chosen], self.up[chosen]
            if generator is not None and rotate:
                features, up = rotated(features, up, generator.uniform(-np.pi, np.pi, len(chosen)))
            for begin in range(0, features.shape[1], length):
                part = slice(begin, begin + length)
                yield Window(features[:, part], up[:, part], self.mask[chosen, part], begin == 0)


def simulate(domain: Recipe, seed: int, episodes: int, progress: str = "") -> Iterator[Trajectory]:
    """Episodes one after the other, named ``randomised-<seed>-<index>``."""
    with progress_bar(episodes, progress, "episode", show=bool(progress)) as bar:
        for index in range(episodes):
            yield domain.episode(seed, index, f"randomised-{seed}-{index}")
            bar.update()


def sequence_of(trajectory: Trajectory, frame: GravityAlignedFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Features ``(N, F)``, true up vector ``(N, 3)`` in the frame and evaluation mask ``(N,)`` of a trajectory."""
    if not trajectory.uniform:
        raise ValueError(f"{trajectory.name} is not sampled evenly; resample it first")
    truth = trajectory.truth_of("up")
    if not trajectory.dt <= frame.interval:
        raise ValueError(f"{trajectory.name} is sampled every {trajectory.dt:g} s, more than {frame.interval:g} s")
    seen = run(Observer(frame.with_dt(trajectory.dt)), trajectory.measurements).pose
    due = seen["due"][:, 0] == 1.0
    if not due.any():
        raise ValueError(f"{trajectory.name} is too short: {len(trajectory)} samples hold no interval of the network")
    up = rotation.rotate(seen["relative_orientation"], truth)[due]
    known = np.isfinite(up).all(axis=-1)
    up[~known] = (0.0, 0.0, 1.0)
    return seen["features"][due], up, trajectory.mask[due] & known


def rotated(features: np.ndarray, up: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same sequences ``(B, N, …)`` in frames rotated by ``angles`` ``(B,)`` about the vertical."""
    cosine, sine = (part.astype(np.float32)[:, None] for part in (np.cos(angles), np.sin(angles)))
    copies = []
    for array, vectors in ((features, VECTORS), (up, 1)):
        copy = array.copy()
        for index in range(vectors):
            x, y = array[..., 3 * index], array[..., 3 * index + 1]
            copy[..., 3 * index], copy[..., 3 * index + 1] = cosine * x - sine * y, sine * x + cosine * y
        copies.append(copy)
    return copies[0], copies[1]


def simulation_digest(domain: Recipe, seed: int, episodes: int, frame: GravityAlignedFrame) -> str:
    """Name of a data set that depends on its settings and on the code that simulates it."""
    settings = {"domain": domain.describe(), "seed": seed, "episodes": episodes, "frame": asdict(frame)}
    settings["code"] = code_version()
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:16]
