"""Whether the bias of a gyroscope changes on the way, in motion, too.

Turned by the integrated rates, gravity and the magnetic field stand still, as in :mod:`.agreement`. What is left of
their motion in a window is regressed on a bias. The windows before and after a time have one each; the time at which
two explain most is that of the step. The scatter of the windows gives the standard error.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .agreement import MOST_MISSING, STEP, Windows
from .integration import attitudes
from .readings import Finding

SHORTEST, LONGEST, WINDOWS = 1.2, 4.0, 10
"""s of a window; windows of a short recording."""
FEWEST, MOST = 3, 120
"""Windows before and after a step; windows of a long recording, which are apart."""
LEAST = np.radians(4.5)
"""rad/s: of the steps that are told."""
CERTAIN = 6.0
"""Standard errors of them."""
EXPLAINED = {"acc": 0.02, "mag": 0.4}
"""Share of what one bias leaves that two must explain: forces are mostly accelerations, a field is a direction."""
PRIOR, LARGEST_CHANGE, ITERATIONS = 0.3, 0.1, 3
"""rad/s: deviation of a bias, and how far it is changed in one of the iterations."""


class BiasStep(NamedTuple):
    """Step of a bias.

    Attributes:
        time: s after the start of the recording.
        size: ``(3,)`` rad/s.
        error: rad/s, standard error along it.
        explained: share of what one bias leaves that two explain.
    """

    time: float
    size: np.ndarray
    error: float
    explained: float


def windows_in_order(rate: np.ndarray, vector: np.ndarray, interval: float) -> tuple[Windows, np.ndarray] | None:
    """Windows of a uniform grid, without those that lack samples, and the times in s at which they begin."""
    together = max(1, round(STEP / interval))
    step, count = together * interval, len(rate) // together
    length = max(2, round(np.clip(count * step / WINDOWS, SHORTEST, LONGEST) / step))
    begins = np.arange(0, count - length + 1, length * max(1, count // (length * MOST)))
    if len(begins) < 2 * FEWEST or step > 3.0 * STEP:
        return None
    rates, vectors = (values[: count * together].reshape(count, together, 3).mean(axis=1) for values in (rate, vector))
    known, seen = (np.isfinite(values).all(axis=1) for values in (rates, vectors))
    rows = begins[:, None] + np.arange(length)
    usable = (known[rows].mean(axis=1) > 1.0 - MOST_MISSING) & (seen[rows].mean(axis=1) > 0.5)
    if usable.sum() < 2 * FEWEST:
        return None
    directions = vectors[rows[usable]]
    directions = directions / np.nanmedian(np.linalg.norm(directions, axis=2))
    return Windows(np.nan_to_num(rates)[rows[usable]], directions, step), begins[usable] * step


def bias_step(rate: np.ndarray, vector: np.ndarray, interval: float) -> BiasStep | None:
    """The likeliest step of the bias of rates against a measured direction.

    Args:
        rate: ``(T, 3)`` rad/s, on a uniform grid, NaN where missing.
        vector: ``(T, 3)`` of an accelerometer or magnetometer, any unit, NaN where missing.
        interval: s of the grid.

    Returns:
        The step; None if the recording is too short.
    """
    cut = windows_in_order(rate, vector, interval)
    if cut is None:
        return None
    windows, begins = cut
    bias, prior = np.zeros(3), np.eye(3) / PRIOR**2
    for _ in range(ITERATIONS):
        rates = windows.rates - bias
        residual, slopes, weight = windows.linearised(attitudes(windows.step * rates), rates, 0.0)
        slopes = slopes[..., 2:].copy()
        information = np.einsum("w,wtcp,wtcq->wpq", weight, slopes, slopes, optimize=True)
        gradient = np.einsum("w,wtcp,wtc->wp", weight, slopes, residual, optimize=True)
        change = -np.linalg.solve(information.sum(axis=0) + prior, gradient.sum(axis=0))
        bias = bias + np.clip(change, -LARGEST_CHANGE, LARGEST_CHANGE)

    def fitted(part: slice) -> tuple[np.ndarray, np.ndarray, float]:
        """Bias of some windows beyond the common one, its covariance, and what it leaves."""
        inverse = np.linalg.inv(information[part].sum(axis=0) + prior)
        beyond = -inverse @ gradient[part].sum(axis=0)
        each = gradient[part] + information[part] @ beyond
        covariance = inverse @ (each.T @ each) @ inverse * len(each) / (len(each) - 1)
        rest = residual[part] + slopes[part] @ beyond
        return beyond, covariance, float(weight[part] @ np.square(rest).sum(axis=(1, 2)))

    borders = range(FEWEST, len(begins) - FEWEST + 1)
    halves = [(fitted(slice(border)), fitted(slice(border, None))) for border in borders]
    border, (before, after) = min(zip(borders, halves, strict=True), key=lambda one: one[1][0][2] + one[1][1][2])
    size = after[0] - before[0]
    along = size / (np.linalg.norm(size) + 1e-12)
    error = float(np.sqrt(along @ (before[1] + after[1]) @ along))
    return BiasStep(float(begins[border]), size, error, 1.0 - (before[2] + after[2]) / fitted(slice(None))[2])


def check_bias_step(
    channel: str, gyr: np.ndarray, acc: np.ndarray | None, mag: np.ndarray | None, dt: float
) -> Iterator[Finding]:
    """A bias of the gyroscope that is another from some time on.

    Args:
        channel: of the gyroscope.
        gyr: ``(T, 3)`` rad/s on a grid, NaN where missing; likewise the others.
        acc: m/s², or None.
        mag: any unit, or None.
        dt: s between samples.
    """
    for kind, vector in (("mag", mag), ("acc", acc)):
        found = None if vector is None else bias_step(gyr, vector, dt)
        if found is None or found.explained < EXPLAINED[kind]:
            continue
        size = float(np.linalg.norm(found.size))
        if size > LEAST and size > CERTAIN * found.error:
            axes = ", ".join(f"{value:+.1f}" for value in np.degrees(found.size))
            what = f"its bias changes by {np.degrees(size):.0f} °/s ({axes}) at about {found.time:.0f} s"
            cause = "a sensor that warmed up, was switched over or was calibrated on the way"
            yield Finding("warning", channel, what, cause, "Cut the recording there.")
            return
