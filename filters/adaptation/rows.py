"""Tuned filters side by side, one a row: they may differ in rider, device and sampling rate, and begin anew singly.

Rows whose equations are compiled alike and that have one sampling interval are computed in one call, with the
parameters of each. The numbers are those of one :class:`.TunedFilter` a row, bit by bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from ..compile.run import CompiledEquations, compiled_equations
from ..core.kalman import KalmanFilter
from ..core.model import Equations, Model, parameters_of, structure_of
from ..core.quantity import Estimate
from ..core.sampling import split
from .gains import gain_sizes, log_gains
from .tuned import TunedFilter, TunedState

Rows = np.ndarray
"""Indices of rows ``(b,)``."""


@dataclass(eq=False)
class RowGroup:
    """Rows that advance together.

    Attributes:
        tuned: the filter of one of them: structure and sampling interval are those of all.
        form: the compiled equations; None where they cannot be compiled.
        base: published parameters ``(rows, count)`` of those rows that belong to the group.
    """

    tuned: TunedFilter
    form: CompiledEquations | None
    base: np.ndarray


class TunedRows:
    """A tuned filter in each of several rows.

    Args:
        tuned: the filter with its actions and features; rows may have other parameters.
        count: number of rows.
    """

    def __init__(self, tuned: TunedFilter, count: int) -> None:
        self.tuned, self.count = tuned, count
        empty = {channel.name: np.full((count, channel.size), np.nan) for channel in tuned.kalman.channels}
        self.state = mapped(tuned.init(empty), np.array)  # of its own, to write into
        self._initial = taken(self.state, np.array([0]))
        self._groups: dict[Any, RowGroup] = {}
        self._models: dict[Any, Equations] = {}
        self._group: list[RowGroup | None] = [None] * count
        self._model: list[Equations] = [tuned.kalman.model] * count

    def begin(self, row: int, kalman: KalmanFilter) -> None:
        """Start a row anew with a filter in its published tuning; its equations may have other parameters."""
        model = kalman.model
        key = (structure_of(model), model.dt)
        values = tuple(parameters_of(model).values())
        if len(self._groups) + len(self._models) > 4 * self.count + 16:
            self._forget()
        if key not in self._groups:
            form = compiled_equations(model) if kalman.compiled else None
            tuned = replace(self.tuned, kalman=replace(kalman, keep_covariance=False))
            self._groups[key] = RowGroup(tuned, form, np.zeros((self.count, len(values))))
        self._group[row] = group = self._groups[key]
        self._model[row] = self._models.setdefault((key, values), model)
        group.base[row] = values
        put(self.state, np.array([row]), self._initial)

    def _forget(self) -> None:
        """Keep only groups and models of present rows."""
        groups, models = {id(group) for group in self._group}, {id(model) for model in self._model}
        self._groups = {key: group for key, group in self._groups.items() if id(group) in groups}
        self._models = {key: model for key, model in self._models.items() if id(model) in models}

    def groups(self, rows: Rows) -> list[tuple[RowGroup, Rows]]:
        """The groups among rows that have begun, each with its rows in the order given."""
        found: dict[int, tuple[RowGroup, list[int]]] = {}
        for row in rows.tolist():
            group = self._group[row]
            assert group is not None
            found.setdefault(id(group), (group, []))[1].append(row)
        return [(group, np.array(members)) for group, members in found.values()]

    def advance(self, group: RowGroup, rows: Rows, actions: np.ndarray, samples: np.ndarray) -> Estimate:
        """Decide and process one interval in the rows of a group.

        Args:
            group: from :meth:`groups`.
            rows: its rows ``(b,)``.
            actions: ``(b, k)``; values beyond [−1, 1] are clipped.
            samples: ``(T, b, d)``, the channels one after the other, as :func:`.check_measurements` gives them.

        Returns:
            Estimates ``(T, b, …)``.
        """
        tuned = group.tuned
        state = tuned.decide(taken(self.state, rows), actions)
        if group.form is None:
            return self._advance_each(tuned, rows, state, samples)
        model = tuned.kalman.model
        parameters = self._parameters(group, rows, state.action)
        estimate, after = group.form.run_samples(model, state.filter, samples, parameters, tuned.kalman.restart, False)
        memory = tuned.features.update(state.memory, tuned.kalman, split(samples, model.channels), estimate)
        put(self.state, rows, TunedState(after, memory, state.action))
        return estimate

    def _advance_each(self, tuned: TunedFilter, rows: Rows, state: TunedState, samples: np.ndarray) -> Estimate:
        """The same for equations that are not compiled, one row after the other."""
        estimates = []
        for place, row in enumerate(rows):
            place_of = np.array([place])
            own = replace(tuned, kalman=replace(tuned.kalman, model=cast(Model, self._model[row])))
            chunk = split(samples[:, place_of], tuned.kalman.channels)
            estimate, after = own.advance(taken(state, place_of), chunk)
            put(self.state, np.array([row]), after)
            estimates.append(estimate)
        pose = {name: np.concatenate([one.pose[name] for one in estimates], axis=1) for name in estimates[0].pose}
        white, nis = (np.concatenate([np.asarray(one[index]) for one in estimates], axis=1) for index in (2, 3))
        return Estimate(pose, None, white, nis)

    def observe(self) -> np.ndarray:
        """Observations of all rows ``(rows, n)``, float32 in [−1, 1], at a decision."""
        seen = np.zeros((self.count, self.tuned.observation_size), np.float32)
        for group, rows in self.groups(np.arange(self.count)):
            seen[rows] = group.tuned.observe(taken(self.state, rows))
        return seen

    def gains(self, group: RowGroup, rows: Rows, actions: np.ndarray) -> dict[str, np.ndarray]:
        """Log gains ``(b,)`` of the actions ``(b, k)`` of rows of a group, by name."""
        ranges, models = self.tuned.ranges, [self._model[row] for row in rows]
        distinct = {id(model): model for model in models}
        if len(distinct) == 1 or type(models[0]).limited is Equations.limited:
            return log_gains(cast(Model, models[0]), ranges, actions)
        found = {part.gain: np.zeros(len(rows)) for part in ranges}
        for number, model in distinct.items():
            mine = np.array([id(one) == number for one in models])
            for name, factors in log_gains(cast(Model, model), ranges, actions[mine]).items():
                found[name][mine] = factors
        return found

    def sizes(self, group: RowGroup, rows: Rows, actions: np.ndarray) -> dict[str, np.ndarray]:
        """The scaled constants ``(b,)`` by gain, in the unit of the parameter."""
        model = group.tuned.kalman.model
        base = dict(zip(parameters_of(model), group.base[rows].T, strict=True))
        return gain_sizes(model, self.gains(group, rows, actions), base)

    def _parameters(self, group: RowGroup, rows: Rows, actions: np.ndarray) -> np.ndarray:
        """Parameters of an interval ``(1, b, count)``."""
        table = group.base[rows]
        model, names = group.tuned.kalman.model, list(parameters_of(group.tuned.kalman.model))
        for name, size in self.sizes(group, rows, actions).items():
            table[:, names.index(model.gains[name].parameter)] = size
        return table[None]


def arrays_of(state: TunedState) -> list[np.ndarray]:
    """The arrays of a state that have one entry a row."""
    return [*state.filter, *(part for part in state.memory if part.ndim), state.action]


def mapped(state: TunedState, function: Callable[[np.ndarray], np.ndarray]) -> TunedState:
    """The state of what a function gives of each array."""
    filter, memory = state.filter, state.memory
    moved = type(filter)(*map(function, filter)), type(memory)(*map(function, memory))
    return TunedState(*moved, function(state.action))


def taken(state: TunedState, rows: Rows) -> TunedState:
    """Some rows of a state, copied."""
    return mapped(state, lambda array: array[rows] if array.ndim else array)


def put(state: TunedState, rows: Rows, part: TunedState) -> None:
    """Write rows of a state."""
    for array, new in zip(arrays_of(state), arrays_of(part), strict=True):
        array[rows] = new
