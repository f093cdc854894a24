"""How fast the filters of a family are, in every form, beside filterpy that is driven with the same model functions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...filters.core.estimator import Estimator, run, run_by_steps
from ...filters.core.kalman import KalmanFilter
from ...filters.core.model import Model, equations_of
from ..registry import list_estimators, make_estimator
from .filters import Speed, measure
from .fixtures import plausible_measurements

FAMILIES: dict[str, tuple[str, ...]] = {
    "bicycle": (
        "two-gyro",
        "platform-gyro",
        "force-inertial",
        "whole-body",
        "odometry-aided",
        "two-gyro-integration",
        "force-inertial-integration",
        "whole-body-integration",
    ),
    "arrays": (
        "array-orientation",
        "array-rate",
        "marins",
        "planar-orientation",
        "planar-pose",
        "planar-mean",
    ),
}
"""Part of ``poise speed`` → estimators; those that the registry lacks are left out."""

SAMPLES = 200
"""of the measurements; longer sequences repeat them"""
BATCHES = (64, 256, 1024)
STEPS = 1_000
LONG = 20_000
"""samples of whole sequences"""
ARRAYS = 20
"""samples of the slow forms"""


def family_speeds(family: str) -> Iterator[Speed]:
    """Rates of every estimator of a family, a group each.

    Raises:
        ValueError: an unknown family.
    """
    if family not in FAMILIES:
        raise ValueError(f"family must be one of {list(FAMILIES)}, got {family!r}")
    known = list_estimators()
    for name in FAMILIES[family]:
        if name in known:
            yield from estimator_speeds(name)


def estimator_speeds(name: str) -> Iterator[Speed]:
    """Rates of one estimator; the yardstick is filterpy, or for what is no Kalman filter stepping in arrays."""
    estimator = make_estimator(name, dt=0.01)
    data = plausible_measurements(estimator, 0, SAMPLES)
    equations = equations_of(estimator)
    slow, short = (repeated(data, length) for length in (ARRAYS, STEPS))
    is_kalman = isinstance(estimator, KalmanFilter)
    if is_kalman:
        group = f"{name} ({equations.state_size} states, {equations.residual_size} rows)"
        rate = measure(lambda: filterpy_run(equations, slow), ARRAYS)
        yardstick = rate
        yield Speed(group, "filterpy.ExtendedKalmanFilter, same model functions", rate, "updates/s", 1.0)
    else:
        group = f"{name} (not a Kalman filter)"
    arrays = in_arrays(estimator)
    rate = measure(lambda: run_by_steps(arrays, slow), ARRAYS)
    if not is_kalman:
        yardstick = rate
    yield Speed(group, "step by step, arrays", rate, "updates/s", rate / yardstick)
    forms: list[tuple[str, Callable[[], Any], int, Callable[[], float]]] = []
    if arrays is not estimator:
        whole = repeated(data, LONG)
        slim = replace(estimator, keep_covariance=False) if is_kalman else estimator  # type: ignore[type-var]
        forms += [
            ("step by step, compiled", lambda: run_by_steps(estimator, short), STEPS, time.process_time),
            ("whole sequence, compiled", lambda: run(estimator, whole), LONG, time.process_time),
        ]
        if is_kalman:
            forms.append(
                ("whole sequence, compiled, no covariances", lambda: run(slim, whole), LONG, time.process_time)
            )
        for batch in BATCHES:
            wide = widened(repeated(data, SAMPLES), batch)
            forms.append(
                (
                    f"batch of {batch}, compiled",
                    lambda wide=wide: run(slim, wide),  # type: ignore[misc]
                    SAMPLES * batch,
                    time.perf_counter,
                )
            )
    for batch in BATCHES:
        narrow = widened(slow, batch)
        forms.append(
            (
                f"batch of {batch}, arrays",
                lambda narrow=narrow: run(arrays, narrow),  # type: ignore[misc]
                ARRAYS * batch,
                time.perf_counter,
            )
        )
    for what, work, count, clock in forms:
        rate = measure(work, count, clock=clock)
        yield Speed(group, what, rate, "updates/s", rate / yardstick)


def in_arrays(estimator: Estimator[Any]) -> Estimator[Any]:
    """The same without the compiled form; the estimator itself if it has none."""
    return replace(estimator, compiled=False) if hasattr(estimator, "compiled") else estimator  # type: ignore[type-var]


def repeated(data: Mapping[str, np.ndarray], length: int) -> dict[str, np.ndarray]:
    """Samples forth and back, repeated to ``length``."""
    there_and_back = {name: np.concatenate([array, array[::-1]]) for name, array in data.items()}
    return {name: np.resize(array, (length, *array.shape[1:])) for name, array in there_and_back.items()}


def widened(data: Mapping[str, np.ndarray], batch: int) -> dict[str, np.ndarray]:
    """The same sequence ``batch`` times, ``(T, batch, size)``."""
    return {
        name: np.ascontiguousarray(np.broadcast_to(array[:, None], (len(array), batch, array.shape[-1])))
        for name, array in data.items()
    }


def filterpy_run(model: Model, measurements: Mapping[str, np.ndarray]) -> np.ndarray:
    """A model driven by filterpy's extended Kalman filter, as its user would; states ``(T, n)``.

    The error state is what filterpy filters: zero before every tick, then put into the state by ``retract``. Samples
    must not be missing; rows of the residual may be.
    """
    from filterpy.kalman import ExtendedKalmanFilter

    size = model.error_size
    other = ExtendedKalmanFilter(dim_x=size, dim_z=model.residual_size)
    ticks = [dict(zip(measurements, values, strict=True)) for values in zip(*measurements.values(), strict=True)]
    x, other.P = model.prior(ticks[0])
    states = [x]
    for before, z in pairwise(ticks):
        x, other.F, other.Q = model.predict(x, z, before)
        other.x = np.zeros((size, 1))
        other.predict()
        r, H, R = model.residual(x, z)
        rows = np.isfinite(r) & np.isfinite(H).all(axis=-1) & np.isfinite(np.diagonal(R))
        if rows.any():
            other.update(
                r[rows, None],
                HJacobian=lambda error, H=H, rows=rows: H[rows],
                Hx=lambda error, rows=rows: np.zeros((int(rows.sum()), 1)),
                R=R[np.ix_(rows, rows)],
            )
            x = model.retract(x, other.x[:, 0])
        x = model.finish(x, z)
        states.append(x)
    return np.array(states)
