"""The core of the package without what extras bring; ``.ci/core`` checks the same in environments of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent


def test_the_core_works_without_the_packages_of_extras() -> None:
    done = subprocess.run([sys.executable, TESTS / "core_only.py", "--block"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith("the core works alone")


def test_asking_for_help_is_light() -> None:
    code = "import sys; from poise.scripts.main import main; main(['--help']); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[0] for name in done.stdout.splitlines()[-1].split()}
    assert loaded & {"tyro", "rich", "scipy", "pandas", "matplotlib", "numba", "h5py", "joblib", "tqdm"} == set()


@pytest.mark.slow
def test_the_wheel_works_in_a_clean_environment(tmp_path: Path) -> None:
    pip = [sys.executable, "-m", "pip"]
    copy = tmp_path / "poise"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".venv", ".git", "build", "runs", "*.egg-info"))
    words = ["wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir", tmp_path]
    subprocess.run([*pip, *words, copy], check=True)
    (wheel,) = tmp_path.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "environment"], check=True)
    python = tmp_path / "environment" / "bin" / "python"
    words = ["install", "--quiet", "--disable-pip-version-check", "-c", ROOT / "constraints.txt", wheel]
    subprocess.run([python, "-m", "pip", *words], check=True)
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([python, TESTS / "core_only.py"], capture_output=True, text=True, env=clean)
    assert done.returncode == 0, done.stderr
