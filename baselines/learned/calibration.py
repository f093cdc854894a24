"""Covariance of a trained network's corrections, from sequences that it was not trained on.

The variance of the error of an angle is

    σ² = κ s (1 − ρ + ρ u²)

with the unlikeness u of the network's inputs (:mod:`.networks.unlikeness`), whose square makes the errors of held-out
rides likelier than u itself does. For each ρ the likelihood of the errors has its maximum at
s = mean(e² / (1 − ρ + ρ u²)). Most of an error is constant in a ride, so rides, not samples, are what is independent:
all rides weigh the same, and ρ is the one with the highest likelihood of each ride under the s of the others. κ widens
the interval of 90 % of a normal distribution to that of Student's with as many degrees of freedom as there are rides,
since a variance of few rides is known badly, and further until 90 % of the errors lie inside in nine of ten groups of
twelve other rides: each ride under the covariance of the others, less 1.28 standard deviations of a group's mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.stats import norm, t

if TYPE_CHECKING:
    from .data import SequenceData
    from .head import AngleHead

POWER = 2
"""of the unlikeness in the variance"""
SHARES = np.linspace(0.0, 0.9, 19)
"""ρ that are tried"""
INSIDE = 0.95
"""quantile at the upper end of an interval of 90 %"""
GROUP, CONFIDENCE = 12, 0.9
"""Rides of a test, such as the benchmark's, and the share of such tests in which 90 % of the errors lie inside."""
WIDER = np.geomspace(1.0, 9.0, 45)
"""factors on the variances that are tried; the last one, if none is wide enough"""


class Calibration(NamedTuple):
    """What the errors of held-out sequences say, for each of K angles.

    Attributes:
        deviations: ``(K,)`` rad; the variance is ``deviations² (1 + growth · u²)``.
        growth: ``(K,)``.
        rides: how many there are.
        nees: mean of an angle's squared error over its variance, each ride under the calibration of the others; NaN of
            one ride.
        coverage: share of the errors inside the stated 90 %, likewise.
        constant: ``(K,)`` rad: the deviations if they did not grow, to compare with.
    """

    deviations: tuple[float, ...]
    growth: tuple[float, ...]
    rides: int
    nees: float
    coverage: float
    constant: tuple[float, ...]


def calibrated(network: Any, head: AngleHead, data: SequenceData) -> tuple[AngleHead, Calibration]:
    """The head of a network with the covariance that its errors on sequences have.

    Args:
        network: whose last output is the unlikeness (:class:`.networks.unlikeness.WithUnlikeness`).
        head: what its other outputs mean.
        data: sequences that it was not trained on.

    Raises:
        ValueError: see :func:`calibrate`.
    """
    features = np.ascontiguousarray(np.moveaxis(data.features, 1, 0), dtype=float)
    due, start = np.ones(features.shape[:2]), np.zeros((len(data), network.memory_size))
    outputs = np.moveaxis(network.advance(features, due, start, np.zeros((len(data), network.outputs))), 0, 1)
    errors = np.asarray(head.errors(outputs, data.target, data.spread))
    found = calibrate(errors, outputs[..., -1], data.mask, data.names)
    return replace(head, deviations=found.deviations, growth=found.growth, power=POWER), found


def calibrate(errors: np.ndarray, unlikeness: np.ndarray, mask: np.ndarray, names: Sequence[str]) -> Calibration:
    """Find the covariance.

    Args:
        errors: ``(E, N, K)`` rad, of sequences.
        unlikeness: ``(E, N)`` of the network's inputs.
        mask: ``(E, N)`` which samples count.
        names: ``(E,)`` of the rides; sequences of one name count as one.

    Raises:
        ValueError: the mask is empty.
    """
    if not mask.any():
        raise ValueError("the covariance needs sequences that are scored, got none")
    rides, ride = np.unique(np.asarray(names)[mask.any(axis=1)], return_inverse=True)
    of_sample = np.repeat(ride, mask[mask.any(axis=1)].sum(axis=1))
    squares, grows = errors[mask].astype(float) ** 2, unlikeness[mask].astype(float) ** POWER
    found = likeliest(squares, grows, of_sample, SHARES if len(rides) > 1 else SHARES[:1])
    return found._replace(constant=likeliest(squares, grows, of_sample, SHARES[:1]).deviations)


def likeliest(squares: np.ndarray, grows: np.ndarray, of_sample: np.ndarray, shares: np.ndarray) -> Calibration:
    """The covariance with the best of some ρ.

    Args:
        squares: ``(M, K)`` rad², of the errors of all samples.
        grows: ``(M,)`` what the variance grows with.
        of_sample: ``(M,)`` number of the ride of each.
        shares: ρ that are tried.
    """
    number = np.bincount(of_sample)
    count = len(number)

    def means(values: np.ndarray) -> np.ndarray:
        """Of each ride."""
        return np.bincount(of_sample, values, minlength=count) / number

    deviations, growth, normalised = [], [], np.empty_like(squares)
    for k in range(squares.shape[1]):
        best, share = np.inf, 0.0
        for rho in shares:
            profile = 1.0 - rho + rho * grows
            each, logs = means(squares[:, k] / profile), means(np.log(profile))
            others = np.maximum(left_out(each), np.finfo(float).tiny)
            cost = float(np.mean(np.log(others) + logs + each / others))
            if cost < best:
                best, share = cost, float(rho)
        profile = 1.0 - share + share * grows
        each = np.maximum(means(squares[:, k] / profile), np.finfo(float).tiny)
        deviations.append(float(np.sqrt(each.mean() * (1.0 - share))))
        growth.append(share / (1.0 - share))
        normalised[:, k] = squares[:, k] / (left_out(each)[of_sample] * profile)

    def covered(widened: float) -> np.ndarray:
        """Share of the errors of each ride that lie inside."""
        inside = normalised < widened * norm.ppf(INSIDE) ** 2
        return np.asarray(np.mean([means(column) for column in inside.T], axis=0))

    widened = (t.ppf(INSIDE, count) / norm.ppf(INSIDE)) ** 2
    nees = coverage = float("nan")
    if count > 1:
        doubt = norm.ppf(CONFIDENCE) * np.sqrt(1.0 / (count - 1) + 1.0 / GROUP)
        each_wider = [covered(widened * wider) for wider in WIDER]
        enough = [inside.mean() - doubt * inside.std() >= 2.0 * INSIDE - 1.0 for inside in each_wider]
        chosen = enough.index(True) if any(enough) else len(WIDER) - 1
        widened, coverage = widened * WIDER[chosen], float(each_wider[chosen].mean())
        nees = float(np.mean([means(column).mean() for column in normalised.T])) / widened
    wide = tuple(float(np.sqrt(widened)) * each for each in deviations)
    return Calibration(wide, tuple(growth), count, nees, coverage, wide)


def left_out(values: np.ndarray) -> np.ndarray:
    """Mean of all others, for each of the values ``(R,)``; the value itself where there is no other."""
    count = len(values)
    return (values.sum() - values) / (count - 1) if count > 1 else values
