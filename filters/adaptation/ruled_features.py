"""Observation of a policy that corrects a rule by hand: every number by its name, and the action of the rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.quantity import Estimate
from ..support.names import look_up
from .gains import GainRange
from .named_features import NamedFeatures
from .rules import RULES, Rule, TurningRule
from .time_scales import FeatureMemory


@dataclass(frozen=True)
class RuledFeatures(NamedFeatures):
    """Those of :class:`.NamedFeatures`, and last what a rule makes of its own averages.

    Attributes:
        rule: with the range of the gain that it sets.
    """

    rule: Rule = field(default_factory=TurningRule)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every feature, in order; the actions of the last interval follow them."""
        return (*super().names, "rule")

    def init(self, kalman: KalmanFilter, batch: tuple[int, ...] = ()) -> FeatureMemory:
        """Empty memory: moments of the numbers, then those of the rule."""
        own, rule = super().init(kalman, batch), self.rule.init(kalman, batch)
        moments = own.sums.shape[-1] + rule.sums.shape[-1]
        return self.empty(batch, moments)._replace(previous=rule.previous)

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Moments ``(T, *batch, moments)`` of the samples, and what the rule keeps of the last one."""
        own, _ = super().moments(memory, kalman, measurements, estimate)
        rule, previous = self.rule.moments(memory, kalman, measurements, estimate)
        return np.concatenate([own, rule], axis=-1), previous

    def averaged(self, averages: np.ndarray, means: np.ndarray, duration: float) -> np.ndarray:
        """Averages after an interval; those of the rule have a time constant of its own, the same in every scale."""
        count = 3 * len(self.numbers)
        own = super().averaged(averages[..., :count], means[..., :count], duration)
        rule = self.rule.averaged(averages[..., :1, count:], means[..., count:], duration)
        return np.concatenate([own, np.broadcast_to(rule, (*own.shape[:-1], rule.shape[-1]))], axis=-1)

    def observe(self, memory: FeatureMemory, kalman: KalmanFilter, action: np.ndarray) -> np.ndarray:
        """Features and the action of the last interval: float32 ``(*batch, size)`` in [−1, 1]."""
        own, rule = np.split(memory.averages, [3 * len(self.numbers)], axis=-1)
        seen = super().observe(memory._replace(averages=own), kalman, action)
        ruled = self.rule.observe(memory._replace(averages=rule[..., :1, :]), kalman, action)
        features, last = np.split(seen, [seen.shape[-1] - action.shape[-1]], axis=-1)
        return np.concatenate([features, ruled[..., :1], last], axis=-1)


def ruled_features(kalman: KalmanFilter, rule: str, interval: float, ranges: Sequence[GainRange]) -> RuledFeatures:
    """Features for a filter whose first gain the rule of that name sets.

    Raises:
        ValueError: an unknown rule.
    """
    named = NamedFeatures.of(kalman, interval)
    return RuledFeatures(named.interval, named.scales, named.rows, named.channels, in_range(rule, ranges[0]))


def in_range(rule: str, part: GainRange) -> Rule:
    """The rule of that name, whose actions 1 and −1 are the ends of the range of a gain.

    Raises:
        ValueError: an unknown rule.
    """
    return replace(look_up("rule", rule, RULES), largest=part.upper, reach=max(-part.lower, 1e-9))
