"""Angles from your own recording
==============================

A table of numbers from any device becomes angles with their standard deviations. The file here is made on the spot: semicolons, degrees a
second, multiples of g, milliseconds, and a gap of half a second, as loggers write them.
"""

# %%
# A file as a logger writes it
# ----------------------------

import tempfile
from pathlib import Path

import numpy as np

import poise

motion = poise.record("poise/HandMotion-v0", seed=3)
gyr, acc = motion.measurements["imu/gyr"], motion.measurements["imu/acc"]
rows = np.column_stack([1000.0 * motion.time, np.degrees(gyr), acc / 9.80665])
rows = np.delete(rows, slice(800, 850), axis=0)
folder = Path(tempfile.mkdtemp())
path = folder / "walk.csv"
np.savetxt(path, rows, delimiter=";", header="time_ms;wx;wy;wz;ax;ay;az", comments="", fmt="%.6f")

# %%
# What is it?
# -----------
# A column map says what the table does not: which columns, in which units. ``poise inspect walk.csv --write-map`` drafts one.
# ``check_recording`` names what looks wrong, with its likely cause.

recording = poise.load_recording(
    path,
    columns={"gyr": ["wx", "wy", "wz"], "acc": ["ax", "ay", "az"]},
    units={"gyr": "deg/s", "acc": "g", "time": "ms"},
    time="time_ms",
)
print(recording)
for finding in poise.check_recording(recording):
    print("-", finding)

# %%
# Angles
# ------
# The estimator runs on the uniform grid behind the time stamps: over the gap it only predicts, and its standard deviation grows.

estimate = poise.run("bounded-motion", recording, grid=True)
table = estimate.to_frame()
print(table.iloc[::200][["time", "roll", "std_roll", "pitch", "std_pitch"]].round(2).to_string())

# %%

import matplotlib.pyplot as plt

smoothed = poise.smooth("bounded-motion", recording, grid=True).to_frame()
figure, ax = plt.subplots(figsize=(8, 3), layout="constrained")
ax.plot(table["time"], table["roll"], label="filter")
ax.plot(smoothed["time"], smoothed["roll"], label="smoother: every estimate uses the whole recording")
ax.axvspan(motion.time[800], motion.time[850], color="0.9", label="gap")
ax.set(xlabel="time, s", ylabel="roll, °")
ax.legend(frameon=False)

# %%
# The estimates as a file
# -----------------------
# ``poise estimate walk.toml --output angles.csv`` does all of this from the command line; other endings are ``.parquet``, ``.h5``, ``.npz``
# and OpenSim's ``.sto``.

table.to_csv(folder / "angles.csv", index=False)
print((folder / "angles.csv").read_text()[:200])
