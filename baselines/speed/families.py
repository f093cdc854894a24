"""Speed of the filters of a family, in every form, relative to filterpy with the same model functions; of networks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import pairwise

import numpy as np

from ...filters.core.estimator import run, run_by_steps
from ...filters.core.kalman import KalmanFilter
from ...filters.core.model import Model
from ..registry import list_estimators, make_estimator
from .fixtures import plausible_measurements
from .measure import Speed, form_rates, measure

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
    "arrays": ("array-orientation", "array-rate", "marins", "planar-orientation", "planar-pose", "planar-mean"),
}
"""Part of ``poise speed`` → estimators."""

SAMPLES = 200
"""of the measurements; longer sequences repeat them"""
BATCHES = (64, 256, 1024)
STEPS = 1_000
LONG = 20_000
"""samples of whole sequences"""
ARRAYS = 20
"""samples of the slow forms"""


def estimator_speeds(name: str) -> Iterator[Speed]:
    """Rates of one estimator; the yardstick is filterpy, or for what is not a Kalman filter stepping in arrays."""
    estimator = make_estimator(name, dt=0.01)
    data = plausible_measurements(estimator, 0, SAMPLES)
    if isinstance(estimator, KalmanFilter):
        equations = estimator.model
        group = f"{name} ({equations.state_size} states, {equations.residual_size} rows)"
        yardstick = measure(lambda: filterpy_run(equations, repeated(data, ARRAYS)), ARRAYS)
        yield Speed(group, "filterpy.ExtendedKalmanFilter, same model functions", yardstick, "updates/s", 1.0)
    else:
        group, yardstick = f"{name} (not a Kalman filter)", None
    for what, rate in form_rates(estimator, partial(repeated, data), STEPS, LONG, ARRAYS, SAMPLES, BATCHES):
        yardstick = yardstick or rate
        yield Speed(group, what, rate, "updates/s", rate / yardstick)


def learned_speeds() -> Iterator[Speed]:
    """Rates of every shipped network and of the filter that it corrects; steps and whole sequences are own groups.

    The yardstick of a network that stands alone is bounded-motion.
    """
    for name in (name for name, info in list_estimators().items() if info.kind == "learned"):
        own = name.partition("+")[0]
        contenders = dict.fromkeys((own if own in list_estimators() and own != name else "bounded-motion", name))
        made = {each: make_estimator(each, dt=0.01) for each in contenders}
        data = {each: plausible_measurements(estimator, 0, SAMPLES) for each, estimator in made.items()}
        for what, runner, length in (("step by step", run_by_steps, STEPS), ("whole sequence", run, LONG)):
            yardstick = 0.0
            for each, estimator in made.items():
                rate = measure(partial(runner, estimator, repeated(data[each], length)), length)
                yardstick = yardstick or rate
                yield Speed(f"{name}, {what}", each, rate, "updates/s", rate / yardstick)


def repeated(data: Mapping[str, np.ndarray], length: int) -> dict[str, np.ndarray]:
    """Samples forth and back, repeated to ``length``."""
    there_and_back = {name: np.concatenate([array, array[::-1]]) for name, array in data.items()}
    return {name: np.resize(array, (length, *array.shape[1:])) for name, array in there_and_back.items()}


def filterpy_run(model: Model, measurements: Mapping[str, np.ndarray]) -> np.ndarray:
    """A model driven by filterpy's extended Kalman filter, as its user would; states ``(T, n)``.

    The error state is what filterpy filters: zero before every sample, then put into the state by ``retract``. Samples
    must not be missing; rows of the residual may be.
    """
    from filterpy.kalman import ExtendedKalmanFilter

    size = model.error_size
    other = ExtendedKalmanFilter(dim_x=size, dim_z=model.residual_size)
    samples = [dict(zip(measurements, values, strict=True)) for values in zip(*measurements.values(), strict=True)]
    x, other.P = model.prior(samples[0])
    states = [x]
    for before, z in pairwise(samples):
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
