"""Train several networks of one configuration, each from a seed of its own, as one policy: the mean of their actions.

What a single training finds depends on the motions that it draws and on where its weights begin. Such errors differ
between networks and mostly cancel in the mean.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.support.seeds import named_seed
from ..checkpoint import has_checkpoint
from .config import TrainingConfig
from .motions import RiddenMotions
from .policy import GainPolicy
from .training import CHECKPOINT, Report, Validate, train_policy

OF_EACH = ("steps", "chosen_steps", "costs", "seconds")
"""What the card of the mean holds of each network, where its training tells it."""


def network_seed(root: int, index: int) -> int:
    """Seed of a network; a larger number of networks keeps the first ones."""
    return named_seed(root, "network", index)


def ridden(config: TrainingConfig, index: int) -> list[Trajectory] | None:
    """Rides of the root seed with the devices of a network; None where motions are no rides."""
    motions = config.motions
    return motions.devices(config.seed, config.trajectories, index) if isinstance(motions, RiddenMotions) else None


def train_networks(
    config: TrainingConfig,
    networks: int,
    *,
    trajectories: Sequence[Trajectory] | None = None,
    start: np.ndarray | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
    validate: Validate | None = None,
) -> GainPolicy:
    """Train networks one after the other; each draws its motions, weights and order from its own seed.

    Riding takes long: networks for filters of rides share the rides, with other devices on each.

    Its limit for the gyroscope bias is the smallest of theirs: all networks have seen biases up to it.

    Args:
        config: of each network, with the root of their seeds.
        networks: their number.
        trajectories: see :func:`.train_policy`; with them, networks differ in weights and order only.
        start: see :func:`.train_policy`.
        folder: a subfolder a network holds its checkpoint.
        resume: continue an interrupted training in ``folder``; networks that are finished there are kept.
        report: see :func:`.train_policy`; steps and seconds count on from network to network.
        validate: see :func:`.train_policy`; it scores each network alone.

    Raises:
        ValueError: fewer than two networks, an agent whose policy has a memory, or as :func:`.train_policy`.
    """
    if networks < 2:
        raise ValueError(f"networks must be at least 2, got {networks}")
    if config.agent == "recurrent-ppo":
        raise ValueError(f"networks must be 1 for the agent recurrent-ppo, whose policy has a memory, got {networks}")
    found: list[GainPolicy] = []
    done = {"steps": 0.0, "seconds": 0.0}

    def report_sum(progress: dict[str, float]) -> None:
        if report is not None:
            report(progress | {name: progress[name] + done[name] for name in done})

    for index in range(networks):
        home = None if folder is None else Path(folder) / f"network-{index}"
        policy = train_policy(
            replace(config, seed=network_seed(config.seed, index)),
            trajectories=ridden(config, index) if trajectories is None else trajectories,
            start=start,
            folder=home,
            resume=resume and home is not None and has_checkpoint(home / CHECKPOINT),
            report=report_sum,
            validate=validate,
        )
        assert isinstance(policy, GainPolicy)
        found.append(policy)
        done = {name: done[name] + float(policy.card[name]) for name in done}
    members = [
        {"seed": network_seed(config.seed, index)}
        | {"bias_limit": policy.bias_limit if math.isfinite(policy.bias_limit) else None}
        | {name: policy.card[name] for name in OF_EACH if name in policy.card}
        for index, policy in enumerate(found)
    ]
    card = {
        "training": config.describe(),
        "constant_action": found[0].card["constant_action"],
        "networks": members,
        **{name: round(done[name], 1) for name in done},
    }
    limit = min(policy.bias_limit for policy in found)
    return replace(GainPolicy.mean_of(found), card=json.loads(json.dumps(card)), bias_limit=limit)
