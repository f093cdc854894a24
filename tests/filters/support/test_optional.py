"""Imports of what an extra brings."""

from __future__ import annotations

import subprocess
import sys

import pytest


def test_the_physics_engine_is_silent_when_imported() -> None:
    pytest.importorskip("pybullet")
    code = "import os, poise.envs.physics.world; os.write(2, b'still heard')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "still heard")
