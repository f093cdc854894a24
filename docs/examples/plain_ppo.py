"""PPO of stable-baselines3 on the default gain environment, against its filter and the best constant gains.

python plain_ppo.py --seeds 0 1 2 3 4 --steps 50000
python plain_ppo.py --seeds 0 1 2 3 4 --steps 100000 --settings shipped

With its default hyper-parameters, or with those of ``rl_zoo3_ppo.yml`` beside this file: a learning rate that falls to
zero, and less exploration. Results go to ``--results`` as they are found; seeds that it holds are not trained again.

The native vector environment replaces one environment: 8 episodes of 256 decisions make the 2048 of a default rollout.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO

from poise.baselines.gain_policy.actor_critic import actor_layers
from poise.baselines.gain_policy.constant_gains import constant_errors, policy_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.baselines.gain_policy.vec_env import SB3VecEnv
from poise.envs.hand.trajectories import HandTrajectories

IDENTITY = "poise/HandMotionGain-v0"
EPISODES = 16
"""of a minute, that no training sees"""
SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "shipped": {"learning_rate": lambda left: 3e-4 * left, "policy_kwargs": {"log_std_init": -1.0}},
}
"""Arguments of PPO besides the rollouts."""


def main(words: list[str] | None = None) -> list[tuple[float, float, float]]:
    """Train once a seed, and return for each: mean RMS error of the published gains, the best constant, PPO (deg)."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--settings", choices=list(SETTINGS), default="default")
    parser.add_argument("--results", type=Path, help="CSV file to continue")
    args = parser.parse_args(words)
    known = {}
    if args.results is not None and args.results.is_file():
        with args.results.open(newline="") as file:
            for settings, steps, seed, *rest in csv.reader(file):
                if (settings, int(steps)) == (args.settings, args.steps):
                    known[int(seed)] = tuple(map(float, rest))
    test = HandTrajectories(("hand-held",)).draw_many(777, EPISODES)
    found = []
    for seed in args.seeds:
        if seed in known:
            found.append(known[seed])
            continue
        env = SB3VecEnv.make(IDENTITY, 8, infos=False)
        (tuned, *_) = env.get_attr("tuned")
        model = PPO("MlpPolicy", env, n_steps=256, seed=seed, device="cpu", **SETTINGS[args.settings]).learn(args.steps)
        size = tuned.observation_size
        policy = GainPolicy.of_network(tuned, actor_layers(model), np.zeros(size), np.ones(size))
        grid = [constant_errors(tuned, test, np.array([action])).mean() for action in np.linspace(-1.0, 1.0, 9)]
        errors = (grid[4], min(grid), policy_errors(tuned.kalman, policy, test).mean())
        found.append(tuple(float(np.degrees(each)) for each in errors))
        if args.results is not None:
            with args.results.open("a", newline="") as file:
                csv.writer(file).writerow([args.settings, args.steps, seed, *found[-1]])
        print("seed {}: published {:.3f}, best constant {:.3f}, PPO {:.3f}".format(seed, *found[-1]), flush=True)
    return found


if __name__ == "__main__":
    main()
