r"""Posterior Cramér–Rao bound along one true trajectory, for every model of the package.

P. Tichavský, C. H. Muravchik, A. Nehorai, "Posterior Cramér–Rao bounds for discrete-time nonlinear filtering", IEEE
Transactions on Signal Processing 46(5), 1998. With the information matrix J and

    D¹¹ = Fᵀ Q⁻¹ F,   D¹² = −Fᵀ Q⁻¹,   D²² = Q⁻¹ + Hᵀ R⁻¹ H,
    J(k+1) = D²² − D²¹ (J(k) + D¹¹)⁻¹ D¹²

no estimator has a smaller covariance than J⁻¹, where the expectation is over trajectories and measurements. Here F, Q,
H and R are those at the true states of one trajectory, as in (27)–(29) of the two-gyroscope paper. The result is the
bound of the linearised problem and not an average. It equals the Riccati recursion, which needs no Q⁻¹:

    P(k+1)⁻ = F P(k) Fᵀ + Q,   P(k+1) = (P(k+1)⁻ ⁻¹ + Hᵀ R⁻¹ H)⁻¹

If Q depends on the state, D¹¹ has the further term ½ tr(Q⁻¹ ∂ᵢQ Q⁻¹ ∂ⱼQ), the information in the size of the noise. It
is omitted, as in the paper, because no Kalman filter uses it. (With it the bound of a platform that does not turn would
not grow.)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..core.estimator import check_measurements
from ..core.model import Model
from ..core.recursion import correct
from ..core.sampling import filled, join, last_readings, split


class Linearisation(NamedTuple):
    """A model along a trajectory of T states: T − 1 steps, T measurements.

    Attributes:
        F: ``(T − 1, e, e)`` Jacobian of the error from sample k to k + 1.
        Q: ``(T − 1, e, e)`` process covariance.
        H: ``(T, m, e)`` Jacobian of the measurement.
        R: ``(T, m, m)`` its covariance.
        usable: ``(T, m)`` bool, rows that were measured.
    """

    F: np.ndarray
    Q: np.ndarray
    H: np.ndarray
    R: np.ndarray
    usable: np.ndarray


def linearise(model: Model, states: np.ndarray, measurements: Mapping[str, Any]) -> Linearisation:
    """Jacobians and covariances of a model at true states.

    Args:
        model: the equations.
        states: ``(T, n)`` true states.
        measurements: channel → ``(T, size)`` at the same times, without errors for the bound (samples of an ideal
            sensor plus the biases in ``states``, see :func:`with_gaps`); NaN where there is no sample. Missing inputs
            are replaced by the last valid ones, and updates of missing measurements are skipped, as in
            :class:`poise.filters.core.kalman.KalmanFilter`.

    Raises:
        ValueError: shapes do not fit.
    """
    samples, held = samples_of(model, measurements)
    states = np.asarray(states, dtype=float)
    if states.shape != (len(samples), model.state_size):
        raise ValueError(f"states must have shape {(len(samples), model.state_size)}, got {states.shape}")
    _, F, Q = model.predict(states[:-1], *inputs_of_steps(model, held))
    r, H, R = model.residual(states, split(samples, model.channels))
    usable = np.isfinite(r) & np.isfinite(H).all(-1) & np.isfinite(np.linalg.diagonal(R))
    steps, e, m = len(samples), model.error_size, model.residual_size
    F, Q = (np.broadcast_to(part, (steps - 1, e, e)) for part in (F, Q))
    return Linearisation(F, Q, np.broadcast_to(H, (steps, m, e)), np.broadcast_to(R, (steps, m, m)), usable)


def samples_of(model: Model, measurements: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """All channels of a model side by side ``(T, d)``: as recorded, and with the last valid sample held."""
    arrays = check_measurements(model.channels, measurements, time_axis=True)
    samples = np.asarray(join(arrays, model.channels), dtype=float)
    return samples, last_readings(samples)


def inputs_of_steps(model: Model, held: np.ndarray) -> tuple[dict[str, Any], dict[str, Any]]:
    """Samples at the end and at the beginning of each step, channel → ``(T − 1, size)``, of held ones ``(T, d)``."""
    inputs = split(filled(held), model.channels)
    return {name: array[1:] for name, array in inputs.items()}, {name: array[:-1] for name, array in inputs.items()}


def start_of(model: Model, measurements: Mapping[str, Any]) -> tuple[int, np.ndarray]:
    """First sample at which a filter of this model can start, and its initial covariance ``(e, e)``.

    Raises:
        ValueError: the samples never suffice for a start.
    """
    _, held = samples_of(model, measurements)
    x, P = (np.asarray(part, dtype=float) for part in model.prior(split(held, model.channels)))
    P = np.broadcast_to(P, (len(held), *P.shape[-2:]))
    ready = np.isfinite(x).all(axis=-1) & np.isfinite(P).all(axis=(-2, -1))
    if not ready.any():
        raise ValueError(f"measurements never suffice for the prior of {type(model).__name__}: a channel has no sample")
    first = int(np.argmax(ready))
    return first, P[first]


def posterior_bound(model: Model, states: np.ndarray, measurements: Mapping[str, Any]) -> np.ndarray:
    """Bound ``(T, e, e)`` on the covariance of any estimate at each sample, in Riccati form.

    NaN before the sample at which a filter can start, whose bound is the covariance of the model's prior.

    Args:
        model: the equations, with the true noises of the sensors.
        states: ``(T, n)`` true states.
        measurements: as for :func:`linearise`.

    Raises:
        ValueError: shapes do not fit, or the samples never suffice for the model's prior.
    """
    first, P = start_of(model, measurements)
    return riccati(linearise(model, states, measurements), P, first)


def riccati(system: Linearisation, P: np.ndarray, first: int = 0) -> np.ndarray:
    """Covariances ``(T, e, e)`` of the optimal filter of a linear system; NaN before the start.

    ``P`` ``(e, e)`` is that at the sample ``first``, its measurement included.
    """
    F, Q = system.F, system.Q
    bounds = [np.full_like(P, np.nan)] * first + [P]
    for k in range(first, len(F)):
        P = measured(F[k] @ P @ F[k].T + Q[k], system, k + 1)
        bounds.append(P)
    return np.array(bounds)


def measured(P: np.ndarray, system: Linearisation, k: int) -> np.ndarray:
    """Covariance ``(e, e)`` after the measurement of sample k."""
    H, R, usable = system.H, system.R, system.usable
    return correct(P, np.where(usable[k], 0.0, np.nan), H[k], R[k])[1] if usable[k].any() else P


def with_gaps(ideal: Mapping[str, Any], recorded: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Error-free samples where a recording has samples, NaN where it has none.

    Args:
        ideal: channel → ``(T, size)`` of ideal sensors for the same motion (same seed, ``sensors="ideal"``).
        recorded: channel → ``(T, size)``, whose missing samples are copied.

    Raises:
        ValueError: a channel is missing or has another shape.
    """
    result = {}
    for name, samples in recorded.items():
        pattern, exact = np.asarray(samples, dtype=float), np.asarray(ideal.get(name, np.nan), dtype=float)
        if exact.shape != pattern.shape:
            raise ValueError(f"ideal[{name!r}] must have shape {pattern.shape}, got {exact.shape}")
        result[name] = np.where(np.isfinite(pattern), exact, np.nan)
    return result
