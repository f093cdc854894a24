"""Settings and fixtures of all tests."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest

# Before NumPy, numba or torch start their threads: tests run in parallel processes, one thread each.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ["MPLBACKEND"] = "Agg"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "recordings_folder" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.recordings)


def pytest_collection_finish() -> None:
    # What was imported stays: the collector of garbage need not look through it again and again.
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def recordings_folder() -> Path:
    """The folder of recorded data, named by the environment variable POISE_DATA."""
    name = os.environ.get("POISE_DATA")
    if not name:
        pytest.skip("needs recorded data: set POISE_DATA to its folder")
    folder = Path(name)
    assert folder.is_dir(), f"POISE_DATA names no folder: {folder}"
    return folder
