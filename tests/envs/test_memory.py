"""A thousand resets take no more memory than the caches of the first ones."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import pytest

from poise.envs.base import PoseEnv
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.hand.environment import HandMotionEnv

STATM = Path("/proc/self/statm")
pytestmark = pytest.mark.skipif(not STATM.exists(), reason="reads the memory from /proc")


def resident() -> float:
    """Memory of this process, MB."""
    return int(STATM.read_text().split()[1]) * 4096 / 1e6


def sizes(env: PoseEnv, options: tuple[dict[str, Any], ...]) -> list[float]:
    """Memory after every hundred of a thousand resets with the options in turn, each of them stepped and saved."""
    found = []
    for reset in range(1000):
        env.reset(seed=reset, options=options[reset % len(options)])
        env.step(env.neutral_action)
        env.snapshot()
        if reset % 100 == 99:
            gc.collect()
            found.append(resident())
    env.close()
    return found


@pytest.mark.slow
@pytest.mark.parametrize("drive", ["kinematic", "dynamic"])
def test_memory_stays_flat_over_a_thousand_hand_motions(drive):
    found = sizes(HandMotionEnv(drive=drive, duration=2.0), ({}, {"gesture": "severe"}))
    assert max(found) - found[1] < 8.0


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", ["lumped", "full"])
def test_memory_stays_flat_over_a_thousand_rides(fidelity):
    """Another person and another motion in turn."""
    env = RiderBicycleEnv("outdoor+bumps", "random", fidelity=fidelity, duration=2.0)
    found = sizes(env, ({"subject": 0}, {}))
    # tables of the pilot's gains are kept for a thousand speeds of people
    assert max(found) - found[1] < 60.0
    assert found[-1] - found[-3] < 8.0
