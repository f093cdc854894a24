"""Vector environments that compute their episodes together equal single environments, step by step."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter

HAND, REPLAY, PARTS = "poise/HandMotionGain-v0", "poise/Replay-v0", "poise/ReplayGain-v0"
RIDER = "poise/RiderBicycleGain-v0"
SHORT = {"duration": 1.0, "gesture": ("slow", "fast")}
CASES = {
    "two rates": (HAND, {**SHORT, "rate": (50.0, 100.0), "consistency": 0.1}),
    "relative": (HAND, {**SHORT, "filter": "bounded-motion", "reward": "relative", "motions": 3}),
    "privileged": (HAND, {**SHORT, "reference": (0.1,), "privileged": True, "reward": "improvement"}),
    "two angles": (HAND, {**SHORT, "filter": "bounded-motion", "quantity": ("up", "relative_orientation")}),
    "recordings": (PARTS, {"duration": 1.0}),
    "replay": (REPLAY, {"duration": 0.15, "random_start": True}),
    "rides": (RIDER, {"duration": 1.0, "rides": 2}),
    "riders": (RIDER, {"duration": 1.0, "rides": 2, "filter": "two-gyro", "gains": ("process",)}),
}


def assert_same(ours, theirs, path=""):
    """Equal bit by bit, but for rewards of replay, which are equal to rounding."""
    if isinstance(theirs, dict):
        assert set(ours) == set(theirs), path
        for name in theirs:
            assert_same(ours[name], theirs[name], f"{path}/{name}")
    elif theirs.dtype == object:
        for mine, other in zip(ours, theirs, strict=True):
            assert (mine is None) == (other is None)
            if other is not None:
                assert_same(mine, other, path)
    else:
        assert (ours.shape, ours.dtype) == (theirs.shape, theirs.dtype), path
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 if path == "reward" else 0.0, err_msg=path)


def native(identity, count=3, **options):
    return gym.make_vec(identity, count, vectorization_mode="vector_entry_point", **options)


def played(env, steps, seed=0):
    """What some steps return."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(steps):
        found.append(env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)))
    return found


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("case", CASES)
def test_it_equals_single_environments(case, mode):
    identity, options = CASES[case]
    mode = AutoresetMode(mode)
    theirs = gym.make_vec(identity, 3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **options)
    ours = native(identity, autoreset_mode=mode, **options)
    assert ours.metadata["autoreset_mode"] == mode
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    for name, mine, other in zip(("observation", "info"), ours.reset(seed=3), theirs.reset(seed=3), strict=True):
        assert_same(mine, other, name)
    names, ends = ("observation", "reward", "terminated", "truncated", "info"), 0
    for mine, other in zip(played(ours, 25), played(theirs, 25), strict=True):
        for name, one, two in zip(names, mine, other, strict=True):
            assert_same(one, two, name)
        assert ours.observation_space.contains(mine[0])
        ends += mine[3].sum()
    assert ends >= 3
    ours.close()
    theirs.close()


@pytest.mark.parametrize("identity", [HAND, REPLAY, PARTS])
def test_it_is_what_gymnasium_makes_by_default(identity):
    env = gym.make_vec(identity, num_envs=2)
    assert type(env).__module__.startswith("poise.envs")
    observation, _ = env.reset(seed=[4, None])
    assert env.observation_space.contains(observation)
    assert env.np_random_seed[0] == 4
    env.close()


def test_rows_are_reset_one_by_one():
    env = native(HAND, autoreset_mode="Disabled", **SHORT)
    env.reset(seed=0)
    played(env, 10)
    with pytest.raises(RuntimeError, match=r"rows \[0, 1, 2\] are over"):
        env.step(np.zeros((3, 1)))
    mask = np.array([True, False, True])
    _, info = env.reset(seed=[7, None, 8], options={"reset_mask": mask})
    np.testing.assert_array_equal(info["_time"], mask)
    assert info["time"][1] == 0.0
    env.reset(options={"reset_mask": ~mask})
    np.testing.assert_array_equal(env.step(np.zeros((3, 1)))[4]["time"], [0.09, 0.09, 0.09])


