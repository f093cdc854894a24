"""Data sets of recipes on disk: one file an episode, several at a time, resumed where they stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..data.trajectory import load_trajectory
from ..record import refuse_others, resumed
from .recipe import Recipe
from .registry import described_recipe


def record_recipe(
    made: Recipe,
    folder: str | Path,
    *,
    episodes: int,
    seed: int = 0,
    processes: int = 1,
    report: Callable[[Path], None] | None = None,
) -> list[Path]:
    """Record the first episodes of a recipe; what is finished stays, and a second call continues there.

    Args:
        made: the recipe, which every file carries.
        folder: where the files ``<recipe>_<index>.h5`` go.
        episodes: how many there shall be; a larger number keeps the first ones.
        seed: root seed.
        processes: how many are simulated at a time; the numbers do not depend on it.
        report: called with the path of every finished episode, also with those that were there.

    Returns:
        The paths, in order.

    Raises:
        ValueError: a number is out of its range, or a file in the folder is an episode of another recipe or seed
            (nothing is overwritten).
    """
    for name, value, least in (("episodes", episodes, 1), ("processes", processes, 1), ("seed", seed, 0)):
        if value < least:
            raise ValueError(f"{name} must be at least {least}, got {value}")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{made.name}_{index:04d}.h5" for index in range(episodes)]
    described = made.describe()
    return resumed(
        record_one, check_same, [(described, seed, index, path) for index, path in enumerate(paths)], processes, report
    )


def record_one(described: Mapping[str, Any], seed: int, index: int, path: Path) -> Path:
    """Simulate one episode and write it; the file appears whole or not at all."""
    return described_recipe(described).episode(seed, index, path.stem).save(path)


def check_same(described: Mapping[str, Any], seed: int, index: int, path: Path) -> None:
    """Refuse to mix episodes of different origin in one folder.

    Raises:
        ValueError: the file holds another episode.
    """
    found = load_trajectory(path).metadata.get("recipe") or {}
    refuse_others(
        path, found | {"recipe": found.get("definition")}, {"seed": seed, "index": index, "recipe": described}
    )
