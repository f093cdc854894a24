"""Parallel processing and progress bars."""

from __future__ import annotations

import functools
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from .names import look_up
from .optional import extra

BACKENDS = ("loky", "dask", "ray")
"""Where jobs run: processes of this machine, the workers of a Dask scheduler, those of a Ray cluster."""


def processors() -> int:
    """Processors of this process's affinity mask, fewer if ``OMP_NUM_THREADS`` or ``NUMBA_NUM_THREADS`` is set."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        value = os.environ.get(name, "").split(",")[0].strip()
        if value.isdigit() and int(value) > 0:
            count = min(count, int(value))
    return count


def progress_bar(total: int | None, label: str, unit: str, *, show: bool = True) -> Any:
    """Return a bar on standard error (a context manager with ``update``), invisible where that is not a terminal."""
    return _bar()(total=total, desc=label, unit=unit, disable=None if show else True)


@functools.cache
def _bar() -> Any:
    """Progress bars with a lock of threads: that of tqdm is a semaphore, which an interrupted process leaves behind."""
    from tqdm import tqdm

    class Bar(tqdm):
        _lock = threading.RLock()

    return Bar


@contextmanager
def on_backend(name: str, processes: int = 2) -> Iterator[None]:
    """Jobs of :func:`in_parallel` run on joblib's backend of that name inside this context.

    ``dask`` and ``ray`` join the cluster of ``DASK_SCHEDULER_ADDRESS`` or ``RAY_ADDRESS``, and without one start
    workers on this machine. Results are those of a serial run: a job's seed belongs to the job, not to the worker.

    Args:
        name: one of :data:`BACKENDS`.
        processes: workers to start where no cluster is named.

    Raises:
        ValueError: the name is unknown.
        MissingExtraError: the packages of the extra ``cluster`` are not installed.
    """
    look_up("backend", name, dict.fromkeys(BACKENDS))
    if name == "loky":
        yield
        return
    import joblib

    with extra("cluster"):
        if name == "dask":
            from dask.distributed import Client

            # one thread a worker, since compiled filters have their own
            address = os.environ.get("DASK_SCHEDULER_ADDRESS")
            cluster: dict[str, Any] = {"n_workers": processes, "threads_per_worker": 1, "dashboard_address": None}
            with Client(address) if address else Client(**cluster), joblib.parallel_config("dask"):
                yield
        else:
            import ray
            from ray.util.joblib import register_ray

            register_ray()
            address = os.environ.get("RAY_ADDRESS")
            cluster = {"num_cpus": processes, "include_dashboard": False, "log_to_driver": False}
            ray.init(address=address) if address else ray.init(**cluster)
            try:
                with joblib.parallel_config("ray"):
                    yield
            finally:
                ray.shutdown()


def in_parallel(
    function: Callable[..., Any],
    jobs: Sequence[tuple[Any, ...]],
    processes: int = 1,
    *,
    label: str = "",
    unit: str = "job",
) -> Iterator[Any]:
    """Yield ``function(*job)`` of every job as soon as it is done, in any order; see :func:`on_backend` for where.

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
        from joblib.parallel import get_active_backend

        # joblib's backend for Ray hands over all results at the end
        at_once = not get_active_backend()[0].supports_return_generator
        pool = Parallel(n_jobs=min(processes, len(jobs)), return_as="list" if at_once else "generator_unordered")
        results = pool(delayed(_in_worker)(os.getpid(), function, *job) for job in jobs)
    with progress_bar(len(jobs), label, unit, show=bool(label and jobs)) as bar:
        for result in results:
            bar.update()
            yield result


def _in_worker(employer: int, function: Callable[..., Any], *job: Any) -> Any:
    """Do a job of another process; a worker that this process started ends with it."""
    _end_with(employer)
    return function(*job)


@functools.cache
def _end_with(employer: int) -> None:
    """End this process when its parent is killed: it would wait for ever for somebody to read its results."""
    if os.getppid() != employer:  # of a cluster
        return

    def watch() -> None:
        while os.getppid() == employer:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
