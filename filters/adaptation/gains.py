"""Actions of an agent: one bounded log factor on each gain of a filter.

An action lies in [−1, 1]; 0 is exactly the published tuning. The log factor is linear between 0 and ±1, with a separate
slope on each side (:class:`GainRange`). Variances may change by 10^±1.5 unless a gain declares ``bounds``; a model may
limit gains further where a combination would be unsafe (:meth:`poise.filters.core.model.Equations.limited`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.model import Equations, Model, parameters_of
from ..registry import FILTERS, make, name_of
from ..support.names import unknown

DECADES = 1.5
"""Powers of ten by which a variance may change in either direction.

In the external-acceleration filter the ratio of its two variances sets the time constant, 0.1 s as published: it can
change from 3 ms to 3 s. Beyond that a gyroscope bias causes larger errors than any acceleration."""


@dataclass(frozen=True)
class GainRange:
    """Range within which one gain may be changed.

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
    """The filter of this name, without covariances, or the filter itself.

    Args:
        filter: a Kalman filter with gains, or the name of one in :data:`poise.filters.registry.FILTERS`.

    Raises:
        ValueError: another name, or something that is not a Kalman filter with gains.
    """
    if isinstance(filter, str):
        if not has_gains(filter):
            known = [name for name in FILTERS if has_gains(name)]
            raise ValueError(unknown("filter", filter, known, "filter must be a Kalman filter with gains, got"))
        made = make(filter)
        assert isinstance(made, KalmanFilter)
        return replace(made, keep_covariance=False)
    if not isinstance(filter, KalmanFilter) or not filter.gains:
        raise ValueError(f"filter must be a Kalman filter with gains, or the name of one, got {filter!r}")
    return filter


def has_gains(name: str) -> bool:
    """Whether this is the name of a Kalman filter with gains."""
    entry = FILTERS.get(name)
    return entry is not None and entry.runner is KalmanFilter and bool(getattr(entry.made_by, "gains", ()))


def filter_name(filter: KalmanFilter) -> str:
    """Name by which a filter is registered, or the name of its model's class."""
    return name_of(filter.model) or type(filter.model).__name__


def acted_gains(kalman: KalmanFilter) -> tuple[str, ...]:
    """The gains that an agent sets unless they are named."""
    return tuple(name for name, gain in kalman.model.gains.items() if gain.acted)


def gain_ranges(kalman: KalmanFilter, gains: Sequence[str] | None = None) -> tuple[GainRange, ...]:
    """Ranges of the gains that may be chosen.

    Args:
        kalman: the filter.
        gains: names in the order of the action; None for all gains of the filter.

    Raises:
        ValueError: a gain is unknown or named twice, or there is none.
    """
    names = tuple(kalman.gains) if gains is None else tuple(gains)
    unknown = [name for name in names if name not in kalman.gains]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"gains must be distinct names from {sorted(kalman.gains)}, got {list(names)}")
    return tuple(_range(kalman.model, name) for name in names)


def _range(model: Model, name: str) -> GainRange:
    """The bounds that the gain declares, extended to include the published value; else :data:`DECADES`."""
    gain = model.gains[name]
    if gain.bounds is not None and (value := parameters_of(model)[gain.parameter]) > 0.0:
        lower, upper = (math.log(bound / value) / gain.power for bound in gain.bounds)
        return GainRange(name, min(lower, 0.0), max(upper, 0.0))
    reach = DECADES * math.log(10.0)
    return GainRange(name, -reach, reach)


def log_gains(model: Model, ranges: Sequence[GainRange], action: np.ndarray) -> dict[str, np.ndarray]:
    """Gains of an action, for :meth:`poise.filters.core.kalman.KalmanFilter.run_from`.

    Args:
        model: the published tuning.
        ranges: one for each entry of the action.
        action: ``(*batch, k)``; values beyond [−1, 1] are clipped.

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
    return model.limited({part.gain: factors[..., index] for index, part in enumerate(ranges)})


def gain_sizes(
    model: Equations, gains: Mapping[str, np.ndarray], base: Mapping[str, Any] | None = None
) -> dict[str, np.ndarray]:
    """The scaled constants: gain name → value in the unit of the parameter, as used by the filter.

    ``base`` holds other parameters than those of the model, one array each.
    """
    base, sizes = parameters_of(model) if base is None else base, {}
    for name, factor in gains.items():
        gain = model.gains[name]
        sizes[name] = gain.scaled(base[gain.parameter], factor)
    return sizes
