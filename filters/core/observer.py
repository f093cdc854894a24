"""Estimator for equations without covariance: observers with fixed gains, integration, tilt."""

from __future__ import annotations

from dataclasses import dataclass

from .model import Recurrence
from .recursion import Recursion


@dataclass(frozen=True)
class Observer(Recursion):
    """Estimator for equations without covariance: the recursion of :class:`.KalmanFilter` without error state.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data.
        restart: start anew when the estimate contradicts the sensors for too long (:mod:`.monitor`).
    """

    model: Recurrence
    compiled: bool = True
    restart: bool = True
