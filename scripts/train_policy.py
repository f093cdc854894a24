"""Training of a gain policy: arguments, progress, weights with their card."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from .experiment import Run, start_run, versions


@dataclass
class Policy:
    """Train a policy that sets the gains of a filter."""

    filter: str = "external-acceleration"
    """name of the filter"""
    seed: int = 0
    """root seed of motions, weights and actions"""
    steps: int = 100_000
    """decisions in total"""
    trajectories: int | None = None
    """simulated trajectories to train on, instead of the usual number"""
    recordings: tuple[Path, ...] = ()
    """files or folders of recordings with known orientation, to train on instead of simulated trajectories"""
    resume: Path | None = None
    """run folder of an interrupted training; give the other arguments as then"""
    export: Path | None = None
    """file to which the weights are written too"""
    runs: Path = Path("runs")
    """where the run folder goes"""


def run_policy(args: Policy) -> int:
    """Train, and write weights with their card."""
    from tqdm import tqdm

    from ..baselines.policy_training import TrainingConfig, train_policy
    from .train_gru import load_all

    config = TrainingConfig(filter=args.filter, seed=args.seed, steps=args.steps)
    if args.trajectories is not None:
        config = replace(config, trajectories=args.trajectories)
    own = load_all(args.recordings) if args.recordings else None
    if args.resume is None:
        folder = start_run("train", args, args.seed, args.runs)
    elif args.resume.is_dir():
        folder = Run(args.resume, "train", args.seed)
    else:
        raise FileNotFoundError(f"there is no run folder {args.resume}")
    with tqdm(total=config.steps, desc=f"train {args.filter}", unit="step") as bar:

        def report(entry: dict[str, float]) -> None:
            bar.update(int(entry["steps"]) - bar.n)
            bar.set_postfix(saved_deg=f"{entry['gain_deg']:.3f}")

        policy = train_policy(
            config, trajectories=own, folder=folder.folder, resume=args.resume is not None, report=report
        )
    card = {**policy.card, "command": command_of(args), "versions": versions(("numpy", "torch", "stable-baselines3"))}
    print(f"weights: {policy.save(folder.folder / 'policy', card)}")
    if args.export is not None:
        print(f"weights: {policy.save(args.export, card)}")
    return 0


def command_of(args: Policy) -> str:
    """The command line that trains these weights again."""
    words = ["poise", "train", "policy", "--filter", args.filter, "--seed", str(args.seed), "--steps", str(args.steps)]
    if args.trajectories is not None:
        words += ["--trajectories", str(args.trajectories)]
    if args.recordings:
        words += ["--recordings", *map(str, args.recordings)]
    return shlex.join(words)
