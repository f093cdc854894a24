"""Normalisation of observations survives in files without code; other files are refused."""

import gymnasium
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from poise.baselines.gain_policy.agents.normalisation import load_normalisation, save_normalisation

GAIN = {"id": "poise/HandMotionGain-v0", "duration": 1.0}
HAND = {"id": "poise/HandMotion-v0", "duration": 1.0}


def made(options):
    return DummyVecEnv([lambda: gymnasium.make(**options)] * 2)


@pytest.mark.parametrize("options", [GAIN, HAND], ids=["array", "dictionary"])
def test_statistics_and_settings_come_back(options, tmp_path):
    keys = ["imu/gyr", "imu/acc"] if options is HAND else None
    env = VecNormalize(made(options), clip_obs=7.0, gamma=0.9, norm_obs_keys=keys)
    env.seed(0)
    env.reset()
    for _ in range(5):
        env.step(np.stack([env.action_space.sample()] * 2))
    path = save_normalisation(env, tmp_path / "normalisation")
    read = load_normalisation(path, made(options))
    assert (read.clip_obs, read.gamma) == (7.0, 0.9)
    read.training = env.training = False
    env.seed(1)
    read.seed(1)
    np.testing.assert_equal(read.reset(), env.reset())
    assert read.ret_rms.count == env.ret_rms.count


def test_other_files_are_refused(tmp_path):
    env = VecNormalize(made(GAIN))
    path = save_normalisation(env, tmp_path / "normalisation")
    wider = made({**GAIN, "gains": ("process", "measurement")})
    with pytest.raises(ValueError, match="the environment needs"):
        load_normalisation(path, wider)
    with pytest.raises(ValueError, match="is not a normalisation of observations but"):
        load_normalisation("external_acceleration_policy", made(GAIN))
    path.with_suffix(".json").unlink()
    with pytest.raises(FileNotFoundError, match="no card"):
        load_normalisation(path, made(GAIN))