def test_equal_seeds_repeat_and_others_do_not():
    env = native(HAND, **SHORT)
    first = [env.reset(seed=seed)[1]["truth"]["up"] for seed in (1, 1, 2)]
    np.testing.assert_array_equal(first[0], first[1])
    assert not np.array_equal(first[0], first[2])
    # the seeds of the rows count on
    np.testing.assert_array_equal(first[0][1:], first[2][:-1])
    for wrong in (1.5, "123", [1, 2], {3}):
        with pytest.raises(ValueError, match="seed must be an integer, None or 3 of them, got"):
            env.reset(seed=wrong)


@pytest.mark.parametrize("clone", [lambda env: pickle.loads(pickle.dumps(env)), copy.deepcopy])
def test_copies_continue_with_the_same_numbers(clone):
    env = native(HAND, **SHORT, rate=(50.0, 100.0), motions=4)
    env.reset(seed=0)
    played(env, 7)
    twin = clone(env)
    for one, two in zip(played(env, 12), played(twin, 12), strict=True):
        assert_same(one[4], two[4])
        np.testing.assert_array_equal(one[0], two[0])
        np.testing.assert_array_equal(one[1], two[1])


def test_the_first_episodes_end_at_different_times_where_that_is_wanted():
    ends = [played_ends(native(HAND, 8, staggered=staggered, **SHORT)) for staggered in (False, True)]
    assert ends[0] == {10}
    assert len(ends[1]) > 3


def played_ends(env):
    env.reset(seed=0)
    return {step + 1 for step, found in enumerate(played(env, 10)) if found[3].any()}


def test_filters_that_are_not_compiled_give_the_same_numbers():
    from dataclasses import replace

    kalman = replace(tunable_filter("bounded-motion"), compiled=False)
    trajectories = HandTrajectories(duration=0.3).draw_many(0, 2)
    slow, fast = (
        native(PARTS, 2, trajectory=trajectories, filter=filter) for filter in (kalman, replace(kalman, compiled=True))
    )
    slow.reset(seed=0)
    fast.reset(seed=0)
    for one, two in zip(played(slow, 3), played(fast, 3), strict=True):
        np.testing.assert_allclose(one[0], two[0], atol=1e-6)
        np.testing.assert_allclose(one[1], two[1], atol=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"autoreset_mode": "Never"}, "autoreset_mode must be one of"),
        ({"render_mode": "rgb_array"}, "to draw, use vectorization_mode='sync'"),
        ({"reference": (2.0,)}, r"reference must hold 1 numbers in \[-1, 1\]"),
        ({"motions": 0}, "motions must be None or at least 1"),
        ({"reward": "best"}, "reward must be one of"),
        ({"error_scale": 0.0}, "error_scale must be positive"),
        ({"quantity": ("up", "up")}, "each once"),
    ],
)
def test_wrong_arguments_are_explained(options, words):
    with pytest.raises(ValueError, match=words):
        native(HAND, 2, **options)


def test_wrong_calls_are_explained():
    env = native(HAND, **SHORT)
    with pytest.raises(RuntimeError, match="call reset first"):
        env.step(np.zeros((3, 1)))
    with pytest.raises(ValueError, match="an integer, None or 3 of them, got"):
        env.reset(seed=[1, 2])
    with pytest.raises(ValueError, match="every row at the first reset"):
        env.reset(options={"reset_mask": np.array([True, False, False])})
    with pytest.raises(ValueError, match="unknown reset options"):
        env.reset(options={"speed": 3})
    env.reset()
    with pytest.raises(ValueError, match=r"shape \(3, 1\), got \(3,\)"):
        env.step(np.zeros(3))
    with pytest.raises(ValueError, match=r"those of the rows \[1\] are not"):
        env.step(np.array([[0.0], [np.nan], [0.0]]))
