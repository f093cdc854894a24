"""Train a learned estimator; the weights, their card and everything that led to them stay in the run folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import tyro

from .main import run_command
from .train_gru import Gru, run_gru


@dataclass
class Args:
    """Arguments of ``poise train``."""

    what: tyro.conf.OmitSubcommandPrefixes[Annotated[Gru, tyro.conf.subcommand("gru", prefix_name=False)]] = field(
        default_factory=Gru
    )
    """what is trained"""


def run(args: Args) -> int:
    """Train."""
    return run_gru(args.what)


if __name__ == "__main__":
    run_command("train")
