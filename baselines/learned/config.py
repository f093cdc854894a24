"""Settings of a training."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class FitConfig:
    """How a network is trained.

    Raises:
        ValueError: a number is out of its range.
    """

    epochs: int = 4
    """passes over the sequences"""
    batch: int = 32
    """sequences in a batch"""
    window: int = 250
    """updates through which gradients flow; memory is carried on from window to window"""
    learning_rate: float = 2e-3
    """highest rate, after the warm-up; it falls to zero along a cosine"""
    warmup: float = 0.1
    """share of the updates in which the rate rises"""
    weight_decay: float = 1e-2
    """of AdamW"""
    clip: float = 1.0
    """largest norm of a gradient"""
    seed: int = 0
    """of order, headings and noise"""

    def __post_init__(self) -> None:
        for name in ("epochs", "batch", "window"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        for name in ("learning_rate", "clip"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.warmup < 1.0:
            raise ValueError(f"warmup must lie in [0, 1), got {self.warmup}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")
