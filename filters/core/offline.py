"""Smoothing of whole recordings with the interface of an estimator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from .estimator import Enclosing, Estimator
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
        """Smoothed estimates of a whole sequence, ``(T, *batch, size)`` in and out."""
        return self.filter.smooth(measurements)  # type: ignore[attr-defined]

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
