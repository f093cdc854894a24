"""Train a network of your own
===========================

Any torch module can estimate the pose: alone, or by correcting a Kalman filter. Here a small network corrects ``bounded-motion``, trained on
simulated hand motion for seconds. It has no memory and starts at zero correction, so expect about the errors of the filter; with a recurrent
module, more episodes and more epochs the same lines train the networks that the package ships.
"""

# %%
# Data, module, training
# ----------------------
# The front end says what the network sees (samples and the state of a filter, in the filter's level frame), the head what its output means.

import torch

import poise
from poise.baselines.learned.config import FitConfig
from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.fit import fit
from poise.baselines.learned.head import TiltHead
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.envs.recipes.hand import HandRecipe

front_end, head = LevelFrame(poise.make_estimator("bounded-motion")), TiltHead(limit=3.0)
motions = HandRecipe(duration=20.0, carried_share=0.0)
train = SequenceData.from_recipe(motions, 1, 24, front_end, head)
held_out = SequenceData.from_recipe(motions, 2, 6, front_end, head)
module = torch.nn.Sequential(torch.nn.Linear(front_end.size, 32), torch.nn.Tanh(), torch.nn.Linear(32, head.size))
torch.nn.init.zeros_(module[-1].weight)
torch.nn.init.zeros_(module[-1].bias)
result = fit(module, front_end, head, train, held_out, FitConfig(epochs=8, batch=8))

# %%
# It is an estimator like all others
# ----------------------------------

unseen = [motions.episode(3, number) for number in range(3)]
unseen = [one.replace(metadata={**one.metadata, "name": f"unseen {number}"}) for number, one in enumerate(unseen)]
table = poise.evaluate({"mine": result.estimator, "bounded-motion": "bounded-motion", "vqf": "vqf"}, unseen)
wide = table[table.metric == "inclination"].pivot_table(index="estimator", columns="trajectory", values="value")
print(wide.round(3).to_string())

# %%

import matplotlib.pyplot as plt

figure, ax = plt.subplots(figsize=(7, 3), layout="constrained")
wide.T.plot.bar(ax=ax, rot=0)
ax.set(xlabel="", ylabel="inclination error, RMS, °")
ax.legend(frameon=False)
