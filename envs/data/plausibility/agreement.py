"""Lag and scale of a gyroscope against a direction that another sensor at the same site measures.

Turned into a frame that stands still by the integrated rates, gravity (or the magnetic field) is constant. What is left
of its motion is regressed on what a lag, a scale and a bias of the rates would leave (Gauss–Newton). A lag leaves the
direction's own rate of turn; accelerations that follow from the rotation about a distant axis leave its derivative,
which is uncorrelated with it, so that they do not look like a lag. The regression is repeated over windows, whose
scatter gives the standard errors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from .integration import attitudes

LARGEST_LAG = 0.6
"""s; lags are looked for within it."""
WINDOWS, SHORTEST, LONGEST = 8, 1.2, 5.0
"""Windows of a short recording; bounds of their length in s."""
FEWEST_WINDOWS, MOST_WINDOWS = 4, 24
"""Windows that are needed, and that are looked at: those in which direction and rates move most."""
LIVELY = 0.05
"""Share of the motion of the liveliest window below which a window tells nothing."""
STEP, SEGMENT = 0.02, 0.3
"""s: of the integration, and over which directions are averaged, as fast accelerations are noise."""
MOST_MISSING = 0.05
"""Share of missing rates of a window that is used."""
COARSE_LAGS, COARSE_SCALES = np.arange(-0.6, 0.61, 0.05), (0.5, 0.6, 0.75, 1.0, 1.3, 1.6, 2.0)
ITERATIONS, LONGEST_STEP, CONVERGED = 8, 0.1, 2e-4
SCALE_PRIOR, BIAS_PRIOR = 0.5, 0.05
"""Standard deviations of the scale and, rad/s, of the bias."""


class Agreement(NamedTuple):
    """How rates and the motion of a direction fit one another.

    Attributes:
        lag: s by which the rates are late.
        lag_error: its standard error.
        scale: by which the rates must be multiplied.
        scale_error: its standard error.
        explained: share of the motion of the direction that rates with this lag and scale explain.
        explained_by_lag: share of what rates without the lag leave that the lag explains.
        left: what is left of the motion, root mean square as a share of the length of the vector.
    """

    lag: float
    lag_error: float
    scale: float
    scale_error: float
    explained: float
    explained_by_lag: float
    left: float


class Windows(NamedTuple):
    """Rates ``(W, M + N + M, 3)`` rad/s of windows and beyond them, directions ``(W, N, 3)`` within; step in s."""

    rates: np.ndarray
    directions: np.ndarray
    step: float

    def within(self, values: np.ndarray, lag: float) -> np.ndarray:
        """The part ``(W, N, …)`` of values ``(W, M + N + M, …)`` that is later by a lag in s, in whole steps."""
        first = (values.shape[1] - self.directions.shape[1]) // 2 + round(lag / self.step)
        return values[:, first : first + self.directions.shape[1]]

    def turned(self, attitude: np.ndarray, rates: np.ndarray, lag: float) -> tuple[np.ndarray, np.ndarray]:
        """Attitudes ``(W, N, 4)`` that come later by a lag in s, and the directions ``(W, N, 3)`` turned by them."""
        rest = lag - self.step * round(lag / self.step)
        attitude = self.within(attitude, lag)
        if abs(rest) > 1e-9:
            attitude = rotation.multiply(attitude, rotation.exp(rest * self.within(rates, lag)))
        return attitude, rotation.rotate(attitude, self.directions)

    def segments(self, values: np.ndarray) -> np.ndarray:
        """Means ``(W, S, …)`` of ``(W, N, …)`` over segments, less that of the window; NaN without a sample."""
        length = max(1, round(SEGMENT / self.step))
        count = values.shape[1] // length
        parts = values[:, : count * length].reshape(len(values), count, length, *values.shape[2:])
        known = np.isfinite(parts)
        with np.errstate(invalid="ignore"):
            means = np.where(known, parts, 0.0).sum(axis=2) / known.sum(axis=2)
        return means - np.nanmean(means, axis=1, keepdims=True)

    def left(self, values: np.ndarray) -> np.ndarray:
        """Mean square ``(W,)`` of the motion of vectors ``(W, N, 3)``."""
        return np.nanmean(np.square(self.segments(values)).sum(axis=2), axis=1)

    def linearised(
        self, attitude: np.ndarray, rates: np.ndarray, lag: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is left of the motion, its derivatives as of :func:`sensitivities`, and the weight of each window.

        They are ``(W, S, 3)``, ``(W, S, 3, 5)``, both zero without a sample, and ``(W,)``: less for what is left more.
        """
        attitude, directions = self.turned(attitude, rates, lag)
        residual = self.segments(directions)
        slopes = self.segments(sensitivities(self.step, self.within(rates, lag), attitude, directions))
        known = np.isfinite(residual)
        residual, slopes = np.where(known, residual, 0.0), np.where(known[..., None], slopes, 0.0)
        left = np.square(residual).sum(axis=(1, 2)) / known[..., 0].sum(axis=1)
        return residual, slopes, 1.0 / (left + 0.5 * np.median(left) + 1e-9)


