"""A thousand resets take no more memory than the caches of the first ones."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv

STATM = Path("/proc/self/statm")


def resident() -> float:
    """Memory of this process, MB."""
    return int(STATM.read_text().split()[1]) * 4096 / 1e6


@pytest.mark.slow
@pytest.mark.skipif(not STATM.exists(), reason="reads the memory from /proc")
def test_memory_stays_flat_over_a_thousand_resets():
    """Another person and another motion in turn, each of them ridden and saved."""
    env = RiderBicycleEnv("outdoor+bumps", "random", fidelity="lumped", duration=2.0)
    sizes = []
    for reset in range(1000):
        env.reset(seed=reset, options={} if reset % 2 else {"subject": 0})
        env.step(env.neutral_action)
        env.snapshot()
        if reset % 100 == 99:
            gc.collect()
            sizes.append(resident())
    env.close()
    # tables of the pilot's gains are kept for a thousand speeds of people
    assert max(sizes) - sizes[1] < 60.0
    assert sizes[-1] - sizes[-3] < 8.0
