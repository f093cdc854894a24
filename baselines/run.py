"""``poise.run`` and ``poise.smooth``: an estimator on a recording, at the time stamps of the recording."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np

from ..envs.data.glitches import without_glitches
from ..envs.data.plausibility.recording import check_recording
from ..envs.data.trajectory import TRUSTED, Trajectory, trusted
from ..filters.core.backend import to_numpy
from ..filters.core.estimator import Estimator, without_impossible
from ..filters.core.estimator import run as run_sequence
from ..filters.core.model import equations_of
from ..filters.core.offline import SUFFIX, Offline
from ..filters.core.quantity import Estimate, Layout
from .registry import make_estimator

SAME_INTERVAL = 1e-3
"""Relative difference up to which two sampling intervals are the same."""


def run(
    estimator: str | Estimator[Any],
    data: Trajectory | Mapping[str, Any],
    dt: float | None = None,
    *,
    grid: bool = False,
    check: bool = True,
) -> Estimate:
    """Run an estimator over a recording.

    With a trajectory, the estimator runs on the uniform grid behind the time stamps. Gaps are missing samples, for
    which it only predicts, and so are glitches (:mod:`poise.envs.data.glitches`); an estimator with another sampling
    interval is adjusted. Arrays have no time stamps, so their interval must be given; arrays of one recording are read
    without glitches, too.

    Args:
        estimator: a name (see :func:`poise.list_estimators`), or an estimator. One given by name is configured for
            the trajectory (rider, bicycle, array) where its metadata describe these.
        data: a trajectory, or channel name → ``(T, *batch, size)``, NaN where a channel has no valid sample.
        dt: sampling interval, s; needed with arrays. With a trajectory it may only confirm the trajectory's.
        grid: return the estimate on the uniform grid, gaps included, instead of at the trajectory's samples.
        check: warn of implausible units, signs, axes and clocks (:func:`poise.check_recording`), once for each
            trajectory; those that were simulated in this process need no check.

    Returns:
        The estimate, time first, with ``time``: as many samples as the trajectory has, or as its grid.

    Warns:
        UserWarning: findings of ``check``; there is no estimate at all, as a channel has no valid sample; or see
            :func:`run_on`.

    Raises:
        ValueError: no ``dt`` with arrays; a ``dt`` that contradicts trajectory or estimator; an unknown name; missing
            channels; a clock without uniform sampling (:meth:`Trajectory.on_grid`).
    """
    interval = checked_interval(dt)
    for name, value in {"grid": grid, "check": check}.items():
        if not isinstance(value, bool):
            raise ValueError(f"{name} must be True or False, got {value!r}")
    if not isinstance(estimator, str | Estimator):
        raise ValueError(f"estimator must be a name (poise.list_estimators) or an estimator, got {estimator!r}")
    if not isinstance(data, Trajectory):
        made = for_arrays(estimator, data, interval)
        assert interval is not None
        estimate = warned_of(run_sequence(made, as_recorded(data, interval)), made, data)
        length = len(next(iter(estimate.pose.values())))
        return estimate._replace(time=interval * np.arange(length), layout=layout_of(made))
    on_grid = data.on_grid()
    if interval is not None and not same_interval(interval, on_grid.dt):
        raise ValueError(f"dt={interval:.6g} s contradicts {data.name!r}, which has {on_grid.dt:.6g} s; leave it out")
    made = fitted(estimator, on_grid)
    if check and data not in TRUSTED:
        report_findings(data)
    estimate = warned_of(run_on(made, on_grid), made, on_grid.measurements, f"{data.name}: ")
    return estimate if grid or on_grid is data else at_samples(estimate, data, on_grid)


def smooth(
    estimator: str | Estimator[Any],
    data: Trajectory | Mapping[str, Any],
    dt: float | None = None,
    *,
    grid: bool = False,
    check: bool = True,
) -> Estimate:
    """Fixed-interval smoothing of a recording: every estimate uses all samples (offline use).

    Every Kalman filter of the package has a smoother (:meth:`.KalmanFilter.smooth`), with covariance; ``vqf`` has the
    offline form of its own package.

    Args:
        estimator: as for :func:`run`.
        data: as for :func:`run`.
        dt: as for :func:`run`.
        grid: as for :func:`run`.
        check: as for :func:`run`.

    Returns:
        As :func:`run`; innovations and NIS are those of the filter.

    Raises:
        ValueError: as :func:`run`; or the estimator has no smoother.
    """
    if isinstance(estimator, str):
        return run(estimator.removesuffix(SUFFIX) + SUFFIX, data, dt, grid=grid, check=check)
    return run(estimator if isinstance(estimator, Offline) else Offline(estimator), data, dt, grid=grid, check=check)


def report_findings(trajectory: Trajectory) -> None:
    """Warn whoever called the caller of all findings that make estimates wrong."""
    for finding in check_recording(trusted(trajectory)):
        if finding.severity == "warning":
            warnings.warn(f"{trajectory.name}: {finding}", stacklevel=3)


def checked_interval(dt: Any) -> float | None:
    """A sampling interval as a float.

    Raises:
        ValueError: it is not a positive, finite number.
    """
    if dt is None:
        return None
    if isinstance(dt, bool | np.bool_) or not isinstance(dt, Real) or not 0.0 < float(dt) < math.inf:
        raise ValueError(f"dt must be a positive number of seconds, got {dt!r}")
    return float(dt)


def same_interval(one: float, other: float) -> bool:
    """Whether two sampling intervals agree."""
    return abs(one - other) <= SAME_INTERVAL * other


def fitted(estimator: str | Estimator[Any], trajectory: Trajectory) -> Estimator[Any]:
    """An estimator at the trajectory's sampling interval; one given by name is configured for it."""
    if isinstance(estimator, str):
        return make_estimator(estimator, dt=trajectory.dt, metadata=trajectory.metadata)
    return estimator if abs(estimator.dt - trajectory.dt) <= 1e-6 * trajectory.dt else estimator.with_dt(trajectory.dt)


