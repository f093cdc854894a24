"""Rates of whatever is repeated, and of an estimator in every form in which it runs."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...filters.core.estimator import Estimator, run, run_by_steps
from ...filters.core.kalman import KalmanFilter

REPEATS = 5


@dataclass(frozen=True)
class Speed:
    """One row: what was timed, how often a second it happens, and how often the yardstick does.

    Attributes:
        group: rows of one group are compared.
        what: what was timed.
        rate: times a second of CPU time (wall-clock for batches, which use several cores).
        unit: of the rate.
        ratio: rate divided by the rate of the group's yardstick; None for a latency.
    """

    group: str
    what: str
    rate: float
    unit: str
    ratio: float | None = None


def measure(work: Callable[[], Any], count: int, *, clock: Callable[[], float] = time.process_time) -> float:
    """Median rate of ``count`` things that ``work`` does, after one call that is not counted."""
    work()
    rates = []
    for _ in range(REPEATS):
        start = clock()
        work()
        rates.append(count / max(clock() - start, 1e-9))
    return statistics.median(rates)


def form_rates(
    estimator: Estimator[Any],
    sample: Callable[[int], Mapping[str, np.ndarray]],
    steps: int,
    long: int,
    short: int,
    wide: int,
    batches: Sequence[int],
) -> Iterator[tuple[str, float]]:
    """Name and updates a second of every form in which an estimator runs.

    Args:
        estimator: compiled, if it has that form.
        sample: gives so many samples.
        steps: samples of the compiled form step by step.
        long: samples of a whole sequence.
        short: samples of the slow form in arrays.
        wide: samples of a batch in the compiled form.
        batches: numbers of sequences that run at a time.
    """
    # the same without the compiled form; the estimator itself if it has none
    arrays = replace(estimator, compiled=False) if hasattr(estimator, "compiled") else estimator  # type: ignore[type-var]
    forms: list[tuple[str, Estimator[Any], Callable[..., Any], Mapping[str, np.ndarray], int]] = [
        ("step by step, arrays", arrays, run_by_steps, sample(short), 1)
    ]
    if arrays is not estimator:
        forms.append(("step by step, compiled", estimator, run_by_steps, sample(steps), 1))
        forms.append(("whole sequence, compiled", estimator, run, sample(long), 1))
        slim = estimator
        if isinstance(estimator, KalmanFilter):
            slim = replace(estimator, keep_covariance=False)
            forms.append(("whole sequence, compiled, no covariances", slim, run, sample(long), 1))
        forms += [(f"batch of {n}, compiled", slim, run, widened(sample(wide), n), n) for n in batches]
    forms += [(f"batch of {n}, arrays", arrays, run, widened(sample(short), n), n) for n in batches]
    for what, form, runner, data, width in forms:
        count = len(next(iter(data.values()))) * width
        # Batches use several cores.
        clock = time.process_time if width == 1 else time.perf_counter
        yield what, measure(partial(runner, form, data), count, clock=clock)


def widened(data: Mapping[str, np.ndarray], batch: int) -> dict[str, np.ndarray]:
    """The same sequence ``batch`` times, ``(T, batch, size)``."""
    return {
        name: np.ascontiguousarray(np.broadcast_to(array[:, None], (len(array), batch, array.shape[-1])))
        for name, array in data.items()
    }
