"""Vector environments that compute all their episodes at once (``vectorization_mode="vector_entry_point"``).

They give what :class:`gymnasium.vector.SyncVectorEnv` gives for the same environments and seeds, in all three modes of
automatic resets, an order of magnitude faster. ``numpy.random`` generators, one a row, are those of the single
environments.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Self

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from .registration import refuse_unknown_arguments


class RowsVectorEnv(VectorEnv[Any, np.ndarray, np.ndarray]):
    """Base class: seeds, automatic resets and infos; subclasses compute the rows.

    Args:
        num_envs: number of episodes at a time, the rows.
        single: an environment made with the same arguments: its spaces are those of each row.
        autoreset_mode: ``NextStep`` (the step after the last one of an episode resets, whatever its action),
            ``SameStep`` (the last step returns the first observation of the next episode; the last one of this episode
            is ``info["final_obs"]``), or ``Disabled`` (``reset(options={"reset_mask": …})`` does it).

    Raises:
        TypeError: an argument that neither the vector environment nor its single one has.
        ValueError: ``num_envs`` is not positive, an unknown mode, or an environment that renders.
    """

    kind: ClassVar[type[gymnasium.Env[Any, Any]]]
    """Class of the single environment."""

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:
        """Check the names of the arguments."""
        refuse_unknown_arguments(cls, kwargs)
        return super().__new__(cls)

    def __init__(
        self, num_envs: int, single: gymnasium.Env[Any, Any], autoreset_mode: str | AutoresetMode = "NextStep"
    ) -> None:
        if isinstance(num_envs, bool) or not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise ValueError(f"num_envs must be a whole number of at least 1, got {num_envs!r}")
        if single.render_mode is not None:
            raise ValueError(
                f"render_mode must be None, got {single.render_mode!r}: to draw, use vectorization_mode='sync'"
            )
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            known = [mode.value for mode in AutoresetMode]
            raise ValueError(f"autoreset_mode must be one of {known}, got {autoreset_mode!r}") from None
        self.num_envs, self.single = int(num_envs), single
        self.metadata = {**single.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = single.observation_space, single.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.generators: list[np.random.Generator | None] = [None] * self.num_envs
        self._seeds: list[int] = [-1] * self.num_envs
        self._begun = np.zeros(self.num_envs, bool)
        self._over = np.zeros(self.num_envs, bool)

    def begin_rows(self, rows: np.ndarray, options: Mapping[str, Any], *, first: bool) -> None:
        """Begin an episode in some rows, by a reset (``first``) or automatically; randomness of :meth:`generator`."""
        raise NotImplementedError

    def step_rows(self, rows: np.ndarray, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One step of some rows with actions ``(b, …)``: rewards ``(b,)`` and which episodes are truncated ``(b,)``."""
        raise NotImplementedError

    def observations(self) -> Any:
        """Observations of all rows, shared with nobody."""
        raise NotImplementedError

    def infos(self) -> dict[str, Any]:
        """Infos of all rows, in Gymnasium's form."""
        raise NotImplementedError

    def generator(self, row: int) -> np.random.Generator:
        """The generator of a row."""
        found = self.generators[row]
        if found is None:
            found, self._seeds[row] = seeding.np_random()
            self.generators[row] = found
        return found

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generator of each row."""
        return tuple(self.generator(row) for row in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each row; −1 before the first reset."""
        return tuple(self._seeds)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every row.

        Args:
            seed: of the first row, the others count on from it; or one for each row; None continues.
            options: those of the single environment, and ``reset_mask`` ``(num_envs,)`` bool: the rows to reset.

        Raises:
            ValueError: a wrong number of seeds, an unknown option, or a mask of another shape or of no row.
        """
        if seed is None or isinstance(seed, int | np.integer):
            seeds: list[int | None] = [None if seed is None else int(seed) + row for row in range(self.num_envs)]
        else:
            seeds = list(seed) if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str) else []
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed must be an integer, None or {self.num_envs} of them, got {seed!r}")
        given = dict(options or {})
        mask = np.asarray(given.pop("reset_mask", np.ones(self.num_envs, bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(f"reset_mask must hold {self.num_envs} booleans, one of them true, got {mask!r}")
        given = self.single.unwrapped.checked_options(given)  # type: ignore[attr-defined]
        if not (self._begun | mask).all():
            raise ValueError("reset_mask must name every row at the first reset")
        rows = np.flatnonzero(mask)
        for row in rows:
            if seeds[row] is not None:
                self.generators[row], self._seeds[row] = seeding.np_random(seeds[row])
        self._over[rows], self._begun[rows] = False, True
        self.begin_rows(rows, given, first=True)
        infos = self.infos()
        return self.observations(), infos if mask.all() else only(infos, mask)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step of every row, or its automatic reset.

        Raises:
            ValueError: actions of a wrong shape, or one that is not finite.
            RuntimeError: before :meth:`reset`, or after the end of an episode in the mode ``Disabled``.
        """
        chosen = np.asarray(actions, dtype=float)
        if chosen.shape != self.action_space.shape:
            raise ValueError(f"actions must have shape {self.action_space.shape}, got {chosen.shape}")
        if not np.isfinite(chosen).all():
            wrong = np.flatnonzero(~np.isfinite(chosen.reshape(self.num_envs, -1)).all(axis=1))
            raise ValueError(f"actions must be finite, those of the rows {wrong.tolist()} are not")
        if not self._begun.all():
            raise RuntimeError("call reset first: there is no episode")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._over.any():
            over = np.flatnonzero(self._over).tolist()
            raise RuntimeError(f"the episodes in the rows {over} are over: reset them (option reset_mask)")
        anew, rows = np.flatnonzero(self._over), np.flatnonzero(~self._over)
        rewards, truncations = np.zeros(self.num_envs), np.zeros(self.num_envs, bool)
        if len(rows):
            rewards[rows], truncations[rows] = self.step_rows(rows, chosen[rows])
        if len(anew):
            self.begin_rows(anew, {}, first=False)
        self._over = truncations.copy()
        final: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and truncations.any():
            seen = self.observations()
            last = np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(truncations).tolist():
                last[row] = row_of(seen, row)
            final = {
                "final_obs": last,
                "_final_obs": truncations.copy(),
                "final_info": only(self.infos(), truncations),
                "_final_info": truncations.copy(),
            }
            self.begin_rows(np.flatnonzero(truncations), {}, first=False)
            self._over[:] = False
        terminations = np.zeros(self.num_envs, bool)
        return self.observations(), rewards, terminations, truncations, {**final, **self.infos()}

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environment that the rows were made after."""
        self.single.close()


def row_of(seen: Any, row: int) -> Any:
    """The observation of one row."""
    return {name: part[row].copy() for name, part in seen.items()} if isinstance(seen, dict) else seen[row].copy()


def everywhere(values: Mapping[str, Any], count: int) -> dict[str, Any]:
    """Infos that every row has: name → array ``(count, …)`` or mapping of such, with Gymnasium's masks."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        found[name] = everywhere(value, count) if isinstance(value, Mapping) else value
        found[f"_{name}"] = np.ones(count, bool)
    return found


