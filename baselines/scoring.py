"""Errors of one run: against the truth, or against another estimator where no truth is known."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..envs.data.trajectory import Trajectory
from ..filters.core import rotation
from ..filters.core.consistency import Consistency, consistency
from ..filters.core.estimator import Estimator
from ..filters.core.metrics import score
from ..filters.core.model import equations_of
from ..filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, UP, Estimate, Quantity
from .run import fitted, run_on

ONBOARD = "onboard"
"""Reference: the orientation that the device itself computed."""
AUTOMATIC = ("mekf-9", "bounded-motion")
"""References for recordings without truth, in order of preference."""

LARGEST_NORTH = 15.0
"""deg: larger constant heading offsets indicate another definition of north rather than an error."""

StandIn = tuple[str, dict[str, np.ndarray]]
"""Label and pose of the replacement of the truth."""
Row = tuple[str, str, float, str]
"""Quantity, metric, value, unit."""


def has_truth(trajectory: Trajectory) -> bool:
    """Whether the truth contains the inclination."""
    return UP.name in trajectory.quantities


def without_truth(trajectory: Trajectory) -> bool:
    """Whether the trajectory has no truth of the pose."""
    return not set(trajectory.truth) - {"position", "velocity"}


def automatic_reference(trajectory: Trajectory) -> str | None:
    """Default reference for a recording: with heading if its magnetometer works, else six axes."""
    from .registry import list_estimators

    alive = {
        name
        for name, values in trajectory.measurements.items()
        if np.isfinite(values).any() and np.nanmax(np.abs(values)) > 0.0
    }
    known = list_estimators()
    return next((name for name in AUTOMATIC if set(known[name].channels) <= alive), None)


def onboard_orientation(trajectory: Trajectory) -> np.ndarray:
    """The orientation ``(T, 4)`` that the device itself computed.

    Raises:
        ValueError: the recording has none.
    """
    names = [name for name in trajectory.measurements if name.endswith("onboard_orientation")]
    if not names:
        raise ValueError(f"{trajectory.name!r} holds no orientation of the device's own (…/onboard_orientation)")
    return trajectory.measurements["imu/onboard_orientation" if "imu/onboard_orientation" in names else names[0]]


def reference_pose(reference: str | Estimator[Any], label: str, trajectory: Trajectory) -> StandIn:
    """Replacement of the truth of a trajectory on its grid.

    Raises:
        ValueError: the trajectory lacks a channel that the reference needs.
    """
    if reference == ONBOARD:
        orientation = onboard_orientation(trajectory)
        return ONBOARD, {"orientation": orientation, "up": rotation.up_in_body(orientation)}
    estimator = fitted(reference, trajectory)
    lacking = [channel.name for channel in estimator.channels if channel.name not in trajectory.measurements]
    if lacking:
        raise ValueError(f"the reference {label!r} needs {', '.join(lacking)}, which {trajectory.name!r} lacks")
    return label, with_up(run_on(estimator, trajectory).pose)


def with_up(pose: Mapping[str, Any]) -> dict[str, Any]:
    """The pose with ``up``, which every orientation contains."""
    for name in (ORIENTATION.name, RELATIVE_ORIENTATION.name):
        if UP.name not in pose and name in pose:
            return {**pose, UP.name: rotation.up_in_body(pose[name])}
    return dict(pose)


def with_derived_truth(estimator: Estimator[Any], trajectory: Trajectory) -> Trajectory:
    """The trajectory with the truth of what the estimator's equations derive from it (segments relative to others)."""
    equations = equations_of(estimator)
    derived = dict(equations.truth(trajectory.truth)) if callable(getattr(equations, "truth", None)) else {}
    return trajectory.replace(truth={**derived, **trajectory.truth}) if derived else trajectory


def errors(estimator: Estimator[Any], estimate: Estimate, trajectory: Trajectory, others: list[StandIn]) -> list[Row]:
    """Rows of one run: errors against the truth, distances to others where it is unknown, shares, consistency."""
    pose, trajectory = with_up(estimate.pose), with_derived_truth(estimator, trajectory)
    outputs = {quantity.name: quantity for quantity in (UP, *estimator.outputs)}
    rows: list[Row] = []
    for name, quantity in outputs.items():
        # The inclination of an orientation is scored once, as that of its inclination vector.
        if name not in pose or name == RELATIVE_ORIENTATION.name:
            continue
        if name in trajectory.quantities:
            rows += scored_rows(quantity, pose[name], trajectory.truth_of(name), trajectory.mask)
        elif quantity.kind in ("direction", "rotation"):
            compared = [(label, other[name]) for label, other in others if name in other]
            for label, other in compared:
                rows += scored_rows(quantity, pose[name], other, trajectory.mask, f" to {label}")
            if compared and quantity.kind == "direction":
                rows += [
                    row for row in scored_rows(quantity, pose[name], pose[name], trajectory.mask) if row[1] == "valid"
                ]
    innovations = innovation_consistency(estimate, trajectory.mask)
    if innovations is not None:
        rows.append(("innovation", "nis", innovations.ratio, "1"))
    return rows


def innovation_consistency(estimate: Estimate, mask: np.ndarray) -> Consistency | None:
    """Mean NIS a degree of freedom with its bounds; None of an estimate without innovations."""
    if estimate.nis is None or estimate.innovation is None:
        return None
    return consistency(estimate.nis, (np.asarray(estimate.innovation) != 0.0).sum(axis=-1), mask)


def heading_offset(estimate: Estimate, trajectory: Trajectory) -> float | None:
    """Constant heading in deg between an estimate and a truth that otherwise agree; None if they differ in more.

    A reference with an arbitrary x axis (a laboratory's) gives such an offset, which is not an error of the estimate.
    """
    if ORIENTATION.name not in trajectory.truth or ORIENTATION.name not in estimate.pose:
        return None
    r = rotation.multiply(estimate.pose[ORIENTATION.name], rotation.conjugate(trajectory.truth[ORIENTATION.name]))
    half = np.arctan2(r[:, 3], r[:, 0])[trajectory.mask]
    mean = np.nanmean(np.exp(2j * half)) if np.isfinite(half).any() else 0.0
    offset = float(np.degrees(np.angle(mean)))
    # The length of the mean is 1 if all headings differ equally: 0.95 is a standard deviation of 18°.
    return offset if abs(mean) > 0.95 and abs(offset) > LARGEST_NORTH else None


def scored_rows(quantity: Quantity, estimate: Any, truth: Any, mask: np.ndarray, suffix: str = "") -> list[Row]:
    """Metrics of one quantity; a share of samples only of a truth."""
    return [
        (quantity.name, metric + suffix, value, unit)
        for metric, (value, unit) in score(quantity, estimate, truth, mask).items()
        if (metric != "valid" or not suffix) and (quantity.kind != "rotation" or metric not in ("inclination", "valid"))
    ]


def family(label: str) -> str:
    """Family of estimators with the same equations: the name without axes, policy or variant."""
    return re.sub(r"-9\b|\+policy$", "", label.split(" (")[0])
