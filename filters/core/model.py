"""What a published filter contributes: its equations. The recursion around them is elsewhere.

A :class:`Model` goes into :class:`poise.filters.core.kalman.KalmanFilter`, a :class:`Recurrence` (no covariance) into
:class:`.Observer`. Either is a frozen dataclass: its fields are its parameters (floats with unit
and source), its methods its equations, written over ``xp = namespace(x)`` for arrays ``(*batch, …)``. The same lines
run on NumPy, on torch and, traced once, as compiled code.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from ..support.parameters import check_parameters
from .backend import Array
from .held_inputs import HeldInput
from .quantity import Channel, Measurement, Quantity

E = TypeVar("E", bound="Equations")


@dataclass(frozen=True)
class Gain:
    """A tuning constant that may be scaled at every time step, by a log factor: 0 is the published tuning.

    Attributes:
        parameter: the model's field that is scaled.
        power: the field is multiplied by ``exp(power * log_factor)``. 0.5 for a standard deviation: the log factor then
            scales the variance, that is Q or R.
        maximum: the scaled field never exceeds this.
        bounds: smallest and largest value of the scaled field that a gain policy may choose; None for a range of powers
            of ten (:data:`poise.filters.adaptation.gains.DECADES`).
        description: what the gain does, in one line.
        acted: whether an agent sets it unless the gains are named. False where another gain does the same, or where
            almost every change does harm, so that the noise of exploration costs more than the gain can bring.
    """

    parameter: str
    power: float = 0.5
    maximum: float = math.inf
    description: str = ""
    bounds: tuple[float, float] | None = None
    acted: bool = True

    def scaled(self, value: Any, factor: Any) -> Any:
        """The constant of this value at a log factor, NumPy arrays that broadcast."""
        return np.minimum(value * np.exp(self.power * factor), self.maximum)


@dataclass(frozen=True)
class Equations:
    """What models and recurrences share: channels, outputs, parameters, the sampling interval.

    Measurements arrive as channel → ``(*batch, size)``. ``predict`` sees each channel's last sample (zeros if
    there was none yet), ``prior`` too (NaN if there was none); ``residual`` and ``finish`` see NaN where this time step
    has none.

    A float parameter may be an array ``(*batch,)``: use :func:`.expand` where it scales a matrix.

    Attributes of the class: ``channels``, what is read; ``outputs``, the quantities of ``pose``; ``state_size`` n, the
    numbers in the state; ``error_size`` e and ``residual_size`` m, zero without covariance; ``gains``, name →
    :class:`Gain`; ``error_parts``, quantity → (start, stop) of its part of the error state, if it has one (of a
    rotation: in world axes); ``held_inputs``, whose noise grows while their last sample stands in for missing ones.
    """

    dt: float = 0.01
    """sampling interval, s"""

    channels: ClassVar[tuple[Channel, ...]]
    outputs: ClassVar[tuple[Quantity, ...]]
    state_size: ClassVar[int]
    error_size: ClassVar[int] = 0
    residual_size: ClassVar[int] = 0
    gains: ClassVar[Mapping[str, Gain]] = {}
    error_parts: ClassVar[Mapping[str, tuple[int, int]]] = {}
    held_inputs: ClassVar[tuple[HeldInput, ...]] = ()

    def __post_init__(self) -> None:
        """Refuse parameters of a wrong type or out of their range."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        # Arrays, one number for each sequence of a batch, are not checked.
        kind: Any = type(self)
        check_parameters(kind, {name: value for name, value in given.items() if not getattr(value, "ndim", 0)})
        for field in fields(self):
            if isinstance(field.default, float) and not hasattr(given[field.name], "dtype"):
                object.__setattr__(self, field.name, float(given[field.name]))

    def finish(self, x: Array, z: Measurement) -> Array:
        """Last operation of a time step, after the update: normalise, remember what the next one needs."""
        return x

    def pose(self, x: Array) -> dict[str, Array]:
        """The output quantities of a state."""
        raise NotImplementedError

    def with_dt(self, dt: float) -> Self:
        """The same equations for another sampling interval."""
        return replace(self, dt=float(dt))

    @property
    def supposed_field(self) -> int:
        """Where the state has the unit field in the world that was found at the start and is kept; −1 without one."""
        return -1

    @classmethod
    def parameters_from(cls, metadata: Mapping[str, Any]) -> dict[str, Any]:
        """The parameters that a recording's metadata determine, by field: of the person, the vehicle or the device.

        Raises:
            ValueError: the metadata describe something that is not physically possible.
        """
        return {}

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """The same equations for the person, vehicle or device that a recording's metadata describe.

        Parameters that differ from their defaults were chosen by the caller, and stay.
        """
        found = type(self).parameters_from(metadata)
        usual = type(self)() if found else self
        return replace(
            self, **{name: value for name, value in found.items() if getattr(self, name) == getattr(usual, name)}
        )

    def limited(self, gains: dict[str, Any]) -> dict[str, Any]:
        """Log factors ``(*batch,)`` by gain, lowered where all together make a filter unsafe; by default as given."""
        return gains

    def truth(self, truth: Mapping[str, Any]) -> dict[str, Any]:
        """True values ``(T, size)`` of outputs that only these equations define, from the truth of a recording.

        Outputs that recordings name alike need no entry; where the truth lacks what is needed, the result is empty.
        """
        return {}


