"""Data sets of Minari: what is played, what Minari's own loader gives, and trajectories made from it again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

import poise
from poise.envs.exchange.plain_keys import PlainKeys, plain, restored
from poise.envs.registration import ENTRY_POINTS
from poise.filters.support.seeds import child_seeds
from poise.scripts.main import main

minari = pytest.importorskip("minari")

SHORT: dict[str, dict[str, Any]] = {
    "poise/HandMotion-v0": {"duration": 1.0, "gesture": "severe"},
    "poise/Replay-v0": {"duration": 1.0},
    "poise/BicycleFixture-v0": {"duration": 1.0},
    "poise/RiderBicycle-v0": {"duration": 0.5, "fidelity": "lumped"},
    "poise/RiderBicycleGain-v0": {"duration": 2.0},
    "poise/HandMotionGain-v0": {"duration": 2.0},
    "poise/ReplayGain-v0": {},
}
POSE = [name for name in SHORT if "Gain" not in name]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Minari keeps its data sets here."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def test_every_id_is_tried() -> None:
    assert set(SHORT) == set(ENTRY_POINTS)


@pytest.mark.parametrize("env_id", SHORT)
def test_data_set_of_every_environment(env_id: str) -> None:
    """Minari's loader opens it, and the environment of its specification observes what was recorded."""
    if env_id.startswith("poise/Rider") or "Fixture" in env_id:
        pytest.importorskip("pybullet")
    env = gymnasium.make(env_id, **SHORT[env_id])
    poise.to_minari(env, "poise/played-v0", episodes=2, seed=3)
    env.close()
    dataset = minari.load_dataset("poise/played-v0")
    episodes = list(dataset.iterate_episodes())
    seeds = [about["seed"] for about in dataset.storage.get_episode_metadata(range(2))]
    assert tuple(seeds) == child_seeds(3, 2)
    assert all(episode.infos["time"].shape == (len(episode.rewards) + 1,) for episode in episodes)
    again = dataset.recover_environment()
    observation, info = again.reset(seed=seeds[1])
    first = {"observation": rows(episodes[1].observations, 0), "pose": rows(episodes[1].infos["pose"], 0)}
    assert_equal(first, {"observation": observation, "pose": info["pose"]})
    again.close()


def rows(values: Any, index: int) -> Any:
    return {key: rows(item, index) for key, item in values.items()} if isinstance(values, dict) else values[index]


def assert_equal(left: Any, right: Any) -> None:
    if isinstance(left, dict):
        assert set(left) == set(right)
        for key in left:
            assert_equal(left[key], right[key])
    else:
        np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize("env_id", POSE)
def test_round_trip(env_id: str) -> None:
    """Truth, time and mask are equal, measurements to single precision, drop-outs included."""
    if env_id.startswith("poise/Rider") or "Fixture" in env_id:
        pytest.importorskip("pybullet")
    env = gymnasium.make(env_id, **SHORT[env_id])
    (back,) = poise.from_minari(poise.to_minari(env, "poise/round-v0", episodes=1, seed=5))
    expected = poise.record(env, seed=child_seeds(5, 1)[0])
    env.close()
    assert list(back.measurements) == list(expected.measurements)
    for name, values in expected.measurements.items():
        np.testing.assert_array_equal(back.measurements[name], values.astype(np.float32))
    assert set(back.truth) == set(expected.truth)
    for name, values in expected.truth.items():
        np.testing.assert_array_equal(back.truth[name], values)
    np.testing.assert_array_equal(back.time, expected.time)
    np.testing.assert_array_equal(back.mask, expected.mask)
    assert back.metadata["seed"] == expected.metadata["seed"]
    assert back.metadata["ended"] == expected.metadata["ended"]


def test_policy_sees_keys_of_the_environment() -> None:
    keys = []

    def policy(observation: Any) -> np.ndarray:
        keys.append(set(observation))
        return np.array([1, 0, 0, 0], np.float32)

    env = gymnasium.make("poise/HandMotion-v0", duration=0.1)
    poise.to_minari(env, "poise/policy-v0", policy=policy, seed=0, algorithm="upright")
    assert keys[0] == set(env.observation_space.spaces)
    assert minari.load_dataset("poise/policy-v0").storage.metadata["algorithm_name"] == "upright"


def test_complaints() -> None:
    env = gymnasium.make("poise/HandMotion-v0", duration=0.1)
    with pytest.raises(ValueError, match="episodes must be at least 1, got 0"):
        poise.to_minari(env, "poise/none-v0", episodes=0)
    poise.to_minari(env, "poise/twice-v0", seed=0)
    with pytest.raises(ValueError, match="'poise/twice-v0' exists already"):
        poise.to_minari(env, "poise/twice-v0", seed=0)
    replay = gymnasium.make("poise/Replay-v0", trajectory=poise.record(env, seed=0))
    with pytest.raises(ValueError, match="its argument trajectory is a Trajectory"):
        poise.to_minari(replay, "poise/replay-v0")
    gains = gymnasium.make("poise/HandMotionGain-v0", duration=1.0)
    with pytest.raises(ValueError, match="observes no measurements"):
        poise.from_minari(poise.to_minari(gains, "poise/gains-v0", seed=0))


def test_command(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["record", "hand-motion", "--minari", "poise/command-v0", "--episodes", "2", "--options", "duration=0.2"]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][0]["episodes"] == 2
    assert main([*words, "--recipe", "hand-held"]) == 2
    assert "--minari keeps episodes of one environment" in capsys.readouterr().err


def test_keys() -> None:
    nested = {"imu/acc": 1, "pose": {"bicycle/roll": 2, "up": 3}}
    assert plain(nested) == {"imu.acc": 1, "pose": {"bicycle.roll": 2, "up": 3}}
    assert restored(plain(nested)) == nested


@pytest.mark.parametrize("env_id", ENTRY_POINTS)
def test_specification_as_json(env_id: str) -> None:
    """The specification of every id, made with options and in the wrapper, is rebuilt from JSON."""
    if "Rider" in env_id or "Fixture" in env_id:
        pytest.importorskip("pybullet")
    env = PlainKeys(gymnasium.make(env_id, **SHORT[env_id]))
    assert env.spec is not None
    rebuilt = EnvSpec.from_json(env.spec.to_json())
    assert rebuilt == env.spec
    assert isinstance(gymnasium.make(rebuilt), PlainKeys)
