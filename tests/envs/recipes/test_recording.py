"""Data sets of recipes: files that carry their recipe, resumed, never mixed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.envs.data.trajectory import load_trajectory
from poise.envs.hand.hand_held import HandHeld
from poise.envs.recipes.hand import HandRecipe
from poise.envs.recipes.registry import rebuilt, record_recipe, save_recipe
from poise.scripts.main import main

SHORT = HandRecipe("short", duration=3.0, carried_share=0.0, held=HandHeld(first_rest=(0.3, 1.0)))


def test_a_data_set_is_resumed_and_rebuilt(tmp_path: Path) -> None:
    paths = record_recipe(SHORT, tmp_path, episodes=3, seed=5)
    first = paths[0].read_bytes()
    paths[1].unlink()
    seen: list[Path] = []
    assert record_recipe(SHORT, tmp_path, episodes=4, seed=5, processes=2, report=seen.append)[:3] == paths
    assert len(seen) == 4
    assert paths[0].read_bytes() == first
    episode = load_trajectory(paths[1])
    assert episode.name == "short_0001"
    np.testing.assert_array_equal(rebuilt(episode).measurements["imu/acc"], episode.measurements["imu/acc"])


def test_episodes_of_another_recipe_or_seed_are_refused(tmp_path: Path) -> None:
    record_recipe(SHORT, tmp_path, episodes=1)
    with pytest.raises(ValueError, match=r"short_0000\.h5 holds an episode of another seed"):
        record_recipe(SHORT, tmp_path, episodes=1, seed=1)
    with pytest.raises(ValueError, match="holds an episode of another recipe"):
        record_recipe(replace(SHORT, duration=4.0), tmp_path, episodes=1)
    with pytest.raises(ValueError, match="episodes must be at least 1, got 0"):
        record_recipe(SHORT, tmp_path, episodes=0)


def test_the_command_records_a_recipe_of_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = save_recipe(SHORT, tmp_path / "short.json")
    folder = tmp_path / "episodes"
    assert main(["record", "--recipe", str(path), "-o", str(folder), "--episodes", "2", "--processes", "1"]) == 0
    assert "2 episodes in" in capsys.readouterr().out
    assert sorted(each.name for each in folder.iterdir()) == ["short_0000.h5", "short_0001.h5"]
    assert main(["record", "--recipe", "hand", "-o", str(folder)]) == 2
    assert "unknown recipe 'hand', did you mean 'hand-held'" in capsys.readouterr().err
    assert main(["record", "--recipe", str(path), "--options", "rate=5"]) == 2
    assert "options belong to an environment" in capsys.readouterr().err
