"""Filters whose Kalman gain itself may be scaled, for a network that corrects it.

    x ← x ⊕ D K r,   D = diag(share of each part of the error state)

K is the filter's own gain and D = 1 the filter itself, bit by bit. The idea of a learned gain is that of G. Revach and
colleagues, "KalmanNet: Neural Network Aided Kalman Filtering for Partially Known Dynamics", IEEE Transactions on Signal
Processing 70, 2022; there the network gives all of K. The covariance stays that of the gain K: noises that a network
sets together with the shares make it that of the errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from ....filters.core.backend import Array, expand, namespace
from ....filters.core.kalman import KalmanFilter
from ....filters.core.model import Gain, Model, equations_of, parameters_of
from ....filters.imu.external_acceleration import ExternalAcceleration
from ....filters.imu.mekf import MEKF
from ....filters.registry import make, name_of
from ....filters.support.names import look_up


@dataclass(frozen=True)
class GainMEKF(MEKF):
    """:class:`.mekf.MEKF` with a share of the gain of each part of its error."""

    attitude_share: float = 1.0
    """of the correction of the attitude"""
    bias_share: float = 1.0
    """of the correction of the gyroscope bias"""

    gains: ClassVar[dict[str, Gain]] = MEKF.gains | {
        "attitude-gain": Gain("attitude_share", 1.0, description="factor on the gain of the attitude"),
        "bias-gain": Gain("bias_share", 1.0, description="factor on the gain of the gyroscope bias"),
    }

    def retract(self, x: Array, dx: Array) -> Array:
        """The state corrected by the shares of the error ``dx``."""
        parts = [expand(self.attitude_share, 1) * dx[..., :3], expand(self.bias_share, 1) * dx[..., 3:6]]
        return super().retract(x, namespace(x).concat(parts, axis=-1))


@dataclass(frozen=True)
class GainExternalAcceleration(ExternalAcceleration):
    """:class:`.external_acceleration.ExternalAcceleration` with a share of its gain."""

    attitude_share: float = 1.0
    """of the correction of the inclination"""

    gains: ClassVar[dict[str, Gain]] = ExternalAcceleration.gains | {
        "attitude-gain": Gain("attitude_share", 1.0, description="factor on the gain of the inclination")
    }

    def retract(self, x: Array, dx: Array) -> Array:
        """The state corrected by the share of the error ``dx``."""
        return super().retract(x, expand(self.attitude_share, 1) * dx)


SHARED: dict[str, type[Model]] = {"mekf": GainMEKF, "external-acceleration": GainExternalAcceleration}
"""Filter → its form with shares of the gain."""


def with_gain_shares(filter: str, dt: float = 0.01, **parameters: Any) -> KalmanFilter:
    """A filter whose gain may be scaled.

    Args:
        filter: one of :data:`SHARED`.
        dt: sampling interval, s.
        parameters: of the filter, where they differ from the registered ones.

    Raises:
        ValueError: an unknown filter or parameter.
    """
    return KalmanFilter(look_up("filter with shares of its gain", filter, SHARED)(dt=dt, **parameters))


def described_filter(kalman: KalmanFilter) -> dict[str, Any]:
    """Name, options and constants of a filter, for a card; the inverse is :func:`filter_of`.

    Raises:
        ValueError: its equations are not registered.
    """
    model = kalman.model
    shared = next((name for name, kind in SHARED.items() if type(model) is kind), None)
    name = registered_name(model) if shared is None else shared
    usual: Any = filter_of({"name": name, "shares": shared is not None, "parameters": {}}, model.dt).model
    changed = {
        field.name: getattr(model, field.name)
        for field in fields(model)
        if getattr(model, field.name) != getattr(usual, field.name)
    }
    return {"name": name, "shares": shared is not None, "parameters": changed}


def with_changed_numbers(model: Model) -> dict[str, Any]:
    """Name of a filter and what differs from the registered one among its numbers, persons and vehicles aside."""
    name = registered_name(model)
    usual, own = parameters_of(equations_of(make(name))), parameters_of(model)
    changed = {key: own[key] for key in own if key != "dt" and key in usual and own[key] != usual[key]}
    return {"name": name, "parameters": {key: value for key, value in changed.items() if "[" not in key}}


def registered_name(model: Model) -> str:
    """Name in the registry.

    Raises:
        ValueError: there is none.
    """
    name = name_of(model)
    if name is None:
        raise ValueError(f"{type(model).__name__} is not registered: a card could not name it")
    return name


def filter_of(described: Mapping[str, Any], dt: float) -> KalmanFilter:
    """The filter that :func:`described_filter` describes, for samples ``dt`` s apart.

    Raises:
        ValueError: an unknown filter or parameter, or one that is not a Kalman filter.
    """
    given: Any = {
        name: tuple(value) if isinstance(value, list) else value for name, value in described["parameters"].items()
    }
    if described.get("shares"):
        return with_gain_shares(described["name"], dt, **given)
    made = make(described["name"], dt=dt, **given)
    if not isinstance(made, KalmanFilter):
        raise ValueError(f"filter must be a Kalman filter, got {described['name']!r}")
    return made
