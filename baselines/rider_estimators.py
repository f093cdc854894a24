"""Estimators that are told who rides: rider and bicycle in numbers, from the recording to the filter.

A recorded ride says in ``metadata["geometry"]`` who rode what; a filter of a ride has a class method ``for_rider`` that
takes it, and each paper a function ``true_angles`` that turns the truth of a ride into the paper's own quantities. All
meet here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..envs.data.trajectory import Trajectory
from ..filters.bicycle.geometry import RiderGeometry
from ..filters.bicycle.told import true_quantities as true_outputs
from ..filters.core.estimator import Estimator
from ..filters.registry import CATALOGUE
from .array_estimators import array_parameters
from .registry import make_estimator


def geometry_of(trajectory: Trajectory) -> RiderGeometry | None:
    """The rider and bicycle of a recorded ride; None if it is no ride or does not say.

    Raises:
        ValueError: it says something that is no geometry.
    """
    described = trajectory.metadata.get("geometry")
    return None if described is None else RiderGeometry.read(described)


def geometry_or_usual(trajectory: Trajectory) -> RiderGeometry:
    """As :func:`geometry_of`; the usual rider where the recording does not say."""
    return geometry_of(trajectory) or RiderGeometry()


def told(trajectory: Trajectory, geometry: RiderGeometry) -> Trajectory:
    """The same ride, of which another geometry is told (a measured one instead of the exact one)."""
    return trajectory.replace(metadata={**trajectory.metadata, "geometry": geometry.describe()})


def make_for(name: str, trajectory: Trajectory, **parameters: Any) -> Estimator[Any]:
    """Make an estimator for a trajectory: at its sampling interval, told who rides or which array it is, if it can be.

    Args:
        name: see :func:`poise.list_estimators`.
        trajectory: what it shall run on. If it has no geometry, a filter of rides keeps its usual rider.
        parameters: further ones; they win over what the geometry says.

    Raises:
        ValueError, ImportError: see :func:`poise.make_estimator`.
    """
    given = {"dt": trajectory.dt, **parameters}
    if name not in CATALOGUE:
        return make_estimator(name, **given)
    given = array_parameters(CATALOGUE[name], trajectory) | given
    geometry = geometry_of(trajectory)
    if geometry is None:
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
    """What is true of the paper's own quantities that an estimator gives.

    Args:
        estimator: parameters of its equations go into a ``true_angles`` that takes arguments of these names.
        truth: of a ride.

    Returns:
        Quantity → ``(T, size)``; empty if it gives none, or the truth lacks what it takes.
    """
    return true_outputs(estimator.outputs, equations_of(estimator), truth)


def equations_of(estimator: Any) -> Any:
    """The model inside a filter, an observer, or a filter with a policy; the estimator itself if it wraps nothing."""
    for wrapped in ("filter", "kalman", "model"):
        inner = getattr(estimator, wrapped, None)
        # a filter's own parameter may have one of these names
        if hasattr(inner, "channels"):
            return equations_of(inner)
    return estimator