def for_arrays(estimator: str | Estimator[Any], data: Any, interval: float | None) -> Estimator[Any]:
    """An estimator for arrays, whose sampling interval is that of the call.

    Raises:
        ValueError: see :func:`run`.
    """
    if not isinstance(data, Mapping):
        raise ValueError(f"data must be a Trajectory or a mapping from channel to array, got {type(data).__name__}")
    if interval is None:
        raise ValueError(
            "arrays have no time: pass dt, the sampling interval in s, as poise.run(estimator, arrays, dt=0.01), "
            "or a poise.Trajectory"
        )
    if isinstance(estimator, str):
        return make_estimator(estimator, dt=interval)
    if not same_interval(interval, estimator.dt):
        raise ValueError(
            f"dt={interval:.6g} s contradicts the estimator, which was made for {estimator.dt:.6g} s; "
            f"use estimator.with_dt({interval:.6g})"
        )
    return estimator


def as_recorded(data: Mapping[str, Any], interval: float) -> Mapping[str, Any]:
    """Arrays of one recording as a trajectory of them would be read, without glitches; others and batches as they are.

    A trajectory refuses infinite numbers, which the estimators take for missing samples.
    """
    arrays = [values for values in data.values() if isinstance(values, np.ndarray) and values.ndim == 2]
    lengths = {len(values) for values in arrays}
    if len(arrays) < len(data) or len(lengths) != 1 or min(lengths) < 2:
        return data
    if any(values.dtype.kind != "f" or np.isinf(values).any() for values in arrays):
        return data
    return without_glitches(Trajectory(interval * np.arange(lengths.pop()), dict(data)))


def run_on(estimator: Estimator[Any], trajectory: Trajectory) -> Estimate:
    """Run an estimator over a trajectory that is on its grid already, without glitches."""
    estimate = run_sequence(estimator, without_glitches(trajectory))
    return estimate._replace(time=trajectory.time, layout=layout_of(estimator))


def warned_of(
    estimate: Estimate, estimator: Estimator[Any], measurements: Mapping[str, Any], name: str = ""
) -> Estimate:
    """The estimate; with a warning, to whoever called :func:`run`, if no sample has one."""
    reason = without_estimate(estimator, measurements, estimate)
    if reason:
        warnings.warn(f"{name}{reason}", stacklevel=3)
    return estimate


def without_estimate(estimator: Estimator[Any], measurements: Mapping[str, Any], estimate: Estimate) -> str:
    """Why no sample of a recording has an estimate; empty if one has."""
    if any(bool(np.isfinite(to_numpy(values)).any()) for values in estimate.pose.values()):
        return ""
    read = {
        channel: without_impossible(channel, np.asarray(measurements[channel.name])) for channel in estimator.channels
    }
    empty = [channel.name for channel, values in read.items() if not np.isfinite(values).all(axis=-1).any()]
    cause = f"{', '.join(empty)} without a valid sample" if empty else "too few samples in which all channels are valid"
    return f"no estimate at all: {cause}"


def layout_of(estimator: Estimator[Any]) -> Layout:
    """Layout of the arrays of its estimates."""
    return Layout(tuple(estimator.outputs), dict(getattr(equations_of(estimator), "error_parts", {})))


def at_samples(estimate: Estimate, trajectory: Trajectory, on_grid: Trajectory) -> Estimate:
    """The part of an estimate on the grid that belongs to the trajectory's own samples."""
    index = trajectory.clock.index
    if len(index) != len(trajectory) or index[-1] >= len(on_grid):
        # rows that repeat their predecessor are not on the grid twice
        index = np.rint((trajectory.time - on_grid.time[0]) / on_grid.dt).astype(int).clip(0, len(on_grid) - 1)
    parts = (estimate.covariance, estimate.innovation, estimate.nis)
    covariance, innovation, nis = (None if part is None else part[index] for part in parts)
    pose = {name: values[index] for name, values in estimate.pose.items()}
    return Estimate(pose, covariance, innovation, nis, trajectory.time, estimate.layout)
