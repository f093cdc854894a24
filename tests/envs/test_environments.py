"""One contract for every registered environment."""

import hashlib
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from poise.envs import list_environments, register_environments
from poise.envs.hand.environment import HandMotionEnv
from poise.envs.registration import VECTOR_ENTRY_POINTS, accepted_arguments

IDS = list_environments()
ROLLOUT = """
import hashlib, sys
import gymnasium as gym
import numpy as np
import poise

def feed(digest, value):
    if isinstance(value, dict):
        for key in sorted(value):
            digest.update(key.encode())
            feed(digest, value[key])
    else:
        digest.update(np.ascontiguousarray(value).tobytes())

# a reset of this environment simulates the whole ride
OPTIONS = {"poise/RiderBicycleGain-v0": {"duration": 3.0}}

def digest_of(identity, seed, steps=120, episodes=2):
    digest = hashlib.sha256()
    env = gym.make(identity, **OPTIONS.get(identity, {}))
    env.action_space.seed(0)
    for episode in range(episodes):
        observation, info = env.reset(seed=seed if episode == 0 else None)
        feed(digest, observation), feed(digest, info)
        for _ in range(steps):
            observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
            feed(digest, observation), feed(digest, info), feed(digest, np.float64(reward))
            if terminated or truncated:
                break
    env.close()
    return digest.hexdigest()
"""
NAMESPACE: dict = {}
exec(compile(ROLLOUT, "rollout", "exec"), NAMESPACE)
digest_of, OPTIONS = NAMESPACE["digest_of"], NAMESPACE["OPTIONS"]


def make(identity, **options):
    return gym.make(identity, **OPTIONS.get(identity, {}), **options)


@pytest.fixture(params=IDS)
def identity(request):
    return request.param


def structure(value):
    if isinstance(value, dict):
        return {key: structure(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype
    return type(value)


def test_make_by_module_prefix(identity):
    gym.make(f"poise:{identity}").close()


@pytest.mark.parametrize("together", [False, True])
def test_an_unknown_argument_is_named_with_the_nearest_one_and_all(identity, together):
    def make_one(**options):
        if not together:
            return gym.make(identity, **options)
        mode = "vector_entry_point" if identity in VECTOR_ENTRY_POINTS else "sync"
        return gym.make_vec(identity, num_envs=2, vectorization_mode=mode, **options)

    known = accepted_arguments(identity)
    for wrong in (known[0] + "z", "render_mod"):
        with pytest.raises(
            TypeError, match=f"{identity}: unexpected keyword argument '{wrong}', did you mean '{wrong[:-1]}"
        ) as at:
            make_one(**{wrong: None})
        assert all(name in str(at.value) for name in known)
    if together and identity in VECTOR_ENTRY_POINTS:
        with pytest.raises(TypeError, match="did you mean 'autoreset_mode'"):
            make_one(autoreset_mod="SameStep")


def test_a_class_of_ones_own_has_its_own_arguments():
    class Mine(HandMotionEnv):
        def __init__(self, **options):
            self.mine = options.pop("mine")
            super().__init__(**options)

    with Mine(mine=3, gesture="slow") as env:
        assert env.mine == 3


def test_registering_twice_is_harmless():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        register_environments()


def test_importing_loads_no_engine():
    code = (
        "import sys, poise; print([name for name in ('pybullet', 'torch', 'stable_baselines3') if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


def test_checkers_have_nothing_to_say(identity):
    env = make(identity)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
        check_env_sb3(env.unwrapped, warn=True)
    env.close()


def test_info_has_one_structure_of_floats_and_arrays(identity):
    env = make(identity)
    _, info = env.reset(seed=0)
    first = structure(info)
    assert {"time", "pose", "truth"} <= first.keys()
    for _ in range(60):
        *_, truncated, info = env.step(env.action_space.sample())
        assert structure(info) == first
        if truncated:
            break
    env.close()


def test_observations_stay_in_the_space_and_are_not_shared(identity):
    env = make(identity)
    observation, info = env.reset(seed=0)
    kept = [(observation, info)]
    copies = [repr((observation, info))]
    for _ in range(30):
        observation, _, _, _, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        kept.append((observation, info))
        copies.append(repr((observation, info)))
    assert [repr(item) for item in kept] == copies
    env.close()


@pytest.fixture(scope="module")
def elsewhere():
    """What another process prints: a line with the digest of each environment, and PyBullet's greetings."""
    code = ROLLOUT + f"\nfor identity in {IDS}:\n    print(identity, digest_of(identity, 3))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_equal_seeds_give_equal_rollouts_in_two_processes_and_others_differ(identity, elsewhere):
    here = digest_of(identity, 3)
    assert f"{identity} {here}" in elsewhere
    assert len(here) == len(hashlib.sha256().hexdigest())
    if "Replay" not in identity:
        assert digest_of(identity, 4) != here


def test_reseeding_repeats_and_continuing_does_not(identity):
    env = make(identity)
    first, _ = env.reset(seed=1)
    next_one, next_info = env.reset()
    again, _ = env.reset(seed=1)
    next_again, _ = env.reset()
    for name in env.observation_space if isinstance(env.observation_space, gym.spaces.Dict) else ():
        np.testing.assert_array_equal(first[name], again[name])
        np.testing.assert_array_equal(next_one[name], next_again[name])
    assert np.isfinite(next_info["time"])
    env.close()


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors(identity, mode):
    envs = gym.make_vec(identity, num_envs=2, vectorization_mode=mode, **OPTIONS.get(identity, {}))
    try:
        observation, _ = envs.reset(seed=[0, 1])
        assert envs.observation_space.contains(observation)
        for _ in range(20):
            observation, reward, terminated, truncated, _ = envs.step(envs.action_space.sample())
        assert reward.shape == terminated.shape == truncated.shape == (2,)
    finally:
        envs.close()


def test_closing_twice_is_harmless(identity):
    env = make(identity)
    env.reset(seed=0)
    env.close()
    env.unwrapped.close()


@pytest.mark.parametrize("identity", ["poise/HandMotion-v0", "poise/Replay-v0"])
def test_pictures_show_the_device_and_do_not_change_the_episode(identity):
    env, silent = make(identity, render_mode="rgb_array"), make(identity)
    env.reset(seed=0)
    silent.reset(seed=0)
    action = np.array([0.7, 0.1, 0.7, 0.0], np.float32)
    for _ in range(120):
        seen, unseen = env.step(action), silent.step(action)
    first = env.render()
    assert first.dtype == np.uint8
    assert first.ndim == 3
    assert first.shape[2] == 3
    height, width, _ = first.shape
    middle = first[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4].astype(int)
    assert (middle.sum(axis=2) < 350).mean() > 0.02
    colourful = np.ptp(middle, axis=2) > 60
    assert colourful.mean() > 0.002
    env.step(np.array([0.1, 0.9, 0.0, 0.4], np.float32))
    silent.step(np.array([0.1, 0.9, 0.0, 0.4], np.float32))
    assert (env.render() != first).any()
    for name in seen[0]:
        np.testing.assert_array_equal(seen[0][name], unseen[0][name])
    env.close()
    silent.close()
