"""Smoothing of whole recordings with the interface of an estimator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NoReturn

from .backend import is_torch
from .estimator import Enclosing, Estimator
from .kalman import KalmanFilter
from .model import Model
from .quantity import Estimate, Measurement

SUFFIX = " (offline)"
"""Suffix of an estimator's name that selects its smoother."""


@dataclass(frozen=True)
class Offline(Enclosing):
    """The fixed-interval smoother of an estimator.

    Attributes:
        filter: an estimator with a method ``smooth``.

    Raises:
        ValueError: it has no such method.
    """

    filter: Estimator[Any]

    def __post_init__(self) -> None:
        if not callable(getattr(self.filter, "smooth", None)):
            kind = type(getattr(self.filter, "model", self.filter)).__name__
            raise ValueError(
                f"{kind} has no smoother: smoothing needs a Kalman filter of this package, such as bounded-motion or "
                "mekf, or vqf"
            )

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Smoothed estimates of a whole sequence, ``(T, *batch, size)`` in and out.

        Constants of the model are first estimated from the recording itself where possible (:meth:`.Model.fitted`).
        """
        smoother: Any = self.filter
        if isinstance(smoother, KalmanFilter) and not any(is_torch(array) for array in measurements.values()):
            causal = replace(smoother, keep_covariance=False, restart=False)

            def nis(model: Model, samples: Measurement) -> Any:
                return replace(causal, model=model).run(samples).nis

            smoother = replace(smoother, model=smoother.model.fitted(measurements, nis))
        estimate: Estimate = smoother.smooth(measurements)
        return estimate

    def init(self, measurement: Measurement) -> NoReturn:
        """Not available, since a smoother has no state between samples.

        Raises:
            TypeError: always.
        """
        raise TypeError("a smoother needs the whole recording: use run, not init and step")

    def step(self, state: Any, measurement: Measurement) -> NoReturn:
        """Not available, as :meth:`init`.

        Raises:
            TypeError: always.
        """
        self.init(measurement)
