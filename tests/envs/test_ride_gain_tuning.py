"""Gain tuning on rides: what is its own beyond the contract of all environments."""

import gymnasium as gym
import numpy as np
import pytest

import poise
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.sensors.single_imu import SITES, imu_of
from poise.envs.gain_tuning import ReplayGainEnv
from poise.envs.ride_gain_tuning import RiderBicycleGainEnv
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.core.kalman import KalmanFilter
from poise.filters.imu.bounded_motion import BoundedMotion


def rewards_of(env, seed=0):
    env.reset(seed=seed)
    rewards, over, info = [], False, None
    while not over:
        _, reward, terminated, truncated, info = env.step(np.full(env.action_space.shape, 0.3, np.float32))
        rewards.append(reward)
        over = terminated or truncated
    return rewards, info


@pytest.mark.parametrize("site", SITES)
@pytest.mark.parametrize("name", ["external-acceleration", "bounded-motion"])
def test_it_tunes_named_filters_at_both_sites(site, name):
    env = gym.make("poise/RiderBicycleGain-v0", filter=name, site=site, duration=1.0, reward="error")
    rewards, info = rewards_of(env)
    assert len(rewards) == 10
    assert np.isfinite(rewards).all()
    assert max(rewards) < 0.0
    assert {"orientation", "up", "gyroscope_bias", "accelerometer_bias", "position"} <= set(info["truth"])
    trajectory = env.unwrapped.trajectory
    assert set(trajectory.measurements) == {"imu/gyr", "imu/acc"}
    assert trajectory.metadata["site"] == site
    env.close()
    env.unwrapped.close()


def test_an_episode_is_a_recorded_ride():
    """The same seed of the ride gives the same trajectory, and replaying it gives the same rewards bit by bit."""
    env = RiderBicycleGainEnv(scenario="slow", subject=1, duration=1.0)
    rewards, _ = rewards_of(env, seed=4)
    trajectory = env.trajectory
    ride = RiderBicycleEnv("slow", 1, suite=["bicycle_imu/gyr", "bicycle_imu/acc"], fidelity="lumped", duration=1.0)
    again = imu_of(poise.record(ride, seed=trajectory.metadata["seed"]))
    for name, values in trajectory.measurements.items():
        np.testing.assert_array_equal(values, again.measurements[name])
    replayed, _ = rewards_of(ReplayGainEnv(again))
    assert replayed == rewards
    env.close()
    ride.close()


def test_riders_and_scenarios_follow_the_seed():
    options = {"scenario": ("slow", "indoor_circle"), "duration": 0.3}
    one, two = RiderBicycleGainEnv(**options), RiderBicycleGainEnv(**options)
    drawn = set()
    for seed in range(4):
        one.reset(seed=seed)
        two.reset(seed=seed)
        for name, values in one.trajectory.measurements.items():
            np.testing.assert_array_equal(values, two.trajectory.measurements[name])
        assert one._ridden == two._ridden
        drawn.add(one._ridden)
    assert {number for number, _ in drawn} == {0, 1}
    assert len(drawn) == 4
    one.close()
    two.close()


def test_a_filter_of_ones_own_and_the_full_rider():
    own = KalmanFilter(BoundedMotion(velocity_bound=2.0))
    env = RiderBicycleGainEnv(
        own, "trunk_imu", gains=("velocity",), fidelity="full", duration=0.2, reward="improvement"
    )
    rewards, info = rewards_of(env)
    assert len(rewards) == 2
    assert set(info["gains"]) == {"velocity"}
    env.close()


@pytest.mark.parametrize("quantity", [None, "two-gyro/relative_angles"])
def test_filters_of_rides_are_told_who_rides(quantity):
    """Another rider in every episode: the filter gets the geometry of each, and its own quantities are scored."""
    env = RiderBicycleGainEnv("two-gyro", scenario="slalom", duration=0.5, quantity=quantity)
    rewards, info = rewards_of(env)
    assert np.isfinite(rewards[1:]).all()
    assert set(info["gains"]) == set(env.tuned.kalman.gains)
    assert set(info["pose"]) == {quantity or "bicycle/roll"}
    assert {"trunk_imu/gyr", "relative/orientation"} <= set(env.trajectory.measurements)
    env.close()


def test_the_geometry_of_the_episode_reaches_the_filter():
    env = RiderBicycleGainEnv("odometry-aided", scenario="slow", duration=0.3)
    told = []
    for seed in (0, 1):
        env.reset(seed=seed)
        assert env.tuned.kalman.model == type(env.tuned.kalman.model).for_rider(
            RiderGeometry.read(env.trajectory.metadata["geometry"]), dt=env.trajectory.dt
        )
        told.append(env.trajectory.metadata["geometry"]["rider_mass"])
    assert told[0] != told[1]
    env.close()


def test_kept_rides_are_the_same_rides(tmp_path, monkeypatch):
    monkeypatch.setenv("POISE_CACHE", str(tmp_path))
    options = {"scenario": "slow", "duration": 0.5}
    few = [RiderBicycleGainEnv(rides=2, **options) for _ in range(2)]
    simulated, read = (rewards_of(env, seed=2)[0] for env in few)
    assert simulated == read
    assert few[0].trajectory.metadata == few[1].trajectory.metadata
    seeds = set()
    for seed in range(8):
        few[0].reset(seed=seed)
        seeds.add(few[0].trajectory.metadata["seed"])
    assert len(seeds) == 2
    others = [RiderBicycleGainEnv(rides=2, rides_seed=1, **options), RiderBicycleGainEnv(rides=None, **options)]
    for env in others:
        env.reset(seed=2)
        assert env.trajectory.metadata["seed"] not in seeds
    for env in (*few, *others):
        env.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"site": "thigh_left"}, "site must be one of"),
        ({"filter": "kalman"}, "filter must be a Kalman filter with gains, got 'kalman'"),
        ({"scenario": "moon"}, "unknown scenario"),
        ({"scenario": ()}, "at least one scenario"),
        ({"subject": 9}, "subject"),
        ({"duration": 0.1, "interval": 0.5}, "one interval at least"),
        ({"fidelity": "rough"}, "fidelity must be"),
        ({"rate": 33.0}, "physics_rate must be a multiple"),
        ({"noise_scale": -1.0}, "noise_scale"),
        ({"rides": 0}, "rides must be None or at least 1"),
        ({"render_mode": "ascii"}, "render_mode must be None or one of"),
    ],
)
def test_wrong_arguments_are_explained(arguments, words):
    with pytest.raises(ValueError, match=words):
        RiderBicycleGainEnv(**arguments)
