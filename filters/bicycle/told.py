"""Filters of a ride meet the ride: they are told who rides, and the truth is turned into what they give.

A filter's equations have a class method ``for_rider`` that takes the geometry, and each paper a function
``true_angles`` that turns the truth of a ride into the paper's own quantities.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.quantity import Quantity
from .geometry import RiderGeometry

TRUE_ANGLES = {
    "two-gyro": ".two_gyro.truth",
    "force-inertial": ".force_inertial.axes",
}
"""First word of a quantity's name → module whose ``true_angles`` makes it from the truth of a ride."""


def told(kalman: KalmanFilter, geometry: RiderGeometry) -> KalmanFilter:
    """The same filter, told who rides; what differs from its defaults stays as it is, other filters stay whole."""
    model = kalman.model
    for_rider = getattr(model, "for_rider", None)
    if for_rider is None:
        return kalman
    chosen = {
        item.name: getattr(model, item.name)
        for item in fields(model)
        if item.init and getattr(model, item.name) != item.default
    }
    return replace(kalman, model=for_rider(geometry, **chosen))


def true_quantities(
    outputs: Iterable[Quantity], equations: Any, truth: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """What is true of the papers' own quantities among the outputs of an estimator.

    Args:
        outputs: of the estimator.
        equations: its parameters go into a ``true_angles`` that takes arguments of these names.
        truth: of a ride.

    Returns:
        Quantity → ``(T, size)``; empty if it gives none, or the truth lacks what it takes.
    """
    found: dict[str, np.ndarray] = {}
    for paper in {quantity.name.split("/")[0] for quantity in outputs} & set(TRUE_ANGLES):
        true_angles = importlib.import_module(TRUE_ANGLES[paper], __package__).true_angles
        wanted = [name for name in inspect.signature(true_angles).parameters if hasattr(equations, name)]
        try:
            found |= true_angles(truth, **{name: getattr(equations, name) for name in wanted})
        except (KeyError, ValueError):
            continue  # a trajectory of something else
    return found
