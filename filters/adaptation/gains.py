r"""What an agent may choose: bounded actions, one for each gain of a filter, that are log factors on its constants.

An action lies in [−1, 1]; 0 is the published tuning, exactly. Between 0 and ±1 the log factor is linear, with a slope
of its own on each side (:class:`GainRange`). Variances may change by 10^±1.5 unless a model has a reason for less.

The constant c_a of :mod:`poise.filters.imu.external_acceleration` has one. A steady tilt error e looks like an
acceleration g e there: it shrinks the innovation to (1 − c_a) g e and raises the variance M to at least c_a² g² e² / 3.
With the steady covariance P = Δt σ_G √M / g of small gains, the correction that results,

    (1 − c_a) g e · Δt σ_G / √M  ≤  Δt · √3 σ_G (1 − c_a) / c_a,

does not grow with e. A gyroscope that drifts faster than √3 σ_G (1 − c_a) / c_a carries the attitude away for good: the
filter is locked out. :func:`log_gains` therefore keeps c_a so low that a drift of :data:`FOLLOWED_DRIFT` can be
followed at the σ_G of the same action, and below :data:`LARGEST_C_A` in any case.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.model import Model, parameters_of
from ..imu.external_acceleration import ExternalAcceleration
from ..registry import CATALOGUE, make

DECADES = 1.5
"""Powers of ten by which a variance may change either way.

In the external-acceleration filter the ratio of its two variances sets the time constant, 0.1 s as published: it can
change from 3 ms to 3 s, beyond which a biased gyroscope costs more than any acceleration."""
LARGEST_C_A = 0.5
"""Highest c_a that an action reaches; from 0.7 any bias of the gyroscope can lock the filter out."""
SMALLEST_C_A = 1e-3
"""Lowest c_a that an action reaches; as good as none."""
FOLLOWED_DRIFT = math.radians(1.0)
"""rad/s: gyroscope error that the external-acceleration filter must be able to follow at every action."""


@dataclass(frozen=True)
class GainRange:
    """How far one gain may be changed.

    Attributes:
        gain: name in ``model.gains``.
        lower: log factor at action −1, not positive.
        upper: log factor at action 1, not negative.

    Raises:
        ValueError: a bound has the wrong sign or is not finite.
    """

    gain: str
    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not -math.inf < self.lower <= 0.0 <= self.upper < math.inf:
            raise ValueError(f"range of {self.gain!r} must satisfy lower <= 0 <= upper, got {self.lower}, {self.upper}")


def tunable_filter(filter: str | KalmanFilter) -> KalmanFilter:
    """The filter of a name, or the filter itself.

    Args:
        filter: a Kalman filter of :data:`poise.filters.registry.CATALOGUE` that has gains, by name or made.

    Raises:
        ValueError: unknown name, or something that is no filter with gains.
    """
    names = [name for name, entry in CATALOGUE.items() if entry.recursion == "KalmanFilter"]
    if isinstance(filter, str):
        if filter not in names:
            raise ValueError(f"unknown filter {filter!r}; known are {', '.join(names)}, or give a KalmanFilter")
        made = make(filter, keep_covariance=False)
        assert isinstance(made, KalmanFilter)
        if not made.gains:
            raise ValueError(f"filter must have gains to be tuned, {filter!r} has none")
        return made
    if not isinstance(filter, KalmanFilter) or not filter.gains:
        raise ValueError(f"filter must be one of {', '.join(names)} or a KalmanFilter with gains, got {filter!r}")
    return filter


def filter_name(filter: str | KalmanFilter) -> str:
    """Name by which a filter is known here, or the name of its model's class."""
    if isinstance(filter, str):
        tunable_filter(filter)
        return filter
    model = type(tunable_filter(filter).model)
    place = f"{model.__module__.partition('.filters.')[2]}:{model.__qualname__}"
    return next((name for name, entry in CATALOGUE.items() if entry.factory == place), model.__name__)


def gain_ranges(kalman: KalmanFilter, gains: Sequence[str] | None = None) -> tuple[GainRange, ...]:
    """Ranges of the gains that may be chosen.

    Args:
        kalman: the filter.
        gains: names in the order of the action; None for all of the filter.

    Raises:
        ValueError: a gain is unknown or named twice, or there is none.
    """
    names = tuple(kalman.gains) if gains is None else tuple(gains)
    unknown = [name for name in names if name not in kalman.gains]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"gains must be different ones of {sorted(kalman.gains)}, got {list(names)}")
    return tuple(_range(kalman.model, name) for name in names)


def _range(model: Model, name: str) -> GainRange:
    if isinstance(model, ExternalAcceleration) and name == "c_a" and model.c_a > 0.0:
        lower, upper = (math.log(bound / model.c_a) for bound in (SMALLEST_C_A, LARGEST_C_A))
        return GainRange(name, min(lower, 0.0), max(upper, 0.0))
    reach = DECADES * math.log(10.0)
    return GainRange(name, -reach, reach)


def log_gains(model: Model, ranges: Sequence[GainRange], action: np.ndarray) -> dict[str, np.ndarray]:
    """Gains of an action, for :meth:`poise.filters.core.kalman.KalmanFilter.run_from`.

    Args:
        model: the published tuning.
        ranges: one for each entry of the action.
        action: ``(*batch, k)``; values beyond [−1, 1] count as these.

    Returns:
        Gain name → log factor ``(*batch,)``; zeros for a zero action.

    Raises:
        ValueError: the action has another length than ``ranges``, or is not finite.
    """
    action = np.asarray(action, dtype=float)
    if action.ndim == 0 or action.shape[-1] != len(ranges) or not np.isfinite(action).all():
        raise ValueError(f"action must hold {len(ranges)} finite numbers (last axis), got {action!r}")
    bounded = np.minimum(np.maximum(action, -1.0), 1.0)
    reach = np.where(bounded < 0.0, [-part.lower for part in ranges], [part.upper for part in ranges])
    factors = bounded * reach
    gains = {part.gain: factors[..., index] for index, part in enumerate(ranges)}
    if isinstance(model, ExternalAcceleration) and "c_a" in gains and model.c_a > 0.0:
        gains["c_a"] = np.minimum(gains["c_a"], np.log(_safe_c_a(model, gains) / model.c_a))
    return gains


def _safe_c_a(model: ExternalAcceleration, gains: Mapping[str, np.ndarray]) -> np.ndarray:
    """Largest c_a that still follows a drift, as derived in the head of this file."""
    power = model.gains["process"].power
    noise = model.gyroscope_noise * np.exp(power * np.asarray(gains.get("process", 0.0)))
    safe = np.minimum(followable_c_a(noise), LARGEST_C_A)
    published = min(followable_c_a(model.gyroscope_noise), LARGEST_C_A)
    # A tuning that was published beyond the limit stays reachable: the zero action changes nothing.
    return safe * max(1.0, model.c_a / published)


def followable_c_a(gyroscope_noise: np.ndarray | float) -> np.ndarray | float:
    """c_a at which a drift of :data:`FOLLOWED_DRIFT` is the fastest that σ_G = ``gyroscope_noise`` (rad/s) follows."""
    reach = math.sqrt(3.0) * gyroscope_noise
    return reach / (reach + FOLLOWED_DRIFT)


def gain_sizes(model: Model, gains: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The scaled constants themselves: gain name → value in the parameter's unit, as the filter uses them."""
    base = parameters_of(model)
    sizes = {}
    for name, factor in gains.items():
        gain = model.gains[name]
        sizes[name] = np.minimum(base[gain.parameter] * np.exp(gain.power * factor), gain.maximum)
    return sizes
