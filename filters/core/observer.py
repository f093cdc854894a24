"""Equations without a covariance made an estimator: observers with fixed gains, integration, plain tilt."""

from __future__ import annotations

from dataclasses import dataclass

from .model import Recurrence
from .recursion import Recursion


@dataclass(frozen=True)
class Observer(Recursion):
    """Equations without covariance made an estimator: the recursion of :class:`.KalmanFilter` with no error state.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data.
    """

    model: Recurrence
    compiled: bool = True
