"""Jobs spread over processes of this machine, or over the workers of a cluster."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from poise.envs.data.trajectory import load_trajectory
from poise.filters.support.parallel import BACKENDS, in_parallel, on_backend, progress_bar
from poise.scripts.main import main

JOBS = [(2, power) for power in range(5)]


@pytest.mark.parametrize("processes", [1, 2])
def test_every_job_gives_its_result(processes: int) -> None:
    assert sorted(in_parallel(pow, JOBS, processes)) == [1, 2, 4, 8, 16]


def test_a_count_of_processes_is_positive() -> None:
    with pytest.raises(ValueError, match="processes must be at least 1, got 0"):
        list(in_parallel(pow, JOBS, 0))


def test_unknown_backend() -> None:
    with pytest.raises(ValueError, match=r"unknown backend 'slurm'.*loky, dask, ray"), on_backend("slurm"):
        pass


@pytest.mark.parametrize("words", [["--backend"], ["--backend=lokky"], ["--backend", "lokky"]])
def test_command_line_names_backends(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", *words]) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in BACKENDS)


@pytest.mark.parametrize("backend", ["dask", pytest.param("ray", marks=pytest.mark.slow)])
def test_recordings_do_not_depend_on_the_backend(backend: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A local cluster of two workers records the same episodes, bit for bit."""
    pytest.importorskip({"dask": "distributed"}.get(backend, backend))
    monkeypatch.delenv("DASK_SCHEDULER_ADDRESS", raising=False)
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    words = ["record", "hand-motion", "--episodes", "3", "--options", "duration=1.0", "--folder"]
    assert main([*words, str(tmp_path / "serial"), "--processes", "1"]) == 0
    assert main([*words, str(tmp_path / backend), "--processes", "2", "--backend", backend]) == 0
    files = sorted(path.name for path in (tmp_path / "serial").glob("*.h5"))
    assert len(files) == 3
    for name in files:
        serial, spread = (load_trajectory(tmp_path / folder / name) for folder in ("serial", backend))
        for channel, values in serial.measurements.items():
            np.testing.assert_array_equal(values, spread.measurements[channel])
        for quantity, values in serial.truth.items():
            np.testing.assert_array_equal(values, spread.truth[quantity])


def test_a_bar_leaves_no_semaphore_behind() -> None:
    """Tqdm's own lock is one of the system, of which Python complains when a process is interrupted."""
    assert isinstance(progress_bar(1, "jobs", "job").get_lock(), type(threading.RLock()))


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
def test_workers_end_with_the_process_that_was_killed() -> None:
    """They hold its output, so that a reader would wait as long as they live."""
    script = """
import time
from poise.filters.support.parallel import in_parallel
assert len(list(in_parallel(abs, [(1,), (2,)], 2))) == 2
print("ready", flush=True)
list(in_parallel(time.sleep, [(60.0,), (60.0,)], 2))
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(2.0)
        process.kill()
        assert process.communicate(timeout=40.0)[0] == ""
