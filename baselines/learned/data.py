"""Training data of a network: inputs from a front end and targets, for many sequences."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.recipes.recipe import Recipe
from ...filters.core.estimator import check_measurements
from ...filters.support.files import replacing
from ...filters.support.parallel import in_parallel, progress_bar
from ...filters.support.version import code_version
from ..run import smooth
from .head import Head
from .inputs.front_end import FrontEnd

SPLITS = {"train": 0.7, "validation": 0.15, "test": 0.15}
"""Shares of the named parts of a set of recordings, see :func:`split`."""


class Window(NamedTuple):
    """A window of several sequences.

    Attributes:
        features: ``(B, N, F)`` float32.
        target: ``(B, N, K)`` float32, see :meth:`.head.Head.target`.
        spread: ``(B, N, S)`` float32, see :class:`.front_end.Seen`.
        mask: ``(B, N)`` bool, evaluation mask.
        first: whether the sequences begin here; otherwise the window continues the one before.
    """

    features: np.ndarray
    target: np.ndarray
    spread: np.ndarray
    mask: np.ndarray
    first: bool


@dataclass(frozen=True, eq=False)
class SequenceData:
    """Sequences of updates of a network, padded to the longest with updates that are not scored.

    Attributes:
        features: ``(E, N, F)`` float32.
        target: ``(E, N, K)`` float32 at the end of each interval; any value where it is unknown.
        spread: ``(E, N, S)`` float32.
        mask: ``(E, N)`` bool: the truth is known, and the sample is in the evaluation mask of its trajectory.
        names: of the trajectories.
    """

    features: np.ndarray
    target: np.ndarray
    spread: np.ndarray
    mask: np.ndarray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.features)

    def __getitem__(self, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Features, target, spread and mask of one sequence: what a ``torch.utils.data.DataLoader`` batches."""
        return self.features[index], self.target[index], self.spread[index], self.mask[index]

    @classmethod
    def from_trajectories(cls, trajectories: Iterable[Trajectory], front_end: FrontEnd, head: Head) -> Self:
        """Sequences of simulated or recorded trajectories with known truth.

        Args:
            trajectories: with the channels of the front end and the truth that the head needs.
            front_end: what the network sees; it is configured for the person, vehicle or device of each trajectory.
            head: what it should say.

        Raises:
            ValueError: there is no trajectory, one lacks a channel or the truth, or is too short for one interval.
        """
        names, parts = [], []
        for trajectory in trajectories:
            names.append(trajectory.name)
            parts.append(sequence_of(trajectory, front_end, head))
        if not parts:
            raise ValueError("trajectories must hold at least one, got none")
        return cls.joined(parts, names)

    @classmethod
    def joined(cls, parts: Sequence[tuple[np.ndarray, ...]], names: Sequence[str]) -> Self:
        """Sequences of :func:`sequence_of`, padded to one length.

        Raises:
            ValueError: there are none, or they are of different front ends or heads.
        """
        if not parts:
            raise ValueError("a data set must hold at least one sequence, got none")
        widths = sorted({tuple(array.shape[1:] for array in part) for part in parts})
        if len(widths) > 1:
            raise ValueError(f"sequences must be of one front end and head, got shapes {widths[0]} and {widths[1]}")
        longest = max(len(part[0]) for part in parts)
        wholes: list[np.ndarray] = []
        for index in range(4):
            shape = (len(parts), longest, *parts[0][index].shape[1:])
            # nothing is divided by a spread of zero where a sequence is over
            wholes.append(np.full(shape, index == 2, bool if index == 3 else np.float32))
            for row, part in enumerate(parts):
                wholes[index][row, : len(part[index])] = part[index]
                if index == 1:
                    wholes[index][row, len(part[index]) :] = part[index][-1]
        features, target, spread, mask = wholes
        return cls(features, target, spread, mask, tuple(names))

    @classmethod
    def together(cls, sets: Sequence[SequenceData]) -> Self:
        """Several data sets as one, in their order."""
        parts = [
            (one.features[row], one.target[row], one.spread[row], one.mask[row])
            for one in sets
            for row in range(len(one))
        ]
        return cls.joined(parts, [name for one in sets for name in one.names])

    @classmethod
    def from_recipe(
        cls,
        recipe: Recipe,
        seed: int,
        episodes: int,
        front_end: FrontEnd,
        head: Head,
        *,
        cache: str | Path | None = None,
        progress: str = "",
        processes: int = 1,
    ) -> Self:
        """Simulate episodes; a larger number keeps the first ones.

        Args:
            recipe: their distribution.
            seed: root seed; data sets with different seeds share nothing.
            episodes: how many.
            front_end: what the network sees.
            head: what it should say.
            cache: folder in which a file of this data set is kept, and looked for.
            progress: words before a progress bar; empty for none.
            processes: how many episodes are simulated at a time; the numbers do not depend on it.

        Raises:
            ValueError: ``episodes`` is not positive.
        """
        if episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {episodes}")
        path = None
        if cache is not None:
            path = Path(cache) / f"{simulation_digest(recipe, seed, episodes, front_end, head)}.npz"
            if path.is_file():
                return cls.load(path)
        jobs = [(recipe, seed, index, front_end, head) for index in range(episodes)]
        done = dict(in_parallel(simulated_sequence, jobs, processes, label=progress, unit="episode"))
        data = cls.joined(
            [done[index] for index in range(episodes)], [f"{recipe.name}-{seed}-{index}" for index in range(episodes)]
        )
        if path is not None:
            data.save(path)
        return data

    def save(self, path: str | Path) -> Path:
        """Write a NumPy archive atomically."""
        arrays = {name: getattr(self, name) for name in ("features", "target", "spread", "mask")}
        with replacing(path) as part:
            np.savez(part, names=np.array(self.names), **arrays)
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what :meth:`save` wrote."""
        with np.load(path, allow_pickle=False) as file:
            names = tuple(str(name) for name in file["names"])
            return cls(file["features"], file["target"], file["spread"], file["mask"], names)

    def digest(self) -> str:
        """Digest that identifies a data set."""
        content = hashlib.sha256()
        for array in (self.features, self.target, self.spread, self.mask):
            content.update(np.ascontiguousarray(array).data)
        return content.hexdigest()[:16]

    def windows(
        self, size: int, length: int, generator: np.random.Generator | None = None, head: Head | None = None
    ) -> Iterator[Window]:
        """All sequences in batches, each batch from its beginning to its end in consecutive windows.

        Args:
            size: sequences in a batch; a smaller rest is left out if there is a ``generator``.
            length: updates in a window.
            generator: order of the sequences, and how they are augmented; None: as they are.
            head: augments the sequences; None: as they are.

        Raises:
            ValueError: ``size`` or ``length`` is not positive.
        """
        if size < 1 or length < 1:
            raise ValueError(f"size and length must be at least 1, got {size} and {length}")
        order = np.arange(len(self)) if generator is None else generator.permutation(len(self))
        size = min(size, len(self))
        stop = len(self) if generator is None else len(self) - size + 1
        for start in range(0, stop, size):
            chosen = order[start : start + size]
            features, target = self.features[chosen], self.target[chosen]
            if generator is not None and head is not None:
                features, target = head.augmented(features, target, generator)
            for begin in range(0, features.shape[1], length):
                part = slice(begin, begin + length)
                rest = self.spread[chosen, part], self.mask[chosen, part]
                yield Window(features[:, part], target[:, part], *rest, begin == 0)


def sequence_of(trajectory: Trajectory, front_end: FrontEnd, head: Head) -> tuple[np.ndarray, ...]:
    """Features ``(N, F)``, target ``(N, K)``, spread ``(N, S)`` and evaluation mask ``(N,)`` of a trajectory.

    Raises:
        ValueError: see :meth:`SequenceData.from_trajectories`.
    """
    trajectory = trajectory.on_grid()
    if hasattr(head, "sequence"):
        found: tuple[np.ndarray, ...] = head.sequence(trajectory, front_end)
        return found
    if not trajectory.dt <= front_end.interval * (1.0 + 1e-9):
        raise ValueError(f"{trajectory.name} is sampled every {trajectory.dt:g} s, more than {front_end.interval:g} s")
    front_end = front_end.with_dt(trajectory.dt).configured(trajectory.metadata)
    try:
        arrays = check_measurements(front_end.channels, trajectory.measurements, time_axis=True)
    except ValueError as reason:
        raise ValueError(f"{trajectory.name}: {reason}") from None
    seen = front_end.run(arrays)
    kalman = getattr(front_end, "kalman", None)
    if kalman is not None:
        # a paper's own angles follow from the truth
        trajectory = trajectory.replace(truth={**trajectory.truth, **kalman.model.truth(trajectory.truth)})
    due = seen.due == 1.0
    if not due.any():
        raise ValueError(
            f"{trajectory.name} is too short, or one of its channels holds nothing: "
            f"its {len(trajectory)} samples hold no interval of the network"
        )
    target = head.target(seen, trajectory)[due]
    known = np.isfinite(target).all(axis=-1) & np.isfinite(seen.features[due]).all(axis=-1)
    features, spread = np.nan_to_num(seen.features[due]), seen.spread[due]
    # what is not scored takes a value that has an error and derivatives
    usual = target[known][0] if known.any() else np.ones_like(target[0])
    return features, np.where(known[:, None], target, usual), np.nan_to_num(spread), trajectory.mask[due] & known


def simulated_sequence(
    recipe: Recipe, seed: int, index: int, front_end: FrontEnd, head: Head
) -> tuple[int, tuple[np.ndarray, ...]]:
    """The index, and :func:`sequence_of` the episode, for parallel processes."""
    return index, sequence_of(recipe.episode(seed, index), front_end, head)


def taught(trajectory: Trajectory, filter: str) -> Trajectory:
    """A recording whose truth is what the smoother of a filter says: a teacher that needs no reference.

    The smoother knows what comes later, so it errs half as much as the filter (Rauch, Tung, Striebel 1965).

    Args:
        trajectory: a recording; its own truth is not looked at.
        filter: name of a Kalman filter.
    """
    trajectory = trajectory.on_grid()
    estimate = smooth(filter, trajectory)
    truth = {name: np.asarray(values) for name, values in estimate.pose.items()}
    return trajectory.replace(truth=truth, mask=np.ones(len(trajectory), bool))


def with_errors(trajectory: Trajectory, generator: np.random.Generator) -> Trajectory:
    """The same motion with another device: further errors on top of those of a recording of one inertial sensor.

    A constant bias of up to 0.6 °/s of the gyroscope and 0.03 m/s² of the accelerometer, and white noise of up to
    0.05 °/s a sample.
    """
    gyr, acc = trajectory.measurements["imu/gyr"], trajectory.measurements["imu/acc"]
    bias = math.radians(generator.uniform(0.0, 0.6)) / math.sqrt(3.0) * generator.standard_normal(3)
    noise = math.radians(generator.uniform(0.0, 0.05)) * generator.standard_normal(gyr.shape)
    offset = generator.uniform(0.0, 0.03) * generator.standard_normal(3)
    return trajectory.replace(
        measurements={**trajectory.measurements, "imu/gyr": gyr + bias + noise, "imu/acc": acc + offset}
    )


def simulate(recipe: Recipe, seed: int, episodes: int, progress: str = "") -> Iterator[Trajectory]:
    """Episodes one after the other, named ``randomised-<seed>-<index>``."""
    with progress_bar(episodes, progress, "episode", show=bool(progress)) as bar:
        for index in range(episodes):
            yield recipe.episode(seed, index, f"randomised-{seed}-{index}")
            bar.update()


def split(names: Sequence[str], part: str) -> list[str]:
    """The names that belong to a part of a set of recordings: always the same, whatever else is in the set.

    Args:
        names: of what must not be divided: riders, subjects, trials.
        part: one of :data:`SPLITS`.

    Raises:
        ValueError: an unknown part.
    """
    if part not in SPLITS:
        raise ValueError(f"part must be one of {list(SPLITS)}, got {part!r}")
    chosen = []
    for name in names:
        place = int(hashlib.sha256(name.encode()).hexdigest()[:8], 16) / 2**32
        bounds = np.cumsum([0.0, *SPLITS.values()])
        index = list(SPLITS).index(part)
        if bounds[index] <= place < bounds[index + 1]:
            chosen.append(name)
    return chosen


def simulation_digest(recipe: Recipe, seed: int, episodes: int, front_end: FrontEnd, head: Head) -> str:
    """Name of a data set that depends on its settings and on the code that simulates it."""
    settings = {"recipe": recipe.describe(), "seed": seed, "episodes": episodes, "front_end": front_end.describe()}
    settings |= {"head": head.describe(), "code": code_version()}
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:16]
