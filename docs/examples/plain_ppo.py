"""PPO of stable-baselines3 on the default gain environment, against its filter and the best constant gains.

python plain_ppo.py --seeds 0 1 2 3 4 --steps 25000 --results runs/ppo
python plain_ppo.py --seeds 0 1 2 3 4 --settings shipped --results runs/ppo --figure curves.png

With its default hyper-parameters, or with those of ``rl_zoo3_ppo.yml`` beside this file. The best constant is chosen on
the test motions themselves. Printed are the mean errors of every training and statistics over seeds and motions. Each
training leaves a file in ``--results``: it is not repeated, and the table and the figure are of all that are there.

The native vector environment replaces one environment: 8 episodes of 256 decisions make the 2048 of a default rollout.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines.gain_policy.actor_critic import actor_layers
from poise.baselines.gain_policy.compared.runs import CONSTANT, POLICY, PUBLISHED, TuneRun, comparison, curves_figure
from poise.baselines.gain_policy.constant_gains import constant_errors, policy_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.baselines.gain_policy.vec_env import SB3VecEnv
from poise.baselines.plots import save
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.support.rows import markdown_table

IDENTITY = "poise/HandMotionGain-v0"
EPISODES = 32
"""of a minute, that no training sees"""
SETTINGS: dict[str, dict[str, Any]] = {
    "default": {"envs": 8, "n_steps": 256},
    "shipped": {"envs": 64, "n_steps": 64, "batch_size": 1024, "learning_rate": lambda left: 1e-3 * left},
}
"""Episodes at a time, and arguments of PPO; of ``shipped`` also the rewards are normalised."""


class Curve(BaseCallback):
    """Notes the mean reward of a decision, as the environment gives it, over every rollout."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[dict[str, float]] = []
        self.rewards: list[float] = []

    def _on_step(self) -> bool:
        env = self.training_env
        given = env.get_original_reward() if isinstance(env, VecNormalize) else self.locals["rewards"]
        self.rewards.append(float(np.mean(given)))
        return True

    def _on_rollout_end(self) -> None:
        self.rows.append({"steps": float(self.num_timesteps), "gain": float(np.mean(self.rewards))})
        self.rewards.clear()


def main(words: list[str] | None = None) -> list[TuneRun]:
    """Train once a seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--settings", choices=list(SETTINGS), default="default")
    parser.add_argument("--episodes", type=int, default=EPISODES, help="test motions")
    parser.add_argument("--results", type=Path, help="folder of finished trainings")
    parser.add_argument("--figure", type=Path, help="picture of the learning curves")
    args = parser.parse_args(words)
    test = HandTrajectories(("hand-held",)).draw_many(777, args.episodes)
    constants: dict[str, np.ndarray] = {}
    found, known = {}, [] if args.results is None else sorted(args.results.glob("*.json"))
    for file in known:
        found[file.stem] = run_of(file.stem, json.loads(file.read_text()), test)
    if found:
        same = next(iter(found.values())).errors
        constants = {gains: np.radians(list(same[gains].values())) for gains in (PUBLISHED, CONSTANT)}
    for seed in args.seeds:
        name = f"{args.settings}-{args.steps}-{seed}"
        if name in found:
            continue
        content = trained(args.settings, seed, args.steps, test, constants)
        found[name] = run_of(name, content, test)
        if args.results is not None:
            args.results.mkdir(parents=True, exist_ok=True)
            (args.results / f"{name}.json").write_text(json.dumps(content))
    runs = list(found.values())
    rows = [
        {"PPO": run.agent, "seed": run.seed}
        | {gains: float(np.mean(list(errors.values()))) for gains, errors in run.errors.items()}
        for run in runs
    ]
    print(markdown_table(rows))
    print(markdown_table(comparison(runs)))
    if args.figure is not None and (figure := curves_figure(runs)) is not None:
        save(figure, args.figure)
    return runs


def run_of(name: str, content: dict[str, Any], test: list[Any]) -> TuneRun:
    """A training by its name, such as ``shipped-100000-0``."""
    settings, steps, seed = name.split("-")
    sets = {"unseen motions": [each.name for each in test]}
    return TuneRun(Path(name), "external-acceleration", f"{settings}, {int(steps):,} steps", int(seed), sets, **content)


def trained(settings: str, seed: int, steps: int, test: list[Any], constants: dict[str, np.ndarray]) -> dict[str, Any]:
    """Errors on the test motions, deg, of the published gains, the best constant and PPO; and its learning curve.

    ``constants`` holds the errors of the former two from one training to the next.
    """
    arguments = dict(SETTINGS[settings])
    rows = SB3VecEnv.make(IDENTITY, arguments.pop("envs"), infos=False)
    (tuned, *_) = rows.get_attr("tuned")
    env = rows if settings == "default" else VecNormalize(rows, norm_obs=False)
    curve = Curve()
    model = PPO("MlpPolicy", env, seed=seed, device="cpu", **arguments).learn(steps, curve)
    size = tuned.observation_size
    policy = GainPolicy.of_network(tuned, actor_layers(model), np.zeros(size), np.ones(size))
    if not constants:
        grid = [constant_errors(tuned, test, np.array([action])) for action in np.linspace(-1.0, 1.0, 17)]
        constants |= {PUBLISHED: grid[8], CONSTANT: min(grid, key=np.mean)}
    errors = {**constants, POLICY: policy_errors(tuned.kalman, policy, test)}
    named = {
        gains: {one.name: float(np.degrees(value)) for one, value in zip(test, values, strict=True)}
        for gains, values in errors.items()
    }
    return {"errors": named, "curve": curve.rows}


if __name__ == "__main__":
    main()
