"""How each network that sets the gains of a filter is trained."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ....envs.recipes.recipe import Recipe
from ....envs.recipes.registry import hand_recipe
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import DEG
from ....filters.registry import make
from ..config import FitConfig
from ..inputs.gain_features import GainFeatures
from ..presets import PRESETS, RIDES, Preset
from .gain_head import GainHead
from .gain_shares import with_gain_shares

GYROSCOPE_BIAS = (0.03 * DEG, 6.0 * DEG)
ACCELEROMETER_BIAS = (0.01, 0.3)
"""rad/s and m/s²: devices as in the hand recipes, also such that were never calibrated"""
PACKET_LOSS, BURST, SILENT = 0.3, (0.05, 2.0), 0.2
"""Shares of devices that lose packets and whose accelerometer pauses, and mean length of the former, s: a network meets
gaps and what comes after them."""
DURATION = 60.0
"""s of an episode"""


@dataclass(frozen=True)
class GainPreset(Preset):
    """The training of a network that sets the gains of a filter; ``filter`` is that filter.

    Raises:
        ValueError: no filter, or no gains.
    """

    limits: Mapping[str, float] = field(default_factory=dict)
    """gain → largest factor on the constant that it scales, either way"""
    observed: str | None = None
    """filter whose innovations the network sees; None: the same"""
    shares: bool = False
    """whether shares of the Kalman gain are among the gains"""
    likelihood: float = 0.01
    """weight of the likelihood of the errors"""
    small_error: float = 0.5 * DEG
    """rad: errors below it count little"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.filter is None or not self.limits:
            raise ValueError("a network that sets gains needs a filter and limits of its gains")
        if not all(1.0 < limit < math.inf for limit in self.limits.values()):
            raise ValueError(f"limits must be factors above 1, got {dict(self.limits)}")

    def kalman(self) -> KalmanFilter:
        """The filter in its published tuning."""
        made: Any = (with_gain_shares if self.shares else make)(str(self.filter), **self.parameters)
        return made

    def front_end(self) -> Any:
        """What the network sees."""
        observed: Any = None if self.observed is None else make(self.observed)
        return GainFeatures(self.kalman(), observed)

    def head(self) -> Any:
        """What it says."""
        kalman = self.kalman()
        limits = [math.log(limit) / kalman.gains[name].power for name, limit in self.limits.items()]
        return GainHead(kalman, tuple(self.limits), tuple(limits), self.likelihood, self.small_error)

    def recipe(self, name: str) -> Recipe:
        """Episodes of a minute with devices that may be uncalibrated, and gaps."""
        made = hand_recipe(name)
        timing = replace(made.sensors.timing, packet_loss_share=PACKET_LOSS, burst_duration=BURST)
        sensors = replace(
            made.sensors,
            gyroscope_bias=GYROSCOPE_BIAS,
            accelerometer_bias=ACCELEROMETER_BIAS,
            silent_share=SILENT,
            timing=timing,
        )
        return replace(made, duration=DURATION, sensors=sensors)

    def quick(self) -> Preset:
        """A small version that learns visibly within minutes."""
        sources = {name: min(count, 8) for name, count in self.sources.items()}
        rides = None if self.rides is None else replace(self.rides, rides=4, draws=2)
        fit = replace(self.fit, epochs=3)
        return replace(self, sources=sources, rides=rides, units=min(self.units, 16), fit=fit)

    def describe(self) -> dict[str, Any]:
        """All settings, for a card."""
        return {**super().describe(), "limits": dict(self.limits)}


HANDS = {"hand-held-prompt": 96, "carried-prompt": 48}
FIT = FitConfig(epochs=5, batch=4, window=10**6, learning_rate=6e-3)
"""A whole sequence is one window: the filter runs over it from its start."""
NOISE, SHARE = 30.0, 10.0
"""Largest factors on a standard deviation, and on a share of the Kalman gain."""
GAIN_PRESETS: dict[str, Preset] = {
    "external-acceleration+noise": GainPreset(
        "external-acceleration, its process and measurement noise set by a recurrent network",
        {"hand-held-prompt": 64, "carried-prompt": 24, "carried-running": 8},
        filter="external-acceleration",
        observed="mekf",
        units=32,
        limits={"process": NOISE, "measurement": 1000.0, "c_a": NOISE},
        scale=2.0,
        noise=0.05,
        fit=replace(FIT, epochs=8),
        small_error=0.2 * DEG,
    ),
    "mekf+noise": GainPreset(
        "mekf, its process, bias and measurement noise set by a recurrent network",
        HANDS,
        filter="mekf",
        units=32,
        limits={"process": NOISE, "bias": NOISE, "measurement": NOISE},
        scale=2.0,
        noise=0.05,
        fit=FIT,
    ),
    "mekf+gain": GainPreset(
        "mekf, its Kalman gain corrected and its noises set by a recurrent network",
        {"hand-held-prompt": 72, "carried-prompt": 36, "gestures-varying": 36},
        filter="mekf",
        shares=True,
        units=32,
        limits={"process": NOISE, "bias": NOISE, "measurement": NOISE, "attitude-gain": SHARE, "bias-gain": SHARE},
        scale=2.0,
        noise=0.05,
        fit=replace(FIT, epochs=6),
        small_error=0.2 * DEG,
    ),
    "two-gyro-level+noise": GainPreset(
        "two-gyro-level, its noises and how far level ground is believed set by a recurrent network",
        rides=replace(RIDES, rides=20, draws=4, sloped_share=0.6),
        filter="two-gyro-level",
        units=32,
        limits={"process": NOISE, "measurement": NOISE, "constraint": 100.0},
        noise=0.1,
        fit=replace(FIT, epochs=6),
    ),
}
"""Name of the weights → training."""


def all_presets() -> dict[str, Preset]:
    """Name of the weights → training, of every network of the package."""
    return {**PRESETS, **GAIN_PRESETS}
