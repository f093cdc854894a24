"""Filters whose gain a rule by hand sets: estimators that a trained policy has to beat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...filters.adaptation.gains import filter_name, gain_ranges
from ...filters.adaptation.rules import InnovationRule, PitchRateRule, Rule
from ...filters.core.kalman import KalmanFilter
from .adaptive import AdaptiveEstimator
from .policy import GainPolicy


def ruled(filter: KalmanFilter, gain: str, rule: Rule) -> AdaptiveEstimator:
    """A filter with one gain set by a rule.

    Args:
        filter: in its published tuning.
        gain: name of the gain.
        rule: what sets it; action 1 is the end of the gain's range.

    Raises:
        ValueError: the filter has no such gain.
    """
    (part,) = gain_ranges(filter, (gain,))
    features = replace(rule, largest=part.upper)
    if isinstance(features, InnovationRule) and part.lower == -part.upper:
        features = replace(features, smallest=part.lower)
    layers = ((np.array([[1.0, 0.0]]), np.zeros(1)),)
    return AdaptiveEstimator(filter, GainPolicy(filter_name(filter), (part,), features, layers))


def doubting_level_ground(filter: KalmanFilter, rule: Rule | None = None) -> AdaptiveEstimator:
    """A filter of rides that believes less in level ground while the bicycle pitches.

    Args:
        filter: one with a gain ``constraint`` (two gyroscopes, Σ1 with the constraint), or ``platform-gyro``.
        rule: None for :class:`.PitchRateRule`.

    Raises:
        ValueError: a filter without such a gain.
    """
    gain = "constraint" if "constraint" in filter.gains else "measurement"
    return ruled(filter, gain, rule or PitchRateRule())
