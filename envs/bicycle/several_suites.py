"""One ride, recorded with several suites of sensors: it is ridden once and sensed by each suite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from ..data.trajectory import Trajectory
from ..record import named, record
from ..registration import make_environment

ENVIRONMENT = "poise/RiderBicycle-v0"


def record_suites(options: Sequence[Mapping[str, Any]], seed: int) -> list[Trajectory]:
    """Episodes of ``poise/RiderBicycle-v0`` that differ in their sensors only, bit for bit as if recorded one by one.

    Their options may differ in ``suite``, ``sensors``, ``rate`` and what else concerns the sensors alone.

    Raises:
        ValueError: the ride is not the same in all of them.
    """
    with ExitStack() as stack:
        made: list[Any] = [stack.enter_context(closing(make_environment(ENVIRONMENT, **each))) for each in options]
        first, *others = made
        for other in others:
            other.unwrapped.ride_with(first.unwrapped)
        return [record(env, seed=seed) for env in (first, *others)]


def record_suite_files(options: Sequence[Mapping[str, Any]], seed: int, paths: Sequence[Path]) -> list[Path]:
    """:func:`record_suites`, each written to its file, which appears whole or not at all."""
    recorded = record_suites(options, seed)
    return [named(trajectory, path).save(path) for trajectory, path in zip(recorded, paths, strict=True)]
