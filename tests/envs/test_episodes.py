"""Kept episodes: bit for bit, bounded, and never those of other settings."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from poise.envs import episodes
from poise.envs.data.trajectory import Trajectory
from poise.envs.episodes import EpisodeStore, exact
from poise.envs.sensors.noise import NoiseModel
from poise.filters.support.version import code_version


def episode(number: int) -> Trajectory:
    values = np.random.default_rng(number).standard_normal((200, 3))
    return Trajectory(0.01 * np.arange(200), {"imu/gyr": values}, metadata={"name": f"episode-{number}"})


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("POISE_CACHE", str(tmp_path))
    calls: list[int] = []

    def make(settings=("a", 1.0), **bounds):
        kept = EpisodeStore("episodes", settings, **bounds)

        def draw(number):
            return kept.episode((number,), lambda: calls.append(number) or episode(number))

        return kept, draw

    return make, calls


def test_an_episode_is_simulated_once_and_read_bit_for_bit(store):
    make, calls = store
    for _ in range(2):
        _, draw = make()
        for _ in range(2):
            found = draw(3)
    assert calls == [3]
    assert np.array_equal(found.measurements["imu/gyr"], episode(3).measurements["imu/gyr"])
    assert found.metadata == episode(3).metadata


def test_other_settings_and_damaged_files_are_simulated_anew(store):
    make, calls = store
    first, draw = make()
    draw(1)
    make(("a", 2.0))[1](1)
    assert calls == [1, 1]
    path = first.path((1,))
    path.write_bytes(path.read_bytes()[:1000])
    make()[1](1)
    assert calls == [1, 1, 1]


def test_memory_and_folder_are_bounded(store):
    make, calls = store
    kept, draw = make(in_memory=2, on_disk=25_000)
    for number in range(6):
        draw(number)
    assert len(kept._kept) == 2
    sizes = [path.stat().st_size for path in kept.folder.rglob("*.h5")]
    assert 0 < sum(sizes) <= 25_000
    draw(5)
    assert calls == list(range(6))
    draw(0)
    assert calls == [*range(6), 0]


def test_checkouts_of_other_versions_share_the_folder(store, monkeypatch):
    make, calls = store
    _, ours = make(on_disk=50_000)
    ours(1)
    with monkeypatch.context() as other:
        other.setattr(episodes, "code_version", lambda *layers: "other")
        _, theirs = make(on_disk=50_000)
        theirs(2)
    kept, ours = make(on_disk=50_000)
    ours(1)
    assert calls == [1, 2]
    assert {path.parent.name for path in kept.folder.rglob("*.h5")} == {code_version("filters", "envs"), "other"}
    for number in range(3, 20):
        ours(number)
    assert {path.parent.name for path in kept.folder.rglob("*.h5")} == {code_version("filters", "envs")}
    assert not (kept.folder / "other").exists()


def test_what_nobody_read_for_a_month_is_removed(store):
    make, calls = store
    kept, draw = make(in_memory=1)
    for number in range(2):
        draw(number)
    old = kept.path((0,))
    os.utime(old, (time.time() - 31 * 86400.0,) * 2)
    draw(2)
    assert not old.exists()
    assert kept.path((1,)).exists()
    draw(0)
    assert calls == [0, 1, 2, 0]


def test_settings_without_an_exact_form_stay_in_memory(store):
    make, calls = store
    kept, draw = make((lambda: 0,))
    draw(1)
    draw(1)
    assert calls == [1]
    assert kept.path((1,)) is None
    assert not kept.folder.exists()


def test_exact_forms_differ_where_values_do():
    forms = [exact(value) for value in (NoiseModel(), NoiseModel(white_noise=1e-9), {"a": [1]}, {"a": [2]}, None)]
    assert all(one != two for i, one in enumerate(forms) for two in forms[:i])
    with pytest.raises(TypeError, match="no exact JSON form"):
        exact(object())
