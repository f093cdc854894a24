"""Train a learned estimator; weights, card and all that led to them stay in the run folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import tyro

from .main import run_command
from .train_gru import Gru, run_gru


@dataclass
class Args(Gru):
    """Arguments of ``poise train``."""

    network: tyro.conf.Positional[Literal["gru"]] = "gru"
    """what is trained; gain policies are trained by `poise tune`"""


def run(args: Args) -> int:
    """Train."""
    return run_gru(args)


if __name__ == "__main__":
    run_command("train")
