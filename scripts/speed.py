"""Measure the speed of filters and environments relative to other packages and bare physics."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

from .output import Output


@dataclass
class Args:
    """Arguments of ``poise speed``."""

    what: tuple[Literal["filters", "bicycle", "arrays", "learned", "latency", "environments", "vectors"], ...] = (
        "filters",
        "bicycle",
        "arrays",
        "learned",
        "latency",
        "environments",
        "vectors",
    )
    """parts to measure; bicycle and arrays are families of filters, learned are networks, vectors are vector
    environments"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Measure and print every group as soon as it is complete."""
    from functools import partial
    from itertools import chain, groupby

    from ..baselines.speed.environments import environment_speeds
    from ..baselines.speed.families import FAMILIES, estimator_speeds, learned_speeds
    from ..baselines.speed.filters import filter_speeds, latencies
    from ..baselines.speed.vectors import vector_speeds

    parts = {"filters": filter_speeds, "latency": latencies, "environments": environment_speeds}
    parts |= {"vectors": vector_speeds, "learned": learned_speeds}
    parts |= {family: partial(chain.from_iterable, map(estimator_speeds, names)) for family, names in FAMILIES.items()}
    with Output("speed", args) as out:
        for name in args.what:
            for group, rows in groupby(parts[name](), key=lambda speed: speed.group):
                table = [asdict(row) for row in rows]
                out.rows(table)
                out.show(table, group, columns=("what", "rate", "unit", "ratio"))
    return 0