def cut_windows(rate: np.ndarray, vector: np.ndarray, interval: float) -> Windows | None:
    """The liveliest windows of a uniform grid; None without enough of them."""
    together = max(1, round(STEP / interval))
    step, count = together * interval, len(rate) // together
    beyond = round((LARGEST_LAG + STEP) / step)
    length = round(np.clip((count * step - 2.0 * LARGEST_LAG) / WINDOWS, SHORTEST, LONGEST) / step)
    first = np.arange(beyond, count - length - beyond + 1, length)
    present = np.isfinite(rate).all(axis=1)
    if len(first) < FEWEST_WINDOWS or step > 3.0 * STEP or not present.any():
        return None
    stamps = np.arange(len(rate))
    filled = np.stack([np.interp(stamps, stamps[present], rate[present, axis]) for axis in range(3)], axis=1)
    rates, missing = (
        each[: count * together].reshape(count, together, -1).mean(axis=1) for each in (filled, 1.0 - present[:, None])
    )
    parts = vector[: count * together].reshape(count, together, 3)
    known = np.isfinite(parts).all(axis=(1, 2))
    vectors = np.where(known[:, None], parts.mean(axis=1), np.nan)
    rows = first[:, None] + np.arange(-beyond, length + beyond)
    inside = first[:, None] + np.arange(length)
    usable = (missing[rows].mean(axis=(1, 2)) < MOST_MISSING) & (known[inside].mean(axis=1) > 0.5)
    if usable.sum() < FEWEST_WINDOWS:
        return None
    rates, directions = rates[rows[usable]], vectors[inside[usable]]
    directions = directions / np.nanmedian(np.linalg.norm(directions, axis=2))
    turning = np.minimum(np.sqrt(np.square(rates).sum(axis=2).mean(axis=1)), 3.0)
    lively = turning * np.sqrt(np.nanvar(directions, axis=1).sum(axis=1))
    order = np.argsort(-lively, kind="stable")[:MOST_WINDOWS]
    order = order[lively[order] > LIVELY * lively.max()]
    return Windows(rates[order], directions[order], step) if len(order) >= FEWEST_WINDOWS else None


def agreement(rate: np.ndarray, vector: np.ndarray, interval: float) -> Agreement | None:
    """Lag and scale of rates against a measured direction.

    Args:
        rate: ``(T, 3)`` rad/s, on a uniform grid, NaN where missing.
        vector: ``(T, 3)`` of an accelerometer or magnetometer, any unit, NaN where missing.
        interval: s of the grid.

    Returns:
        The fit; None if the recording is too short, too slow or too still for one.
    """
    windows = cut_windows(rate, vector, interval)
    if windows is None:
        return None

    def median_left(attitude: np.ndarray, lag: float) -> float:
        return float(np.median(windows.left(windows.turned(attitude, windows.rates, lag)[1])))

    attitude = attitudes(windows.step * windows.rates)
    whole_steps = np.round(COARSE_LAGS / windows.step) * windows.step
    lag = min(whole_steps.tolist(), key=lambda one: median_left(attitude, one))
    scale = min(
        COARSE_SCALES,
        key=lambda one: median_left(attitude if one == 1.0 else attitudes(one * windows.step * windows.rates), lag),
    )
    bias, scatter = np.zeros(3), np.eye(5)
    prior = np.diag([0.0, SCALE_PRIOR**-2.0, *[BIAS_PRIOR**-2.0] * 3])
    for _ in range(ITERATIONS):
        rates = scale * windows.rates - bias
        integrated = attitudes(windows.step * rates)
        residual, slopes, weight = windows.linearised(integrated, rates, lag)
        information = np.einsum("w,wtcp,wtcq->pq", weight, slopes, slopes, optimize=True) + prior
        gradient = np.einsum("w,wtcp,wtc->wp", weight, slopes, residual, optimize=True)
        inverse = np.linalg.inv(information)
        scatter = inverse @ (gradient.T @ gradient) @ inverse * len(weight) / (len(weight) - 2)
        change = -inverse @ (gradient.sum(axis=0) + prior @ [0.0, scale - 1.0, *bias])
        if np.abs(change).max() < CONVERGED:
            break
        change = np.clip(change, -LONGEST_STEP, LONGEST_STEP)
        lag = float(np.clip(lag + change[0], -LARGEST_LAG, LARGEST_LAG))
        scale, bias = float(np.clip(scale + change[1], 0.3, 3.0)), bias + change[2:]

    def weighted(values: np.ndarray) -> float:
        return float(weight @ windows.left(values) / weight.sum())

    left, without = (weighted(windows.turned(integrated, rates, one)[1]) for one in (lag, 0.0))
    explained, by_lag = 1.0 - left / weighted(windows.directions), 1.0 - left / without
    lag_error, scale_error = np.sqrt(np.diag(scatter)[:2]).tolist()
    return Agreement(lag, lag_error, scale, scale_error, explained, by_lag, float(np.sqrt(left)))


def sensitivities(step: float, rates: np.ndarray, attitude: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Derivatives ``(W, N, 3, 5)`` of directions in the still frame by lag, scale and the three biases.

    Args:
        step: s.
        rates: ``(W, N, 3)`` rad/s in the sensor's axes, as are the biases.
        attitude: ``(W, N, 4)``.
        directions: ``(W, N, 3)``, turned.
    """
    turning = rotation.rotate(attitude, rates)
    axes = [-rotation.rotate(attitude, np.broadcast_to(axis, directions.shape)) for axis in np.eye(3)]
    turns = [np.cumsum(one, axis=1) * step for one in (turning, *axes)]
    turns = [turn - turn.mean(axis=1, keepdims=True) for turn in turns]
    return np.stack([rotation.cross(one, directions) for one in (turning, *turns)], axis=-1)
