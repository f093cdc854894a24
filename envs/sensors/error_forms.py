"""How errors meet a reading that is no plain vector: angles, rotations, counts, and axes in different units."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from ...filters.core import rotation
from .noise import NoiseProcess
from .noise_model import NoiseModel

Form = Literal["additive", "angle", "rotation", "counted"]
"""``additive``: the error is added to the reading. ``angle``: likewise, wrapped to [−π, π]. ``rotation``: the reading
is a unit quaternion and is turned by the error, a rotation vector (rad) in axes of the child frame. ``counted``:
additive, but what rounding to the resolution leaves is carried to the next sample, as counters do."""

FORMS: tuple[Form, ...] = ("additive", "angle", "rotation", "counted")


def error_size(form: Form, size: int) -> int:
    """Values of the error of a reading with ``size`` values: three for a quaternion."""
    return 3 if form == "rotation" else size


class FormedNoise(NoiseProcess):
    """The errors of one channel during one episode, in another form than a plain sum.

    Args:
        model: how large they are.
        size: values a sample.
        rate: samples a second.
        generator: what to draw from; the process owns it from now on.
        form: how errors meet the reading.
        units: size of one unit of ``model`` on each axis of the error, in units of the channel; empty for ones.

    Raises:
        ValueError: as :class:`NoiseProcess`.
    """

    def __init__(
        self,
        model: NoiseModel,
        size: int,
        rate: float,
        generator: np.random.Generator,
        form: Form = "additive",
        units: tuple[float, ...] = (),
    ) -> None:
        # wrapped and unit readings cannot leave their range; counting comes after everything else
        free = model if form == "additive" else replace(model, full_scale=math.inf)
        self._count = model.resolution if form == "counted" else 0.0
        super().__init__(
            replace(free, resolution=0.0) if self._count else free, error_size(form, size), rate, generator
        )
        self.form, self.size, self._limit = form, size, model.full_scale
        self._units = np.array(units) if units else np.ones(self.width)
        if self._count:
            self._state.carry = np.zeros(size)

    @property
    def bias(self) -> np.ndarray:
        """True bias of the last sample, in units of the channel; a rotation vector ``(3,)`` (rad) for rotations."""
        return self._state.bias * self._units

    def step(self, value: np.ndarray, specific_force: np.ndarray | None = None) -> np.ndarray:
        """Measure once; see :meth:`NoiseProcess.step`."""
        if self.form == "rotation":
            return self._turned(value, super().step(np.zeros(3)))
        measured = super().step(value / self._units, specific_force) * self._units
        return self._finished(measured[None])[0]

    def sequence(self, values: np.ndarray, specific_force: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Measure T times; see :meth:`NoiseProcess.sequence`."""
        if self.form == "rotation":
            errors, biases = super().sequence(np.zeros((len(values), 3)))
            return self._turned(values, errors), biases * self._units
        measured, biases = super().sequence(values / self._units, specific_force)
        return self._finished(measured * self._units), biases * self._units

    def _turned(self, values: np.ndarray, errors: np.ndarray) -> np.ndarray:
        return rotation.positive(rotation.multiply(values, rotation.exp(errors * self._units)))

    def _finished(self, rows: np.ndarray) -> np.ndarray:
        """What comes after the errors: ``(n, size)``, NaN where lost."""
        if self.form == "angle":
            return rotation.wrap(rows)
        if self.form == "counted":
            rows = self._counted(rows) if self._count else rows
            return np.clip(rows, -self._limit, self._limit)
        return rows

    def _counted(self, rows: np.ndarray) -> np.ndarray:
        """Whole counts; a lost sample takes its counts with it and leaves the rest as it is."""
        carry, counted = self._state.carry, np.full_like(rows, np.nan)
        assert carry is not None
        for number, row in enumerate(rows):
            if not np.isnan(row[0]):
                whole = row + carry
                counted[number] = np.rint(whole / self._count) * self._count
                carry = whole - counted[number]
        self._state.carry = carry
        return counted
