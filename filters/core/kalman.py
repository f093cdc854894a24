"""A model's equations made an estimator: the extended (error-state) Kalman filter in Joseph form.

The recursion, which handles missing samples and the start, is in :mod:`.recursion`.
"""

from __future__ import annotations

from dataclasses import dataclass

from .model import Gain, Model
from .recursion import Recursion, correct
from .sampling import FilterState, Gains, scaled


@dataclass(frozen=True)
class KalmanFilter(Recursion):
    """A model's equations made an estimator.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data.
        keep_covariance: give the covariance with every estimate of a sequence (off saves memory in long runs).
    """

    model: Model
    compiled: bool = True
    keep_covariance: bool = True

    @property
    def _keeps_covariance(self) -> bool:
        return self.keep_covariance


__all__ = ["FilterState", "Gain", "Gains", "KalmanFilter", "Model", "correct", "scaled"]
