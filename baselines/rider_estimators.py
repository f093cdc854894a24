"""Estimators that are told who rides: rider and bicycle in numbers, from the recording to the filter.

A recorded ride says in ``metadata["geometry"]`` who rode what; a filter of a ride has a class method ``for_rider`` that
takes it, and a function ``true_angles`` (of its class or module) that turns the truth of the ride into the filter's own
quantities. Both meet here.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..envs.trajectory import Trajectory
from ..filters.bicycle.geometry import RiderGeometry
from ..filters.catalogue import CATALOGUE
from ..filters.estimator import Estimator
from .zoo import make_estimator

TrueAngles = Callable[[Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]


def geometry_of(trajectory: Trajectory) -> RiderGeometry | None:
    """The rider and bicycle of a recorded ride; None if it is no ride or does not say.

    Raises:
        ValueError: it says something that is no geometry.
    """
    described = trajectory.metadata.get("geometry")
    return None if described is None else RiderGeometry.read(described)


def told(trajectory: Trajectory, geometry: RiderGeometry) -> Trajectory:
    """The same ride, of which another geometry is told (a measured one instead of the exact one)."""
    return trajectory.replace(metadata={**trajectory.metadata, "geometry": geometry.describe()})


def make_for(name: str, trajectory: Trajectory, **parameters: Any) -> Estimator[Any]:
    """Make an estimator for a trajectory: at its sampling interval, and told who rides if it can be told.

    Args:
        name: see :func:`poise.list_estimators`.
        trajectory: what it shall run on. If it has no geometry, a filter of rides keeps its usual rider.
        parameters: further ones; they win over what the geometry says.

    Raises:
        ValueError, ImportError: see :func:`poise.make_estimator`.
    """
    given = {"dt": trajectory.dt, **parameters}
    geometry = geometry_of(trajectory)
    if geometry is None or name not in CATALOGUE:
        return make_estimator(name, **given)
    equations = CATALOGUE[name].load()
    for_rider = getattr(equations, "for_rider", None)
    if for_rider is None:
        return make_estimator(name, **given)
    own = {item.name for item in fields(equations) if item.init}
    fixed = CATALOGUE[name].fixed
    rider = for_rider(geometry, **{key: value for key, value in given.items() if key in own}, **fixed)
    return make_estimator(name, **{key: getattr(rider, key) for key in own - set(fixed)} | given)


def true_quantities(estimator: Estimator[Any], truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What the estimator's own ``true_angles`` makes of the truth of a ride.

    Returns:
        Quantity → ``(T, size)``; empty if the estimator has no such function, or the truth lacks what it needs.
    """
    function = true_angles_of(estimator)
    if function is None:
        return {}
    try:
        return dict(function(truth))
    except KeyError:
        return {}


def true_angles_of(estimator: Estimator[Any]) -> TrueAngles | None:
    """``true_angles`` of the class or of the module of an estimator's equations; None if there is none."""
    equations = type(equations_of(estimator))
    for owner in equations.__mro__:
        if "true_angles" in vars(owner):
            return equations.true_angles
        found = getattr(importlib.import_module(owner.__module__), "true_angles", None)
        if found is not None:
            return found
    return None


def equations_of(estimator: Any) -> Any:
    """The model inside a filter, an observer, or a filter with a policy; the estimator itself if it wraps nothing."""
    for wrapped in ("filter", "kalman", "model"):
        inner = getattr(estimator, wrapped, None)
        if inner is not None:
            return equations_of(inner)
    return estimator
