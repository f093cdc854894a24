r"""Orientation in a vertical plane by the unscented Kalman filter of the package filterpy.

P. He, thesis, Université Laval; section 3.3.6: the model of the extended filter (:class:`.PlanarOrientation`) with
sigma points (3.48), λ = α̃²(L + κ) − L, L = 1, κ = 3 − L. The variance of the angle is so small that the
linearisation is accurate, and the two filters agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from ...core.backend import constant, to_numpy
from ...core.estimator import check_measurements, run_by_steps
from ...core.quantity import Estimate, Measurement
from ...core.sampling import FilterState, aged, check_batch, empty_state, filled, hold, join, split
from .orientation import PLANAR_ANGLE, PLANAR_GYROSCOPE, TURNED_IN_A_PLANE, PlanarEquations, PlanarOrientation


@dataclass(frozen=True)
class PlanarUnscented(PlanarEquations):
    """The unscented filter; batches are processed one sequence at a time, in NumPy.

    Raises:
        ValueError: ``spread`` is not in (0, 1], or as :class:`.PlanarEquations`.
    """

    spread: float = 1e-3
    """α̃: distance of the sigma points from the mean, 10⁻⁴ to 1 (section 3.3.6)"""
    weight: float = 2.0
    """β̃ of the scaled transform: 2 suits a normal distribution"""

    state_size: ClassVar[int] = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.spread <= 1.0:
            raise ValueError(f"spread must lie in (0, 1], got {self.spread}")

    @property
    def _model(self) -> PlanarOrientation:
        return PlanarOrientation(**{item.name: getattr(self, item.name) for item in fields(PlanarEquations)})

    def _filter(self, model: PlanarOrientation) -> Any:
        """The filter of the package, without state."""
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

        points = MerweScaledSigmaPoints(1, alpha=self.spread, beta=self.weight, kappa=2.0)
        made = UnscentedKalmanFilter(1, 2, self.dt, hx=model.expected, fx=_turned, points=points)
        made.R = model.force_covariance(np.zeros(1))
        return made

    def init(self, measurement: Measurement) -> FilterState:
        """Empty memory, NumPy arrays, with the batch shape of ``measurement``."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        return empty_state(self._model, to_numpy(join(arrays, self.channels)).astype(float))

    def step(self, state: FilterState, measurement: Measurement) -> tuple[FilterState, Estimate]:
        """Take one sample of every channel, ``(*batch, size)``; NaN where there is none."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        check_batch(arrays, state.started)
        model, like = self._model, next(iter(arrays.values()))
        engine = self._filter(model)
        sample = to_numpy(join(arrays, self.channels)).astype(float)
        current = hold(sample, state.held)
        now, before = (split(filled(part), self.channels) for part in (current, state.held))
        age = aged(state.age, sample, self.channels, self.dt)
        rate = PLANAR_GYROSCOPE.name
        noise = TURNED_IN_A_PLANE.noise(np.array(self.gyroscope_noise), age[..., 0], now[rate], self.dt)
        turn = model.integrated(np.zeros_like(state.x), now, before)
        force = model.specific_force(split(sample, self.channels))
        first, variance = model.first(split(current, self.channels))
        x, P, started = state.x.copy(), state.covariance.copy(), state.started.copy()
        for index in np.ndindex(started.shape):
            if started[index]:
                engine.x, engine.P = x[index].copy(), P[index].copy()
                engine.Q = np.array([[self.dt**2 * noise[index] ** 2]])
                engine.predict(turn=turn[index])
                if np.isfinite(force[index]).all():
                    engine.update(force[index])
                x[index], P[index] = engine.x, np.maximum(engine.P, 0.0)
            elif math.isfinite(first[index].item()):
                x[index], P[index], started[index] = first[index], variance[index], True
        angle = np.where(started[..., None], x, np.nan)
        covariance = np.where(started[..., None, None], P, np.nan)
        estimate = Estimate({PLANAR_ANGLE.name: constant(angle, like)}, constant(covariance, like))
        return FilterState(x, P, current, age, state.monitor, started), estimate

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, size)`` in and out; equal to stepping."""
        return run_by_steps(self, measurements)


def _turned(x: np.ndarray, dt: float, turn: np.ndarray) -> np.ndarray:
    return x + turn
