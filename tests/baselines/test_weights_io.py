"""Weights survive a round trip and nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.weights_io import WEIGHTS, find_weights, list_weights, load_weights, save_weights

ARRAYS = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array([1.5]), "c": np.array(3)}


def test_round_trip(tmp_path: Path) -> None:
    path = save_weights(tmp_path / "deeper" / "net", ARRAYS, {"seed": 3, "note": "°"})
    assert path.name == "net.safetensors"
    arrays, card = load_weights(path)
    assert card["seed"] == 3
    assert card["note"] == "°"
    assert set(arrays) == set(ARRAYS)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == array.dtype
        assert arrays[name].shape == array.shape


def test_transposed_arrays_are_kept_as_they_look(tmp_path: Path) -> None:
    path = save_weights(tmp_path / "net", {"a": ARRAYS["a"].T}, {})
    np.testing.assert_array_equal(load_weights(path)[0]["a"], ARRAYS["a"].T)


def test_equal_weights_give_equal_files(tmp_path: Path) -> None:
    first = save_weights(tmp_path / "first", ARRAYS, {})
    second = save_weights(tmp_path / "second", dict(reversed(list(ARRAYS.items()))), {})
    assert first.read_bytes() == second.read_bytes()


def test_a_changed_byte_is_refused(tmp_path: Path) -> None:
    path = save_weights(tmp_path / "net", ARRAYS, {})
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(bytes(data))
    with pytest.raises(ValueError, match="not the file that its card describes"):
        load_weights(path)


def test_a_truncated_file_is_refused(tmp_path: Path) -> None:
    path = save_weights(tmp_path / "net", ARRAYS, {})
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(ValueError, match="not the file that its card describes"):
        load_weights(path)


def test_a_card_is_needed_and_must_be_sound(tmp_path: Path) -> None:
    path = save_weights(tmp_path / "net", ARRAYS, {})
    card = path.with_suffix(".json")
    card.write_text("{")
    with pytest.raises(ValueError, match="not JSON"):
        load_weights(path)
    card.write_text(json.dumps({"seed": 1}))
    with pytest.raises(ValueError, match="must hold the sha256"):
        load_weights(path)
    card.unlink()
    with pytest.raises(FileNotFoundError, match=r"no card net\.json"):
        load_weights(path)


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one array"):
        save_weights(tmp_path / "net", {}, {})
    with pytest.raises(ValueError, match="'a' must be finite"):
        save_weights(tmp_path / "net", {"a": np.array([np.nan])}, {})
    with pytest.raises(ValueError, match="must be numbers"):
        save_weights(tmp_path / "net", {"a": np.array(["x"])}, {})
    with pytest.raises(ValueError, match="computed here"):
        save_weights(tmp_path / "net", ARRAYS, {"sha256": ""})
    with pytest.raises(ValueError, match="cannot write"):
        save_weights(tmp_path / "net", ARRAYS, {"x": {1, 2}})
    assert not list(tmp_path.iterdir())


def test_an_unknown_name_lists_what_is_shipped() -> None:
    with pytest.raises(FileNotFoundError, match="no weights 'nothing'; shipped are"):
        load_weights("nothing")


@pytest.mark.parametrize("name", list_weights())
def test_shipped_weights_are_sound_and_small(name: str) -> None:
    arrays, card = load_weights(name)
    assert arrays
    assert len(card) > 1
    assert (WEIGHTS / f"{name}.safetensors").stat().st_size < 300_000


def test_loading_needs_no_torch() -> None:
    code = "import sys; import poise.baselines.weights_io; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["bounded-motion+network", "external-acceleration+policy", "mekf+noise", "gru"])
def test_the_name_of_an_estimator_is_that_of_its_weights(name: str) -> None:
    assert find_weights(name).stem in list_weights()
