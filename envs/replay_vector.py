"""Many episodes of ``poise/Replay-v0`` at a time: ``gymnasium.make_vec("poise/Replay-v0", num_envs=256)``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from ..filters.core.metrics import error
from ..filters.core.quantity import ORIENTATION
from .base import UNIT_ENTRY, Block, Observation
from .replay import ReplayEnv
from .vector import RowsVectorEnv, everywhere


class ReplayVectorEnv(RowsVectorEnv):
    """Episodes of one recording, each from its own start.

    Observations, ends and infos are those of :class:`.ReplayEnv` with the same arguments and the seed of the row;
    rewards too, up to rounding (1e-12 rad).

    Args:
        num_envs: number of episodes at a time.
        autoreset_mode: see :class:`.RowsVectorEnv`.
        arguments: those of :class:`.ReplayEnv`.

    Raises:
        ValueError: see :class:`.RowsVectorEnv` and :class:`.ReplayEnv`.
    """

    kind = ReplayEnv
    single: ReplayEnv

    def __init__(
        self, num_envs: int = 1, *, autoreset_mode: str | AutoresetMode = "NextStep", **arguments: Any
    ) -> None:
        super().__init__(num_envs, self.kind(**arguments), autoreset_mode)
        self._blocks: list[Block | None] = [None] * self.num_envs
        self._seen: list[Observation] = [{}] * self.num_envs
        self._step, self._last = np.zeros(self.num_envs, int), np.zeros(self.num_envs, int)

    def begin_rows(self, rows: np.ndarray, options: Mapping[str, Any], *, first: bool) -> None:
        """Choose where the episodes start."""
        for row in rows:
            motion, sensors = self.generator(row).spawn(2)
            last = self.single.begin(motion, sensors, options)
            block = self.single.next_block(last + 1)
            self._blocks[row], self._step[row], self._last[row] = block, 0, last
            self._seen[row] = self.single.suite.observations(block.measurements, len(block.time))

    def step_rows(self, rows: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Score the actions, the estimates for the last observations, and advance by one time step."""
        (quantity,) = self.single.quantities
        entry = UNIT_ENTRY[quantity.kind]
        estimates = actions.copy()
        estimates[~estimates.any(axis=-1), entry] = 1.0
        name = quantity.name if quantity.name in self.single._pose else ORIENTATION.name
        present = [(self._present(row), step) for row, step in zip(rows, self._step[rows].tolist(), strict=True)]
        truth = np.stack([block.pose[name][step] for block, step in present])
        scored = np.array([block.scored[step] for block, step in present])
        errors = error(quantity, estimates, truth)
        self._step[rows] += 1
        return np.where(scored & np.isfinite(errors), -errors, 0.0), self._step[rows] >= self._last[rows]

    def observations(self) -> dict[str, np.ndarray]:
        """Observations of all rows."""
        steps = self._step.tolist()
        return {
            name: np.stack([seen[name][step] for seen, step in zip(self._seen, steps, strict=True)])
            for name in self.single.suite.observation_space
        }

    def infos(self) -> dict[str, Any]:
        """Infos of all rows, as of the single environment."""
        present = [(self._present(row), step) for row, step in enumerate(self._step.tolist())]

        def rows_of(part: str) -> dict[str, np.ndarray]:
            names = getattr(present[0][0], part)
            return {name: np.stack([getattr(block, part)[name][step] for block, step in present]) for name in names}

        found = {
            "time": np.array([float(block.time[step]) for block, step in present]),
            "pose": rows_of("pose"),
            "truth": rows_of("truth"),
            "scored": np.array([bool(block.scored[step]) for block, step in present]),
        }
        return everywhere(found, self.num_envs)

    def _present(self, row: int) -> Block:
        block = self._blocks[row]
        assert block is not None
        return block
