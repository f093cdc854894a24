"""The shipped recipes by name, recipes from files, and episodes rebuilt from what a data set carries."""

from __future__ import annotations

import importlib
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ...filters.support.files import write_text
from ...filters.support.names import look_up
from ..data.trajectory import Trajectory, load_trajectory
from ..record import refuse_others, resumed
from ..sensors.assumptions import CONSUMER, INDUSTRIAL
from .hand import HandRecipe
from .recipe import Recipe

KINDS = {"hand": (".hand", "HandRecipe"), "rider": (".rider", "RiderRecipe")}
"""Kind → module and class of its recipes; those of riders need PyBullet and are loaded when they are asked for."""


class ShippedRecipe(NamedTuple):
    """A recipe of this package: the fields of its kind that differ from their defaults."""

    kind: str
    summary: str
    """what it is for"""
    fields: Mapping[str, Any]


PROMPT = {
    "gyroscope_bias": (math.radians(0.03), math.radians(4.0)),
    "bandwidth": (400.0, 4000.0),
    "timing": {"late_share": 0.0},
}
"""Sensors that report at once; a gyroscope may be one whose bias nobody has removed."""
VARYING = PROMPT | {
    "gyroscope_g_sensitivity": (INDUSTRIAL.gyroscope.g_sensitivity, CONSUMER.gyroscope.g_sensitivity),
    "gyroscope_temperature": (INDUSTRIAL.gyroscope.temperature_coefficient, CONSUMER.gyroscope.temperature_coefficient),
}
"""The same, whose bias depends on the specific force and on the temperature, from one grade to the other."""
IN_HAND: dict[str, Any] = {"carried_share": 0.0}
WALKED: dict[str, Any] = {"carried_share": 1.0, "carried": {"first_rest": (0.3, 20.0), "running_share": 0.0}}
RUN: dict[str, Any] = {
    "carried_share": 1.0,
    "carried": WALKED["carried"] | {"running_share": 1.0, "standing_share": 0.0},
}
"""Motions of hand-held sensors alone, of carried ones alone without running, and of those of somebody who runs."""
SURROUNDINGS = ["undisturbed", "laboratory", "indoor", "fixed-magnets", "passing-magnets", "attached-magnet"]
"""Of a magnetometer in the hand."""
RECIPES: dict[str, ShippedRecipe] = {
    "hand-held": ShippedRecipe(
        "hand", "a sensor in the hand, at rest or shaken, tapped, put down, from laboratory to phone grade", IN_HAND
    ),
    "carried": ShippedRecipe(
        "hand", "a phone carried by somebody who walks or stands: in the hand, swinging, in a pocket", WALKED
    ),
    "carried-running": ShippedRecipe("hand", "the same of somebody who runs", RUN),
    "hand-held-prompt": ShippedRecipe(
        "hand",
        "hand-held by sensors without delay or low-pass, so that a network does not learn to predict; larger biases",
        IN_HAND | {"sensors": PROMPT},
    ),
    "carried-prompt": ShippedRecipe("hand", "carried, by the same sensors", WALKED | {"sensors": PROMPT}),
    "hand-held-varying": ShippedRecipe(
        "hand",
        "hand-held by the same sensors, whose bias in motion is not that at rest: force and warming change it",
        IN_HAND | {"sensors": VARYING},
    ),
    "carried-varying": ShippedRecipe("hand", "carried, by the same sensors", WALKED | {"sensors": VARYING}),
    "gestures-varying": ShippedRecipe(
        "hand",
        "gestures of poise/HandMotion-v0, slow to severe, by the same sensors",
        IN_HAND | {"gestures": ["slow", "fast", "severe", "mixed"], "sensors": VARYING},
    ),
    "hand-held-magnetic": ShippedRecipe(
        "hand",
        "hand-held-varying with a magnetometer: in rooms, near magnets, with one on the device, or undisturbed",
        IN_HAND | {"sensors": VARYING, "magnetics": SURROUNDINGS},
    ),
    "carried-magnetic": ShippedRecipe(
        "hand",
        "carried-varying with a magnetometer, in rooms, near magnets or on a street",
        WALKED | {"sensors": VARYING, "magnetics": [*SURROUNDINGS[:3], "passing-magnets", "street"]},
    ),
    "rider": ShippedRecipe("rider", "rides of anybody anywhere with sensors of several grades", {}),
}
"""Name → recipe."""


def kind_of(name: str) -> type[Recipe]:
    """The class of the recipes of a kind.

    Raises:
        ValueError: an unknown kind.
    """
    module, cls = look_up("kind", name, KINDS)
    found: type[Recipe] = getattr(importlib.import_module(module, __package__), cls)
    return found


def recipe(of: str | Path | Mapping[str, Any] | Recipe) -> Recipe:
    """A recipe by name, from a JSON file (a name that ends in ``.json``), from what it describes itself, or as given.

    Raises:
        ValueError: an unknown name, kind or field, or a value that is not accepted.
        FileNotFoundError: there is no such file.
    """
    if isinstance(of, Recipe):
        return of
    if isinstance(of, Mapping):
        return described_recipe(of)
    if isinstance(of, Path) or str(of).endswith(".json"):
        text = Path(of).read_text(encoding="utf-8")
        try:
            return described_recipe(json.loads(text))
        except ValueError as reason:
            raise ValueError(f"{of}: {reason}") from None
    shipped = look_up("recipe", of, RECIPES)
    return described_recipe({"kind": shipped.kind, "name": of, **shipped.fields})


def described_recipe(described: Any) -> Recipe:
    """The recipe of a mapping with its ``kind``.

    Raises:
        ValueError: see :func:`recipe`.
    """
    if not isinstance(described, Mapping) or "kind" not in described:
        raise ValueError(f"a recipe must be a mapping with its kind, one of {list(KINDS)}, got {described!r}")
    return kind_of(described["kind"]).read(described)


def hand_recipe(of: str | Path | Mapping[str, Any] | Recipe) -> HandRecipe:
    """A recipe of hand motions, see :func:`recipe`.

    Raises:
        ValueError: the recipe is of another kind, or see there.
    """
    made = recipe(of)
    if not isinstance(made, HandRecipe):
        raise ValueError(f"recipe must be one of hand motions, but {made.name!r} is of the kind {made.kind!r}")
    return made


def save_recipe(made: Recipe, path: str | Path) -> Path:
    """Write a recipe as JSON, for :func:`recipe`."""
    return write_text(Path(path), json.dumps(made.describe(), indent=2) + "\n")


def rebuilt(trajectory: Trajectory) -> Trajectory:
    """The episode simulated again from the recipe, seed and index in its metadata: bit for bit the same.

    Raises:
        ValueError: the metadata hold no recipe.
    """
    origin = trajectory.metadata.get("recipe")
    if not isinstance(origin, Mapping) or not {"definition", "seed", "index"} <= set(origin):
        raise ValueError(f"{trajectory.name} carries no recipe: its metadata hold {sorted(trajectory.metadata)}")
    return recipe(origin["definition"]).episode(origin["seed"], origin["index"], trajectory.name)


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
