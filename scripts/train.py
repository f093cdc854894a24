"""Train a learned estimator or a gain policy; weights, card and all that led to them stay in the run folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from .main import run_command
from .train_gru import Gru, run_gru
from .train_policy import Policy, run_policy


@dataclass
class Args:
    """Arguments of ``poise train``."""

    what: tyro.conf.OmitArgPrefixes[
        Annotated[Gru, tyro.conf.subcommand("gru")] | Annotated[Policy, tyro.conf.subcommand("policy")]
    ]
    """what is trained; `poise train gru --help` tells its arguments"""


def run(args: Args) -> int:
    """Train."""
    return run_gru(args.what) if isinstance(args.what, Gru) else run_policy(args.what)


if __name__ == "__main__":
    run_command("train")
