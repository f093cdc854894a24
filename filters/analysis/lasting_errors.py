r"""Posterior bounds with time-correlated errors: biases, misalignment, and outputs that are wrong for seconds.

The bound for white noise is too small where time-correlated errors dominate, and with the filter's own, inflated
noises it is too large. Here every such error has further states s: a constant, a first-order Gauss–Markov process,
or a second-order one, s = [b ḃ], with the frequency ω and the damping ζ of a movement:

    [δx s]ᵀ(k+1) = [F −∂f/∂b; 0 φ] [δx s]ᵀ(k) + noise,   r = H δx + (∂r/∂b) b + white noise
    φ = exp(−Δt / τ),   or φ = exp(Δt [0 1; −ω² −2 ζ ω])

The recursion is that of :mod:`.bounds`. It bounds what an estimator could do that knows size and time of every error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag, expm

from ..core.model import Model
from ..core.rotation import wrap
from ..core.sampling import split
from .bounds import inputs_of_steps, linearise, measured, samples_of, start_of

STEP = 1e-6
"""of numerical derivatives by an error, in its unit"""
States = Callable[[Mapping[str, Any]], np.ndarray]
"""Samples → true states ``(T, n)``, with what the state remembers of the samples."""


def added(values: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Samples ``(T, k)`` with a constant error ``(k,)``."""
    return values + error


