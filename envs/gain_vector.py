"""Many episodes of gain tuning at a time: ``gymnasium.make_vec(id, num_envs=256)``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.vector import AutoresetMode

from ..filters.adaptation.rows import TunedRows, arrays_of
from ..filters.support.seeds import named_generator
from .gain_env import GainTuningEnv
from .gain_episode import GainEpisode
from .gain_reward import errors_of
from .vector import RowsVectorEnv, everywhere, gathered, restored_generators, saved_generators


class GainTuningVectorEnv(RowsVectorEnv):
    """Episodes of one gain environment, whose filters run in one call for each sampling rate among them.

    Observations, rewards, ends and infos are those of the single environment with the same arguments and the seed of
    the row.

    Args:
        num_envs: number of episodes at a time.
        autoreset_mode: see :class:`.RowsVectorEnv`.
        staggered: whether the first episode of each row ends after a random part of it, so that later ones do not
            end together: good for training, and the only difference from single environments.
        infos: whether steps return infos; without them they take less time.
        kept: trajectories that may be drawn again and are kept in memory.
        arguments: those of the single environment.

    Raises:
        ValueError: see :class:`.RowsVectorEnv` and the single environment.
    """

    kind: ClassVar[type[GainTuningEnv]]
    """The single environment."""
    single: GainTuningEnv

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | AutoresetMode = "NextStep",
        staggered: bool = False,
        infos: bool = True,
        kept: int = 512,
        **arguments: Any,
    ) -> None:
        super().__init__(num_envs, self.kind(**arguments), autoreset_mode)
        self.staggered, self.with_infos, self.kept = staggered, infos, kept
        self.filters = TunedRows(self.single.tuned, self.num_envs)
        self._began = [""] * self.num_envs
        self._decision = np.zeros(self.num_envs, int)
        self._end = np.zeros(self.num_envs, int)
        self._forget()

    def _forget(self) -> None:
        """No episode in any row."""
        self.episodes: list[GainEpisode] = []
        self._weight = np.zeros(self.num_envs)
        self._mean_error, self._last_error = (np.full(self.num_envs, np.nan) for _ in range(2))
        outputs = self.single.tuned.kalman.outputs
        self._estimates = {output.name: np.full((self.num_envs, output.size), np.nan) for output in outputs}

    def begin_rows(self, rows: np.ndarray, options: Mapping[str, Any], *, first: bool) -> None:
        """Draw a trajectory in each of the rows; the filter has seen nothing of it yet."""
        for row in rows:
            generator = self.generator(row)
            self._began[row] = saved_generators([generator])[0]
            self._begin(row, self.single.next_episode(generator, self.kept))
            if first and self.staggered:
                self._end[row] = named_generator(generator, "staggered").integers(1, self._end[row] + 1)

    def _begin(self, row: int, episode: GainEpisode) -> None:
        """Put an episode into a row, at its start."""
        if row == len(self.episodes):
            self.episodes.append(episode)
        self.episodes[row] = episode
        self.filters.begin(row, episode.kalman)
        self._decision[row], self._end[row], self._weight[row] = 0, episode.decisions, episode.weight
        self._mean_error[row] = self._last_error[row] = np.nan
        for values in self._estimates.values():
            values[row] = np.nan

    def step_rows(self, rows: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Run the filters over one interval with the gains of the actions."""
        rewards = np.zeros(self.num_envs)
        chosen = np.zeros((self.num_envs, actions.shape[-1]))
        chosen[rows] = actions
        for group, members in self.filters.groups(rows):
            length, model = group.tuned.interval_samples, group.tuned.kalman.model
            width = sum(channel.size for channel in model.channels)
            chunk = np.empty((length, len(members), self.episodes[members[0]].table.shape[1]))
            for place, row in enumerate(members.tolist()):
                start = self._decision[row] * length
                chunk[:, place] = self.episodes[row].table[start : start + length]
            estimate = self.filters.advance(group, members, chosen[members], chunk[..., :width])
            errors = errors_of(self.single.quantities, estimate.pose, chunk[..., width:-2])
            scored = self.single.reward.scored(
                *(errors, chunk[..., -2] > 0.5, chunk[..., -1], self._weight[members]),
                *(np.asarray(estimate.nis), model.residual_size),
            )
            rewards[members], self._mean_error[members] = scored.reward, scored.mean_error
            self._last_error[members] = errors[-1]
            for name, values in self._estimates.items():
                values[members] = estimate.pose[name][-1]
        self._decision[rows] += 1
        return rewards[rows], self._decision[rows] >= self._end[rows]

    def observations(self) -> np.ndarray:
        """Observations of all rows ``(rows, n)``, float32."""
        seen = self.filters.observe()
        if not self.single.privileged:
            return seen
        errors, decisions = self._last_error.tolist(), self._decision.tolist()
        parts = [one.privileged(at, last) for one, at, last in zip(self.episodes, decisions, errors, strict=True)]
        return np.concatenate([seen, np.stack(parts)], axis=-1)

    @property
    def errors_deg(self) -> np.ndarray:
        """Mean error of each row over the last interval, deg; NaN where none is known."""
        return np.degrees(self._mean_error)

    def gain_sizes(self) -> dict[str, np.ndarray]:
        """The scaled constants of each row: name → ``(rows,)``."""
        gains = {part.gain: np.zeros(self.num_envs) for part in self.single.tuned.ranges}
        for group, members in self.filters.groups(np.arange(self.num_envs)):
            for name, sizes in self.filters.sizes(group, members, self.filters.state.action[members]).items():
                gains[name][members] = sizes
        return gains

    def infos(self) -> dict[str, Any]:
        """Infos of all rows, as of the single environment; empty where none are wanted."""
        if not self.with_infos:
            return {}
        rows = [
            max(at * episode.interval_samples - 1, 0)
            for at, episode in zip(self._decision.tolist(), self.episodes, strict=True)
        ]
        pose = np.stack([episode.truth[row] for row, episode in zip(rows, self.episodes, strict=True)])
        known = [episode.known[1][row] for row, episode in zip(rows, self.episodes, strict=True)]
        truth = gathered([episode.known[0] for episode in self.episodes], [one[1:] for one in known], self.num_envs)
        ends = np.cumsum([quantity.size for quantity in self.single.quantities])
        parts = np.split(pose, ends[:-1], axis=-1)
        found = {
            "time": np.array([one[0] for one in known]),
            "pose": {one.name: part.copy() for one, part in zip(self.single.quantities, parts, strict=True)},
            "truth": {},
            "estimate": {name: values.copy() for name, values in self._estimates.items()},
            "error_deg": self.errors_deg,
            "gains": self.gain_sizes(),
        }
        return {**everywhere(found, self.num_envs), "truth": truth}

    def snapshot(self) -> dict[str, Any]:
        """All that changes while episodes run, for :meth:`restore`: arrays, and generators as JSON."""
        rows = [self._decision, self._end, self._mean_error, self._last_error, self._over]
        return {
            "generators": list(self._began),
            "seeds": list(self._seeds),
            "rows": [np.array(part) for part in rows],
            "estimates": [np.array(part) for part in self._estimates.values()],
            "filters": [np.array(part) for part in arrays_of(self.filters.state)],
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Continue exactly from a snapshot of an environment with the same arguments."""
        self._forget()
        self._seeds, self._began = list(snapshot["seeds"]), list(snapshot["generators"])
        self.generators = list(restored_generators(self._began))
        for row in range(self.num_envs):
            self._begin(row, self.single.next_episode(self.generator(row), self.kept))
        kept = (np.array(part) for part in snapshot["rows"])
        self._decision, self._end, self._mean_error, self._last_error, self._over = kept
        for values, part in zip(self._estimates.values(), snapshot["estimates"], strict=True):
            values[:] = part
        for array, part in zip(arrays_of(self.filters.state), snapshot["filters"], strict=True):
            array[:] = part
        self._begun[:] = True

    def __getstate__(self) -> dict[str, Any]:
        """Arguments of the single environment and a snapshot: pickles hold no trajectories."""
        options = {"autoreset_mode": self.autoreset_mode, "staggered": self.staggered, "infos": self.with_infos}
        made = (self.single._made_with, options | {"kept": self.kept})
        return {
            "made": made,
            "count": self.num_envs,
            "spec": self.spec,
            "at": self.snapshot() if self.episodes else None,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make it again, at the same position."""
        (given, arguments), options = state["made"]
        if given:
            raise ValueError("a vector environment takes the arguments of the single one by name")
        type(self).__init__(self, state["count"], **options, **arguments)
        self.spec = state["spec"]
        if state["at"] is not None:
            self.restore(state["at"])
