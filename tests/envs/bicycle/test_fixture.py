"""The pushed bicycle with a disk: its motion against its own derivatives, and Gymnasium's rules."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from poise.envs.bicycle.fixture import BicycleFixtureEnv, FixtureMotion
from poise.filters.core import rotation


def test_velocities_are_derivatives():
    motion, step = FixtureMotion.random(np.random.default_rng(0)), 1e-5
    time = np.linspace(0.0, 20.0, 50)
    bodies, _ = motion.sample(time)
    later, earlier = (motion.sample(time + shift)[0] for shift in (step, -step))
    for name, now in bodies.items():
        speed = (later[name].position - earlier[name].position) / (2.0 * step)
        np.testing.assert_allclose(now.velocity, speed, atol=1e-8)
        turn = rotation.multiply(later[name].orientation, rotation.conjugate(earlier[name].orientation))
        np.testing.assert_allclose(now.angular_velocity, rotation.log(turn) / (2.0 * step), atol=1e-8)


def test_the_roll_law_of_the_paper_holds():
    """Without pitch, tan(roll) is the ratio of the gyroscope's y and z axes (equation 5; y to the left, z up)."""
    bodies, _ = FixtureMotion.random(np.random.default_rng(1)).sample(np.linspace(0.0, 30.0, 500))
    bicycle = bodies["bicycle"]
    rate = rotation.rotate_back(bicycle.orientation, bicycle.angular_velocity)
    roll = rotation.to_euler_zyx(bicycle.orientation)[2]
    np.testing.assert_allclose(np.tan(roll), rate[:, 1] / rate[:, 2], atol=1e-9)
    assert 5.0 < np.degrees(np.abs(roll)).max() < 20.0


@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")
def test_environment():
    env = gymnasium.make("poise/BicycleFixture-v0", duration=0.5).unwrapped
    check_env(env, skip_render_check=True)
    env = BicycleFixtureEnv(sensors="ideal", duration=2.0)
    observation, info = env.reset(seed=0)
    assert set(observation) == {"bicycle_imu/gyr", "disk/gyr", "relative/distances", "new_sample"}
    assert env.step(info["pose"]["bicycle/roll"])[1] == pytest.approx(0.0, abs=1e-7)
    snapshot = env.snapshot()
    first = [env.step(env.neutral_action)[1] for _ in range(150)]
    env.restore(snapshot)
    assert first == [env.step(env.neutral_action)[1] for _ in range(150)]


@pytest.mark.parametrize(
    ("options", "message"),
    [({"suite": "whole-body"}, "rider"), ({"duration": 0.0}, "duration"), ({"score": "mood"}, "score")],
)
def test_bad_arguments_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        BicycleFixtureEnv(**options)


def test_it_is_drawn():
    env = BicycleFixtureEnv(duration=2.0, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    for _ in range(100):
        env.step(env.neutral_action)
    second = env.render()
    env.close()
    assert first.shape == second.shape == (360, 480, 3)
    # the bicycle and its disk are seen, and move
    assert np.std(first) > 20.0
    assert np.mean(np.any(first != second, axis=-1)) > 0.01
