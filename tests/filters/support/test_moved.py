"""Modules under the names that they had in an earlier version."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from poise.filters.support.moved import MOVED


@pytest.mark.parametrize(("earlier", "now"), MOVED.items())
def test_a_moved_module_is_the_same_module(earlier: str, now: str) -> None:
    module = importlib.import_module(now)
    spec = module.__spec__
    sys.modules.pop(earlier, None)
    with pytest.warns(DeprecationWarning, match=f"{earlier} is now {now}"):
        assert importlib.import_module(earlier) is module
    assert module.__spec__ is spec
    assert module.__name__ == now


def test_users_see_their_own_line() -> None:
    code = "import poise\nfrom poise.filters import rotation\nfrom poise.filters.kalman import KalmanFilter\n"
    done = subprocess.run([sys.executable, "-W", "always", "-c", code], capture_output=True, text=True, check=True)
    assert "<string>:2: DeprecationWarning: poise.filters.rotation is now poise.filters.core.rotation" in done.stderr
    assert "<string>:3: DeprecationWarning: poise.filters.kalman" in done.stderr


def test_the_environment_of_the_hand_is_where_it_was() -> None:
    from poise.envs.hand import HandMotionEnv
    from poise.envs.hand.environment import HandMotionEnv as Same

    assert HandMotionEnv is Same
