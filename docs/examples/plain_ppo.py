"""PPO of stable-baselines3 on the default gain environment, against its filter and the best constant gains.

python plain_ppo.py --seeds 0 1 2 3 4 --steps 25000
python plain_ppo.py --seeds 0 1 2 3 4 --settings shipped
poise tune --report runs/plain_ppo/*

With its default hyper-parameters, or with those of ``rl_zoo3_ppo.yml`` beside this file. The constant gains are the
best on motions of their own. Each training leaves a run folder, of which ``poise tune --report`` makes tables of seeds
and learning curves.

The native vector environment replaces one environment: 8 episodes of 256 decisions make the 2048 of a default rollout.
"""

from __future__ import annotations

import argparse
import json
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines.gain_policy.actor_critic import actor_layers
from poise.baselines.gain_policy.compared.runs import CONSTANT, CURVE, PLAIN, POLICY, PUBLISHED, SETS, TuneRun
from poise.baselines.gain_policy.constant_gains import constant_errors, policy_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.baselines.gain_policy.vec_env import SB3VecEnv
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.support.rows import RESULT
from poise.scripts.experiment import start_run

IDENTITY = "poise/HandMotionGain-v0"
EPISODES = 128
"""of a minute, that no training sees"""
CHOOSING, TEST = 778, 777
"""Root seeds of the motions on which the constant gains are chosen, and of the test motions."""
SETTINGS: dict[str, dict[str, Any]] = {
    "default": {"envs": 8, "n_steps": 256},
    "shipped": {"envs": 64, "n_steps": 64, "batch_size": 1024, "learning_rate": lambda left: 1e-3 * left},
}
"""Episodes at a time, and arguments of PPO; of ``shipped`` also the rewards are normalised."""
EPISODE = 600
"""Decisions of an episode: all begin and end together, so that a mean over fewer depends on their phase."""


class Curve(BaseCallback):
    """Notes after every rollout the mean reward of a decision, as the environment gives it, over the last minute."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[dict[str, float]] = []
        self.rewards: deque[float] = deque(maxlen=EPISODE)

    def _on_step(self) -> bool:
        env = self.training_env
        given = env.get_original_reward() if isinstance(env, VecNormalize) else self.locals["rewards"]
        self.rewards.append(float(np.mean(given)))
        return True

    def _on_rollout_end(self) -> None:
        self.rows.append({"steps": float(self.num_timesteps), "gain": float(np.mean(self.rewards))})


def main(words: list[str] | None = None) -> list[TuneRun]:
    """Train once a seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--settings", choices=list(SETTINGS), default="default")
    parser.add_argument("--episodes", type=int, default=EPISODES, help="test motions")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="parent of the run folders")
    args = parser.parse_args(words)
    tuned: TunedFilter
    (tuned, *_) = SB3VecEnv.make(IDENTITY, 1, infos=False).get_attr("tuned")
    motions = HandTrajectories(("hand-held",))
    test, choosing = motions.draw_many(TEST, args.episodes), motions.draw_many(CHOOSING, args.episodes // 4)
    constants = [np.array([action]) for action in np.linspace(-1.0, 1.0, 17)]
    constant = min(constants, key=lambda action: constant_errors(tuned, choosing, action).mean())
    errors = {
        PUBLISHED: constant_errors(tuned, test, np.zeros(1)),
        CONSTANT: constant_errors(tuned, test, constant),
    }
    runs = []
    for seed in args.seeds:
        described = {"filter": tuned.name, "agent": f"PPO {args.settings}, {args.steps:,} steps"}
        folder = start_run(PLAIN, {**vars(args), **described}, seed, args.runs)
        policy, curve = trained(args.settings, seed, args.steps)
        errors[POLICY] = policy_errors(tuned.kalman, policy, test)
        rows = [
            dict(zip(RESULT, (gains, each.name, "up", "inclination", float(np.degrees(value)), "deg"), strict=True))
            for gains, values in errors.items()
            for each, value in zip(test, values, strict=True)
        ]
        folder.write_results(rows)
        (folder.folder / SETS).write_text(json.dumps({"unseen motions": [each.name for each in test]}))
        lines = [f"{row['steps']:.0f},{row['gain']!r}" for row in curve]
        (folder.folder / CURVE).write_text("\n".join(["steps,gain", *lines, ""]))
        runs.append(TuneRun.read(folder.folder))
        means = {gains: round(float(np.degrees(values.mean())), 3) for gains, values in errors.items()}
        print(f"{described['agent']}, seed {seed}: mean errors in deg {means}", folder.folder, flush=True)
    return runs


def trained(settings: str, seed: int, steps: int) -> tuple[GainPolicy, list[dict[str, float]]]:
    """The policy of PPO, and its learning curve."""
    arguments = dict(SETTINGS[settings])
    rows = SB3VecEnv.make(IDENTITY, arguments.pop("envs"), infos=False)
    (tuned, *_) = rows.get_attr("tuned")
    env = rows if settings == "default" else VecNormalize(rows, norm_obs=False)
    curve = Curve()
    model = PPO("MlpPolicy", env, seed=seed, device="cpu", **arguments).learn(steps, curve)
    size = tuned.observation_size
    return GainPolicy.of_network(tuned, actor_layers(model), np.zeros(size), np.ones(size)), curve.rows


if __name__ == "__main__":
    main()