@dataclass(frozen=True)
class Lasting:
    """Time-correlated errors.

    Attributes:
        std: ``(k,)`` standard deviations, of as many independent components.
        time: correlation time of a first-order process, s; inf for constants.
        frequency: ω of a second-order process, rad/s; 0 for one of first order.
        damping: ζ of it.
        returns: the error is the rate of that process: its integral stays bounded, as that of a movement on the spot.
        channel: whose samples are off by them; empty if ``rows`` says what they do.
        rows: ``(m, k)`` or ``(T, m, k)``, what a unit of each adds to the residual.
        moved: how samples are off; by default by a sum.
    """

    std: Sequence[float]
    time: float = math.inf
    frequency: float = 0.0
    damping: float = 1.0
    returns: bool = False
    channel: str = ""
    rows: np.ndarray | None = None
    moved: Callable[[np.ndarray, np.ndarray], np.ndarray] = added

    def step(self, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of a component with a std of 1: transition in an interval (s), stationary covariance, row of the error."""
        if not self.frequency:
            return np.array([[math.exp(-dt / self.time)]]), np.eye(1), np.eye(1)
        omega = self.frequency
        A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * self.damping * omega]])
        if self.returns:
            return np.asarray(expm(A * dt)), np.diag([1.0 / omega**2, 1.0]), np.array([[0.0, 1.0]])
        return np.asarray(expm(A * dt)), np.diag([1.0, omega**2]), np.array([[1.0, 0.0]])


def lasting_bound(
    model: Model,
    states: States,
    measurements: Mapping[str, Any],
    errors: Sequence[Lasting],
    *,
    white: np.ndarray | None = None,
    prior: np.ndarray | None = None,
) -> np.ndarray:
    """Bound ``(T, e, e)`` on the covariance of the model's error state; NaN before the start.

    Args:
        model: the equations, with the true white noises of the sensors.
        states: from samples to true states; the error state is a difference of their first e elements.
        measurements: channel → ``(T, size)``; NaN where there is no sample.
        errors: the time-correlated ones.
        white: ``(m, m)`` covariance of the outputs' white noise; None for that of the model.
        prior: ``(e, e)`` covariance before the first sample, which then is a measurement too; None for the model's own
            covariance after it.

    Raises:
        ValueError: shapes do not fit, or the samples never suffice for the model's prior.
    """
    system = linearise(model, states(measurements), measurements)
    by_step, by_output = _derivatives(model, states, measurements, errors)
    steps, noises, starts, loads = [], [], [], []
    for error in errors:
        keep, stationary, seen = error.step(model.dt)
        for std in error.std:
            steps.append(keep)
            starts.append(std**2 * stationary)
            noises.append(std**2 * (stationary - keep @ stationary @ keep.T))
            loads.append(seen)
    e, load = model.error_size, block_diag(*loads)
    by_step, by_output = by_step @ load, by_output @ load
    size = e + load.shape[-1]
    grown, P, A = (np.zeros((size, size)) for _ in range(3))
    grown[e:, e:], P[e:, e:], A[e:, e:] = block_diag(*noises), block_diag(*starts), block_diag(*steps)
    first, own = (0, prior) if prior is not None else start_of(model, measurements)
    P[:e, :e] = own
    R = system.R if white is None else np.broadcast_to(white, system.R.shape)
    system = system._replace(H=np.concatenate([system.H, by_output], axis=-1), R=R)
    if prior is not None:
        P = measured(P, system, 0)
    bounds = [np.full((e, e), np.nan)] * first + [P[:e, :e].copy()]
    for k in range(first, len(by_step)):
        A[:e, :e], A[:e, e:] = system.F[k], by_step[k]
        P = A @ P @ A.T + grown
        P[:e, :e] += system.Q[k]
        P = measured(P, system, k + 1)
        bounds.append(P[:e, :e].copy())
    return np.array(bounds)


def _derivatives(
    model: Model, states: States, measurements: Mapping[str, Any], errors: Sequence[Lasting]
) -> tuple[np.ndarray, np.ndarray]:
    """What a unit of each error adds to the error state in a step ``(T − 1, e, b)`` and to the residual ``(T, m, b)``.

    The error state is the truth less the estimate, which is moved by the error of the samples: hence the minus.
    """
    step, output = _moved(model, states(measurements), measurements)
    by_step: list[np.ndarray] = []
    by_output: list[np.ndarray] = []
    for error in errors:
        for index in range(len(error.std)):
            if error.rows is not None:
                by_step.append(np.zeros_like(step))
                by_output.append(np.broadcast_to(error.rows[..., index], output.shape))
                continue
            off = np.zeros(len(error.std))
            off[index] = STEP
            samples = np.asarray(measurements[error.channel], dtype=float)
            changed = {**measurements, error.channel: error.moved(samples, off)}
            moved, found = _moved(model, states(changed), changed)
            by_step.append(-wrap(moved - step) / STEP)
            by_output.append(wrap(found - output) / STEP)
    return np.stack(by_step, axis=-1), np.nan_to_num(np.stack(by_output, axis=-1))


def _moved(model: Model, x: np.ndarray, measurements: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """First e elements of the predicted states ``(T − 1, e)``, and the residual ``(T, m)``."""
    samples, held = samples_of(model, {channel.name: measurements[channel.name] for channel in model.channels})
    predicted = np.asarray(model.predict(x[:-1], *inputs_of_steps(model, held))[0])[:, : model.error_size]
    return predicted, np.asarray(model.residual(x, split(samples, model.channels))[0])


def lasting_and_white(values: np.ndarray, dt: float, window: float = 0.1) -> tuple[list[Lasting], np.ndarray]:
    """Errors of outputs over time, column by column, as a constant, a second-order process and white noise.

    Args:
        values: ``(T, m)``; NaN where there is none.
        dt: s.
        window: s of the moving average that separates white noise from what lasts; ``dt`` for none.

    Returns:
        The constants (of the size of each mean) and the processes, whose rows are those of the identity, and the
        standard deviation ``(m,)`` of the white part. Frequency and damping are those whose autocorrelation is nearest
        to that of the values over :data:`LAGS`.

    Raises:
        ValueError: a column has too few values.
    """
    span = max(1, round(window / dt))
    errors, whites = [], []
    for column, row in zip(np.asarray(values, dtype=float).T, np.eye(values.shape[-1]), strict=True):
        known = column[np.isfinite(column)]
        if len(known) < 4 * span:
            raise ValueError(f"values need at least {4 * span} that are finite in each column, got {len(known)}")
        smooth = np.convolve(known, np.full(span, 1.0 / span), "valid")
        rest = known[span // 2 : span // 2 + len(smooth)] - smooth
        mean = float(smooth.mean())
        errors.append(Lasting((abs(mean),), rows=row[:, None]))
        frequency, damping, returns = fitted_process(smooth - mean, dt)
        errors.append(Lasting((float(smooth.std()),), math.inf, frequency, damping, returns, rows=row[:, None]))
        whites.append(float(rest.std()) * math.sqrt(span / max(1, span - 1)))
    return errors, np.array(whites)


LAGS = 2.0
"""s over which autocorrelations are compared"""
FREQUENCIES, DAMPINGS = np.geomspace(0.3, 30.0, 41), np.geomspace(0.1, 4.0, 25)
"""rad/s, and 1: what is tried"""


def fitted_process(values: np.ndarray, dt: float) -> tuple[float, float, bool]:
    """Second-order process that is correlated as values ``(T,)`` of mean zero every ``dt`` s, or whose rate is.

    Returns:
        Frequency ω (rad/s), damping ζ, and whether it is the rate.
    """
    found = _autocorrelation(values)[: max(2, round(LAGS / dt))]
    time = dt * np.arange(len(found))
    omega, zeta = (grid[..., None] for grid in np.meshgrid(FREQUENCIES, DAMPINGS, indexing="ij"))
    # of ẍ + 2 ζ ω ẋ + ω² x = white noise; the root is imaginary below ζ = 1, where cosh is a cosine
    root = np.sqrt((zeta * zeta - 1.0).astype(complex)) + 1e-9
    turn, fades = root * omega * time, np.exp(-zeta * omega * time)
    shapes = np.stack([np.real(fades * (np.cosh(turn) + sign * zeta / root * np.sinh(turn))) for sign in (1.0, -1.0)])
    distances = np.sum((shapes - found) ** 2, axis=-1)
    rate, i, k = np.unravel_index(int(np.argmin(distances)), distances.shape)
    return float(FREQUENCIES[i]), float(DAMPINGS[k]), bool(rate)


def _autocorrelation(values: np.ndarray) -> np.ndarray:
    """Mean product of values that lie so many samples apart, over the mean square; as far as a third of them."""
    size = len(values)
    spectrum = np.fft.rfft(values, 2 * size)
    products = np.fft.irfft(np.abs(spectrum) ** 2)[: max(2, size // 3)] / (size - np.arange(max(2, size // 3)))
    return np.asarray(products / max(products[0], np.finfo(float).tiny))
