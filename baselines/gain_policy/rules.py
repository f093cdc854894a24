"""Filters whose gain a rule by hand sets: estimators that a trained policy has to beat."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...filters.adaptation.gains import DECADES, filter_name, gain_ranges
from ...filters.adaptation.rules import RULES, AccelerationRule, InnovationRule, Rule
from ...filters.core.kalman import KalmanFilter
from ...filters.registry import make
from ...filters.support.names import look_up
from .adaptive import AdaptiveEstimator
from .policy import GainPolicy


def by_rule(filter: str, rule: str, dt: float = 0.01, **parameters: Any) -> AdaptiveEstimator:
    """A registered filter with its measurement variance, or its belief in level ground, set by a rule.

    Args:
        filter: name of a Kalman filter.
        rule: one of :data:`.RULES`.
        dt: sampling interval, s.
        parameters: constants of the filter that differ from the published tuning, by the model's field names.

    Raises:
        ValueError: an unknown filter, rule or parameter.
    """
    kalman = make(filter, dt=dt, **parameters)
    if not isinstance(kalman, KalmanFilter):
        raise ValueError(f"filter must be a Kalman filter, got {filter!r}")
    gain = "constraint" if "constraint" in kalman.gains else "measurement"
    return ruled(kalman, gain, look_up("rule", rule, RULES))


def ruled(filter: KalmanFilter, gain: str, rule: Rule) -> AdaptiveEstimator:
    """A filter with one gain set by a rule.

    Args:
        filter: in its published tuning.
        gain: name of the gain.
        rule: what sets it; actions 1 and −1 are the ends of the gain's range, of a single IMU the common one at most.

    Raises:
        ValueError: the filter has no such gain.
    """
    (part,) = gain_ranges(filter, (gain,))
    if all(channel.name.startswith("imu/") for channel in filter.channels):
        # Beyond the common range the rules lose to the published gains on recordings of RepoIMU and phones.
        reach = DECADES * math.log(10.0)
        part = replace(part, lower=max(part.lower, -reach), upper=min(part.upper, reach))
    features = replace(rule, largest=part.upper, reach=max(-part.lower, 1e-9))
    # Nothing lowers the variance of what is only believed but a rule that sees when it holds.
    if isinstance(features, InnovationRule | AccelerationRule) and gain == "measurement":
        features = replace(features, smallest=part.lower)
    layers = ((np.array([[1.0, 0.0]]), np.zeros(1)),)
    return AdaptiveEstimator(filter, GainPolicy(filter_name(filter), (part,), features, layers))
