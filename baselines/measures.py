"""Measures of one run beyond its RMS error: largest error, settling, drift, ratio to a bound, consistency."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..envs.data.trajectory import Trajectory
from ..filters.core import rotation
from ..filters.core.consistency import nees
from ..filters.core.estimator import Estimator
from ..filters.core.frames import part_of
from ..filters.core.metrics import metrics_of
from ..filters.core.quantity import RELATIVE_ORIENTATION, UP, Estimate, Quantity
from .scoring import Row, innovation_consistency, with_derived_truth, with_up

WINDOW = 1.0
"""s: the RMS error of this long decides whether an estimate has settled."""
SETTLED = 3.0
"""An estimate has settled when its error stays below this multiple of its RMS over the last half."""
OF_ERROR = ("p95", "largest", "settling", "drift", "over bound")
"""Endings of the metric of a row: ``inclination largest``."""
MEASURES = (*OF_ERROR, "nees", "nees degrees", "nis lower", "nis upper", "coverage of 90 %")
"""All; those of consistency stand alone."""


def measures(
    estimator: Estimator[Any], estimate: Estimate, trajectory: Trajectory, bound: float | None = None
) -> list[Row]:
    """Rows of the measures of every quantity whose truth is known.

    ``p95`` and ``largest`` are of the absolute error over the mask, ``drift`` the slope of its least-squares line (a
    minute), ``settling`` the time in s from the first sample until the RMS of 1 s stays below three times the RMS of
    the last half. ``nees`` is the normalised estimation error squared a degree of freedom, mean over the mask: 1 if
    the covariance is consistent; it has ``nees degrees`` of freedom at each sample. A consistent filter has its ``nis``
    between ``nis lower`` and ``nis upper`` with 95 % probability. ``over bound`` is the RMS error of the inclination in
    multiples of the bound.

    Args:
        estimator: what ran.
        estimate: its output on the trajectory.
        trajectory: on its grid, with truth.
        bound: of the inclination error, deg (:func:`.inclination_bound`); None where there is none, and for
            smoothers.

    Returns:
        (quantity, metric, value, unit) each; a value is NaN where nothing could be scored.
    """
    pose, trajectory = with_up(estimate.pose), with_derived_truth(estimator, trajectory)
    rows: list[Row] = []
    for quantity in {one.name: one for one in (UP, *estimator.outputs)}.values():
        name = quantity.name
        if name not in pose or name not in trajectory.quantities:
            continue
        truth = trajectory.truth_of(name)
        if name != RELATIVE_ORIENTATION.name:  # its inclination is that of ``up``
            metric = metrics_of(quantity)[0]
            error = metric.scale * np.abs(np.asarray(metric.error(pose[name], truth)))
            found = of_error(error, trajectory.time, trajectory.mask)
            units = {"p95": metric.unit, "largest": metric.unit, "settling": "s", "drift": f"{metric.unit}/min"}
            rows += [(name, f"{metric.name} {each}", value, units[each]) for each, value in found.items()]
            if bound is not None and name == UP.name:
                inside = error[trajectory.mask & np.isfinite(error)]
                ratio = float(np.sqrt(np.mean(inside**2))) / bound if len(inside) else float("nan")
                rows.append((name, f"{metric.name} over bound", ratio, "1"))
        value = consistency_of(quantity, estimate, truth, trajectory.mask)
        if value is not None:
            rows += [(name, "nees", value[0], "1"), (name, "nees degrees", float(value[1]), "1")]
    innovations = innovation_consistency(estimate, trajectory.mask)
    if innovations is not None:
        rows += [("innovation", f"nis {each}", getattr(innovations, each), "1") for each in ("lower", "upper")]
    return rows


def of_error(error: np.ndarray, time: np.ndarray, mask: np.ndarray) -> dict[str, float]:
    """Measures of an absolute error ``(T,)`` over time."""
    known = np.isfinite(error)
    scored = known & mask
    if not scored.any():
        return dict.fromkeys(("p95", "largest", "settling", "drift"), float("nan"))
    inside = error[scored]
    minutes = (time[scored] - time[scored][0]) / 60.0
    drift = float(np.polyfit(minutes, inside, 1)[0]) if len(inside) > 2 and minutes[-1] > 0.0 else float("nan")
    return {
        "p95": float(np.quantile(inside, 0.95)),
        "largest": float(inside.max()),
        "settling": settling(error[known], time[known] - time[0]),
        "drift": drift,
    }


def settling(error: np.ndarray, time: np.ndarray) -> float:
    """Time in s after which the RMS of a window stays near that of the last half; NaN if it never does."""
    if len(error) < 4:
        return float("nan")
    samples = max(1, int(np.searchsorted(time - time[0], WINDOW)))
    total = np.concatenate([[0.0], np.cumsum(error**2)])
    running = np.sqrt((total[samples:] - total[:-samples]) / samples)
    level = SETTLED * np.sqrt(np.mean(error[len(error) // 2 :] ** 2))
    late = np.flatnonzero(running > level)
    if not len(late):
        return float(time[0])
    return float(time[late[-1] + 1]) if late[-1] + 1 < len(running) // 2 else float("nan")


def consistency_of(
    quantity: Quantity, estimate: Estimate, truth: np.ndarray, mask: np.ndarray
) -> tuple[float, int] | None:
    """Mean NEES a degree of freedom of one quantity, and the degrees of freedom; None without a covariance of it."""
    part = part_of(estimate.layout.error_parts if estimate.layout else {}, quantity.name)
    if estimate.covariance is None or part is None:
        return None
    value = np.asarray(estimate.pose[quantity.name])
    error, axes = error_vector(quantity, value, truth)
    start, stop = part
    covariance = axes @ np.asarray(estimate.covariance)[..., start:stop, start:stop] @ np.swapaxes(axes, -1, -2)
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    scored = (
        mask & np.isfinite(error).all(axis=-1) & np.isfinite(covariance).all(axis=(-2, -1)) & (variance > 0).all(-1)
    )
    if not scored.any():
        return None
    degrees = error.shape[-1]
    return float(np.mean(nees(error[scored], covariance[scored]))) / degrees, degrees


def error_vector(quantity: Quantity, estimate: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Error ``(T, n)`` and the axes ``(…, n, e)`` that take the quantity's part of the error state to it.

    Of a rotation it is the rotation vector of ``estimate ⊗ truth⁻¹`` in world axes; of a relative orientation, whose
    heading is free, the two horizontal components of what is left without the turn about the vertical; of a direction
    the two components across it.
    """
    everything = np.eye(quantity.size)
    if quantity.kind == "angle":
        return np.asarray(rotation.wrap(estimate - truth)), everything
    if quantity.kind == "vector":
        return estimate - truth, everything
    if quantity.kind == "direction":
        across = np.asarray(rotation.to_matrix(rotation.level(estimate)))[..., :2, :]
        return (across @ (estimate - truth)[..., None])[..., 0], across
    difference = np.asarray(rotation.multiply(estimate, rotation.conjugate(truth)))
    if quantity.name != RELATIVE_ORIENTATION.name:
        return np.asarray(rotation.log(difference)), np.eye(3)
    upright = np.asarray(rotation.normalize(difference * np.array([1.0, 0.0, 0.0, 1.0])))
    tilt = np.asarray(rotation.log(rotation.multiply(difference, rotation.conjugate(upright))))
    return tilt[..., :2], np.eye(3)[:2]
