"""The core of the package without what extras bring; ``.ci/core`` checks the same in environments of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parent


def test_the_core_works_without_the_packages_of_extras() -> None:
    done = subprocess.run([sys.executable, TESTS / "core_only.py", "--block"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith("the core works alone")


def test_asking_for_help_is_light() -> None:
    code = "import sys; from poise.scripts.main import main; main(['--help']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[0] for name in done.stdout.splitlines()[-1].split()}
    assert loaded & {"tyro", "rich", "scipy", "pandas", "matplotlib", "numba", "h5py", "joblib", "tqdm"} == set()
