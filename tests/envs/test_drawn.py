"""Every environment: pictures for stable-baselines3, copies and pickles, options that are refused."""

from __future__ import annotations

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from poise.envs import list_environments
from poise.envs.hand.environment import HandMotionEnv
from poise.envs.physics.world import Physics
from poise.envs.record import record
from poise.envs.registration import make_environment

SHORT = {
    "poise/RiderBicycle-v0": {"duration": 2.0},
    "poise/RiderBicycleGain-v0": {"duration": 2.0, "scenario": ("slalom", "slow")},
}
"""Arguments that keep a reset cheap."""


@pytest.fixture(params=list_environments())
def identity(request):
    return request.param


def same(one, other):
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[name], other[name]) for name in one)
    return np.array_equal(one, other, equal_nan=True)


def neutral_steps(env, count):
    action = env.unwrapped.neutral_action
    return [env.step(action) for _ in range(count)]


def assert_equal_steps(one, other):
    for first, second in zip(one, other, strict=True):
        assert first[1:4] == second[1:4]
        assert same(first[0], second[0])
        assert same(first[4], second[4])


def test_stable_baselines3_makes_draws_and_trains_it(identity):
    envs = make_vec_env(identity, seed=0, env_kwargs=SHORT.get(identity))
    envs.reset()
    picture = envs.render()
    assert picture.shape == (360, 480, 3)
    assert picture.dtype == np.uint8
    # something dark and something coloured stands in the middle of it
    middle = picture[90:270, 120:360].astype(int)
    assert (middle.sum(axis=2) < 400).mean() > 0.005
    assert (np.ptp(middle, axis=2) > 60).mean() > 0.002
    policy = "MlpPolicy" if isinstance(envs.observation_space, gym.spaces.Box) else "MultiInputPolicy"
    envs.close()
    model = PPO(policy, identity, n_steps=4, batch_size=4, n_epochs=1, device="cpu")
    if identity != "poise/RiderBicycleGain-v0":
        # there a reset rides for 20 s
        model.learn(4)
    model.env.close()


def test_copies_and_pickles_continue_alone(identity):
    env = gym.make(identity, render_mode="rgb_array", **SHORT.get(identity, {}))
    env.reset(seed=4)
    neutral_steps(env, 5)
    copied, stored = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    # an independent one: steps of the original do not move it
    ahead = neutral_steps(env, 6)
    picture = env.render()
    env.close()
    assert_equal_steps(neutral_steps(copied, 6), ahead)
    np.testing.assert_array_equal(copied.render(), picture)
    copied.close()
    assert_equal_steps(neutral_steps(stored, 6), ahead)
    assert same(stored.reset()[0], copied.reset()[0])
    stored.close()
    copied.close()


def test_a_copy_before_the_first_episode_draws_the_same_ones():
    env = HandMotionEnv("fast", "kinematic", duration=1.0)
    env.reset(seed=3)
    env.close()
    fresh = HandMotionEnv("fast", "kinematic", duration=1.0)
    _ = fresh.np_random
    other = copy.copy(fresh)
    assert same(fresh.reset()[0], other.reset()[0])
    assert same(fresh.reset()[1], other.reset()[1])


def test_a_filter_of_rides_on_a_recorded_ride_is_drawn():
    """A trajectory that knows orientations of bodies only, not that of a sensor."""
    ride = make_environment("poise/RiderBicycle-v0", suite="two-gyro", fidelity="lumped", duration=1.0)
    recorded = record(ride, seed=0)
    ride.close()
    env = gym.make("poise/ReplayGain-v0", trajectory=recorded, filter="two-gyro", render_mode="rgb_array")
    env.reset(seed=0)
    neutral_steps(env, 2)
    first = env.render()
    assert (np.ptp(first.astype(int), axis=2) > 60).mean() > 0.002
    env.close()


def test_a_world_is_not_copied():
    with Physics() as world:
        for duplicate in (copy.deepcopy, pickle.dumps):
            with pytest.raises(TypeError, match=r"a PyBullet world can neither be copied nor pickled; copy or pickle"):
                duplicate(world)


def test_unknown_reset_options_are_refused(identity):
    env = gym.make(identity, **SHORT.get(identity, {}))
    known = env.unwrapped.reset_options
    with pytest.raises(
        ValueError, match=r"unknown reset options \['mood'\]; (known are|this environment has none)"
    ) as caught:
        env.reset(seed=0, options={"mood": "good"})
    for name in known:
        assert repr(name) in str(caught.value)
    for options in ("mood", ["mood"], 3):
        with pytest.raises(ValueError, match="options must be a mapping from name to value"):
            env.reset(seed=0, options=options)
    env.close()


@pytest.mark.parametrize(
    ("argument", "accepted"), [("duration", "a finite number"), ("render_mode", r"of type str or None|\['human'")]
)
def test_a_wrong_type_is_refused_by_the_name_of_its_argument(identity, argument, accepted):
    cls = type(gym.make(identity, **SHORT.get(identity, {})).unwrapped)
    with pytest.raises(ValueError, match=f"{argument} must be .*{accepted}"):
        cls(**{argument: {}})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"foo": 1}, r"^poise/Replay-v0: unexpected keyword argument 'foo' \(arguments: .*render_mode\)$"),
        ({"duration": "long"}, "duration must be a finite number .* or None, got 'long'"),
        ({"duration": True}, "duration must be a finite number .* or None, got True"),
        ({"trajectory": 3}, "trajectory must be of type Trajectory .*, got 3"),
        ({"random_start": "yes"}, "random_start must be True or False, got 'yes'"),
    ],
)
def test_wrong_arguments_are_a_value_error_that_names_the_right_ones(options, message):
    with pytest.raises(ValueError, match=message):
        make_environment("poise/Replay-v0", **options)


def test_arguments_of_the_base_are_known():
    with pytest.raises(ValueError, match=r"unexpected keyword argument 'foo' \(arguments: .*gesture.*consistency"):
        make_environment("poise/HandMotionGain-v0", foo=1)
    with pytest.raises(ValueError, match="Environment `Nothing` doesn't exist"):
        make_environment("poise/Nothing-v0")


@pytest.mark.parametrize("wrong", ["a", None, np.nan, 1j, [[0.0, 0.0]]])
def test_an_action_that_is_no_finite_number_is_refused_by_name(identity, wrong):
    env = gym.make(identity, **SHORT.get(identity, {}))
    env.reset(seed=0)
    action = env.unwrapped.neutral_action
    entries = action.astype(object)
    entries[0] = wrong
    given = [wrong, entries] if not isinstance(wrong, complex) else [action * wrong]
    for each in given:
        with pytest.raises(ValueError, match=f"action must hold {action.size} finite numbers, got"):
            env.step(each)
    env.close()
