"""Extended (error-state) Kalman filter in Joseph form, with the equations of a model.

The recursion, with missing samples and initialisation, is in :mod:`.recursion`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..compile.run import compiled_equations
from .backend import is_torch
from .estimator import check_measurements
from .model import Model
from .quantity import Estimate
from .recursion import Recursion
from .sampling import Gains, check_gains


@dataclass(frozen=True)
class KalmanFilter(Recursion):
    """Extended Kalman filter with the equations of a model.

    Attributes:
        model: the equations and their parameters.
        compiled: use the traced and compiled form for NumPy data.
        restart: start anew when the estimate contradicts the sensors for too long (:mod:`.monitor`); off for the
            equations of a paper alone.
        keep_covariance: give the covariance with every estimate of a sequence (off saves memory in long runs).
    """

    model: Model
    compiled: bool = True
    restart: bool = True
    keep_covariance: bool = True

    @property
    def _keeps_covariance(self) -> bool:
        return self.keep_covariance

    def smooth(self, measurements: Mapping[str, Any], gains: Gains | None = None) -> Estimate:
        """Estimates of a sequence from all of its samples: fixed-interval (error-state RTS) smoothing.

        After H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
        Journal 3(8), 1965, on the error state. Exact for linear models, first-order for others. Missing samples are
        bridged from both sides; samples before the start keep NaN.

        Args:
            measurements: channel → ``(T, *batch, size)``; NaN where there is no sample.
            gains: log factors, constant or per time step.

        Returns:
            Pose and covariance of the smoother; innovations and NIS are those of the filter.

        Raises:
            ValueError: a channel is missing or has a wrong shape, a gain is unknown, or data are torch tensors.
            TypeError: the model cannot be compiled.
        """
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        check_gains(self.gains, gains, type(self.model).__name__)
        if any(is_torch(array) for array in arrays.values()):
            raise ValueError("smoothing takes NumPy arrays, got torch tensors")
        form = compiled_equations(self.model)
        if form is None:
            raise TypeError(f"{type(self.model).__name__} cannot be compiled, which smoothing needs")
        return form.smooth(self.model, arrays, gains, self.restart, self.keep_covariance)
