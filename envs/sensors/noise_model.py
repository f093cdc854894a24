"""How large the errors of a real sensor are: :class:`NoiseModel`, for a channel of any width and unit."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Self


@dataclass(frozen=True)
class NoiseModel:
    """How large the errors of a channel are. ``u`` stands for the unit of the channel; standard deviations per axis.

    The defaults are an ideal sensor. Terms follow IEEE Std 952 (gyroscopes) and IEEE Std 1293 (accelerometers).

    Raises:
        ValueError: a negative or not finite number, or a probability above 1.
    """

    white_noise: float = 0.0
    """u/√Hz: Allan deviation of the white part at 1 s; a sample at ``rate`` has deviation white_noise·√rate"""
    bias_random_walk: float = 0.0
    """u/√s: growth of a random-walk bias (rate random walk)"""
    bias_instability: float = 0.0
    """u: stationary deviation of a first-order Gauss-Markov bias; its Allan deviation peaks at 0.62 of it"""
    bias_correlation_time: float = 200.0
    """s: correlation time of the Gauss-Markov bias"""
    turn_on_bias: float = 0.0
    """u: deviation of the bias from episode to episode"""
    scale_factor: float = 0.0
    """1: deviation of the relative scale error"""
    misalignment: float = 0.0
    """rad (1): deviation of each cross-axis sensitivity"""
    g_sensitivity: float = 0.0
    """u/(m/s²): deviation of each entry of the matrix by which specific force adds to the reading"""
    full_scale: float = math.inf
    """u: readings saturate at ± this"""
    resolution: float = 0.0
    """u: readings are rounded to multiples of this; 0 for none"""
    bandwidth: float = math.inf
    """Hz: -3 dB of a second-order Butterworth low-pass; without effect from half the sampling rate upwards"""
    dropout: float = 0.0
    """1: probability that a sample is lost by itself"""
    burst_rate: float = 0.0
    """1/s: how often a burst of lost samples begins"""
    burst_duration: float = 0.2
    """s: mean duration of a burst (exponential)"""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            unbounded = field.name in ("full_scale", "bandwidth")
            positive = unbounded or field.name in ("bias_correlation_time", "burst_duration")
            low_enough = value <= 1.0 if field.name == "dropout" else (unbounded or value < math.inf)
            if not ((value > 0.0 if positive else value >= 0.0) and low_enough):
                wanted = "in [0, 1]" if field.name == "dropout" else "positive" if positive else "not negative"
                raise ValueError(f"{field.name} must be {wanted}{'' if unbounded else ' and finite'}, got {value}")

    def scaled(self, grade: float) -> Self:
        """The same sensor with all its errors ``grade`` times as large: 0 is ideal, 1 leaves it as it is.

        The full scale stays: it belongs to the observation space.

        Raises:
            ValueError: ``grade`` is negative or not finite.
        """
        if not 0.0 <= grade < math.inf:
            raise ValueError(f"grade must lie in [0, inf), got {grade}")
        kept = ("full_scale", "bandwidth", "dropout", "bias_correlation_time", "burst_duration")
        larger = {field.name: grade * getattr(self, field.name) for field in fields(self) if field.name not in kept}
        # a perfect sensor is infinitely fast
        bandwidth = self.bandwidth / grade if grade > 0.0 else math.inf
        return replace(self, bandwidth=bandwidth, dropout=min(1.0, grade * self.dropout), **larger)

    def describe(self) -> dict[str, float | None]:
        """All fields for JSON; infinity becomes None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: None if value == math.inf else float(value) for name, value in values.items()}
