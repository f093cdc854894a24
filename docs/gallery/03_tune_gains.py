"""Let an agent tune a filter
==========================

In ``poise/HandMotionGain-v0`` the agent sets the gains of a Kalman filter while the filter runs. It sees statistics of innovations and sensors,
never the truth. Ten lines of stable-baselines3 train a policy; the native vector environment computes all filters together.
"""

# %%
# The environment
# ---------------

import gymnasium
import numpy as np
from stable_baselines3 import PPO

from poise.baselines.gain_policy.vec_env import SB3VecEnv

OPTIONS = {"filter": "external-acceleration", "duration": 15.0}
vector = SB3VecEnv.make("poise/HandMotionGain-v0", 32, **OPTIONS)
print(vector.action_space, vector.observation_space.shape)

# %%
# Training
# --------
# This is far too short to be good; it shows the interface. ``poise tune external-acceleration`` trains in minutes to hours.

model = PPO("MlpPolicy", vector, n_steps=64, batch_size=512, seed=0)
model.learn(20_000)


# %%
# Against the published gains
# ---------------------------
# Zero actions leave the filter as it was published.


def error(choose, seed):
    """RMS inclination error of one episode, in degrees."""
    env = gymnasium.make("poise/HandMotionGain-v0", **OPTIONS)
    observation, info = env.reset(seed=seed)
    errors, over = [], False
    while not over:
        observation, _, terminated, truncated, info = env.step(choose(observation))
        errors.append(info["error_deg"])
        over = terminated or truncated
    return float(np.sqrt(np.nanmean(np.square(errors))))


neutral = np.zeros(vector.action_space.shape, np.float32)
for seed in range(3):
    published = error(lambda observation: neutral, seed)
    trained = error(lambda observation: model.predict(observation, deterministic=True)[0], seed)
    print(f"episode {seed}: published gains {published:.2f}°, policy {trained:.2f}°")