def only(infos: Mapping[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """Infos of some rows: zeros and a false mask in the others."""

    def cut(value: Any) -> Any:
        if isinstance(value, Mapping):
            return only(value, mask)
        return value & mask if value.dtype == bool else np.where(mask.reshape(-1, *(1,) * (value.ndim - 1)), value, 0)

    return {name: cut(value) for name, value in infos.items()}


def gathered(
    layouts: Sequence[tuple[tuple[str, int], ...]], values: Sequence[np.ndarray], count: int
) -> dict[str, np.ndarray]:
    """Named columns of each row as arrays ``(count, size)`` with Gymnasium's masks; rows may have different names.

    ``layouts`` are names and sizes of the columns of each row, ``values`` its numbers ``(columns,)``.
    """
    members: dict[tuple[tuple[str, int], ...], list[int]] = {}
    for row, layout in enumerate(layouts):
        members.setdefault(layout, []).append(row)
    found: dict[str, np.ndarray] = {}
    for layout, rows in members.items():
        table, start = np.stack([values[row] for row in rows]), 0
        for name, size in layout:
            part = table[:, start : start + size]
            start += size
            if len(rows) == count:
                found[name], found[f"_{name}"] = part.copy(), np.ones(count, bool)
                continue
            target = found.setdefault(name, np.zeros((count, size)))
            target[rows] = part
            found.setdefault(f"_{name}", np.zeros(count, bool))[rows] = True
    return found


def saved_generators(generators: Iterable[np.random.Generator]) -> list[str]:
    """Generators as JSON, with the number of children that they have had."""
    kept = []
    for generator in generators:
        sequence: Any = generator.bit_generator.seed_seq
        family = {
            "entropy": sequence.entropy,
            "spawn_key": list(sequence.spawn_key),
            "n_children_spawned": sequence.n_children_spawned,
        }
        kept.append(json.dumps({"state": generator.bit_generator.state, "sequence": family}))
    return kept


def restored_generators(kept: Iterable[str]) -> list[np.random.Generator]:
    """Inverse of :func:`saved_generators`."""
    generators = []
    for text in kept:
        saved = json.loads(text)
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(**saved["sequence"])))
        generator.bit_generator.state = saved["state"]
        generators.append(generator)
    return generators
