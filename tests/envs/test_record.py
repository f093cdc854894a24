"""Recording an episode a block at a time against recording it step by step."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.record import record
from poise.envs.registration import make_environment


@pytest.mark.parametrize(
    ("identity", "options"),
    [
        ("poise/RiderBicycle-v0", {"fidelity": "lumped", "duration": 1.3}),
        ("poise/HandMotion-v0", {"duration": 2.0}),
        ("poise/BicycleFixture-v0", {"duration": 2.0}),
        ("poise/Replay-v0", {"duration": 2.0}),
    ],
)
def test_blocks_and_steps_give_the_same_trajectory(identity, options):
    env = make_environment(identity, **options)
    neutral, seen = env.unwrapped.neutral_action, []

    def policy(observation):
        seen.append(observation)
        return neutral

    at_once, by_steps = record(env, seed=5), record(env, seed=5, policy=policy)
    assert len(seen) == len(at_once) - 1
    for part in ("measurements", "truth"):
        ours, theirs = getattr(at_once, part), getattr(by_steps, part)
        assert list(ours) == list(theirs)
        for name, values in ours.items():
            np.testing.assert_array_equal(values, theirs[name], err_msg=name)
    assert np.array_equal(at_once.time, by_steps.time)
    assert np.array_equal(at_once.mask, by_steps.mask)
    assert at_once.metadata == by_steps.metadata
    env.close()


def test_an_episode_played_to_its_end_is_over():
    env = make_environment("poise/HandMotion-v0", duration=1.0)
    with pytest.raises(RuntimeError, match="call reset first"):
        next(env.unwrapped.rest())
    env.reset(seed=1)
    env.step(env.unwrapped.neutral_action)
    rest = list(env.unwrapped.rest())
    assert sum(len(block.time) for block in rest) == round(env.unwrapped.rate)
    with pytest.raises(RuntimeError, match="it is over"):
        env.unwrapped.step(env.unwrapped.neutral_action)
    env.close()
