"""Base class of environments whose agent estimates a pose: spaces, reward, info, seeds, snapshots.

Actions (estimates) do not affect the motion. A subclass therefore computes many time steps at once, as :class:`Block`
objects, and :class:`PoseEnv` returns them one by one.
"""

from __future__ import annotations

import copy
import itertools
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces

from ..filters.core import metrics
from ..filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, Quantity
from .drawn import DrawnEnv, Shown, finite_action
from .sensors.observation import Sensing

Observation = dict[str, np.ndarray]
UNIT_ENTRY = {"rotation": 0, "direction": -1}
"""Kind of quantity → entry that is 1 where there is no rotation, or up is straight up."""


class Block(NamedTuple):
    """Consecutive time steps of an episode.

    Attributes:
        time: ``(n,)`` s.
        measurements: channel → ``(n, size)``; NaN where not sampled.
        pose: quantity → ``(n, size)``: the true pose.
        truth: name → ``(n, size)``: further known quantities.
        scored: ``(n,)`` bool, the evaluation mask: whether the reward counts.
    """

    time: np.ndarray
    measurements: Mapping[str, np.ndarray]
    pose: Mapping[str, np.ndarray]
    truth: Mapping[str, np.ndarray]
    scored: np.ndarray

    def rows(self, part: slice) -> Block:
        """Some of its time steps."""

        def cut(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
            return {name: values[part] for name, values in arrays.items()}

        time, measurements, pose, truth, scored = self
        return Block(time[part], cut(measurements), cut(pose), cut(truth), scored[part])


class Rows:
    """Arrays ``(n, size)`` by name, row after row: those of one type lie side by side, so that a row is one copy.

    Args:
        arrays: name → ``(n, size)``.
    """

    def __init__(self, arrays: Mapping[str, np.ndarray]) -> None:
        kinds: dict[np.dtype[Any], dict[str, np.ndarray]] = {}
        for name, values in arrays.items():
            kinds.setdefault(values.dtype, {})[name] = values
        self._tables = []
        for beside in kinds.values():
            ends = np.cumsum([values.shape[1] for values in beside.values()]).tolist()
            parts = [slice(begin, end) for begin, end in itertools.pairwise([0, *ends])]
            # one slice more: itemgetter gives a tuple for several only
            cut = operator.itemgetter(*parts, slice(0))
            self._tables.append((tuple(beside), cut, np.concatenate(list(beside.values()), axis=1)))

    def at(self, index: int) -> dict[str, np.ndarray]:
        """Name → ``(size,)`` of one row, which the caller may change."""
        found: dict[str, np.ndarray] = {}
        for names, cut, table in self._tables:
            found.update(zip(names, cut(table[index].copy()), strict=False))
        return found


@dataclass(frozen=True)
class Snapshot:
    """The whole state of an environment between two steps; plain data that can be pickled."""

    generator: np.random.Generator
    step: int
    last_step: int
    block: Block
    seen: Observation
    row: int
    sensors: Any
    source: Any
    estimate: np.ndarray


class PoseEnv(DrawnEnv):
    """An agent reads sensors and outputs a pose estimate; the reward is minus the error of the estimate.

    The action of a step is the estimate for the observation *before* the step: the scored quantities one after the
    other. Rotations and directions may have any length that is not zero; zeros count as no rotation, or as up.

    Args:
        suite: the sensors: channels, observation space, observation ↔ measurement.
        quantities: what the action estimates.
        rate: time steps per second, Hz.
        render_mode: see :class:`.DrawnEnv`.
        bounds: largest magnitude of the action, for each quantity; None for 1.
    """

    def __init__(
        self,
        suite: Sensing,
        quantities: Sequence[Quantity],
        rate: float,
        render_mode: str | None = None,
        bounds: Sequence[float] | None = None,
    ) -> None:
        super().__init__(render_mode, rate)
        self.suite, self.quantities, self.rate = suite, tuple(quantities), float(rate)
        self.observation_space: spaces.Space[Any] = suite.observation_space
        sizes = [quantity.size for quantity in self.quantities]
        limits = np.repeat(np.array(bounds or [1.0] * len(sizes), np.float32), sizes)
        self.action_space = spaces.Box(-limits, limits, dtype=np.float32)
        ends = np.cumsum(sizes).tolist()
        self._parts = tuple(slice(end - size, end) for size, end in zip(sizes, ends, strict=True))
        self._block: Block | None = None
        self._estimate = self.neutral_action
        self._row = self._step = self._last_step = 0

    @property
    def neutral_action(self) -> np.ndarray:
        """Estimate of an agent without information ``(size,)`` float32: no rotation, straight up, zero."""
        neutral = np.zeros(self.action_space.shape or (), np.float32)
        for quantity, part in zip(self.quantities, self._parts, strict=True):
            if quantity.kind in UNIT_ENTRY:
                neutral[part][UNIT_ENTRY[quantity.kind]] = 1.0
        return neutral

    def begin(self, motion: np.random.Generator, sensors: np.random.Generator, options: Mapping[str, Any]) -> int:
        """Begin an episode.

        Args:
            motion: source of randomness of the motion.
            sensors: source of randomness of the sensors, so that other sensors see the same motion.
            options: what ``reset`` was given; only names of :attr:`reset_options`.

        Returns:
            Number of steps of the episode.
        """
        raise NotImplementedError

    def next_block(self, most: int) -> Block:
        """The next time steps of the episode: at least one, at most ``most``; the first block begins with step 0."""
        raise NotImplementedError

    def ending(self) -> tuple[int, bool]:
        """The step after which the episode is over, as far as it is known, and whether it is terminated there."""
        return self._last_step, False

    def save_source(self) -> Any:
        """The state of :meth:`next_block`, as plain data that later calls do not change."""
        return None

    def restore_source(self, saved: Any) -> None:
        """Undo :meth:`save_source`."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: makes this episode and those after it reproducible.
            options: see the environment's Arguments.

        Raises:
            ValueError: an unknown option, or an unusable value of one.
        """
        super().reset(seed=seed)
        options = self.checked_options(options)
        motion, sensors = self.np_random.spawn(2)
        self._last_step = self.begin(motion, sensors, options)
        self._look_at(self.next_block(self._last_step + 1))
        self._step = 0
        self._estimate = self.neutral_action
        self._show(self._step)
        return self._observe(), self._info()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Score ``action``, the estimate for the last observation, then advance by one time step.

        Raises:
            ValueError: the action has another shape than the action space, or is not finite.
            RuntimeError: :meth:`reset` was not called, or the episode is over.
        """
        if self._block is None or self._step >= self._last_step:
            raise RuntimeError("call reset first: there is no episode, or it is over")
        self._estimate = self._checked(action)
        reward = self._reward(self._block)
        self._step += 1
        self._row += 1
        if self._row == len(self._block.time):
            self._look_at(self.next_block(self._last_step + 1 - self._step))
        self._show(self._step)
        last, terminates = self.ending()
        over = self._step >= last
        if over:
            self._last_step = self._step
        return self._observe(), reward, over and terminates, over and not terminates, self._info()

    def rest(self) -> Iterator[Block]:
        """The time steps from the present one to the last, in blocks: stepping through them without an agent.

        The episode is over then.

        Raises:
            RuntimeError: :meth:`reset` was not called.
        """
        if self._block is None:
            raise RuntimeError("call reset first: there is no episode")
        while True:
            left = self.ending()[0] + 1 - self._step
            block = self._block.rows(slice(self._row, self._row + left))
            yield block
            count = len(block.time)
            if count == left:
                self._step, self._row = self._step + count - 1, self._row + count - 1
                self._last_step = self._step
                return
            self._step += count
            self._block, self._row = self.next_block(self._last_step + 1 - self._step), 0

    def _checked(self, action: np.ndarray) -> np.ndarray:
        estimate, values = finite_action(action, (self._parts[-1].stop,))
        for quantity, part in zip(self.quantities, self._parts, strict=True):
            if quantity.kind in UNIT_ENTRY and not any(values[part]):
                estimate[part][UNIT_ENTRY[quantity.kind]] = 1.0
        return estimate

    def _reward(self, block: Block) -> float:
        """Minus the errors of the estimate at this time step; 0 outside the evaluation mask or without truth."""
        if not block.scored[self._row]:
            return 0.0
        total = 0.0
        for quantity, part in zip(self.quantities, self._parts, strict=True):
            truth = block.pose[quantity.name if quantity.name in block.pose else ORIENTATION.name][self._row]
            total += pose_error(quantity, self._estimate[part], truth)
        return -total if total == total else 0.0

    def measurement(self) -> dict[str, np.ndarray]:
        """The measurement of this time step: channel → float64 ``(size,)``, NaN where there is no sample.

        Raises:
            RuntimeError: :meth:`reset` was not called.
        """
        if self._block is None:
            raise RuntimeError("call reset first: nothing was measured yet")
        return {name: values[self._row] for name, values in self._block.measurements.items()}

    def _look_at(self, block: Block) -> None:
        """Continue with another block."""
        self._block, self._row = block, 0
        self._seen: Observation = self.suite.observations(block.measurements, len(block.time))
        self._lay_out()

    def _lay_out(self) -> None:
        """Prepare the rows of the present block."""
        assert self._block is not None
        self._rows = Rows(self._seen), Rows(self._block.pose), Rows(self._block.truth)

    def _observe(self) -> Observation:
        return self._rows[0].at(self._row)

    def _info(self) -> dict[str, Any]:
        block, row = self._block, self._row
        assert block is not None
        _, pose, truth = self._rows
        return {
            "time": float(block.time[row]),
            "pose": pose.at(row),
            "truth": truth.at(row),
            "scored": bool(block.scored[row]),
        }

    def snapshot(self) -> Snapshot:
        """The whole state, to which :meth:`restore` returns here or in an environment made with equal arguments.

        Raises:
            RuntimeError: there is no episode.
        """
        if self._block is None:
            raise RuntimeError("call reset first: there is no episode")
        return Snapshot(
            copy.deepcopy(self.np_random),
            self._step,
            self._last_step,
            self._block,
            self._seen,
            self._row,
            self.suite.save(),
            self.save_source(),
            self._estimate.copy(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot: what follows is bitwise what followed it then, under equal actions."""
        self.np_random = copy.deepcopy(snapshot.generator)
        self._step, self._last_step, self._block = snapshot.step, snapshot.last_step, snapshot.block
        self._seen, self._row, self._estimate = snapshot.seen, snapshot.row, snapshot.estimate.copy()
        self._lay_out()
        self.suite.restore(snapshot.sensors)
        self.restore_source(snapshot.source)

    def save_episode(self) -> Snapshot | None:
        """A snapshot; None where there is no episode."""
        return None if self._block is None else self.snapshot()

    def restore_episode(self, saved: Snapshot) -> None:
        """Return to a snapshot."""
        self.restore(saved)

    def shown(self) -> Shown | None:
        """True pose, truth and the last estimate."""
        block, row = self._block, self._row
        if block is None:
            return None
        pose, truth = ({name: values[row] for name, values in part.items()} for part in (block.pose, block.truth))
        return Shown(pose, truth, self._estimate)


def pose_error(quantity: Quantity, estimate: np.ndarray, truth: np.ndarray) -> float:
    """:func:`.error` of one time step, in plain floats for rotations, where it is 20 times faster.

    Args:
        quantity: what is compared.
        estimate: ``(size,)``, of any positive length.
        truth: ``(size,)``.

    Returns:
        The error in rad or the quantity's unit; NaN where the truth is.
    """
    if quantity.kind != "rotation":
        return float(metrics.error(quantity, estimate, truth))
    (a, b, c, d), (w, x, y, z) = estimate.tolist(), truth.tolist()
    # estimate ⊗ conjugate(truth)
    real = a * w + b * x + c * y + d * z
    east = b * w - a * x + d * y - c * z
    north = c * w - a * y + b * z - d * x
    vertical = d * w - a * z + c * x - b * y
    level = math.hypot(east, north)
    if quantity.name == RELATIVE_ORIENTATION.name:
        return 2.0 * math.atan2(level, math.hypot(real, vertical))
    return 2.0 * math.atan2(math.hypot(level, vertical), abs(real))


def choose_quantity(score: str, choices: Sequence[Quantity]) -> Quantity:
    """The quantity named ``score``.

    Raises:
        ValueError: it is none of the choices.
    """
    for quantity in choices:
        if quantity.name == score:
            return quantity
    raise ValueError(f"score must be one of {[quantity.name for quantity in choices]}, got {score!r}")
