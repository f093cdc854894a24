"""Add a sensor
============

A kind of sensor says what an ideal one reads from the motion of its site; a preset adds its errors. Neither changes the package. Here a
barometric altimeter rides on the hand-held device.
"""

import gymnasium
import matplotlib.pyplot as plt

import poise
from poise.envs.sensors.kinds import KINDS, SensorKind, register_sensor_kind
from poise.envs.sensors.noise import NoiseModel
from poise.envs.sensors.presets import SensorPreset, sensor_preset

if "altimeter" not in KINDS:
    height = SensorKind("altimeter", 1, "m", "height", lambda motion: motion.now.position[:, 2:], full_scale=100.0)
    register_sensor_kind(height)

# %%
# A device that has one
# ---------------------

imu = sensor_preset("xsens-mtw-awinda")
device = SensorPreset(
    "imu with altimeter",
    "an example",
    imu.gyroscope,
    imu.accelerometer,
    others={"altimeter": NoiseModel(white_noise=0.01, full_scale=100.0)},
)
env = gymnasium.make("poise/HandMotion-v0", sensors=device, gesture="severe", duration=8.0)
trajectory = poise.record(env, seed=0)
env.close()

# %%

figure, ax = plt.subplots(figsize=(7, 3), layout="constrained")
ax.plot(trajectory.time, 100.0 * trajectory.measurements["imu/height"][:, 0], lw=0.8, label="altimeter")
ax.plot(trajectory.time, 100.0 * trajectory.truth["position"][:, 2], "k", label="truth")
ax.set(xlabel="time, s", ylabel="height, cm")
ax.legend(frameon=False)
