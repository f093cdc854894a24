"""Recipes: JSON to and from, checks of fields, episodes rebuilt bit for bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory, load_trajectory
from poise.envs.hand.hand_held import HandHeld
from poise.envs.recipes.hand import HandRecipe
from poise.envs.recipes.registry import RECIPES, hand_recipe, rebuilt, recipe, save_recipe

SHORT = HandRecipe("short", duration=6.0, carried_share=0.0, held=HandHeld(first_rest=(0.3, 1.0)))


def assert_same(one: Trajectory, other: Trajectory) -> None:
    np.testing.assert_array_equal(one.time, other.time)
    assert one.metadata == other.metadata
    for part in ("measurements", "truth"):
        arrays, others = getattr(one, part), getattr(other, part)
        assert list(arrays) == list(others)
        for name in arrays:
            np.testing.assert_array_equal(arrays[name], others[name], err_msg=name)


@pytest.mark.parametrize("name", RECIPES)
def test_every_shipped_recipe_survives_json(name: str) -> None:
    made = recipe(name)
    assert made.name == name
    assert recipe(json.loads(json.dumps(made.describe()))) == made


def test_an_episode_is_rebuilt_from_a_file_bit_for_bit(tmp_path: Path) -> None:
    episode = SHORT.episode(3, 2)
    assert episode.metadata["recipe"]["index"] == 2
    read = load_trajectory(episode.save(tmp_path / "episode.h5"))
    assert_same(rebuilt(read), episode)
    other = SHORT.episode(3, 1)
    assert len(other) != len(episode) or not np.array_equal(
        other.measurements["imu/gyr"], episode.measurements["imu/gyr"]
    )
    with pytest.raises(ValueError, match="carries no recipe"):
        rebuilt(episode.replace(metadata={}))


def test_the_random_streams_of_the_default_hand_stay() -> None:
    """Data sets name recipe, seed and index: later versions must draw the same from them."""
    episode = HandRecipe(duration=40.0).episode(7, 1)
    assert len(episode) == 4739
    assert np.nansum(episode.measurements["imu/gyr"]) == pytest.approx(679.0387029546866, rel=1e-9)


def test_drawing_twice_from_one_seed_sequence_gives_the_same() -> None:
    sequence = np.random.SeedSequence(5)
    assert_same(SHORT.draw(sequence), SHORT.draw(sequence))
    assert_same(SHORT.draw(sequence), SHORT.draw(5))


def test_the_hand_makes_gestures_of_the_environment_by_name() -> None:
    def strength(*gestures: str) -> float:
        episode = replace(SHORT, duration=30.0, gestures=gestures).episode(3, 0)
        return float(np.nanstd(np.linalg.norm(episode.measurements["imu/acc"], axis=1)))

    assert strength("severe") > 3.0 * strength("slow")
    with pytest.raises(ValueError, match=r"gestures must be among .*got 'dance'"):
        replace(SHORT, gestures=("dance",))


def test_a_recipe_is_read_from_its_file(tmp_path: Path) -> None:
    path = save_recipe(SHORT, tmp_path / "mine.json")
    assert recipe(path) == SHORT
    assert recipe(str(path)) == SHORT
    path.write_text('{"kind": "hand", "duration": -1.0}')
    with pytest.raises(ValueError, match=r"mine.json: recipe: duration must be .*got -1.0"):
        recipe(path)


@pytest.mark.parametrize(
    ("described", "message"),
    [
        ({"kind": "foot"}, "unknown kind 'foot'"),
        ({"duration": 5.0}, "a recipe must be a mapping with its kind"),
        ({"kind": "hand", "durations": 5.0}, "recipe: unknown field 'durations', did you mean 'duration'"),
        ({"kind": "hand", "held": {"rate": [2.0, 1.0]}}, r"recipe.held: rate must be a range .*got \(2.0, 1.0\)"),
        ({"kind": "hand", "held": [1.0]}, "recipe.held must be a mapping"),
        ({"kind": "hand", "instant_share": 1.5}, r"instant_share must lie in \[0, 1\], got 1.5"),
        ({"kind": "hand", "rates": 100.0}, "rates must be a range"),
        ({"kind": "hand", "sensors": {"lossy_share": "half"}}, "lossy_share must be"),
    ],
)
def test_what_is_wrong_with_a_recipe_is_said(described: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        recipe(described)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown recipe 'hand-hold', did you mean 'hand-held'"):
        recipe("hand-hold")
    with pytest.raises(ValueError, match="index must be 0 or more, got -1"):
        SHORT.episode(0, -1)
    with pytest.raises(ValueError, match="rhythmic_share"):
        replace(SHORT.held, rhythmic_share=2.0)


def test_magnetic_surroundings_bring_a_magnetometer_and_change_nothing_else() -> None:
    plain, magnetic = SHORT.episode(4, 0), replace(SHORT, magnetics=("indoor", "passing-magnets")).episode(4, 0)
    assert "imu/mag" not in plain.measurements
    for name in ("imu/gyr", "imu/acc"):
        np.testing.assert_array_equal(magnetic.measurements[name], plain.measurements[name])
    strength = np.linalg.norm(magnetic.measurements["imu/mag"], axis=1)
    assert 20.0 < np.nanmedian(strength) < 90.0
    assert np.nanstd(strength) > 0.05
    with pytest.raises(ValueError, match=r"magnetics must be among .*got 'moon'"):
        replace(SHORT, magnetics=("moon",))


def test_a_bias_that_depends_on_force_and_temperature_changes_nothing_else() -> None:
    names = ("hand-held-prompt", "hand-held-varying")
    plain, varying = (hand_recipe(name).sensors.draw(np.random.default_rng(3)) for name in names)
    assert min(varying.gyroscope.g_sensitivity, varying.gyroscope.warm_up) > 0.0
    kept = {"g_sensitivity": 0.0, "temperature_coefficient": 0.0, "warm_up": 0.0}
    assert replace(varying, gyroscope=replace(varying.gyroscope, **kept)) == plain
