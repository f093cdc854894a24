"""Aggregate statistics of agents over a few training runs and many tasks, with intervals.

R. Agarwal, M. Schwarzer, P. S. Castro, A. Courville, M. G. Bellemare, "Deep Reinforcement Learning at the Edge of the
Statistical Precipice", NeurIPS 2021. The definitions are those of its package ``rliable``, which draws from NumPy's
global generator and so does not repeat its intervals; these do. Scores are arrays ``(runs, tasks)``, the larger the
better: a run is a training with its own seed, a task for example a test trajectory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

DRAWS = 2000
"""bootstrap draws of an interval"""
LEVEL = 0.95
"""probability that an interval covers"""


class Interval(NamedTuple):
    """A statistic and the percentile interval of its bootstrap."""

    value: float
    low: float
    high: float


def scores_of(scores: np.ndarray | Sequence[Sequence[float]], name: str = "scores") -> np.ndarray:
    """Scores as an array ``(runs, tasks)``.

    Raises:
        ValueError: it has another number of axes, is empty, or holds numbers that are not finite.
    """
    table = np.asarray(scores, dtype=float)
    if table.ndim != 2 or not table.size:
        raise ValueError(f"{name} must have the shape (runs, tasks) and hold something, got shape {table.shape}")
    if not np.isfinite(table).all():
        raise ValueError(f"{name} must be finite, {int((~np.isfinite(table)).sum())} of {table.size} are not")
    return table


def interquartile_mean(scores: np.ndarray) -> float:
    """Mean of the middle half of all scores, runs and tasks together."""
    from scipy.stats import trim_mean

    return float(trim_mean(scores_of(scores), proportiontocut=0.25, axis=None))


def mean_score(scores: np.ndarray) -> float:
    """Mean over runs and tasks."""
    return float(scores_of(scores).mean())


def probability_of_improvement(scores: np.ndarray, others: np.ndarray) -> float:
    """Probability that a run of the first agent has a larger score than one of the second, mean over tasks; ties half.

    Scores are ``(runs, tasks)``, on the same tasks.

    Raises:
        ValueError: they have not the same number of tasks.
    """
    first, second = scores_of(scores), scores_of(others, "others")
    if first.shape[1] != second.shape[1]:
        raise ValueError(f"others must have the {first.shape[1]} tasks of scores, got {second.shape[1]}")
    return float((0.5 + 0.5 * np.sign(first[:, None] - second[None])).mean())


def performance_profile(scores: np.ndarray, thresholds: np.ndarray | Sequence[float]) -> np.ndarray:
    """Share ``(n,)`` of runs and tasks whose score is larger than each of ``thresholds`` ``(n,)``."""
    return (scores_of(scores).ravel() > np.asarray(thresholds, dtype=float)[:, None]).mean(axis=1)


def bootstrap_interval(
    statistic: Callable[..., float],
    *scores: np.ndarray,
    seed: int = 0,
    draws: int = DRAWS,
    level: float = LEVEL,
    tasks_too: bool = False,
) -> Interval:
    """A statistic with its stratified bootstrap interval: of every task the runs are drawn anew, with replacement.

    Args:
        statistic: of one array of scores, or of several.
        scores: ``(runs, tasks)`` each; drawn independently of each other.
        seed: of the draws.
        draws: how many.
        level: probability that the interval covers.
        tasks_too: whether the tasks are drawn too, the same for all arrays: what other trajectories would have shown.
            Without, the interval covers other training seeds.

    Raises:
        ValueError: ``draws`` or ``level`` is out of its range.
    """
    if draws < 1 or not 0.0 < level < 1.0:
        raise ValueError(f"draws must be at least 1 and level lie in (0, 1), got {draws} and {level}")
    tables = [scores_of(table) for table in scores]
    generator, values = np.random.default_rng(seed), np.empty(draws)
    columns = np.arange(tables[0].shape[1])
    for draw in range(draws):
        drawn = generator.integers(len(columns), size=len(columns)) if tasks_too else columns
        rows = [generator.integers(len(table), size=(len(table), len(columns))) for table in tables]
        values[draw] = statistic(*(table[row, drawn] for table, row in zip(tables, rows, strict=True)))
    low, high = np.quantile(values, [0.5 - 0.5 * level, 0.5 + 0.5 * level])
    return Interval(float(statistic(*tables)), float(low), float(high))


def mean_interval(values: np.ndarray, draws: int = DRAWS) -> Interval:
    """The mean of ``values`` ``(tasks,)`` with the interval of other tasks.

    The same numbers as of :func:`bootstrap_interval` of :func:`mean_score` of one run with ``tasks_too``, all at once.
    """
    (table,) = scores_of(values[None])
    drawn = np.random.default_rng(0).integers(len(table), size=(draws, len(table)))
    low, high = np.quantile(table[drawn].mean(axis=1), [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return Interval(float(table.mean()), float(low), float(high))