@dataclass(frozen=True)
class Model(Equations):
    """Equations of a Kalman filter with state x (``n`` numbers) and error state (``e`` numbers).

    Subclasses write ``prior``, ``predict``, ``residual`` and ``pose``; ``retract`` and ``finish`` have defaults.
    """

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """State ``(..., n)`` and covariance ``(..., e, e)`` from the first samples; NaN while they do not suffice."""
        raise NotImplementedError

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """State after one interval, Jacobian F ``(..., e, e)`` of its error, and process covariance Q.

        ``z`` holds the samples at the end of the interval, ``previous`` those at its beginning.
        """
        raise NotImplementedError

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Measured minus expected ``(..., m)``, Jacobian H ``(..., m, e)`` of the expectation, covariance R.

        Where an element of a row is not finite, its measurement update is skipped.
        """
        raise NotImplementedError

    def retract(self, x: Array, dx: Array) -> Array:
        """The state ``x`` corrected by the error ``dx``: a sum, unless the state holds rotations."""
        return x + dx

    def fitted(self, measurements: Measurement, nis: Callable[[Model, Measurement], Any]) -> Self:
        """The same equations with constants estimated from a whole recording, for smoothing it; unchanged by default.

        Args:
            measurements: the recording, channel → ``(T, *batch, size)``.
            nis: equations and samples → normalised innovations squared ``(T, *batch)`` of these.
        """
        return self


@dataclass(frozen=True)
class Recurrence(Equations):
    """Equations of a method without covariance: an observer with fixed gains, or plain integration.

    Subclasses write ``prior``, ``predict`` and ``pose``; what corrects is written in ``finish``.
    """

    def prior(self, z: Measurement) -> Array:
        """State ``(..., n)`` from the first samples; NaN while they do not suffice."""
        raise NotImplementedError

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """State after one interval; ``z`` belongs to its end, ``previous`` to its beginning."""
        raise NotImplementedError


def equations_of(estimator: Any) -> Any:
    """The equations inside a filter, an observer or an adaptive filter; the estimator itself if it has none."""
    for name in ("filter", "model"):
        inner = getattr(estimator, name, None)
        # equations may have a parameter of one of these names
        if hasattr(inner, "channels"):
            return equations_of(inner)
    return estimator


def checked_quaternion(name: str, value: Any) -> tuple[float, ...]:
    """A unit quaternion as four floats.

    Raises:
        ValueError: it has not four numbers, or its length is not 1 within 1e-6.
    """
    numbers = tuple(float(number) for number in value)
    if len(numbers) != 4 or not abs(math.hypot(*numbers) - 1.0) <= 1e-6:
        raise ValueError(f"{name} must be a unit quaternion (w, x, y, z), got {value}")
    return numbers


def parameters_of(model: Equations) -> Mapping[str, float]:
    """The numbers a model is tuned by: every float of its fields, by a name such as ``lever_arm[0]``."""
    return _remembered(model)[0]


def structure_of(model: Equations) -> tuple[Any, ...]:
    """What is not a float and so is fixed when a model is compiled: its class and its integers, booleans and texts."""
    return _remembered(model)[1]


def _remembered(model: Equations) -> tuple[Mapping[str, float], tuple[Any, ...]]:
    """Parameters and structure, found once a model: stepping asks for them at every sample."""
    found = model.__dict__.get("_leaves")
    if found is None:
        leaves = list(_leaves(model))
        parameters = {path: value for path, value in leaves if isinstance(value, float)}
        structure = (type(model), *((path, value) for path, value in leaves if not isinstance(value, float)))
        found = model.__dict__["_leaves"] = (parameters, structure)
    return found


def with_parameters(model: E, values: Mapping[str, Any]) -> E:
    """A copy whose floats are replaced (by arrays or traced scalars too), without the checks of construction."""
    changed = copy.copy(model)
    changed.__dict__.pop("_leaves", None)
    for field in fields(model):
        object.__setattr__(changed, field.name, _rebuild(field.name, getattr(model, field.name), values))
    return changed


def _leaves(model: Equations) -> Iterator[tuple[str, Any]]:
    for field in fields(model):
        yield from _walk(field.name, getattr(model, field.name))


def _walk(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from _walk(f"{path}[{index}]", item)
    else:
        yield path, value


def _rebuild(path: str, value: Any, values: Mapping[str, Any]) -> Any:
    if isinstance(value, tuple):
        return tuple(_rebuild(f"{path}[{index}]", item, values) for index, item in enumerate(value))
    return values.get(path, value)
