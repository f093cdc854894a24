"""The shipped recipes by name, recipes from files, and episodes rebuilt from what a data set carries."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ...filters.support.files import write_text
from ...filters.support.names import look_up, unknown
from ..data.trajectory import Trajectory
from .hand import HandRecipe
from .recipe import Recipe

KINDS: dict[str, type[Recipe]] = {kind.kind: kind for kind in (HandRecipe,)}
"""Kind → class of its recipes."""


class ShippedRecipe(NamedTuple):
    """A recipe of this package."""

    summary: str
    """what it is for"""
    make: Callable[[], Recipe]


RECIPES: dict[str, ShippedRecipe] = {
    "hand-held": ShippedRecipe(
        "a sensor moved by hand in place, at rest or shaken, from laboratory to phone grade",
        lambda: HandRecipe("hand-held"),
    ),
}
"""Name → recipe."""


def list_recipes() -> list[str]:
    """Names that :func:`recipe` takes."""
    return list(RECIPES)


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
    return look_up("recipe", of, RECIPES).make()


def described_recipe(described: Any) -> Recipe:
    """The recipe of a mapping with its ``kind``.

    Raises:
        ValueError: see :func:`recipe`.
    """
    if not isinstance(described, Mapping) or "kind" not in described:
        raise ValueError(f"a recipe must be a mapping with its kind, one of {list(KINDS)}, got {described!r}")
    if described["kind"] not in KINDS:
        raise ValueError(unknown("kind", described["kind"], KINDS))
    return KINDS[described["kind"]].read(described)


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
