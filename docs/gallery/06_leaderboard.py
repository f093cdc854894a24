"""Read a leaderboard
==================

``poise benchmark`` compares estimators on the same motions. Which difference is real, and which is luck of a few trajectories? Intervals of
the mean overlap too often to tell; paired differences on the same trajectories do.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

from poise.baselines.comparison.data_sets import HAND_CHANNELS
from poise.baselines.comparison.intervals import errors_of, intervals, win_matrix
from poise.baselines.comparison.tasks import hand_tasks, run_tasks

NAMES = ("bounded-motion", "vqf", "mekf", "external-acceleration", "mahony", "gru")
suites = run_tasks(hand_tasks(seed=0, episodes=2, duration=20.0), Path(tempfile.mkdtemp()), NAMES, HAND_CHANNELS)
table = suites["simulation"].table
errors = errors_of(table, "inclination", "up")
print(errors.round(2).to_string())

# %%
# Means, and differences to the best
# ----------------------------------
# An estimator whose interval of the difference holds zero may be as good as the best one.

rows = intervals(errors)
for row in rows:
    print(
        f"{row['estimator']:<22} {row['mean']:.2f}° [{row['low']:.2f}, {row['high']:.2f}]   "
        f"difference {row['difference']:+.2f}° [{row['difference low']:+.2f}, {row['difference high']:+.2f}]"
    )

# %%
# Who beats whom
# --------------

names, wins = win_matrix(errors)
figure, ax = plt.subplots(figsize=(5, 4), layout="constrained")
image = ax.imshow(wins, vmin=0, vmax=1, cmap="RdBu")
ax.set_xticks(range(len(names)), names, rotation=45, ha="right")
ax.set_yticks(range(len(names)), names)
figure.colorbar(image, label="share of trajectories on which the row is better")
