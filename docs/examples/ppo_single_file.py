"""PPO in one file, after CleanRL (S. Huang et al., JMLR 23, 2022), on any environment by its id.

It knows Gymnasium, NumPy and torch; of this package only that importing it registers environments:

    python ppo_single_file.py poise/HandMotionGain-v0 --steps 100000
    python ppo_single_file.py poise/HandMotion-v0 --option score=relative_orientation --gamma 0 --history 4

Observations that are dictionaries are flattened. Printed, and written with ``--curve``, is the mean reward of a step.
"""

from __future__ import annotations

import argparse
import csv
import json
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers import FlattenObservation, FrameStackObservation
from matplotlib import pyplot
from torch import nn
from torch.distributions import Normal

import poise  # noqa: F401


def arguments(words: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("id")
    parser.add_argument("--option", action="append", default=[], help="argument of the environment: name=value")
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--envs", type=int, default=8)
    parser.add_argument("--rollout", type=int, default=256, help="steps of each environment between updates")
    parser.add_argument("--history", type=int, default=1, help="observations that the agent sees at a time")
    parser.add_argument("--gamma", type=float, default=0.99, help="0 where actions do not change what comes")
    parser.add_argument("--std", type=float, default=0.3, help="of the exploration, at the start")
    parser.add_argument("--rate", type=float, default=3e-4, help="learning rate, falls to zero")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--evaluate", type=int, default=500, help="steps of each environment in the last evaluation")
    parser.add_argument("--curve", help="CSV file of the learning curve")
    parser.add_argument("--figure", help="picture of the learning curve")
    return parser.parse_args(words)


def value_of(text: str) -> Any:
    """``3.0`` → 3.0, ``fast`` → "fast"."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def make_envs(args: argparse.Namespace) -> gymnasium.vector.VectorEnv:
    options = {name: value_of(value) for name, value in (each.split("=", 1) for each in args.option)}
    wrappers: list[Any] = []
    if not isinstance(gymnasium.make(args.id, **options).observation_space, gymnasium.spaces.Box):
        wrappers.append(FlattenObservation)
    if args.history > 1:
        wrappers += [lambda env: FrameStackObservation(env, args.history), FlattenObservation]
    same = {"autoreset_mode": gymnasium.vector.AutoresetMode.SAME_STEP}
    if wrappers or gymnasium.spec(args.id).vector_entry_point is None:
        envs = gymnasium.make_vec(args.id, args.envs, "sync", same, wrappers, **options)
    else:
        envs = gymnasium.make_vec(args.id, args.envs, autoreset_mode="SameStep", **options)
    return envs


class Agent(nn.Module):
    """Two networks of two layers; the actor begins at zero."""

    def __init__(self, inputs: int, actions: int, std: float) -> None:
        super().__init__()
        self.critic = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1))
        self.actor = nn.Sequential(
            nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, actions)
        )
        with torch.no_grad():
            self.actor[-1].weight.mul_(0.01)
            self.actor[-1].bias.zero_()
        self.log_std = nn.Parameter(torch.full((actions,), float(np.log(std))))

    def distribution(self, seen: torch.Tensor) -> Normal:
        return Normal(self.actor(seen), self.log_std.exp())


def main(words: list[str] | None = None) -> list[tuple[int, float]]:
    """Train, and return the learning curve: steps, and the mean reward of a step."""
    args = arguments(words)
    torch.manual_seed(args.seed)
    rng = np.random.default_rng(args.seed)
    envs = make_envs(args)
    low, high = envs.single_action_space.low, envs.single_action_space.high
    size = int(np.prod(envs.single_observation_space.shape))
    agent = Agent(size, len(low), args.std)
    optimizer = torch.optim.Adam(agent.parameters(), lr=args.rate, eps=1e-5)
    seen, _ = envs.reset(seed=args.seed)
    inputs, returns, spread = Running(size), np.zeros(args.envs), Running(1)
    updates = max(1, args.steps // (args.envs * args.rollout))
    curve = []
    for update in range(updates):
        for group in optimizer.param_groups:
            group["lr"] = args.rate * (1.0 - update / updates)
        shape = (args.rollout, args.envs)
        observations = torch.zeros((*shape, agent.actor[0].in_features))
        actions, logs = torch.zeros((*shape, len(low))), torch.zeros(shape)
        rewards, values, ends = np.zeros(shape), np.zeros((args.rollout + 1, args.envs)), np.zeros(shape)
        for step in range(args.rollout):
            observations[step] = inputs.normalised(seen, learn=True)
            with torch.no_grad():
                distribution = agent.distribution(observations[step])
                actions[step] = distribution.sample()
                logs[step] = distribution.log_prob(actions[step]).sum(-1)
                values[step] = agent.critic(observations[step])[:, 0].numpy()
            seen, rewards[step], terminated, truncated, _ = envs.step(np.clip(actions[step].numpy(), low, high))
            ends[step] = terminated | truncated
            returns = args.gamma * returns + rewards[step]
            spread.update(returns[:, None])
            returns[ends[step] > 0] = 0.0
        curve.append(((update + 1) * args.envs * args.rollout, float(rewards.mean())))
        print(f"{curve[-1][0]:8d} steps, mean reward {curve[-1][1]:.4f}", flush=True)
        with torch.no_grad():
            values[-1] = agent.critic(inputs.normalised(seen))[:, 0].numpy()
        advantages, carried = np.zeros(shape), np.zeros(args.envs)
        for step in reversed(range(args.rollout)):
            alive = 1.0 - ends[step]
            delta = rewards[step] / spread.std[0] + args.gamma * values[step + 1] * alive - values[step]
            carried = delta + 0.95 * args.gamma * alive * carried
            advantages[step] = carried
        batch = {
            "seen": observations.flatten(0, 1),
            "action": actions.flatten(0, 1),
            "log": logs.flatten(),
            "advantage": torch.as_tensor(advantages, dtype=torch.float32).flatten(),
            "target": torch.as_tensor(advantages + values[:-1], dtype=torch.float32).flatten(),
        }
        for _ in range(10):
            for rows in np.array_split(rng.permutation(args.rollout * args.envs), 8):
                part = {name: each[rows] for name, each in batch.items()}
                distribution = agent.distribution(part["seen"])
                ratio = (distribution.log_prob(part["action"]).sum(-1) - part["log"]).exp()
                advantage = (part["advantage"] - part["advantage"].mean()) / (part["advantage"].std() + 1e-8)
                gain = torch.min(advantage * ratio, advantage * ratio.clamp(0.8, 1.2)).mean()
                error = (agent.critic(part["seen"])[:, 0] - part["target"]).square().mean()
                optimizer.zero_grad()
                (0.5 * error - gain).backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimizer.step()
    for name, chosen in (("zero actions", None), ("the policy without noise", agent)):
        print(f"{name}: mean reward {evaluated(envs, chosen, inputs, args):.4f}")
    envs.close()
    if args.curve:
        with open(args.curve, "w", newline="") as file:
            csv.writer(file).writerows([("steps", "reward"), *curve])
    if args.figure:
        figure, axes = pyplot.subplots(figsize=(5.0, 3.0), layout="constrained")
        steps, rewards = zip(*curve, strict=True)
        axes.plot(np.divide(steps, 1000.0), rewards)
        axes.set(xlabel="thousand steps", ylabel="mean reward of a step")
        axes.set_title("\n".join([args.id, " ".join(args.option)]), fontsize=9)
        figure.savefig(args.figure, dpi=120)
    return curve


def evaluated(
    envs: gymnasium.vector.VectorEnv, agent: Agent | None, inputs: Running, args: argparse.Namespace
) -> float:
    """Mean reward of a step on episodes of another seed, of actions without noise; None: of zeros."""
    seen, _ = envs.reset(seed=args.seed + 1_000_000)
    rewards, low, high = [], envs.action_space.low, envs.action_space.high
    for _ in range(args.evaluate):
        actions = np.zeros(envs.action_space.shape, np.float32)
        if agent is not None:
            with torch.no_grad():
                actions = np.clip(agent.actor(inputs.normalised(seen)).numpy(), low, high)
        seen, reward, *_ = envs.step(actions)
        rewards.append(reward)
    return float(np.mean(rewards))


class Running:
    """Mean and standard deviation of all rows so far."""

    def __init__(self, size: int) -> None:
        self.count, self.total, self.squares = 1e-4, np.zeros(size), np.full(size, 1e-4)

    def update(self, rows: np.ndarray) -> None:
        self.count += len(rows)
        self.total += rows.sum(axis=0)
        self.squares += (rows * rows).sum(axis=0)

    @property
    def std(self) -> np.ndarray:
        return np.sqrt(np.maximum(self.squares / self.count - (self.total / self.count) ** 2, 1e-8))

    def normalised(self, seen: np.ndarray, learn: bool = False) -> torch.Tensor:
        rows = np.asarray(seen, dtype=float).reshape(len(seen), -1)
        if learn:
            self.update(rows)
        return torch.as_tensor(np.clip((rows - self.total / self.count) / self.std, -10.0, 10.0), dtype=torch.float32)


if __name__ == "__main__":
    main()
