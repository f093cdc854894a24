"""Arguments of ``poise tune`` that choose what is simulated."""

from __future__ import annotations

from pathlib import Path

import pytest

from poise.baselines.gain_policy.config import TRAINING_MOTIONS
from poise.envs.recipes.hand import HandRecipe
from poise.envs.recipes.registry import recipe, save_recipe
from poise.scripts.tune import Args, training_config


def test_a_recipe_replaces_the_motions_of_the_shipped_policies(tmp_path: Path) -> None:
    assert training_config(Args()).motions is TRAINING_MOTIONS
    chosen = training_config(Args(recipe="carried")).motions
    assert isinstance(chosen, HandRecipe)
    assert chosen.rates == (100.0, 100.0)
    assert chosen.carried_share == 1.0
    path = save_recipe(recipe("hand-held"), tmp_path / "mine.json")
    described = training_config(Args(recipe=str(path))).describe()
    assert described["motions"]["name"] == "hand-held"
    with pytest.raises(ValueError, match="recipe must be one of hand motions"):
        training_config(Args(recipe="rider"))
