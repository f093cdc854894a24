"""Parallel processing and progress bars."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any


def processors() -> int:
    """Processors of this process's affinity mask, fewer if ``OMP_NUM_THREADS`` or ``NUMBA_NUM_THREADS`` says so."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        value = os.environ.get(name, "").split(",")[0].strip()
        if value.isdigit() and int(value) > 0:
            count = min(count, int(value))
    return count


def progress_bar(total: int | None, label: str, unit: str, *, show: bool = True) -> Any:
    """Return a bar on standard error (a context manager with ``update``), invisible where that is not a terminal."""
    from tqdm import tqdm

    return tqdm(total=total, desc=label, unit=unit, disable=None if show else True)


def in_parallel(
    function: Callable[..., Any],
    jobs: Sequence[tuple[Any, ...]],
    processes: int = 1,
    *,
    label: str = "",
    unit: str = "job",
) -> Iterator[Any]:
    """Yield ``function(*job)`` of every job as soon as it is done, in any order.

    Args:
        function: of a module, so that other processes find it.
        jobs: its arguments.
        processes: how many jobs run at a time; one process, or a single job, runs here.
        label: words before a progress bar; empty for none.
        unit: what the bar counts.

    Raises:
        ValueError: ``processes`` is not positive.
    """
    if processes < 1:
        raise ValueError(f"processes must be at least 1, got {processes}")
    results: Any
    if processes == 1 or len(jobs) < 2:
        results = (function(*job) for job in jobs)
    else:
        from joblib import Parallel, delayed

        pool = Parallel(n_jobs=min(processes, len(jobs)), return_as="generator_unordered")
        results = pool(delayed(function)(*job) for job in jobs)
    with progress_bar(len(jobs), label, unit, show=bool(label and jobs)) as bar:
        for result in results:
            bar.update()
            yield result
